#include "viewer/breathing/breathing_comparison.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "viewer/breathing/breathing_messages.h"
#include "viewer/breathing/breathing_table.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

double mm_of(double metres) { return 1000 * metres; }

/// The same motion, so much further in its breath.
MotionDeed later(MotionDeed motion, double by_s) {
  motion.motion.rib_cage.phase_s += by_s;
  motion.motion.diaphragm.phase_s += by_s;
  return motion;
}

std::vector<sim::Vector3> tumour_of(const BreathingBench& bench, const MotionDeed& motion) {
  const sim::Waveform waveform = bench.waveform_of(motion);
  std::vector<sim::Vector3> places_m;
  for (const BenchRadiograph& one : bench.radiographs()) {
    places_m.push_back(
        bench.own_lung()->tumour.displacement_m(motion.motion, waveform, bench.model_time_s(one.time_s)));
  }
  return places_m;
}

double squared_distance(const std::vector<sim::Vector3>& one, const std::vector<sim::Vector3>& other) {
  double sum = 0;
  for (std::size_t i = 0; i < one.size(); ++i) sum += (one[i] - other[i]).squaredNorm();
  return sum;
}

/// From 0 to a cycle, to a thousandth of it.
double start_of(const BreathingBench& bench, const MotionDeed& planned, const MotionDeed& found) {
  constexpr int kCoarse = 100, kFine = 20;
  const double cycle_s = *planned.cycle_s;
  const std::vector<sim::Vector3> places_m = tumour_of(bench, found);
  const auto nearest = [&](double from_s, double step_s, int steps) {
    double best_s = from_s, least = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= steps; ++i) {
      const double at_s = from_s + i * step_s;
      const double distance = squared_distance(tumour_of(bench, later(planned, at_s)), places_m);
      if (distance >= least) continue;
      least = distance;
      best_s = at_s;
    }
    return best_s;
  };
  const double step_s = cycle_s / kCoarse;
  const double coarse_s = nearest(0, step_s, kCoarse - 1);
  const double start_s = nearest(coarse_s - step_s, 2 * step_s / kFine, kFine);
  return start_s < 0 ? start_s + cycle_s : std::fmod(start_s, cycle_s);
}

void add_distance(const BreathingBench& bench, ComparedRadiograph& one) {
  const sim::Vector3 ray = (bench.tumour_m() + one.planned_m - bench.geometry(1).source_m()).normalized();
  const sim::Vector3 apart_m = one.seen->place_m - one.planned_m;
  const sim::Vector3 across_m = apart_m - ray.dot(apart_m) * ray;
  one.off_m = across_m.norm();
  const sim::Vector3 direction = one.off_m > 0 ? sim::Vector3(across_m / one.off_m) : ray.unitOrthogonal();
  one.off_error_m = direction.cwiseProduct(one.seen->error_m).norm();
}

ordered_json place_json(const sim::Vector3& place_m) {
  return {mm_of(place_m.x()), mm_of(place_m.y()), mm_of(place_m.z())};
}

ordered_json radiograph_json(const ComparedRadiograph& one) {
  ordered_json out{{"time_s", one.time_s},
                   {"similarity", one.similarity},
                   {"planned_mm", place_json(one.planned_m)},
                   {"seen_mm", nullptr}};
  if (!one.seen) return out;
  out["seen_mm"] = place_json(one.seen->place_m);
  out["error_mm"] = place_json(one.seen->error_m);
  out["off_mm"] = mm_of(one.off_m);
  out["off_error_mm"] = mm_of(one.off_error_m);
  return out;
}

ordered_json tumour_json(const BreathingComparison& comparison) {
  const std::vector<double> off_m = comparison.distances_m();
  ordered_json tumour{{"seen", off_m.size()}, {"of", comparison.radiographs.size()}};
  if (off_m.empty()) return tumour;
  constexpr double kMostOf = 0.95;
  const auto at = static_cast<std::size_t>(std::ceil(kMostOf * static_cast<double>(off_m.size()))) - 1;
  tumour["mean_mm"] =
      mm_of(std::accumulate(off_m.begin(), off_m.end(), 0.0) / static_cast<double>(off_m.size()));
  tumour["within_95_mm"] = mm_of(off_m[at]);
  tumour["largest_mm"] = mm_of(off_m.back());
  tumour["beyond_two_errors"] = comparison.beyond_two();
  return tumour;
}

}  // namespace

std::vector<double> BreathingComparison::distances_m() const {
  std::vector<double> off_m;
  for (const ComparedRadiograph& one : radiographs) {
    if (one.seen) off_m.push_back(one.off_m);
  }
  std::ranges::sort(off_m);
  return off_m;
}

std::size_t BreathingComparison::beyond_two() const {
  return static_cast<std::size_t>(std::ranges::count_if(radiographs, [](const ComparedRadiograph& one) {
    return one.seen && one.off_m > 2 * one.off_error_m;
  }));
}

double BreathingComparison::mean_similarity() const {
  double sum = 0;
  for (const ComparedRadiograph& one : radiographs) sum += one.similarity;
  return sum / static_cast<double>(radiographs.size());
}

BreathingComparison compare_breathing(const BreathingBench& bench, const sim::SeriesProgress& progress) {
  const MotionDeed planned = bench.own_motion();
  if (!planned.cycle_s) {
    throw Error(
        "the plan's waveform was measured, or is told breath by breath: nothing says which of its moments is "
        "the "
        "recording's first. Compare a model whose waveform is a sine");
  }
  BreathingComparison comparison;
  comparison.found = fit_to_radiographs(bench, {planned, false}, progress);
  if (!comparison.found.fit.refusal.empty())
    throw Error("nothing can be compared: " + comparison.found.fit.refusal);
  comparison.start_s = start_of(bench, planned, comparison.found.motion);
  comparison.planned = later(planned, comparison.start_s);
  progress("measuring how alike the pictures are", 0, 1);
  BreathingTable table(bench);
  table.apply(comparison.planned);
  while (table.measure_one()) {
  }
  const std::vector<sim::Vector3> places_m = tumour_of(bench, comparison.planned);
  for (std::size_t i = 0; i < places_m.size(); ++i) {
    ComparedRadiograph one{.time_s = bench.radiographs()[i].time_s,
                           .similarity = *table.similarities()[i],
                           .planned_m = places_m[i],
                           .seen = comparison.found.tumour[i]};
    if (one.seen) add_distance(bench, one);
    comparison.radiographs.push_back(std::move(one));
  }
  return comparison;
}

ordered_json comparison_json(const BreathingComparison& comparison) {
  ordered_json radiographs = ordered_json::array();
  for (const ComparedRadiograph& one : comparison.radiographs) radiographs.push_back(radiograph_json(one));
  const ordered_json found = fitted_json(comparison.found)["fitted"];
  return {{"plan_starts_s", comparison.start_s},
          {"planned", motion_json(comparison.planned)},
          {"found", found["motion"]},
          {"errors", found["errors"]},
          {"similarity",
           {{"planned", comparison.mean_similarity()}, {"found", comparison.found.fit.similarity_after}}},
          {"change", found["change"]},
          {"change_by_chance", found["change_by_chance"]},
          {"findings", found["findings"]},
          {"tumour", tumour_json(comparison)},
          {"radiographs", std::move(radiographs)}};
}

}  // namespace kiroku::viewer
