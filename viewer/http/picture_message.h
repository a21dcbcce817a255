// A picture and what belongs to it as one WebSocket message: the number of bytes of the JSON (32 bits, the
// lowest first), the JSON, the JPEG file. Pure, thread-safe.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "base/bytes.h"

namespace kiroku::viewer {

Bytes picture_message(const nlohmann::ordered_json& about, ByteView jpeg);

}  // namespace kiroku::viewer
