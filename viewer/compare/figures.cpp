#include "viewer/compare/figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
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

void add_passings(const std::string& code, const VitalSeries& series, std::int64_t from_ns,
                  std::int64_t to_ns, const char* what, bool below, double limit,
                  std::vector<PressureEvent>& events) {
  bool was_beyond = false;
  for (const VitalNumber& number : series.numbers) {
    if (number.time_ns >= to_ns) break;
    const std::optional<double> known = mmhg_of(number.value, series.unit);
    if (!known) return;  // what cannot be read passes no limit: measured_of() says so
    const double value = *known;
    const bool beyond = below ? value < limit : value > limit;
    if (beyond && !was_beyond && number.time_ns >= from_ns) {
      const std::string text = text_of(what, value, below ? "below" : "above", limit, series.told_device);
      events.push_back({number.time_ns, text, code, value});
    }
    was_beyond = beyond;
  }
}

/// The last number before the step, where it was beyond the limit already: passing it is no event of the
/// step, and the step was done under it all the same.
void add_standing(const std::string& code, const VitalSeries& series, std::int64_t from_ns, const char* what,
                  bool below, double limit, std::vector<PressureEvent>& events) {
  const auto after = std::ranges::lower_bound(series.numbers, from_ns, {}, &VitalNumber::time_ns);
  if (after == series.numbers.begin()) return;
  const VitalNumber& last = *std::prev(after);
  if (last.time_ns < from_ns - kOldestPressureNs) return;
  const std::optional<double> value = mmhg_of(last.value, series.unit);
  if (!value || !(below ? *value < limit : *value > limit)) return;
  const std::string text =
      text_of(what, *value, below ? "already below" : "already above", limit, series.told_device);
  events.push_back({from_ns, text, code, *value});
}

std::vector<PressureEvent> standing_events(const CaseRecord& record, std::int64_t from_ns,
                                           const PressureLimits& limits) {
  std::vector<PressureEvent> events;
  for (const auto& [key, series] : record.vitals) {
    if (is_one_of(key.code, kSystolic)) {
      add_standing(key.code, series, from_ns, "systolic", true, limits.systolic_low, events);
      add_standing(key.code, series, from_ns, "systolic", false, limits.systolic_high, events);
    } else if (is_one_of(key.code, kMean)) {
      add_standing(key.code, series, from_ns, "mean", true, limits.mean_low, events);
    }
  }
  return events;
}

PressureMeasured measured_of(const CaseRecord& record, const archive::Span& span) {
  PressureMeasured measured;
  for (const auto& [key, series] : record.vitals) {
    if (!is_one_of(key.code, kSystolic) && !is_one_of(key.code, kMean)) continue;
    const auto first = std::ranges::lower_bound(series.numbers, span.start_ns, {}, &VitalNumber::time_ns);
    if (first == series.numbers.end() || first->time_ns >= span.end_ns) continue;
    if (mmhg_of(first->value, series.unit)) {
      measured.judged = true;
    } else if (std::ranges::find(measured.unread_units, series.unit) == measured.unread_units.end()) {
      measured.unread_units.push_back(series.unit);
    }
  }
  return measured;
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
    figures.pressure = standing_events(record, match->span.start_ns, limits);
    std::ranges::move(pressure_events(record, match->span.start_ns, match->span.end_ns, limits),
                      std::back_inserter(figures.pressure));
    figures.measured = measured_of(record, match->span);
  }
  return all;
}

}  // namespace kiroku::compare
