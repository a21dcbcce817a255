// One line of an events stream (docs/reference/format-streams.md, "The events stream"). A function;
// thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "crypto/hash.h"

namespace kiroku::archive {

inline constexpr std::size_t kLongestEventLine = std::size_t{16} << 20U;

struct EventLine {
  std::string event;                // JSON as a text
  crypto::Sha256Digest commitment;  // as its `mark` entry states it: over salt and event
};
/// Nothing where it is none: no JSON object of `salt`, 64 lower-case hexadecimal digits, and `event`, a text,
/// each once and nothing else.
std::optional<EventLine> parse_event_line(std::string_view line);

}  // namespace kiroku::archive
