#include "viewer/compare/captions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

#include "archive/reading/case_reader.h"

namespace kiroku::compare {
namespace {

std::string plan_time(const PlanMoment& moment) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "Plan  %.2f s%s", moment.plan_s, moment.stands ? ", stands" : "");
  return text.data();
}

/// The last number, of whatever device, that is not older than `oldest_ns`.
std::optional<double> latest(const CaseRecord& record, const std::string& code, std::int64_t case_ns,
                             std::int64_t oldest_ns, bool is_pressure = false) {
  std::optional<VitalNumber> newest;
  for (auto entry = record.vitals.lower_bound({code, ""});
       entry != record.vitals.end() && entry->first.code == code; ++entry) {
    const std::vector<VitalNumber>& numbers = entry->second.numbers;
    const auto after = std::ranges::upper_bound(numbers, case_ns, {}, &VitalNumber::time_ns);
    if (after == numbers.begin() || std::prev(after)->time_ns < case_ns - oldest_ns) continue;
    if (newest && std::prev(after)->time_ns <= newest->time_ns) continue;
    newest = *std::prev(after);
    if (!is_pressure) continue;
    // Pressures are shown without a unit: they are mmHg or not shown.
    if (const auto mmhg = mmhg_of(newest->value, entry->second.unit)) {
      newest->value = *mmhg;
    } else {
      newest.reset();
    }
  }
  return newest ? std::optional(newest->value) : std::nullopt;
}

std::string vitals_text(const CaseRecord& record, std::int64_t case_ns) {
  constexpr std::int64_t kMinuteNs = 60'000'000'000, kCuffNs = 10 * kMinuteNs;
  std::string text;
  const auto add = [&](const std::string& words) { text += (text.empty() ? "" : "    ") + words; };
  const auto rounded = [](double value) { return std::to_string(std::lround(value)); };
  if (const auto rate = latest(record, "MDC_ECG_HEART_RATE", case_ns, kMinuteNs)) add("HR " + rounded(*rate));
  if (const auto oxygen = latest(record, "MDC_PULS_OXIM_SAT_O2", case_ns, kMinuteNs))
    add("SpO2 " + rounded(*oxygen) + " %");
  const auto add_pressure = [&](const char* label, const std::string& code, std::int64_t oldest_ns) {
    const auto systolic = latest(record, code + "_SYS", case_ns, oldest_ns, true);
    const auto diastolic = latest(record, code + "_DIA", case_ns, oldest_ns, true);
    const auto mean = latest(record, code + "_MEAN", case_ns, oldest_ns, true);
    if (!systolic && !mean) return;
    std::string words = label;
    if (systolic) words += " " + rounded(*systolic) + (diastolic ? "/" + rounded(*diastolic) : "");
    if (mean) words += " (" + rounded(*mean) + ")";
    add(words);
  };
  add_pressure("ABP", "MDC_PRESS_BLD_ART_ABP", kMinuteNs);
  add_pressure("ART", "MDC_PRESS_BLD_ART", kMinuteNs);
  add_pressure("NIBP", "MDC_PRESS_BLD_NONINV", kCuffNs);
  return text;
}

}  // namespace

Caption caption_at(const Comparison& comparison, std::int64_t case_ns) {
  const PlanMoment moment = comparison.map->plan_at(case_ns);
  const auto& pieces = comparison.map->pieces();
  constexpr std::int64_t kHundredthNs = 10'000'000;
  Caption caption;
  caption.plan = plan_time(moment);
  caption.recording =
      "Recording, not verified  " +
      archive::case_time_text(case_ns / kHundredthNs * kHundredthNs, comparison.case_begins_ns);
  if (case_ns < pieces.front().knots.front().case_ns) {
    caption.step = "before the first step";
  } else if (case_ns >= pieces.back().knots.back().case_ns) {
    caption.step = "after the last step";
  } else if (moment.stands) {
    caption.step = "pause";
  } else {
    caption.step = "step " + std::to_string(moment.step + 1) + " of " +
                   std::to_string(comparison.steps.size()) + ": " + comparison.steps[moment.step].name;
  }
  caption.vitals = vitals_text(comparison.record, case_ns);
  return caption;
}

}  // namespace kiroku::compare
