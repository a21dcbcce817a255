#include "viewer/playback/still_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

extern "C" {
#include <libswscale/swscale.h>

#include <libavcodec/avcodec.h>
#include <libavutil/frame.h>
#include <libavutil/imgutils.h>
}

#include "base/error.h"
#include "media/png.h"
#include "media/rgb_converter.h"

namespace kiroku::playback {
namespace {

using media::require;

constexpr const char* kAction = "cannot make a thumbnail";
constexpr int kThumbnailWidth = 160;
constexpr int kMostThumbnailHeight = 640;
constexpr std::size_t kMostKeptBytes = std::size_t{192} << 20;
constexpr std::size_t kMostKeptPictures = 64;
constexpr std::size_t kFewestKeptPictures = 3;
/// Further ahead than this it is quicker to begin anew at a key frame.
constexpr Ticks kFurthestReadOn = kTicksPerSecond;

Bytes jpeg_of(const AVFrame& picture) {
  const AVRational pixel =
      picture.sample_aspect_ratio.num > 0 ? picture.sample_aspect_ratio : AVRational{1, 1};
  const double shape = av_q2d(pixel) * picture.width / picture.height;
  const int height =
      std::clamp(static_cast<int>(std::lround(kThumbnailWidth / shape)), 2, kMostThumbnailHeight);
  media::Codec encoder(avcodec_alloc_context3(avcodec_find_encoder(AV_CODEC_ID_MJPEG)));
  if (!encoder) throw std::bad_alloc();
  encoder->width = kThumbnailWidth;
  encoder->height = height;
  encoder->pix_fmt = AV_PIX_FMT_YUVJ420P;
  encoder->time_base = {1, 1};
  encoder->flags |= static_cast<int>(AV_CODEC_FLAG_QSCALE | AV_CODEC_FLAG_BITEXACT);
  constexpr int kQuality = 4;  // 2 is the best
  encoder->global_quality = kQuality * FF_QP2LAMBDA;
  encoder->thread_count = 1;
  require(avcodec_open2(encoder.get(), nullptr, nullptr), kAction);

  const media::Scaler scaler(
      sws_getContext(picture.width, picture.height, static_cast<AVPixelFormat>(picture.format),
                     kThumbnailWidth, height, AV_PIX_FMT_YUVJ420P, SWS_AREA, nullptr, nullptr, nullptr));
  if (!scaler) throw Error("cannot make a thumbnail: swscale does not know the pictures' format");
  const media::Frame small = media::make_frame();
  small->width = kThumbnailWidth;
  small->height = height;
  small->format = AV_PIX_FMT_YUVJ420P;
  small->quality = encoder->global_quality;
  require(av_frame_get_buffer(small.get(), 0), kAction);
  require(sws_scale(scaler.get(), picture.data, picture.linesize, 0, picture.height, small->data,
                    small->linesize),
          kAction);
  require(avcodec_send_frame(encoder.get(), small.get()), kAction);
  const media::Packet packet = media::make_packet();
  require(avcodec_receive_packet(encoder.get(), packet.get()), kAction);
  return to_bytes(std::as_bytes(std::span(packet->data, static_cast<std::size_t>(packet->size))));
}

std::size_t bytes_of_picture(const AVFrame& frame) {
  return static_cast<std::size_t>(std::max(
      0, av_image_get_buffer_size(static_cast<AVPixelFormat>(frame.format), frame.width, frame.height, 1)));
}

}  // namespace

Bytes make_thumbnail(const SegmentOpener& media, const VideoIndex& index, Ticks from, Ticks to) {
  if (!index.may_hold(from, to)) return {};
  PictureReader reader(media, index, Decoding::kKeyFramesOnly);
  reader.stop_before(to);
  const std::optional<Ticks> following = reader.seek(from);
  std::optional<ArchivedPicture> picture = reader.next();
  if (picture && picture->time < from) {
    std::optional<ArchivedPicture> later = reader.next();
    if ((later && later->time < to) || !following || *following >= to) picture = std::move(later);
  }
  return picture && picture->time < to ? jpeg_of(*picture->frame) : Bytes();
}

PictureStepper::PictureStepper(const SegmentOpener& media, const VideoIndex& index)
    : index_(index), reader_(media, index) {}

const ArchivedPicture* PictureStepper::find(Ticks time, Step step) {
  if (index_.segments.empty()) return nullptr;
  reach(time);
  const auto after = std::find_if(kept_.begin(), kept_.end(),
                                  [&](const ArchivedPicture& picture) { return picture.time > time; });
  if (step == Step::kAfter) return after == kept_.end() ? nullptr : &*after;
  if (after == kept_.begin()) return nullptr;
  const auto at = std::prev(after);
  if (step == Step::kAt) return &*at;
  if (at != kept_.begin()) return &*std::prev(at);
  const Ticks shown = at->time;
  reach(shown - 1);
  const auto same = std::find_if(kept_.begin(), kept_.end(),
                                 [&](const ArchivedPicture& picture) { return picture.time >= shown; });
  return same == kept_.begin() ? nullptr : &*std::prev(same);
}

void PictureStepper::reach(Ticks time) {
  const bool kept_before = !kept_.empty() && kept_.front().time <= time;
  if (!kept_before || time - kept_.back().time > kFurthestReadOn) {
    kept_.clear();
    kept_bytes_ = 0;
    at_end_ = false;
  }
  try {
    if (kept_.empty()) reader_.seek(time);
    while (!at_end_ && (kept_.empty() || kept_.back().time <= time)) at_end_ = !decode_next();
  } catch (...) {
    kept_.clear();  // what comes next would be no neighbour
    throw;
  }
}

bool PictureStepper::decode_next() {
  std::optional<ArchivedPicture> picture = reader_.next();
  if (!picture) return false;
  kept_bytes_ += bytes_of_picture(*picture->frame);
  kept_.push_back(std::move(*picture));
  while (kept_.size() > kFewestKeptPictures &&
         (kept_.size() > kMostKeptPictures || kept_bytes_ > kMostKeptBytes)) {
    kept_bytes_ -= bytes_of_picture(*kept_.front().frame);
    kept_.pop_front();
  }
  return true;
}

Bytes png_of_archived(const AVFrame& picture) {
  const std::vector<std::uint8_t> samples = media::RgbConverter().convert(picture);
  return media::png_of({picture.width, picture.height, 3, samples}, media::PngEffort::kQuick);
}

}  // namespace kiroku::playback
