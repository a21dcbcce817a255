// How well a tumour is followed by fitting a breathing lung to radiographs of one that breathes otherwise, in
// the box-shaped chest: one view and two, five numbers of quanta a pixel. tests/bench/breathing_proof.py does
// the same on a CT, which takes far longer.
//
//   series_proof_bench [NAME...]
//
// NAME: two_1 (two views, the most quanta) to one_5; all if absent. Prints a line a fit, then the figures as
// ID=VALUE for docs/results/record.py: errors of the tumour's centre in space, mm (mean, 95 %, most), and
// across the front view's rays; exposed moments without a place; and parts of all coordinates beyond two and
// three of the standard deviations told with them, %.
#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>

#include "base/error.h"
#include "tests/unit/sim/respiration/series_proof.h"

namespace kiroku::test {
namespace {

constexpr std::array<double, 5> kQuanta{1e6, 1e5, 3e4, 1e4, 3e3};
constexpr double kMillimetres = 1000;

struct Measured {
  std::vector<double> errors_mm, across_mm;
  std::size_t beyond_2 = 0, beyond_3 = 0, lost = 0;
  bool dark_told = false;
};

Measured measured_of(const SeriesProof& proof) {
  Measured measured;
  for (std::size_t i = 0; i < kProofMoments; ++i) {
    const sim::TumourMoment& moment = proof.track.moments[i];
    const bool told = moment.sight != sim::TumourSight::kLost;
    if (i == kNotExposed) {
      measured.dark_told = told;
      continue;
    }
    if (!told) {
      ++measured.lost;
      continue;
    }
    const sim::Vector3 off_m = moment.place_m - proof.truth_m[i];
    measured.errors_mm.push_back(kMillimetres * off_m.norm());
    measured.across_mm.push_back(kMillimetres * std::hypot(off_m.x(), off_m.z()));
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double deviations = std::abs(off_m[axis]) / std::sqrt(moment.covariance(axis, axis));
      measured.beyond_2 += deviations > 2 ? 1U : 0U;
      measured.beyond_3 += deviations > 3 ? 1U : 0U;
    }
  }
  if (measured.errors_mm.empty()) throw Error("no exposed moment was given a place");
  std::ranges::sort(measured.errors_mm);
  std::ranges::sort(measured.across_mm);
  return measured;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / double(values.size());
}
double percentile_95(const std::vector<double>& ascending) {
  return ascending[static_cast<std::size_t>(std::ceil(0.95 * double(ascending.size()))) - 1];
}

int run(const std::vector<std::string>& wanted) {
  const sim::Vector3 shift_m(0.008, -0.005, 0.009),
      turn_rad = std::numbers::pi / 180 * sim::Vector3(3, -4, 2);
  std::string figures;
  for (const bool side : {true, false}) {
    for (std::size_t level = 0; level < kQuanta.size(); ++level) {
      const std::string name = (side ? "two_" : "one_") + std::to_string(level + 1);
      if (!wanted.empty() && std::ranges::find(wanted, name) == wanted.end()) continue;
      const SeriesProof proof = prove_series(kQuanta[level], side, shift_m, turn_rad);
      const auto enter = [&](const std::string& what, const std::string& value) {
        figures += name + "_" + what + "=" + value + " ";
      };
      if (!proof.fit.refusal.empty()) {
        std::cout << name << ": refused: " << proof.fit.refusal << std::endl;
        for (const char* const what : {"mean", "95", "most", "across", "lost", "beyond_2", "beyond_3"})
          enter(what, "refused");
        continue;
      }
      const Measured of = measured_of(proof);
      const double coordinates = 3 * double(of.errors_mm.size());
      const auto mm = [](double value) { return number_text(std::round(100 * value) / 100, 3); };
      const auto part = [&](std::size_t count) {
        return number_text(std::round(1000 * double(count) / coordinates) / 10, 3);
      };
      enter("mean", mm(mean_of(of.errors_mm)));
      enter("95", mm(percentile_95(of.errors_mm)));
      enter("most", mm(of.errors_mm.back()));
      enter("across", mm(mean_of(of.across_mm)));
      enter("lost", std::to_string(of.lost));
      enter("beyond_2", part(of.beyond_2));
      enter("beyond_3", part(of.beyond_3));
      std::cout << name << ": mean " << mm(mean_of(of.errors_mm)) << ", 95 % "
                << mm(percentile_95(of.errors_mm)) << ", most " << mm(of.errors_mm.back()) << " mm, across "
                << mm(mean_of(of.across_mm)) << "; seen " << proof.track.seen << ", lost " << of.lost
                << ", what was not exposed " << (of.dark_told ? "was given a place" : "was told lost")
                << "; beyond 2: " << part(of.beyond_2) << " %, 3: " << part(of.beyond_3) << " %" << std::endl;
    }
  }
  std::cout << figures << "\n";
  return 0;
}

}  // namespace
}  // namespace kiroku::test

int main(int count, char** words) {
  try {
    return kiroku::test::run({words + 1, words + count});
  } catch (const std::exception& error) {
    std::cerr << "series_proof_bench: " << error.what() << "\n";
    return 1;
  }
}
