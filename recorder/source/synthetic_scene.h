// Pictures of the embedded synthetic operating room, drawn here: what is dear to compute is drawn once, and
// only parts of it move. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "media/libav_handles.h"

namespace kiroku::recorder {

struct SceneForm {
  int width = 0, height = 0;  // pixels, both even and at least 16
  int rate = 25;              // pictures a second, by which things move
  int pixel_format = -1;      // AVPixelFormat that swscale can make
};

class SyntheticScene {
 public:
  virtual ~SyntheticScene() = default;
  /// Picture `number`, of square pixels. Others may refer to the same samples.
  virtual media::Frame picture(std::int64_t number) = 0;
};

/// "endoscope": a moving view into a body; "room": people at a table, the wall clock and the time since
/// picture 0 in its pixels; "pattern": coloured cells that move sideways, no pixel of which is drawn twice.
/// Null for others. Throws kiroku::Error where swscale cannot make such pictures.
std::unique_ptr<SyntheticScene> make_scene(std::string_view name, const SceneForm& form);

/// One that is white everywhere.
media::Frame white_picture(const SceneForm& form);

}  // namespace kiroku::recorder
