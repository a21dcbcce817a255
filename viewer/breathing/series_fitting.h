// A breathing lung fitted to the radiographs of its bench, from where a person has its sliders.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "sim/respiration/tumour_track.h"
#include "viewer/breathing/breathing_bench.h"
#include "viewer/people/turns.h"

namespace kiroku::viewer {

struct FitDeed {
  MotionDeed start;
  bool direction = false;  // whether the diaphragm's direction is sought, too
};

/// Where the tumour was seen in a radiograph, from its place at rest.
struct SeenTumour {
  sim::Vector3 place_m = sim::Vector3::Zero();
  sim::Vector3 error_m = sim::Vector3::Zero();  // standard deviations
};

struct FittedSeries {
  MotionDeed motion;   // that was found; without meaning where it was refused
  sim::SeriesFit fit;  // its refusal is empty where it is a fit
  std::chrono::duration<double> took{0};
  /// By radiograph: nothing where the tumour does not stand out; no element where the fit was refused.
  std::vector<std::optional<SeenTumour>> tumour;
};

/// Looks for amplitudes, phases, baselines, drifts and a sine's cycle (sim::fit_series()); the patient stays
/// where the geometry has them, as on the page. `progress` may throw to end it. Pure, takes seconds to
/// minutes on all cores. kiroku::Error for a motion that the model cannot say and for fewer than
/// sim::kLeastMoments radiographs.
FittedSeries fit_to_radiographs(const BreathingBench& bench, const FitDeed& deed,
                                const sim::SeriesProgress& progress);

/// One fit in a thread of its own. Thread-safe.
class BackgroundFit {
 public:
  /// Told from that thread: what is done and the parts done of all, and then one of the others.
  struct Listener {
    sim::SeriesProgress progress;
    std::function<void(const FittedSeries& fitted)> fitted;
    std::function<void(const std::string& sentence)> ended;  // cancelled, or why it failed
  };
  /// `bench` outlives it. `turn` is given back before anything is told of the end.
  BackgroundFit(const BreathingBench& bench, const FitDeed& deed, std::unique_ptr<Turns::Turn> turn,
                Listener listener);
  /// Cancels, and waits for the part that is being computed.
  ~BackgroundFit();
  BackgroundFit(const BackgroundFit&) = delete;
  BackgroundFit& operator=(const BackgroundFit&) = delete;

  void cancel() { cancelled_ = true; }
  [[nodiscard]] bool over() const { return over_; }

 private:
  void run(const BreathingBench& bench, const FitDeed& deed);

  Listener listener_;
  std::unique_ptr<Turns::Turn> turn_;
  std::atomic<bool> cancelled_ = false, over_ = false;
  std::thread thread_;  // last, as it uses all above
};

}  // namespace kiroku::viewer
