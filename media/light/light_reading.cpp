#include "media/light/light_reading.h"

#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "archive/format/case_folder.h"
#include "archive/format/segment_media.h"
#include "base/error.h"
#include "media/borrowed_source.h"
#include "media/box/boxed_jobs.h"
#include "media/light/box_answers.h"
#include "media/light/light_job.h"
#include "media/sealed_segment.h"
#include "media/segment_input.h"
#include "media/stream_clock.h"

namespace kiroku::media {
namespace {

using nlohmann::json;

/// Of one segment: ten seconds of a thousand pictures each, with every place in them.
constexpr std::size_t kMostBytes = std::size_t{64} << 20;
constexpr std::chrono::hours kLongestReading{1};

/// Reads the segments of one stream in their order.
class StreamReading {
 public:
  StreamReading(const archive::CaseReader& recording, const light::LedgerLights& ledger,
                const archive::StreamInfo& stream, const crypto::AgeIdentities& identities)
      : recording_(recording),
        folder_(archive::CaseFolder::open(recording.folder())),
        stream_(stream),
        identities_(identities),
        judge_(ledger) {}

  StreamLight run(const LightProgress& progress) {
    const std::vector<archive::SegmentEntry> segments =
        recording_.segments(stream_.name, INT64_MIN, INT64_MAX);
    clock_ = StreamClock(stream_, segments);
    StreamLight result;
    for (const archive::SegmentEntry& segment : segments) {
      ++result.segments;
      if (recording_.is_erased(segment)) {
        ++result.erased;
        continue;
      }
      try {
        read(segment);
      } catch (const IoError&) {
        throw;
      } catch (const Error& error) {
        if (result.unread_segments++ == 0) result.why_unread = error.what();
      }
      if (progress) progress(result.segments, segments.size());
    }
    result.report = judge_.finish();
    return result;
  }

 private:
  void read(const archive::SegmentEntry& segment) {
    const std::string media = archive::media_of(stream_, segment);
    const std::optional<Ticks> offset = clock_.offset_of(segment);
    if (!offset) throw Error("no entry says when the pictures of " + segment.file.file + " are from");
    const SealedSegment plain = SealedSegment::open(folder_, segment, identities_);
    Bytes said;
    const json asked{{"media", media},
                     {"name", segment.file.file},
                     {"complete", segment.complete},
                     {"places", json_of(places_)}};
    const json answer = boxes_.with([&](BoxedJobs& box) {
      return box.ask(kReadLight, asked,
                     [&](std::uint64_t) { return std::make_unique<BorrowedSource>(plain); },
                     segment.file.file, &said, {.whole = kLongestReading, .bytes = kMostBytes});
    });
    if (const auto places = answer.find("places"); places != answer.end()) places_ = places_of(*places);
    const bool wraps = media == "video/mp2t";
    const Ticks ledger_time = ticks_of_ns(segment.span.start_ns);
    std::vector<std::pair<Ticks, ReadPicture>> pictures;  // with the time since the segment's beginning
    std::string_view text = text_of(said);
    for (std::size_t end = text.find('\n'); end != std::string_view::npos; end = text.find('\n')) {
      std::optional<ReadPicture> picture = picture_of(text.substr(0, end));
      if (!picture)
        throw MediaError("the media of " + segment.file.file +
                         " cannot be decoded: the decoder says what it may not");
      text.remove_prefix(end + 1);
      // What a ledger states of its first picture may be anything.
      const Ticks since = std::clamp(picture->stamp - *offset - ledger_time, -kFurthestStamp, kFurthestStamp);
      pictures.emplace_back(wraps ? unwrapped(since) : since, std::move(*picture));
    }
    for (const auto& [since, picture] : pictures) {
      if (!may_lie(segment, since, pictures.size()))
        throw Error("a picture of " + segment.file.file + " is stamped " + seconds_text(since) +
                    " after its segment begins, which by the ledger lasts " +
                    seconds_text(ticks_of_ns(segment.span.end_ns) - ledger_time) +
                    ": it was recorded at another time, or not by a recorder");
    }
    for (const auto& [since, picture] : pictures)
      judge_.add(ns_of_ticks(ledger_time + since), picture.sightings);
  }

  static std::string seconds_text(Ticks ticks) {
    return std::to_string(static_cast<double>(ticks) / double{kTicksPerSecond}) + " s";
  }

  const archive::CaseReader& recording_;
  const archive::CaseFolder folder_;
  const archive::StreamInfo& stream_;
  const crypto::AgeIdentities& identities_;
  StreamClock clock_;
  light::LightJudge judge_;
  BoxPool boxes_;
  std::vector<light::Place> places_;
};

}  // namespace

StreamLight read_light(const archive::CaseReader& recording, const light::LedgerLights& ledger,
                       const std::string& stream, const crypto::AgeIdentities& identities,
                       const LightProgress& progress) {
  const archive::StreamInfo& info = recording.stream(stream);
  if (info.kind != "video")
    throw UsageError("stream '" + stream + "' has no pictures: light is read in a stream of pictures");
  return StreamReading(recording, ledger, info, identities).run(progress);
}

}  // namespace kiroku::media
