// How well an organ was pushed aside. Not thread-safe.
#pragma once

#include <optional>
#include <string>

#include "trainer/exclusion/exclusion_body.h"

namespace kiroku::trainer {

struct ExclusionScore {
  bool done = false;                // seen for as long as was asked
  double time_s = 0;                // until then, or until it was given up
  double largest_von_mises_pa = 0;  // of an element: grows with the fineness of the mesh
  double damaged_m3 = 0;            // tissue that was above the damage limit at a time, the most
  double path_m = 0;                // of all fingers, or tips of instruments, together
  double peak_force_n = 0;          // of a finger, or of the tissue on an instrument
  double peak_wrist_n = 0;          // of all together, of instruments at their handles
  double best_visible_share = 0;
  /// What all tissue but kHighStressShare stayed below, smoothed, the most (stress_score.h). Absent of
  /// attempts that were kept before there was this measure.
  std::optional<double> high_von_mises_pa;
};

/// How an attempt ended.
enum class Ending {
  kDone,
  kTimeOver,   // the task's time, or the hand's, was over before
  kGivenUp,    // by the trainee
  kBrokenOff,  // the connection to the trainee was lost, or the program ended
};
/// "done", "time-over", "given-up", "broken-off"; kiroku::UsageError for other names.
std::string name_of(Ending ending);
Ending ending_named(const std::string& name);
/// Whether an attempt that ended so is a result to be compared.
inline bool is_result(Ending ending) { return ending == Ending::kDone || ending == Ending::kTimeOver; }

/// What is looked at for each picture.
struct ExclusionMoment {
  double time_s = 0;
  double visible_share = 0;
  double largest_von_mises_pa = 0;
  double damaged_m3 = 0;
  double high_von_mises_pa = 0;
};

/// Follows a task to its end.
class ExclusionJudge {
 public:
  explicit ExclusionJudge(const ExclusionTask& task) : task_(task) {}

  /// Moments in their order. After the end nothing changes any more.
  void see(const ExclusionMoment& moment);
  [[nodiscard]] bool over() const { return over_; }
  /// How long the line has been seen without a break, s.
  [[nodiscard]] double held_s() const { return held_s_; }
  [[nodiscard]] const ExclusionScore& score() const { return score_; }

 private:
  ExclusionTask task_;
  ExclusionScore score_;
  bool over_ = false, seen_ = false;
  double seen_since_s_ = 0, held_s_ = 0;
};

/// How dangerous a stress is: 0 up to half of the damage limit, 1 at it and above.
double danger(double von_mises_pa, double damage_pa);
/// The tone for it: 0 for silence, else 220 Hz rising by two octaves to 880 Hz at the limit.
double danger_tone_hz(double danger);

}  // namespace kiroku::trainer
