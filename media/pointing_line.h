// Lines of the stream `pointing`: where somebody pointed on a live picture. Plain values and pure functions,
// thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace kiroku::media {

/// A place in a picture.
struct PointedAt {
  std::string by, role;  // "anna", "surgeon"; "Dr. Sato", "guest"
  std::string stream;    // of pictures
  double x = 0, y = 0;   // parts of the picture's width and height, from its upper left corner
  /// Case-clock time of the picture that they saw, as their browser said.
  std::optional<std::int64_t> picture_ns;
};

struct PointingLine {
  std::int64_t time_ns = 0;  // case clock of the recorder
  PointedAt at;
};

/// {"time_ns":1500000000,"by":"Dr. Sato","role":"guest","stream":"endoscope","x":0.4123,"y":0.6001,
/// "picture_ns":1260000000} with its LF. x and y have four decimals.
std::string pointing_line(const PointingLine& line);
/// Nothing for what is no such line.
std::optional<PointingLine> parse_pointing_line(std::string_view line);

}  // namespace kiroku::media
