// Pictures as JPEG files, for whom they are sent to many times a second. Thread-safe.
#pragma once

#include "base/bytes.h"
#include "sim/render/picture.h"

namespace kiroku::sim {

/// A baseline JPEG, colour at half the resolution; `quality` 1 to 100. kiroku::Error for a picture without
/// pixels, and where the library fails.
Bytes jpeg_of(const Picture& picture, int quality);

}  // namespace kiroku::sim
