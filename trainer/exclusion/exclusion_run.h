// One attempt to push an organ aside: a hand on a device, forces, pictures, the score.
#pragma once

#include <chrono>
#include <functional>
#include <optional>

#include "sim/render/surface_renderer.h"
#include "trainer/exclusion/exclusion_score.h"
#include "trainer/exclusion/hand_forces.h"
#include "trainer/hand/hand_motion.h"
#include "trainer/hand/safe_device.h"

namespace kiroku::trainer {

struct ExclusionOptions {
  bool shows_stress = false;  // in the tissue's colour
  bool shows_press = false;   // what fingers press, blue to red by how hard (press_cue.h)
  Feedback feedback = Feedback::kFull;
  Touch touch = Touch::kFingertips;
  InstrumentOptions instruments;  // of Touch::kTrocar
  double force_rate_hz = 1000, picture_rate_hz = 20;
  int width = 640, height = 480;
  SafetyLimits limits;
  bool draws = true;  // pictures for who watches; what can be seen of the line is measured without, too
  std::optional<HandMotion> ghost;  // an expert's hand, shown where it was at the same time of its attempt
  double most_s = 0;                // ends the attempt before the task does; 0: not
};

/// What a trainee is shown and may know.
struct ExclusionView {
  double time_s = 0;
  const sim::Picture* picture = nullptr;            // none where nothing is drawn
  std::span<const double> displacement_m;           // (3 |V|), valid during the call, as the picture is
  std::chrono::steady_clock::time_point looked_at;  // forces given before it are in the picture
  double visible_share = 0, held_s = 0;
  double largest_von_mises_pa = 0, damaged_m3 = 0;
  double high_von_mises_pa = 0;  // what all tissue but kHighStressShare stays below
  double danger = 0, tone_hz = 0;
  HandForces::State hand;
  ExclusionScore score;  // so far
};
/// Returns false to give up.
using ExclusionObserver = std::function<bool(const ExclusionView&)>;

struct ExclusionOutcome {
  ExclusionScore score;
  double peak_wall_n = 0;  // of instruments: the largest force on the wall at a trocar
  HandMotion motion;       // what the hand did
  SafeDevice::Faults faults;
  std::uint64_t pictures = 0;
  double elapsed_s = 0;
  std::optional<sim::ForceLoopStatistics> force_loop;  // of an attempt in real time
};

/// Draws and judges attempts on one body. Belongs to the thread that made it.
class ExclusionRunner {
 public:
  /// `body` must outlive it. kiroku::UsageError for options without sense; kiroku::Error as SurfaceRenderer.
  ExclusionRunner(const ExclusionBody& body, ExclusionOptions options, sim::GpuUse gpu = sim::GpuUse::kOff);

  /// Forces and pictures as fast as they are computed, time as the device's steps count it: the same device
  /// gives the same outcome, to the bit. The observer is called with each picture.
  ExclusionOutcome run_in_own_time(sim::HapticDevice& device, const ExclusionObserver& observer = {});
  /// Forces by a ForceLoop in a thread of its own, pictures in this one. kiroku::Error as ForceLoop.
  ExclusionOutcome run_in_real_time(sim::HapticDevice& device, const ExclusionObserver& observer = {});

  [[nodiscard]] const std::string& notice() const { return renderer_.notice(); }

 private:
  /// One picture's worth; false at the end.
  bool look(HandForces& forces, ExclusionJudge& judge, double time_s, const ExclusionObserver& observer);
  void add_tools(const HandForces::State& hand, bool shows_press, sim::SurfaceScene& scene) const;
  void add_ghost(double time_s, sim::SurfaceScene& scene) const;
  [[nodiscard]] sim::SurfaceScene scene_of(const HandForces::State& hand, double time_s,
                                           std::span<const double> displacement_m) const;

  const ExclusionBody& body_;
  ExclusionOptions options_;
  sim::SurfaceRenderer renderer_;
  VisibilityMeter meter_;
  std::vector<double> von_mises_pa_;  // (|T|)
};

}  // namespace kiroku::trainer
