#include "viewer/compare/paired_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

extern "C" {
#include <libavutil/frame.h>
}

#include "base/error.h"

namespace kiroku::compare {
namespace {

int even(double side) { return std::max(16, 2 * static_cast<int>(std::lround(side / 2))); }

std::string plan_time(const PlanMoment& moment) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "Plan  %.2f s%s", moment.plan_s, moment.stands ? ", stands" : "");
  return text.data();
}

/// The last number, of whatever device, that is not older than `oldest_ns`.
std::optional<double> latest(const CaseRecord& record, const std::string& code, std::int64_t case_ns,
                             std::int64_t oldest_ns) {
  std::optional<VitalNumber> newest;
  for (auto entry = record.vitals.lower_bound({code, ""});
       entry != record.vitals.end() && entry->first.code == code; ++entry) {
    const std::vector<VitalNumber>& numbers = entry->second.numbers;
    const auto after = std::ranges::upper_bound(numbers, case_ns, {}, &VitalNumber::time_ns);
    if (after == numbers.begin() || std::prev(after)->time_ns < case_ns - oldest_ns) continue;
    if (!newest || std::prev(after)->time_ns > newest->time_ns) newest = *std::prev(after);
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
    const auto systolic = latest(record, code + "_SYS", case_ns, oldest_ns);
    const auto diastolic = latest(record, code + "_DIA", case_ns, oldest_ns);
    const auto mean = latest(record, code + "_MEAN", case_ns, oldest_ns);
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

PictureSize picture_size(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                         const std::string& stream, std::int64_t from_ns, int widest) {
  playback::PictureSpan reader(recording, identities, stream, from_ns);
  if (!reader.next()) throw Error("stream '" + stream + "' holds no picture at that time");
  const double wide = reader.frame().width, high = reader.frame().height;
  const double scale = std::min(1.0, widest / wide);
  return {even(wide * scale), even(high * scale)};
}

PairedPictures::PairedPictures(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                               const Comparison& comparison, const sim::PlanFrames& frames,
                               sim::PlanPictures& plan, const CompositionForm& form, std::int64_t from_ns,
                               std::int64_t to_ns)
    : comparison_(comparison),
      frames_(frames),
      plan_(plan),
      form_(form),
      composer_(form),
      reader_(recording, identities, comparison.stream, from_ns, to_ns),
      pending_(reader_.next()),
      recorded_(form.width, form.height) {}

void PairedPictures::read_until(std::int64_t case_ns) {
  bool newer = false;
  media::Frame newest;
  while (pending_ && reader_.time_ns() <= case_ns) {
    newest = media::reference(reader_.frame());
    newer = true;
    pending_ = reader_.next();
  }
  if (newer) recorded_.rgb = converter_.convert(*newest, form_.width, form_.height);
}

void PairedPictures::render(const PlanMoment& moment, std::int64_t case_ns) {
  const sim::PlanFrames::Kept& kept = frames_.at(moment.step, moment.plan_s);
  const sim::Camera* const camera = comparison_.camera && form_.arrangement != Arrangement::kSideBySide
                                        ? &comparison_.camera->camera_at(case_ns)
                                        : nullptr;
  if (&kept == rendered_frame_ && camera == rendered_camera_) return;
  if (camera != nullptr) plan_.set_camera(*camera);
  rendered_ = plan_.picture(kept.frame, *kept.mesh);
  rendered_frame_ = &kept;
  rendered_camera_ = camera;
}

Caption PairedPictures::caption_at(std::int64_t case_ns) const {
  const PlanMoment moment = comparison_.map->plan_at(case_ns);
  const auto& pieces = comparison_.map->pieces();
  constexpr std::int64_t kHundredthNs = 10'000'000;
  Caption caption;
  caption.plan = plan_time(moment);
  caption.recording =
      "Recording  " + case_time_text(case_ns / kHundredthNs * kHundredthNs, comparison_.case_begins_ns);
  if (case_ns < pieces.front().knots.front().case_ns) {
    caption.step = "before the first step";
  } else if (case_ns >= pieces.back().knots.back().case_ns) {
    caption.step = "after the last step";
  } else if (moment.stands) {
    caption.step = "pause";
  } else {
    caption.step = "step " + std::to_string(moment.step + 1) + " of " +
                   std::to_string(comparison_.steps.size()) + ": " + comparison_.steps[moment.step].name;
  }
  if (form_.arrangement != Arrangement::kSideBySide && comparison_.camera && comparison_.camera->lost_ns() &&
      case_ns >= *comparison_.camera->lost_ns())
    caption.step += "    (camera lost)";
  caption.vitals = vitals_text(comparison_.record, case_ns);
  return caption;
}

sim::Picture PairedPictures::at(std::int64_t case_ns) {
  read_until(case_ns);
  render(comparison_.map->plan_at(case_ns), case_ns);
  return composer_.compose(rendered_, recorded_, caption_at(case_ns));
}

}  // namespace kiroku::compare
