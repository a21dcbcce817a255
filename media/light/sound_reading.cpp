#include "media/light/sound_reading.h"

#include <algorithm>
#include <chrono>
#include <list>
#include <optional>
#include <set>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "archive/format/case_folder.h"
#include "archive/format/segment_media.h"
#include "base/error.h"
#include "light/sound_finder.h"
#include "media/borrowed_source.h"
#include "media/box/boxed_jobs.h"
#include "media/light/box_answers.h"
#include "media/light/sound_job.h"
#include "media/sealed_segment.h"
#include "media/segment_input.h"
#include "media/stream_clock.h"

namespace kiroku::media {
namespace {

using light::SoundFinder;
using nlohmann::json;

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kPeriodNs = light::kSoundPeriodSeconds * kSecondNs;
// A code is shorter than a period; sound may stand in the segment before that of its time, or behind it.
constexpr std::int64_t kTailNs = kPeriodNs + kSecondNs, kAheadNs = kSecondNs;
/// Sound stands so far at most outside the time of its segment: where it waited for pictures, or for a burst.
constexpr std::int64_t kAstrayNs = 3 * kSecondNs;
/// No recorder writes a longer segment. What a ledger states may be anything, and each window costs time.
constexpr std::int64_t kLongestSegmentNs = 3'600 * kSecondNs;
/// Of a minute: a line for each window and each thing that may be a code.
constexpr std::size_t kMostBytes = std::size_t{1} << 20;
constexpr std::chrono::hours kLongestReading{1};
/// Of one job: each is an open file. Segments as short as the recorder makes them leave room for a period.
constexpr std::size_t kMostOpened = 128;

/// Listens to the segments of one stream in their order, window by window.
class SoundReading {
 public:
  SoundReading(const archive::CaseReader& recording, const light::LedgerLights& ledger,
               const archive::StreamInfo& stream, const crypto::AgeIdentities& identities)
      : recording_(recording),
        folder_(archive::CaseFolder::open(recording.folder())),
        stream_(stream),
        identities_(identities),
        segments_(recording.segments(stream.name, INT64_MIN, INT64_MAX)),
        clock_(stream, segments_),
        judge_(ledger, light::kSoundPeriodSeconds) {}

  StreamSound run(const LightProgress& progress) {
    result_.light.segments = segments_.size();
    for (const archive::SegmentEntry& segment : segments_)
      if (recording_.is_erased(segment)) ++result_.light.erased;
    std::int64_t next_ns = segments_.empty() ? 0 : segments_.front().span.start_ns;
    const std::int64_t base_ns = next_ns;
    for (std::size_t at = 0; at < segments_.size();) {
      const archive::SegmentEntry& segment = segments_[at];
      if (recording_.is_erased(segment) || end_of(segment) <= next_ns) {
        ++at;
        continue;
      }
      if (segment.span.start_ns > next_ns)  // after a gap: windows stay a whole number of periods apart
        next_ns = base_ns + (segment.span.start_ns - base_ns) / kPeriodNs * kPeriodNs;
      const int windows = windows_from(next_ns, at);
      listen(next_ns, windows, at);
      next_ns += windows * kPeriodNs;
      if (progress) progress(at + 1, segments_.size());
    }
    result_.light.unread_segments = unread_.size();
    result_.unheard = unheard_.size();
    result_.light.report = judge_.finish();
    return std::move(result_);
  }

 private:
  static std::int64_t end_of(const archive::SegmentEntry& segment) {
    return std::min(segment.span.end_ns, segment.span.start_ns + kLongestSegmentNs);
  }
  static std::int64_t latest_in(const archive::SegmentEntry& segment) {
    const std::int64_t estimated_ns = segment.counted ? 0 : kLatestAfterEstimateNs;
    return segment.span.end_ns + kAstrayNs + estimated_ns;
  }
  void note_unread(const archive::SegmentEntry& segment, const std::string& why) {
    if (unread_.insert(segment.file.file).second && unread_.size() == 1) result_.light.why_unread = why;
  }

  /// The first segment of which windows may need sound that begin in segment `first`.
  static std::size_t first_before(std::size_t first) {
    constexpr std::size_t kBefore = 8;  // none is shorter than an eighth of what sound stands ahead by
    return first - std::min(first, kBefore);
  }
  [[nodiscard]] bool is_needed(const archive::SegmentEntry& segment, std::int64_t begin_ns) const {
    return end_of(segment) > begin_ns - kAheadNs && !recording_.is_erased(segment) &&
           !unread_.contains(segment.file.file);
  }
  /// How many windows one job takes, so that it opens no more segments than it may.
  [[nodiscard]] int windows_from(std::int64_t begin_ns, std::size_t first) const {
    int windows = kMostSoundWindows;
    std::size_t needed = 0;
    for (std::size_t at = first_before(first); at < segments_.size() && windows > 1; ++at) {
      const archive::SegmentEntry& segment = segments_[at];
      if (segment.span.start_ns >= begin_ns + windows * kPeriodNs + kTailNs) break;
      if (!is_needed(segment, begin_ns) || ++needed <= kMostOpened) continue;
      while (windows > 1 && segment.span.start_ns < begin_ns + windows * kPeriodNs + kTailNs) --windows;
    }
    return windows;
  }

  /// The windows of one job, the first of which begins at `begin_ns` of the case clock, in segment `first`.
  void listen(std::int64_t begin_ns, int asked_windows, std::size_t first) {
    const std::int64_t end_ns = begin_ns + asked_windows * kPeriodNs;
    std::list<SealedSegment> opened;
    std::vector<const archive::SegmentEntry*> entries;
    json asked_segments = json::array();
    for (std::size_t at = first_before(first); at < segments_.size(); ++at) {
      const archive::SegmentEntry& segment = segments_[at];
      if (segment.span.start_ns >= end_ns + kTailNs) break;
      if (!is_needed(segment, begin_ns)) continue;
      if (opened.size() >= kMostOpened) {
        note_unread(segment, "there are more than " + std::to_string(kMostOpened) + " segments around " +
                                 segment.file.file + ", which no recorder makes of so short a time");
        continue;
      }
      try {
        const std::string media = archive::media_of(stream_, segment);
        const std::optional<Ticks> offset = clock_.offset_of(segment);
        if (!offset) throw Error("no entry says when the sound of " + segment.file.file + " is from");
        // What a ledger states of its first picture may be anything.
        const Ticks apart = std::clamp(*offset, -kFurthestStamp, kFurthestStamp);
        opened.push_back(SealedSegment::open(folder_, segment, identities_));
        entries.push_back(&segment);
        asked_segments.push_back({{"media", media},
                                  {"name", segment.file.file},
                                  {"complete", segment.complete},
                                  {"from", ticks_of_ns(begin_ns) + apart},
                                  {"earliest", ticks_of_ns(segment.span.start_ns - begin_ns - kAstrayNs)},
                                  {"latest", ticks_of_ns(latest_in(segment) - begin_ns)}});
      } catch (const IoError&) {
        throw;
      } catch (const Error& error) {
        note_unread(segment, error.what());
      }
    }
    if (entries.empty()) return;
    const std::string name = entries.front()->file.file;
    try {
      Bytes said;
      const json asked{{"windows", asked_windows}, {"phases", phases_}, {"segments", asked_segments}};
      const json answer = boxes_.with([&](BoxedJobs& box) {
        return box.ask(kReadSound, asked,
                       [&](std::uint64_t number) -> std::unique_ptr<crypto::ByteSource> {
                         if (number >= opened.size())
                           throw Error("the decoder asks for a segment that there is not");
                         return std::make_unique<BorrowedSource>(
                             *std::next(opened.begin(), static_cast<std::ptrdiff_t>(number)));
                       },
                       name, &said, {.whole = kLongestReading, .bytes = kMostBytes});
      });
      take_answer(answer, entries);
      judge(begin_ns, asked_windows, said, name);
    } catch (const IoError&) {
      throw;
    } catch (const Error& error) {
      for (const archive::SegmentEntry* entry : entries) {
        note_unread(*entry, error.what());
        unheard_.insert(entry->file.file);
      }
    }
  }

  void take_answer(const json& answer, const std::vector<const archive::SegmentEntry*>& entries) {
    phases_ = sound_phases_of(answer);
    const auto whole_numbers = [&](const char* key) {
      std::vector<std::int64_t> numbers;
      if (const auto found = answer.find(key); found != answer.end() && found->is_array())
        for (const json& one : *found)
          if (one.is_number_integer()) numbers.push_back(one.get<std::int64_t>());
      return numbers;
    };
    const std::vector<std::int64_t> rates = whole_numbers("rates");
    for (std::size_t i = 0; i < std::min(rates.size(), entries.size()); ++i) {
      if (rates[i] <= 0 || !counted_.insert(entries[i]->file.file).second) continue;
      ++result_.with_sound;
      if (rates[i] < SoundFinder::kRate) ++result_.too_slow;
    }
    for (const std::int64_t number : whole_numbers("damaged")) {
      if (number < 0 || number >= static_cast<std::int64_t>(entries.size())) continue;
      const archive::SegmentEntry& segment = *entries[static_cast<std::size_t>(number)];
      note_unread(segment, "the sound of " + segment.file.file +
                               " cannot be decoded to its end, or is stamped "
                               "outside the time that the ledger states of it");
      if (counted_.contains(segment.file.file)) unheard_.insert(segment.file.file);
    }
  }

  /// Each window's line stands before those of what may be codes in it.
  void judge(std::int64_t begin_ns, int asked_windows, const Bytes& said, const std::string& name) {
    std::optional<std::int64_t> window_ns;
    std::vector<light::TimedSighting> heard;
    int windows = 0;
    const auto close = [&] {
      if (window_ns) judge_.hear(*window_ns, *window_ns + kPeriodNs, heard);
      heard.clear();
    };
    std::string_view text = text_of(said);
    for (std::size_t end = text.find('\n'); end != std::string_view::npos; end = text.find('\n')) {
      const std::optional<ReadPicture> line = picture_of(text.substr(0, end));
      text.remove_prefix(end + 1);
      const bool is_window = line && line->sightings.empty();
      const Ticks last = asked_windows * light::kSoundPeriodSeconds * kTicksPerSecond;
      const bool fits =
          line && line->stamp >= -kTicksPerSecond && line->stamp <= last + kTicksPerSecond &&
          (is_window ? ++windows <= asked_windows
                     : window_ns && line->sightings.size() == 1 && heard.size() < SoundFinder::kMostHeard);
      if (!fits)
        throw MediaError("the sound of " + name + " cannot be decoded: the decoder says what it may not");
      const std::int64_t case_ns = begin_ns + ns_of_ticks(line->stamp);
      if (is_window) {
        close();
        window_ns = case_ns;
      } else {
        heard.push_back({case_ns, line->sightings.front()});
      }
    }
    close();
  }

  const archive::CaseReader& recording_;
  const archive::CaseFolder folder_;
  const archive::StreamInfo& stream_;
  const crypto::AgeIdentities& identities_;
  const std::vector<archive::SegmentEntry> segments_;
  const StreamClock clock_;
  light::LightJudge judge_;
  BoxPool boxes_;
  std::vector<int> phases_;
  StreamSound result_;
  std::set<std::string> unread_, counted_, unheard_;  // files
};

}  // namespace

StreamSound read_sound(const archive::CaseReader& recording, const light::LedgerLights& ledger,
                       const std::string& stream, const crypto::AgeIdentities& identities,
                       const LightProgress& progress) {
  const archive::StreamInfo& info = recording.stream(stream);
  if (info.kind != "video")
    throw UsageError("stream '" + stream + "' has no pictures: sound is recorded beside pictures alone");
  return SoundReading(recording, ledger, info, identities).run(progress);
}

}  // namespace kiroku::media
