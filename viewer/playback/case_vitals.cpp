#include "viewer/playback/case_vitals.h"

#include <algorithm>
#include <chrono>
#include <sys/resource.h>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "media/plaintext_lines.h"
#include "viewer/playback/saved_values.h"

namespace kiroku::playback {
namespace {

constexpr std::size_t kMostBins = 20'000;
constexpr std::size_t kMostRemarks = 100'000;
constexpr int kNiceness = 10;
constexpr std::int64_t kLookedBackNs = 10'000'000'000;

}  // namespace

CaseVitals::CaseVitals(const CaseMedia& media, EncryptedCache& cache, const std::string& stream,
                       std::string name)
    : media_(media),
      cache_(cache),
      stream_(media.recording().stream(stream)),
      name_(std::move(name)),
      segments_(media.recording().segments(stream, INT64_MIN, INT64_MAX)) {
  if (stream_.kind != "vitals") {
    throw UsageError("stream '" + stream + "' has no vital signs; choose another");
  }
  std::erase_if(segments_,
                [&](const archive::SegmentEntry& segment) { return media_.recording().is_erased(segment); });
  if (!restore()) builder_ = std::thread([this] { build(); });
}

CaseVitals::~CaseVitals() {
  {
    const std::lock_guard guard(mutex_);
    stopping_ = true;
  }
  if (builder_.joinable()) builder_.join();
}

std::vector<media::VitalLine> CaseVitals::lines_of(const archive::SegmentEntry& segment) const {
  std::vector<media::VitalLine> lines;
  const media::SealedSegment plain = media_.open(segment);
  media::for_each_line(plain, segment.file.file, media::kMaximumVitalLineBytes, !segment.complete,
                       [&](std::uint64_t number, std::string_view text) {
                         media::VitalLineParse parse = media::parse_vital_line_of_any_kind(text);
                         if (!parse.line) {
                           throw Error("line " + std::to_string(number) + " of " + segment.file.file +
                                       " is no vital sign: " + parse.problem);
                         }
                         lines.push_back(std::move(*parse.line));
                       });
  return lines;
}

void CaseVitals::build() {
  // Linux gives each thread a niceness of its own; where it refuses, the work is done all the same.
  (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNiceness);
  for (const archive::SegmentEntry& segment : segments_) {
    std::vector<media::VitalLine> lines;
    std::string problem;
    try {
      lines = lines_of(segment);
    } catch (const Error& error) {
      problem = error.what();
    }
    const std::lock_guard guard(mutex_);
    if (stopping_) return;
    for (media::VitalLine& line : lines) take(std::move(line));
    if (!problem.empty()) unreadable_.push_back({segment.span, problem});
    // A waveform that ends in a later segment may reach back into this one.
    built_to_ns_ = segment.span.end_ns - pyramid_.longest_block_ns();
    changed_.notify_all();
  }
  Bytes result;
  {
    const std::lock_guard guard(mutex_);
    built_to_ns_ = INT64_MAX;
    changed_.notify_all();
    if (unreadable_.empty()) result = saved();
  }
  if (!result.empty()) cache_.put(name_, result);
}

void CaseVitals::take(media::VitalLine&& line) {
  if (const auto* const sample = std::get_if<media::VitalSample>(&line)) {
    pyramid_.add(*sample);
  } else if (auto* const alarm = std::get_if<media::DeviceAlarm>(&line)) {
    take(std::move(*alarm));
  } else if (auto* const text = std::get_if<media::VitalText>(&line)) {
    if (texts_.size() == kMostRemarks || text->quality == media::VitalQuality::kInvalid) return;
    texts_.push_back({text->time_ns, std::move(text->code), std::move(text->text),
                      text->quality != media::VitalQuality::kGood});
  } else if (auto* const notice = std::get_if<media::VitalNotice>(&line)) {
    if (notices_.size() < kMostRemarks)
      notices_.push_back({notice->time_ns, std::move(notice->notice), std::move(notice->text)});
  }
}

void CaseVitals::take(media::DeviceAlarm&& alarm) {
  if (alarm.quality == media::VitalQuality::kInvalid) return;
  const std::tuple key{alarm.source, alarm.code, alarm.about, alarm.text};
  auto lasting = lasting_alarms_.find(key);
  const bool is_questionable = alarm.quality != media::VitalQuality::kGood;
  const bool is_another =
      lasting != lasting_alarms_.end() &&
      (alarm.phase == "start" || alarms_[lasting->second].is_questionable != is_questionable);
  if (is_another) {
    lasting_alarms_.erase(lasting);  // its end was never said
    lasting = lasting_alarms_.end();
  }
  if (lasting == lasting_alarms_.end()) {
    if (alarms_.size() == kMostRemarks) return;
    lasting = lasting_alarms_.emplace(key, alarms_.size()).first;
    alarms_.push_back({alarm.time_ns, alarm.time_ns, alarm.text, alarm.priority, false, is_questionable});
  }
  AlarmSpan& span = alarms_[lasting->second];
  span.end_ns = alarm.time_ns;
  const bool lasts = alarm.phase == "start" || alarm.phase == "continue" || alarm.phase == "update";
  span.ended = alarm.phase == "end";
  if (!lasts) lasting_alarms_.erase(lasting);
}

VitalPyramid CaseVitals::read_short(std::int64_t from_ns, std::int64_t to_ns, std::int64_t width_ns,
                                    std::vector<UnreadableStretch>& unreadable) const {
  std::int64_t reach_ns = media::kLongestWaveformNs;
  {
    const std::lock_guard guard(mutex_);
    if (built_to_ns_ == INT64_MAX) reach_ns = pyramid_.longest_block_ns() + 1;
  }
  VitalPyramid read(width_ns);
  const auto first = std::partition_point(
      segments_.begin(), segments_.end(),
      [&](const archive::SegmentEntry& segment) { return segment.span.end_ns <= from_ns; });
  for (auto segment = first; segment != segments_.end() && segment->span.start_ns - reach_ns < to_ns;
       ++segment) {
    try {
      for (const media::VitalLine& line : lines_of(*segment)) {
        if (const auto* const sample = std::get_if<media::VitalSample>(&line)) {
          read.add(*sample, from_ns, to_ns);
        }
      }
    } catch (const Error& error) {
      unreadable.push_back({segment->span, error.what()});
    }
  }
  return read;
}

VitalsView CaseVitals::view(std::int64_t from_ns, std::int64_t to_ns, std::size_t bins, int patience_ms) {
  VitalsView view;
  if (to_ns <= from_ns) return view;
  const std::int64_t width = VitalPyramid::width_for(to_ns - from_ns, std::min(bins, kMostBins));
  const bool is_short = width < VitalPyramid::kBaseNs;
  if (is_short) {
    // What is not there at all is not looked at, whatever was asked for.
    const std::int64_t start = std::max(from_ns, -media::kLongestWaveformNs);
    view.series = read_short(start, to_ns, width, view.unreadable).view(start, to_ns, width);
  }
  std::unique_lock guard(mutex_);
  if (!is_short) {
    changed_.wait_for(guard, std::chrono::milliseconds(patience_ms), [&] { return built_to_ns_ >= to_ns; });
    view.series = pyramid_.view(from_ns, to_ns, width);
    for (const UnreadableStretch& stretch : unreadable_) {
      if (archive::meets(stretch.span, from_ns, to_ns)) view.unreadable.push_back(stretch);
    }
  }
  for (const AlarmSpan& alarm : alarms_) {
    if (alarm.start_ns < to_ns && alarm.end_ns >= from_ns) view.alarms.push_back(alarm);
  }
  for (const TimedText& text : texts_) {
    if (text.time_ns >= from_ns && text.time_ns < to_ns) view.texts.push_back(text);
  }
  for (const TimedNotice& notice : notices_) {
    if (notice.time_ns >= from_ns && notice.time_ns < to_ns) view.notices.push_back(notice);
  }
  view.complete_to_ns = built_to_ns_;
  return view;
}

std::vector<VitalSeries> CaseVitals::values_at(std::int64_t time_ns) {
  std::vector<UnreadableStretch> unreadable;
  const VitalPyramid near =
      read_short(time_ns - kLookedBackNs, time_ns + 1, VitalPyramid::kFinestNs, unreadable);
  std::vector<VitalSeries> values = near.before(time_ns);
  const auto is_known = [&](const VitalSeries& series) {
    return std::any_of(values.begin(), values.end(), [&](const VitalSeries& value) {
      return value.code == series.code && value.source == series.source && value.unit == series.unit &&
             value.is_wave == series.is_wave;
    });
  };
  const std::lock_guard guard(mutex_);
  for (VitalSeries& series : pyramid_.before(time_ns)) {
    if (!is_known(series)) values.push_back(std::move(series));
  }
  return values;
}

Bytes CaseVitals::saved() const {
  Saver saver;
  const Bytes pyramid = pyramid_.save();
  saver.list(pyramid);
  saver.number(alarms_.size());
  for (const AlarmSpan& alarm : alarms_) {
    saver.number(alarm.start_ns);
    saver.number(alarm.end_ns);
    saver.text(alarm.text);
    saver.text(alarm.priority);
    saver.number(alarm.ended);
    saver.number(alarm.is_questionable);
  }
  saver.number(texts_.size());
  for (const TimedText& text : texts_) {
    saver.number(text.time_ns);
    saver.text(text.code);
    saver.text(text.text);
    saver.number(text.is_questionable);
  }
  saver.number(notices_.size());
  for (const TimedNotice& notice : notices_) {
    saver.number(notice.time_ns);
    saver.text(notice.notice);
    saver.text(notice.text);
  }
  return saver.take();
}

bool CaseVitals::restore() {
  const std::optional<Bytes> cached = cache_.get(name_);
  if (!cached) return false;
  Restorer restorer(*cached);
  std::optional<VitalPyramid> pyramid = VitalPyramid::restore(restorer.list<std::byte>());
  std::vector<AlarmSpan> alarms;
  for (auto count = restorer.number<std::size_t>(); restorer.fits() && alarms.size() < count;) {
    AlarmSpan& alarm = alarms.emplace_back();
    alarm.start_ns = restorer.number<std::int64_t>();
    alarm.end_ns = restorer.number<std::int64_t>();
    alarm.text = restorer.text();
    alarm.priority = restorer.text();
    alarm.ended = restorer.number<bool>();
    alarm.is_questionable = restorer.number<bool>();
  }
  std::vector<TimedText> texts;
  for (auto count = restorer.number<std::size_t>(); restorer.fits() && texts.size() < count;) {
    TimedText& text = texts.emplace_back();
    text.time_ns = restorer.number<std::int64_t>();
    text.code = restorer.text();
    text.text = restorer.text();
    text.is_questionable = restorer.number<bool>();
  }
  std::vector<TimedNotice> notices;
  for (auto count = restorer.number<std::size_t>(); restorer.fits() && notices.size() < count;) {
    TimedNotice& notice = notices.emplace_back();
    notice.time_ns = restorer.number<std::int64_t>();
    notice.notice = restorer.text();
    notice.text = restorer.text();
  }
  if (!pyramid || !restorer.whole()) return false;
  pyramid_ = std::move(*pyramid);
  alarms_ = std::move(alarms);
  texts_ = std::move(texts);
  notices_ = std::move(notices);
  built_to_ns_ = INT64_MAX;
  return true;
}

}  // namespace kiroku::playback
