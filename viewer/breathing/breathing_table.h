// The breathing workbench without a network: how the lung moves, when and how it is looked at, and pictures
// of that. Belongs to the thread that made it; the bench outlives it.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "sim/drr/picture.h"
#include "sim/respiration/tumour.h"
#include "viewer/breathing/breathing_bench.h"

namespace kiroku::viewer {

class BreathingTable {
 public:
  explicit BreathingTable(const BreathingBench& bench);

  /// Solves anew for groups that were others before. kiroku::Error in one sentence for what the model cannot
  /// say; then nothing was done.
  void apply(const MotionDeed& deed);
  void apply(const MomentDeed& deed) { time_s_ = deed.time_s; }
  /// Radiographs cannot be shown where there are none: then the lung alone is.
  void apply(const LookDeed& deed) { look_ = deed; }

  [[nodiscard]] const BreathingBench& bench() const { return bench_; }
  [[nodiscard]] const MotionDeed& motion() const { return motion_; }
  /// Of the motion: rises with each that is applied.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  [[nodiscard]] double duration_s() const;
  /// Where the tumour is at the moments of the time line, which are its times.
  [[nodiscard]] sim::TumourPath path() const;

  struct Shown {
    sim::ColourPicture picture;
    double time_s = 0;                             // of the time line: the radiograph's, where there is one
    std::optional<std::size_t> radiograph;         // from 0
    sim::Vector3 tumour_m = sim::Vector3::Zero();  // from its place at rest
  };
  /// In pixels `factor` times as wide and high.
  [[nodiscard]] Shown picture(std::size_t factor) const;

  /// Measures how alike one more radiograph and the lung at its moment are (sim::gradient_correlation(), in
  /// the radiograph's own pixels), from the one that is looked at on. False where all are measured.
  bool measure_one();
  /// By radiograph; nothing for those that were not measured since the motion changed.
  [[nodiscard]] const std::vector<std::optional<double>>& similarities() const { return similarities_; }

 private:
  [[nodiscard]] std::vector<sim::Vector3> moved_m(double time_s) const;

  const BreathingBench& bench_;
  std::shared_ptr<const GroupedLung> lung_;
  MotionDeed motion_;
  sim::Waveform waveform_;
  LookDeed look_;
  double time_s_;
  std::uint64_t revision_ = 1;
  std::vector<std::optional<double>> similarities_;
};

}  // namespace kiroku::viewer
