// What page and breathing workbench say to each other over a WebSocket (docs/reference/viewer.md,
// "Breathing"). Pure functions, thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <variant>

#include <nlohmann/json_fwd.hpp>

#include "base/bytes.h"
#include "viewer/breathing/live_breathing.h"
#include "viewer/breathing/series_fitting.h"

namespace kiroku::viewer {

/// {"input": 3, "save": {"file": "fitted", "motion": {…}, "seal": true}}
struct SaveMotion {
  std::string file;
  MotionDeed motion;
  bool seal = false;  // as a plan, before an operation
};
/// {"input": 4, "cancel": true}: the fit that is computed.
struct CancelFit {};
struct BreathingMessage {
  std::uint64_t input = 0;
  std::variant<MotionDeed, MomentDeed, LookDeed, SaveMotion, FitDeed, CancelFit> deed;
};

/// No message is longer: a motion, with a letter for each node that can be painted.
inline constexpr std::size_t kLongestBreathingMessage = (16U << 10) + BreathingBench::kMostPaintedNodes;
/// Refusal 400 in one sentence for what is none of them, or no motion that a model's document can say.
BreathingMessage parse_breathing_message(std::string_view text);

nlohmann::ordered_json motion_json(const MotionDeed& motion);
/// {"opened": {…}}: what there is, before the first picture.
nlohmann::ordered_json opened_json(const BreathingBench& bench, bool may_seal);
/// {"surface": {"nodes_mm", "faces", "groups"}}: what is painted on; null where the surface has too many
/// nodes.
nlohmann::ordered_json surface_json(const BreathingBench& bench);
/// {"refused": {"input", "why", "motion"}}: why a motion is not shown, and which is.
nlohmann::ordered_json refused_json(const std::string& why, std::uint64_t input, const MotionDeed& stands);
/// {"path": {"revision", "duration_s", "times_s", "mm"}}
nlohmann::ordered_json path_json(const BreathingTable& table);
/// {"similarity": {"revision", "values"}}, null for radiographs that were not measured
nlohmann::ordered_json similarity_json(const BreathingTable& table);
/// {"fitting": {"doing", "done", "all"}}
nlohmann::ordered_json fitting_json(const std::string& doing, std::size_t done, std::size_t all);
/// {"fitted": {…}}: what was found, or why nothing was.
nlohmann::ordered_json fitted_json(const FittedSeries& fitted);
/// A picture with its numbers (viewer/http/picture_message.h).
Bytes moment_message(const BreathingMoment& moment);

}  // namespace kiroku::viewer
