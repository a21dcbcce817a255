// What a person says of a comparison, as a JSON file to be edited (docs/explanation/comparison.md).
// Functions; thread-safe.
//
// {"steps": [{"step": 2, "start": "00:00:12.5", "end": "00:00:20", "pauses": [["00:00:14", "00:00:15"]]}],
//  "points": [{"plan_s": 1.5, "at": "00:00:13"}],
//  "registration": {"at": "00:00:12", "field_deg": 60, "points": [{"organ": [10, 20, 30], "pixel": [320,
//  240]}]}, "tools": {"forceps": [{"at": "00:00:12", "pixel": [300, 200]}]}, "limits": {"systolic_low": 90,
//  "systolic_high": 160, "mean_low": 65}}
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/reading/case_reader.h"
#include "sim/plan/plan.h"
#include "viewer/compare/camera_track.h"
#include "viewer/compare/figures.h"
#include "viewer/compare/time_map.h"
#include "viewer/compare/tool_path.h"

namespace kiroku::compare {

struct ByHand {
  std::optional<std::vector<StepMatch>> steps;  // nothing: by marks
  std::vector<Knot> points;
  std::optional<PickedRegistration> registration;
  std::map<std::size_t, std::vector<ToolClick>> tools;  // by the plan's tool
  PressureLimits limits;
};

/// kiroku::Error in a sentence with `name` and the JSON path; times as archive::CaseReader::parse_time(), or
/// as whole nanoseconds of the case clock, organ points in the plan's unit, steps from 1, tools by the plan's
/// names.
ByHand read_by_hand(std::string_view text, const std::string& name, const archive::CaseReader& recording,
                    const sim::Plan& plan);

/// The same form, of what was matched: to begin with.
std::string by_hand_text(const StepMatching& matching, std::span<const PlannedStep> steps,
                         std::int64_t begins_ns);

}  // namespace kiroku::compare
