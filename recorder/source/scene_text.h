// Words in synthetic pictures, in dots as cameras show them: no font is needed. Functions; thread-safe.
#pragma once

#include <string_view>

#include "media/libav_handles.h"
#include "recorder/source/scene_layer.h"

namespace kiroku::recorder {

/// Columns and rows of dots that a character takes, without the column between two.
inline constexpr int kTextColumns = 5, kTextRows = 7;

/// Writes into a picture of yuv420p, with squares of `dot` pixels for dots, upper left corner at x, y, over a
/// darkened box. It knows the digits and "-:. UTC"; anything else is left blank. What is beyond the edges is
/// left out.
void write_text(AVFrame& picture, int x, int y, int dot, std::string_view text, const Paint& colour);

}  // namespace kiroku::recorder
