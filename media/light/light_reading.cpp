#include "media/light/light_reading.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>
#include <vector>

extern "C" {
#include <libswscale/swscale.h>

#include <libavformat/avformat.h>
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <nlohmann/json.hpp>

#include "archive/format/case_folder.h"
#include "archive/format/segment_media.h"
#include "base/error.h"
#include "light/light_code.h"
#include "media/borrowed_source.h"
#include "media/box/boxed_jobs.h"
#include "media/picture_decoder.h"
#include "media/sealed_segment.h"
#include "media/segment_input.h"
#include "media/stream_clock.h"

namespace kiroku::media {
namespace {

using nlohmann::json;

// What a box says of a picture is numbers between spaces, and a line feed behind them: its pts in 1/90000 s;
// then for each place that was looked at `opposite`, `clarity` in thousandths and kViews words.
constexpr std::size_t kNumbersOfSighting = 2 + light::kViews;
constexpr std::int64_t kThousand = 1'000;
/// Of one segment: ten seconds of a thousand pictures each, with every place in them.
constexpr std::size_t kMostBytes = std::size_t{64} << 20;
constexpr std::chrono::hours kLongestReading{1};

json json_of(const std::vector<light::Place>& places) {
  json all = json::array();
  for (const light::Place& place : places) {
    json one = json::array();
    for (const light::Point& corner : place) one.insert(one.end(), {corner.x, corner.y});
    all.push_back(std::move(one));
  }
  return all;
}

/// What is no place is left out: a box that was taken over says what it likes.
std::vector<light::Place> places_of(const json& all) {
  std::vector<light::Place> places;
  if (!all.is_array()) return places;
  for (const json& one : all) {
    light::Place place;
    if (!one.is_array() || one.size() != 2 * place.size()) continue;
    if (!std::all_of(one.begin(), one.end(), [](const json& number) { return number.is_number(); })) continue;
    for (std::size_t i = 0; i < place.size(); ++i)
      place[i] = {std::clamp(one[2 * i].get<double>(), -1e5, 1e5),
                  std::clamp(one[2 * i + 1].get<double>(), -1e5, 1e5)};
    places.push_back(place);
    if (places.size() == light::PictureFinder::kMostPlaces) break;
  }
  return places;
}

/// A decoded picture's luma with eight bits.
class Luma {
 public:
  light::GreyView view(const AVFrame& frame) {
    const AVPixFmtDescriptor* const form = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
    const bool is_plain = form != nullptr && (form->flags & AV_PIX_FMT_FLAG_RGB) == 0 &&
                          (form->flags & AV_PIX_FMT_FLAG_PAL) == 0 && form->comp[0].depth == 8 &&
                          form->comp[0].step == 1 && form->comp[0].plane == 0;
    if (is_plain) return {frame.data[0], frame.width, frame.height, frame.linesize[0]};
    scaler_.reset(sws_getCachedContext(scaler_.release(), frame.width, frame.height,
                                       static_cast<AVPixelFormat>(frame.format), frame.width, frame.height,
                                       AV_PIX_FMT_GRAY8, SWS_POINT, nullptr, nullptr, nullptr));
    if (!scaler_) throw MediaError("the pictures' format has no luma that swscale knows");
    if (!grey_ || grey_->width != frame.width || grey_->height != frame.height) {
      grey_ = make_frame();
      grey_->width = frame.width;
      grey_->height = frame.height;
      grey_->format = AV_PIX_FMT_GRAY8;
      require(av_frame_get_buffer(grey_.get(), 0), "cannot look at a picture");
    }
    require(
        sws_scale(scaler_.get(), frame.data, frame.linesize, 0, frame.height, grey_->data, grey_->linesize),
        "cannot look at a picture");
    return {grey_->data[0], grey_->width, grey_->height, grey_->linesize[0]};
  }

 private:
  Scaler scaler_;
  Frame grey_;
};

/// One picture, as the box said.
struct ReadPicture {
  Ticks stamp = 0;
  std::vector<light::Sighting> sightings;
};

std::optional<ReadPicture> picture_of(std::string_view line) {
  std::vector<std::int64_t> numbers;
  while (!line.empty()) {
    std::int64_t number = 0;
    const auto [end, failed] = std::from_chars(line.data(), line.data() + line.size(), number);
    if (failed != std::errc()) return std::nullopt;
    numbers.push_back(number);
    line.remove_prefix(static_cast<std::size_t>(end - line.data()));
    if (line.empty()) break;
    if (line.front() != ' ') return std::nullopt;
    line.remove_prefix(1);
  }
  if (numbers.size() % kNumbersOfSighting != 1) return std::nullopt;
  constexpr std::int64_t kFurthest = std::int64_t{1} << 50;  // ticks: 400 years
  ReadPicture picture{std::clamp(numbers[0], -kFurthest, kFurthest), {}};
  for (std::size_t at = 1; at < numbers.size(); at += kNumbersOfSighting) {
    light::Sighting sighting;
    sighting.opposite = static_cast<int>(std::clamp<std::int64_t>(numbers[at], 0, light::kCodeBits));
    sighting.clarity =
        static_cast<double>(std::clamp<std::int64_t>(numbers[at + 1], 0, kThousand)) / kThousand;
    for (std::size_t view = 0; view < light::kViews; ++view)
      sighting.words[view] = static_cast<std::uint64_t>(numbers[at + 2 + view]) & light::kCodeMask;
    picture.sightings.push_back(sighting);
  }
  return picture;
}

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
    offsets_ = stamp_offsets(stream_, segments);
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
    const auto offset = offsets_.find(media);
    if (offset == offsets_.end())
      throw Error("no entry says when the pictures of " + segment.file.file + " are from");
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
    std::string_view text = text_of(said);
    for (std::size_t end = text.find('\n'); end != std::string_view::npos; end = text.find('\n')) {
      const std::optional<ReadPicture> picture = picture_of(text.substr(0, end));
      if (!picture)
        throw MediaError("the media of " + segment.file.file +
                         " cannot be decoded: the decoder says what it may not");
      text.remove_prefix(end + 1);
      const Ticks ledger_time = ticks_of_ns(segment.span.start_ns);
      const Ticks since = picture->stamp - offset->second - ledger_time;
      judge_.add(ns_of_ticks(ledger_time + (wraps ? unwrapped(since) : since)), picture->sightings);
    }
  }

  const archive::CaseReader& recording_;
  const archive::CaseFolder folder_;
  const archive::StreamInfo& stream_;
  const crypto::AgeIdentities& identities_;
  std::map<std::string, Ticks> offsets_;
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

json read_light_in_box(const json& with, JobSegments& segments) {
  const std::string name = with.at("name");
  const std::unique_ptr<crypto::ByteSource> segment = segments.open(0);
  light::PictureFinder finder(places_of(with.at("places")));
  try {
    SegmentInput input(*segment, with.at("media"), name);
    const AVRational unit = input.video().time_base;
    PictureDecoder decoder(input, name);
    Luma luma;
    std::optional<Ticks> looked;  // when the whole picture was searched
    while (decoder.next()) {
      const AVFrame& frame = decoder.frame();
      const Ticks stamp = av_rescale_q(frame.pts, unit, AVRational{1, kTicksPerSecond});
      const light::GreyView view = luma.view(frame);
      // A display stays where it is; who walks by it goes again.
      if (!looked || stamp - *looked >= kTicksPerSecond * 2 / 5 || stamp < *looked) {
        finder.search(view);
        looked = stamp;
      }
      std::string line = std::to_string(stamp);
      for (const light::Sighting& sighting : finder.read(view)) {
        line += " " + std::to_string(sighting.opposite) + " " +
                std::to_string(std::lround(sighting.clarity * kThousand));
        for (const std::uint64_t word : sighting.words) line += " " + std::to_string(word);
      }
      line += "\n";
      segments.give(bytes_of(line));
    }
  } catch (const MediaError&) {  // cut off, perhaps before its first picture
    if (with.at("complete").get<bool>()) throw;
  }
  return {{"places", json_of(finder.places())}};
}

}  // namespace kiroku::media
