// JPEG 2000 pictures (ISO/IEC 15444-1), as DICOM files hold them. Pure, thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/bytes.h"

namespace kiroku::sim {

/// One grey picture, rows from the top, as the stored whole numbers. `encoded` is a codestream or a JP2 file.
/// kiroku::Error beginning with `what` for damaged ones, and for any other size or more than one component.
std::vector<std::int32_t> decode_jpeg2000(ByteView encoded, std::size_t columns, std::size_t rows,
                                          const std::string& what);

}  // namespace kiroku::sim
