#include "viewer/live/live_monitors.h"

#include <algorithm>
#include <chrono>
#include <variant>

namespace kiroku::live {
namespace {

/// Far more often than a tap is full.
constexpr std::chrono::milliseconds kBetweenLooks{250};

/// IHE PCD-04's priorities. One that the device does not state may be grave.
int gravity_of(const std::string& priority) {
  if (priority == "PH") return 3;
  if (priority == "PL") return 1;
  return priority == "PI" ? 0 : 2;
}

}  // namespace

LiveMonitors::LiveMonitors() : thread_([this] { run(); }) {}

LiveMonitors::~LiveMonitors() {
  {
    const std::lock_guard guard(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void LiveMonitors::add(const std::string& room, const std::string& stream,
                       std::shared_ptr<recorder::VitalsTap> tap) {
  const std::lock_guard guard(mutex_);
  streams_.push_back({room, stream, std::move(tap), {}, {}, {}});
}

std::optional<viewer::LiveVitalsNow> LiveMonitors::now(const std::string& room, std::int64_t after_ns) {
  const std::lock_guard guard(mutex_);
  std::optional<viewer::LiveVitalsNow> out;
  for (Stream& stream : streams_) {
    if (stream.room != room) continue;
    drain(stream);
    if (!out) out.emplace();
    for (const viewer::LiveVitalSeries& series : stream.series) {
      out->series.push_back(series);
      std::erase_if(out->series.back().blocks,
                    [after_ns](const viewer::LiveWaveBlock& block) { return block.end_ns <= after_ns; });
    }
    out->alarms.insert(out->alarms.end(), stream.alarms.begin(), stream.alarms.end());
  }
  return out;
}

void LiveMonitors::drain(Stream& stream) {
  stream.tap->take([&stream](const media::VitalLine* line) {
    if (line == nullptr) {
      // Another case, with a clock of its own.
      stream.series.clear();
      stream.alarms.clear();
      stream.alarm_keys.clear();
    } else if (const auto* const sample = std::get_if<media::VitalSample>(line)) {
      take(stream, *sample);
    } else if (const auto* const alarm = std::get_if<media::DeviceAlarm>(line)) {
      take(stream, *alarm);
    }
  });
}

void LiveMonitors::take(Stream& stream, const media::VitalSample& sample) {
  auto series = std::ranges::find_if(stream.series, [&](const viewer::LiveVitalSeries& each) {
    return each.code == sample.code && each.source == sample.source && each.is_wave == sample.is_waveform();
  });
  if (series == stream.series.end()) {
    // What was said longest ago makes room: names that come once must not hide the heart rate.
    if (stream.series.size() == kMostSeries) {
      stream.series.erase(std::ranges::min_element(stream.series, {}, &viewer::LiveVitalSeries::time_ns));
    }
    stream.series.push_back(
        {stream.name, sample.source, sample.code, sample.unit, sample.is_waveform(), 0, {}, {}});
    series = std::prev(stream.series.end());
  }
  series->time_ns = sample.time_ns;
  series->unit = sample.unit;
  series->is_questionable = sample.quality == media::VitalQuality::kQuestionable;
  if (!sample.is_waveform()) {
    // A number that its device calls invalid is none.
    series->value = sample.quality == media::VitalQuality::kInvalid ? std::nullopt : sample.value;
    return;
  }
  if (sample.quality == media::VitalQuality::kInvalid) return;
  series->blocks.push_back({sample.time_ns, sample.rate_hz, sample.values});
  std::erase_if(series->blocks, [&](const viewer::LiveWaveBlock& block) {
    return block.end_ns < sample.time_ns - kWaveKept_ns;
  });
}

void LiveMonitors::take(Stream& stream, const media::DeviceAlarm& alarm) {
  const std::tuple key{alarm.source + "\n" + alarm.code, alarm.about + "\n" + alarm.text};
  const auto found = std::ranges::find(stream.alarm_keys, key);
  const auto place = found - stream.alarm_keys.begin();
  const bool lasts = alarm.phase != "end" && alarm.state != "inactive";
  // It may be an earlier patient's.
  if (lasts && alarm.quality != media::VitalQuality::kGood) return;
  if (!lasts) {
    if (found == stream.alarm_keys.end()) return;
    stream.alarms.erase(stream.alarms.begin() + place);
    stream.alarm_keys.erase(found);
  } else if (found != stream.alarm_keys.end()) {
    stream.alarms[static_cast<std::size_t>(place)].priority = alarm.priority;
  } else {
    // The oldest of the least grave makes room. A device whose texts change never ends those it began.
    if (stream.alarms.size() == kMostAlarms) {
      const auto least = std::ranges::min_element(
          stream.alarms, {}, [](const viewer::LiveAlarm& each) { return gravity_of(each.priority); });
      if (gravity_of(alarm.priority) < gravity_of(least->priority)) return;
      stream.alarm_keys.erase(stream.alarm_keys.begin() + (least - stream.alarms.begin()));
      stream.alarms.erase(least);
    }
    stream.alarms.push_back({stream.name, alarm.source, alarm.text, alarm.priority, alarm.time_ns});
    stream.alarm_keys.push_back(key);
  }
}

void LiveMonitors::run() {
  std::unique_lock lock(mutex_);
  while (!ending_) {
    for (Stream& stream : streams_) drain(stream);
    changed_.wait_for(lock, kBetweenLooks, [this] { return ending_; });
  }
}

}  // namespace kiroku::live
