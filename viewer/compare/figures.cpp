#include "viewer/compare/figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

namespace kiroku::compare {
namespace {

constexpr std::array<std::string_view, 4> kSystolic{"MDC_PRESS_BLD_ART_ABP_SYS", "MDC_PRESS_BLD_ART_SYS",
                                                    "MDC_PRESS_BLD_NONINV_SYS", "MDC_PRESS_CUFF_SYS"};
constexpr std::array<std::string_view, 4> kMean{"MDC_PRESS_BLD_ART_ABP_MEAN", "MDC_PRESS_BLD_ART_MEAN",
                                                "MDC_PRESS_BLD_NONINV_MEAN", "MDC_PRESS_CUFF_MEAN"};

bool is_one_of(std::string_view code, const std::array<std::string_view, 4>& codes) {
  return std::ranges::find(codes, code) != codes.end();
}

bool is_arterial_pressure(std::string_view code) {
  constexpr std::string_view kPulmonary = "MDC_PRESS_BLD_ART_PULM";
  return (code.starts_with("MDC_PRESS_BLD_ART") && !code.starts_with(kPulmonary)) ||
         code.starts_with("MDC_PRESS_BLD_NONINV") || code.starts_with("MDC_PRESS_CUFF");
}

std::optional<double> mean_of(const VitalSeries& series, std::int64_t from_ns, std::int64_t to_ns) {
  const auto first = std::ranges::lower_bound(series.numbers, from_ns, {}, &VitalNumber::time_ns);
  const auto last = std::ranges::lower_bound(series.numbers, to_ns, {}, &VitalNumber::time_ns);
  if (first >= last) return {};
  double sum = 0;
  for (auto number = first; number != last; ++number) sum += number->value;
  return sum / double(last - first);
}

std::string text_of(const char* what, double value, const char* passed, double limit,
                    const std::string& device) {
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "%s pressure %.1f mmHg, %s %g", what, value, passed, limit);
  return text.data() + (device.empty() ? "" : " (" + device + ")");
}

/// Kilopascal is the other unit that monitors know.
double mmhg(double value, const std::string& unit) {
  constexpr double kMmhgPerKilopascal = 7.50062;
  return unit == "kPa" ? value * kMmhgPerKilopascal : value;
}

void add_passings(const std::string& code, const VitalSeries& series, std::int64_t from_ns,
                  std::int64_t to_ns, const char* what, bool below, double limit,
                  std::vector<PressureEvent>& events) {
  bool was_beyond = false;
  for (const VitalNumber& number : series.numbers) {
    if (number.time_ns >= to_ns) break;
    const double value = mmhg(number.value, series.unit);
    const bool beyond = below ? value < limit : value > limit;
    if (beyond && !was_beyond && number.time_ns >= from_ns) {
      const std::string text = text_of(what, value, below ? "below" : "above", limit, series.told_device);
      events.push_back({number.time_ns, text, code, value});
    }
    was_beyond = beyond;
  }
}

std::vector<VitalChange> changes(const CaseRecord& record, const archive::Span& span) {
  std::vector<VitalChange> all;
  for (const auto& [key, series] : record.vitals) {
    VitalChange change{key.code, series.label, series.unit, series.told_device, {}, {}, {}};
    change.before = mean_of(series, span.start_ns - kVitalWindowNs, span.start_ns);
    change.during = mean_of(series, span.start_ns, span.end_ns);
    change.after = mean_of(series, span.end_ns, span.end_ns + kVitalWindowNs);
    if (change.before || change.during || change.after) all.push_back(std::move(change));
  }
  return all;
}

}  // namespace

std::vector<PressureEvent> pressure_events(const CaseRecord& record, std::int64_t from_ns, std::int64_t to_ns,
                                           const PressureLimits& limits) {
  std::vector<PressureEvent> events;
  for (const AlarmStart& alarm : record.alarms) {
    if (alarm.time_ns >= from_ns && alarm.time_ns < to_ns && is_arterial_pressure(alarm.about))
      events.push_back({alarm.time_ns, alarm.text, alarm.about, {}, true});
  }
  for (const auto& [key, series] : record.vitals) {
    const std::string& code = key.code;
    if (is_one_of(code, kSystolic)) {
      add_passings(code, series, from_ns, to_ns, "systolic", true, limits.systolic_low, events);
      add_passings(code, series, from_ns, to_ns, "systolic", false, limits.systolic_high, events);
    } else if (is_one_of(code, kMean)) {
      add_passings(code, series, from_ns, to_ns, "mean", true, limits.mean_low, events);
    }
  }
  std::ranges::stable_sort(events, {}, &PressureEvent::time_ns);
  return events;
}

std::vector<StepFigures> figures_of(std::span<const PlannedStep> steps, const StepMatching& matching,
                                    const CaseRecord& record, const PressureLimits& limits) {
  std::vector<StepFigures> all;
  for (std::size_t step = 0; step < steps.size(); ++step) {
    StepFigures& figures = all.emplace_back();
    figures.step = step;
    const StepMatch* const match = matching.match_of(step);
    if (match == nullptr) continue;
    const auto place = static_cast<std::size_t>(match - matching.matches.data());
    figures.done_as = place;
    if (place > 0) {
      const StepMatch& before = matching.matches[place - 1];
      if (before.end_from == KnownFrom::kMark || before.end_from == KnownFrom::kHand)
        figures.pause_before_ns = match->span.start_ns - before.span.end_ns;
    }
    for (const archive::Span& pause : match->pauses)
      figures.pauses_within_ns += pause.end_ns - pause.start_ns;
    figures.vitals = changes(record, match->span);
    figures.pressure = pressure_events(record, match->span.start_ns, match->span.end_ns, limits);
  }
  return all;
}

}  // namespace kiroku::compare
