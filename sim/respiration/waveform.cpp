#include "sim/respiration/waveform.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/respiration/number_table.h"

namespace kiroku::sim {
namespace {

double sine(double turns) { return std::sin(2 * std::numbers::pi * turns); }

void check_duration(double duration_s, const std::string& what) {
  if (duration_s > Waveform::kShortestBreathS && duration_s <= Waveform::kLongestS) return;
  throw Error(what + " is " + number_text(duration_s) + " s long; it must be more than " +
              number_text(Waveform::kShortestBreathS) + " and at most " + number_text(Waveform::kLongestS) +
              " s");
}

double value_of(const SineWave& wave, double time_s) { return sine(time_s / wave.cycle_s); }

double value_of(const std::vector<Breath>& breaths, double time_s) {
  if (time_s < 0) return breaths.front().baseline;
  for (std::size_t i = 0; i < breaths.size(); ++i) {
    const Breath& breath = breaths[i];
    if (time_s < breath.duration_s) {
      const double part = time_s / breath.duration_s;
      const double next = i + 1 < breaths.size() ? breaths[i + 1].baseline : breath.baseline;
      return breath.baseline + (next - breath.baseline) * part + breath.depth * sine(part);
    }
    time_s -= breath.duration_s;
  }
  return breaths.back().baseline;
}

double value_of(const BreathingTrace& trace, double time_s) {
  const auto after = std::ranges::upper_bound(trace.times_s, time_s);
  if (after == trace.times_s.begin()) return trace.values.front();
  if (after == trace.times_s.end()) return trace.values.back();
  const auto i = static_cast<std::size_t>(after - trace.times_s.begin());
  const double part = (time_s - trace.times_s[i - 1]) / (trace.times_s[i] - trace.times_s[i - 1]);
  return trace.values[i - 1] + part * (trace.values[i] - trace.values[i - 1]);
}

}  // namespace

Waveform::Waveform(SineWave sine) : wave_(sine) { check_duration(sine.cycle_s, "the breathing cycle"); }

Waveform::Waveform(std::vector<Breath> breaths) : wave_(breaths) {
  if (breaths.empty()) throw Error("there is no breath: give one at least");
  for (std::size_t i = 0; i < breaths.size(); ++i) {
    check_duration(breaths[i].duration_s, "breath " + std::to_string(i));
    if (!std::isfinite(breaths[i].depth) || !std::isfinite(breaths[i].baseline))
      throw Error("breath " + std::to_string(i) + " has a depth or a baseline that is not finite");
  }
}

Waveform::Waveform(BreathingTrace trace) : wave_(trace) {
  if (trace.times_s.size() < 2 || trace.times_s.size() != trace.values.size())
    throw Error("a breathing trace needs two samples at least, each with its time and its value");
  for (std::size_t i = 0; i < trace.times_s.size(); ++i) {
    if (!std::isfinite(trace.times_s[i]) || !std::isfinite(trace.values[i]))
      throw Error("sample " + std::to_string(i) + " of the breathing trace is not finite");
    if (i > 0 && !(trace.times_s[i] > trace.times_s[i - 1]))
      throw Error("sample " + std::to_string(i) +
                  " of the breathing trace is not later than the one before it");
  }
}

double Waveform::at(double time_s) const {
  return std::visit([&](const auto& wave) { return value_of(wave, time_s); }, wave_);
}

double Waveform::begins_s() const {
  const auto* const trace = std::get_if<BreathingTrace>(&wave_);
  return trace == nullptr ? 0 : trace->times_s.front();
}

double Waveform::duration_s() const {
  if (const auto* const wave = std::get_if<SineWave>(&wave_)) return wave->cycle_s;
  if (const auto* const trace = std::get_if<BreathingTrace>(&wave_))
    return trace->times_s.back() - trace->times_s.front();
  double sum_s = 0;
  for (const Breath& breath : std::get<std::vector<Breath>>(wave_)) sum_s += breath.duration_s;
  return sum_s;
}

BreathingTrace parse_breathing_trace(std::string_view text, const std::string& name) {
  const NumberTable table = NumberTable::parse(text, name);
  const std::optional<std::size_t> seconds = table.column("time_s"), milliseconds = table.column("time_ms");
  if (seconds.has_value() == milliseconds.has_value())
    table.fail(0, "must have one column of times, time_s or time_ms");
  const std::size_t times = seconds ? *seconds : *milliseconds, values = table.needed_column("amplitude");
  constexpr double kMillisecondsPerSecond = 1000;
  BreathingTrace trace;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const double time_s = table.at(row, times) / (seconds ? 1 : kMillisecondsPerSecond);
    if (row > 0 && !(time_s > table.at(row - 1, times) / (seconds ? 1 : kMillisecondsPerSecond)))
      table.fail(row, "is not later than the line before it: sort the trace by time");
    trace.times_s.push_back(time_s);
    trace.values.push_back(table.at(row, values));
  }
  if (trace.times_s.size() < 2) throw Error("cannot use " + name + ": it holds fewer than two samples");
  const double begin_s = trace.times_s.front();
  for (double& time_s : trace.times_s) time_s -= begin_s;
  std::vector<double> sorted = trace.values;
  std::ranges::sort(sorted);
  const auto percentile = [&](double part) {
    return sorted[static_cast<std::size_t>(std::lround(part * static_cast<double>(sorted.size() - 1)))];
  };
  const double half = (percentile(0.95) - percentile(0.05)) / 2;
  const double mean = std::accumulate(trace.values.begin(), trace.values.end(), 0.0) /
                      static_cast<double>(trace.values.size());
  if (!(half > 0) || !std::isfinite(mean) || !std::isfinite(half))
    throw Error("cannot use " + name + ": its amplitude does not move, so that it says nothing of breathing");
  for (double& value : trace.values) value = (value - mean) / half;
  return trace;
}

}  // namespace kiroku::sim
