// A breathing lung that was planned beside the radiographs that were recorded: when its breath began, how
// alike the pictures are, where the tumour was seen from where the plan has it, and how the pictures say that
// the lung breathed. Pure functions, thread-safe; they use all cores.
#pragma once

#include <optional>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "viewer/breathing/series_fitting.h"

namespace kiroku::viewer {

/// One radiograph; places are from the tumour's place at rest.
struct ComparedRadiograph {
  double time_s = 0;                              // since the first
  double similarity = 0;                          // gradient correlation with the plan's lung at that moment
  sim::Vector3 planned_m = sim::Vector3::Zero();  // where the plan has the tumour
  std::optional<SeenTumour> seen;
  /// Where it was seen: how far from the plan's place across the ray to it, as no single view shows depth,
  /// and the standard deviation of that.
  double off_m = 0, off_error_m = 0;
};

struct BreathingComparison {
  MotionDeed planned;  // phases are those of the first radiograph, after `start_s`
  double start_s = 0;  // the plan's moment at the first radiograph, from 0 to a cycle
  FittedSeries found;  // how the pictures themselves say that the lung breathed
  std::vector<ComparedRadiograph> radiographs;

  /// The distances of radiographs in which the tumour was seen, ascending.
  [[nodiscard]] std::vector<double> distances_m() const;
  /// In how many the distance is more than twice its standard deviation.
  [[nodiscard]] std::size_t beyond_two() const;
  [[nodiscard]] double mean_similarity() const;
};

/// No clock says at which moment of its breath the plan was when the first radiograph was taken: that is
/// chosen by which the plan's tumour is nearest, over all radiographs, to that of the motion that was found
/// (fit_to_radiographs(), from the plan on). kiroku::Error in one sentence, and nothing is compared, for a
/// waveform that is no sine (it is that of another time), for too few radiographs, and for a series in which
/// no breathing is found, with the fit's numbers. `progress` as of the fit.
BreathingComparison compare_breathing(const BreathingBench& bench, const sim::SeriesProgress& progress);

/// As documents state it (docs/reference/format-plans.md, "Breathing").
nlohmann::ordered_json comparison_json(const BreathingComparison& comparison);

}  // namespace kiroku::viewer
