// How deep a breath is when: a sine, breaths that differ, or what was measured. Immutable, thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace kiroku::sim {

/// sin 2 pi t / T.
struct SineWave {
  double cycle_s = 3.6;
};

/// A breath of its own length and depth, which begins `baseline` higher than the rest shape; the baseline
/// moves evenly towards the next breath's. baseline + depth sin 2 pi t / T.
struct Breath {
  double duration_s = 3.6, depth = 1, baseline = 0;
};

/// Times ascending, at least two; values in units of half a breath's depth about the mean (see
/// parse_breathing_trace()). Between two samples the value changes evenly.
struct BreathingTrace {
  std::vector<double> times_s, values;
};

/// A number for each time: 0 is the rest shape, 1 one amplitude.
class Waveform {
 public:
  /// kiroku::Error for a cycle or breath that is not longer than kShortestBreathS, numbers that are not
  /// finite, no breath, fewer than two samples, and times that do not ascend.
  explicit Waveform(SineWave sine);
  explicit Waveform(std::vector<Breath> breaths);
  explicit Waveform(BreathingTrace trace);

  static constexpr double kShortestBreathS = 0.1, kLongestS = 3600;

  /// A sine goes on for ever; others stay as they are before their first moment and after their last.
  [[nodiscard]] double at(double time_s) const;
  /// Of a sine one cycle.
  [[nodiscard]] double begins_s() const;
  [[nodiscard]] double duration_s() const;
  /// Whether it repeats, so that a phase is only known up to a cycle.
  [[nodiscard]] bool periodic() const { return std::holds_alternative<SineWave>(wave_); }

 private:
  std::variant<SineWave, std::vector<Breath>, BreathingTrace> wave_;
};

/// Text with a line of names, then a line a sample; fields are separated by commas. A column "time_s" or
/// "time_ms" and a column "amplitude" (any unit) are taken, others ignored, lines that begin with # too.
/// Values become (amplitude - mean) / half the distance between the 5th and the 95th percentile, so that a
/// usual breath goes from -1 to 1 and drift and depth stay as they are. Times count from the first sample.
///
/// kiroku::Error with the name and line for columns that are not there, fields that are no numbers, times
/// that do not ascend, fewer than two samples, and a trace that does not move.
BreathingTrace parse_breathing_trace(std::string_view text, const std::string& name);

}  // namespace kiroku::sim
