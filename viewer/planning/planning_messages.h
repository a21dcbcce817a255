// What page and planner say to each other over a WebSocket (docs/reference/viewer.md, "Planning"). Pure
// functions, thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <variant>

#include <nlohmann/json_fwd.hpp>

#include "base/bytes.h"
#include "viewer/planning/live_planning.h"

namespace kiroku::viewer {

/// {"open": {"plan": "liver/plan.json", "anew": false}}
struct OpenMessage {
  std::string plan;
  bool anew = false;
};
/// {"input": 3, "save": {"file": "liver-2", "name": "Liver, from the left"}}
struct SaveMessage {
  std::uint64_t input = 0;
  std::string file, name;
};
/// {"input": 4, "view": {…}} and so on, each a Deed.
struct DeedMessage {
  std::uint64_t input = 0;
  Deed deed;
};
using PlanningMessage = std::variant<OpenMessage, SaveMessage, DeedMessage>;

/// No longer than this: a drawn line has a thousand places at most.
inline constexpr std::size_t kLongestPlanningMessage = 64U << 10;
/// Refusal 400 in one sentence for what is none of them.
PlanningMessage parse_planning_message(std::string_view text);

/// {"opened": {…}}: what there is, before the first picture.
nlohmann::ordered_json opened_json(const PlanningTable& table);
/// {"steps": [{"title", "action", "tools", "duration_s"}], "undo", "redo"}
nlohmann::ordered_json steps_json(const PlanningTable& table);
/// A picture with its numbers (viewer/http/picture_message.h).
Bytes moment_message(const PlanningMoment& moment);

}  // namespace kiroku::viewer
