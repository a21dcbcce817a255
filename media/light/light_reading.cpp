#include "media/light/light_reading.h"

#include <algorithm>
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
#include "media/borrowed_source.h"
#include "media/box/boxed_jobs.h"
#include "media/light/box_answers.h"
#include "media/picture_decoder.h"
#include "media/sealed_segment.h"
#include "media/segment_input.h"
#include "media/stream_clock.h"

namespace kiroku::media {
namespace {

using nlohmann::json;

/// Of one segment: ten seconds of a thousand pictures each, with every place in them.
constexpr std::size_t kMostBytes = std::size_t{64} << 20;
constexpr std::chrono::hours kLongestReading{1};

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
      // What a ledger states of its first picture may be anything.
      const Ticks since =
          std::clamp(picture->stamp - offset->second - ledger_time, -kFurthestStamp, kFurthestStamp);
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
      const std::string line = line_of({stamp, finder.read(view)});
      segments.give(bytes_of(line));
    }
  } catch (const MediaError&) {  // cut off, perhaps before its first picture
    if (with.at("complete").get<bool>()) throw;
  }
  return {{"places", json_of(finder.places())}};
}

}  // namespace kiroku::media
