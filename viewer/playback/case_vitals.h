// The vital signs of one recorded stream, as a viewer asks for them. Thread-safe.
//
// Short stretches are read from the segments themselves; long ones come from a pyramid of the whole case that
// is built segment by segment beside everything else, with low priority, and kept in the cache for the next
// who opens the case.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "media/vital_line.h"
#include "viewer/playback/case_media.h"
#include "viewer/playback/encrypted_cache.h"
#include "viewer/playback/vital_pyramid.h"

namespace kiroku::playback {

/// An alarm in a device's own words. `end_ns` is when it was last said to last, and `ended` whether its end
/// was said.
struct AlarmSpan {
  std::int64_t start_ns = 0, end_ns = 0;
  std::string text, priority;
  bool ended = false;
  bool is_questionable = false;  // it may be an earlier patient's, or a test
  bool operator==(const AlarmSpan&) const = default;
};
/// A quantity in words.
struct TimedText {
  std::int64_t time_ns = 0;
  std::string code, text;
  bool is_questionable = false;  // likewise
  bool operator==(const TimedText&) const = default;
};
/// What the recorder says of a device's messages: what is not among the values, or not as it was sent.
struct TimedNotice {
  std::int64_t time_ns = 0;
  std::string notice, text;
  bool operator==(const TimedNotice&) const = default;
};

struct UnreadableStretch {
  archive::Span span;
  std::string problem;
};

struct VitalsView {
  std::vector<VitalSeries> series;  // in the order of their first values
  std::vector<AlarmSpan> alarms;    // that meet the span
  std::vector<TimedText> texts;     // what is invalid is among neither
  std::vector<TimedNotice> notices;
  /// Stretches that could not be read, and why in a sentence: what is said to be there is not shown.
  std::vector<UnreadableStretch> unreadable;
  /// Where the rest is not built yet, what is before this time is all there is; INT64_MAX else.
  std::int64_t complete_to_ns = INT64_MAX;
};

class CaseVitals {
 public:
  /// Both must outlive the object; `name` is what the cache knows the result by. Throws kiroku::UsageError if
  /// there is no such stream, or it is none of vital signs.
  CaseVitals(const CaseMedia& media, EncryptedCache& cache, const std::string& stream, std::string name);
  /// Stops building.
  ~CaseVitals();
  CaseVitals(const CaseVitals&) = delete;
  CaseVitals& operator=(const CaseVitals&) = delete;

  /// All that was measured in [from_ns, to_ns), in about `bins` (at most 20,000) bins. Of a long
  /// stretch, waits at most `patience_ms` for what is not built yet. A segment that is not what the ledger
  /// says, does not open, or holds what is no vital sign is left out, and said so.
  VitalsView view(std::int64_t from_ns, std::int64_t to_ns, std::size_t bins, int patience_ms = 0);
  /// The newest value of each quantity at a time, as the one bin of its series: `last`, at `last_ns`. What
  /// was not measured in the ten seconds before is looked up in what is built so far.
  std::vector<VitalSeries> values_at(std::int64_t time_ns);

 private:
  /// Throws kiroku::Error.
  [[nodiscard]] std::vector<media::VitalLine> lines_of(const archive::SegmentEntry& segment) const;
  void build();
  void take(media::VitalLine&& line);
  void take(media::DeviceAlarm&& alarm);
  /// From the segments themselves; what cannot be read goes to `unreadable`.
  [[nodiscard]] VitalPyramid read_short(std::int64_t from_ns, std::int64_t to_ns, std::int64_t width_ns,
                                        std::vector<UnreadableStretch>& unreadable) const;
  [[nodiscard]] bool restore();
  [[nodiscard]] Bytes saved() const;

  const CaseMedia& media_;
  EncryptedCache& cache_;
  const archive::StreamInfo stream_;
  const std::string name_;
  std::vector<archive::SegmentEntry> segments_;  // without erased ones

  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  VitalPyramid pyramid_;
  std::vector<AlarmSpan> alarms_;
  std::map<std::tuple<std::string, std::string, std::string, std::string>, std::size_t> lasting_alarms_;
  std::vector<TimedText> texts_;
  std::vector<TimedNotice> notices_;
  std::int64_t built_to_ns_ = INT64_MIN;
  std::vector<UnreadableStretch> unreadable_;
  bool stopping_ = false;
  std::thread builder_;
};

}  // namespace kiroku::playback
