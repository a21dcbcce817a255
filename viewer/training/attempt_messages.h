// What page and trainer say to each other over an attempt's WebSocket (docs/explanation/training.md, "The
// page"). Pure functions, thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <variant>

#include <nlohmann/json_fwd.hpp>

#include "base/bytes.h"
#include "trainer/curriculum/learning.h"
#include "trainer/exclusion/live_attempt.h"

namespace kiroku::viewer {

/// {"begin": {"trainee": "Aoki", "object": "a", "fingers": 3, "test": false, "expert": true, "press": true}};
/// without "press" it is false. With "instrument": "retractor" as many of these in trocars take the place of
/// the fingers; not in a test, which is with fingertips, nor beside an expert's hand.
struct BeginMessage {
  std::string trainee;
  std::string object;  // one of TrainingRoom::objects()
  std::size_t fingers = 1;
  bool test = false;
  bool expert = false;     // shows an expert's hand
  bool press = false;      // colours what fingers press; not in a test
  std::string instrument;  // "retractor"; empty: fingertips
};
/// {"end": true}
struct EndMessage {};
/// {"input": 17, "pointers": [{"finger": 1, "x": 0.5, "y": 0.6, "push_m": 0}]} is a trainer::PointerInput.
using PageMessage = std::variant<BeginMessage, EndMessage, trainer::PointerInput>;

/// No longer than this.
inline constexpr std::size_t kLongestPageMessage = 2048;
/// Refusal 400 in one sentence for what is none of them.
PageMessage parse_page_message(std::string_view text);

/// A moment and its picture (viewer/http/picture_message.h). What tells of stress is in it only where that
/// is shown.
Bytes moment_message(const trainer::LiveView& view, bool shows_stress, ByteView jpeg);
/// The picture of a moment as the page shows it.
Bytes jpeg_of_moment(const trainer::LiveView& view);
nlohmann::ordered_json over_json(const trainer::LiveOutcome& over);

}  // namespace kiroku::viewer
