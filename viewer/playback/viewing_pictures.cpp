#include "viewer/playback/viewing_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

extern "C" {
#include <libswscale/swscale.h>

#include <libavfilter/avfilter.h>
#include <libavfilter/buffersink.h>
#include <libavfilter/buffersrc.h>
#include <libavutil/frame.h>
#include <libavutil/imgutils.h>
#include <libavutil/mem.h>
#include <libavutil/pixdesc.h>
}

#include "base/error.h"
#include "media/libav_versions.h"

namespace kiroku::playback {
namespace {

using media::require;

constexpr const char* kAction = "cannot prepare a picture for viewing";
constexpr int kFirstHighDefinitionLines = 720;

int even(int side) { return std::max(2, side + side % 2); }

/// The matrix of a picture that does not say: as players take it.
int matrix_of(const AVFrame& frame) {
  if (frame.colorspace != AVCOL_SPC_UNSPECIFIED && frame.colorspace != AVCOL_SPC_RGB) return frame.colorspace;
  return frame.height >= kFirstHighDefinitionLines ? AVCOL_SPC_BT709 : AVCOL_SPC_SMPTE170M;
}

/// The largest rectangle of the shape of `frame` within the copy; sides and offsets even.
struct Placement {
  int left = 0, top = 0, width = 0, height = 0;
};
Placement placement_of(const AVFrame& frame, const ViewingFormat& format) {
  const AVRational pixel = frame.sample_aspect_ratio.num > 0 ? frame.sample_aspect_ratio : AVRational{1, 1};
  const double shape =
      av_q2d(pixel) * frame.width / frame.height * format.aspect_denominator / format.aspect_numerator;
  Placement place{0, 0, format.width, format.height};
  if (shape * format.height < format.width) {
    place.width = std::clamp(even(static_cast<int>(std::lround(shape * format.height))), 2, format.width);
  } else {
    place.height = std::clamp(even(static_cast<int>(std::lround(format.width / shape))), 2, format.height);
  }
  // A picture that was given an odd side is not worth a line of black.
  if (format.width - place.width <= 2) place.width = format.width;
  if (format.height - place.height <= 2) place.height = format.height;
  place.left = (format.width - place.width) / 4 * 2;
  place.top = (format.height - place.height) / 4 * 2;
  return place;
}

}  // namespace

ViewingFormat viewing_format_of(const AVFrame& picture, Ticks usual_duration) {
  ViewingFormat format;
  format.width = even(picture.width);
  format.height = even(picture.height);
  if (picture.sample_aspect_ratio.num > 0) {
    format.aspect_numerator = picture.sample_aspect_ratio.num;
    format.aspect_denominator = picture.sample_aspect_ratio.den;
  }
  format.matrix = matrix_of(picture);
  format.primaries = picture.color_primaries;
  format.transfer = picture.color_trc;
  constexpr int kMostPicturesPerSecond = 240;
  if (usual_duration > 0) {
    format.rate = static_cast<int>(std::clamp<Ticks>((kTicksPerSecond + usual_duration / 2) / usual_duration,
                                                     1, kMostPicturesPerSecond));
  }
  return format;
}

/// bwdif over pictures of one size and form: it looks at the picture before and the one after.
class ViewingPictures::Deinterlacer {
 public:
  explicit Deinterlacer(const AVFrame& like)
      : width_(like.width), height_(like.height), format_(like.format), graph_(avfilter_graph_alloc()) {
    if (!graph_) throw std::bad_alloc();
    graph_->nb_threads = 1;
    const AVRational pixel = like.sample_aspect_ratio.num > 0 ? like.sample_aspect_ratio : AVRational{1, 1};
    const std::string input = "width=" + std::to_string(width_) + ":height=" + std::to_string(height_) +
                              ":pix_fmt=" + std::to_string(format_) +
                              ":time_base=1/90000:pixel_aspect=" + std::to_string(pixel.num) + "/" +
                              std::to_string(pixel.den);
    require(avfilter_graph_create_filter(&source_, avfilter_get_by_name("buffer"), "in", input.c_str(),
                                         nullptr, graph_.get()),
            kAction);
    AVFilterContext* bwdif = nullptr;
    require(avfilter_graph_create_filter(&bwdif, avfilter_get_by_name("bwdif"), "bwdif",
                                         "mode=send_frame:deint=interlaced", nullptr, graph_.get()),
            kAction);
    require(avfilter_graph_create_filter(&sink_, avfilter_get_by_name("buffersink"), "out", nullptr, nullptr,
                                         graph_.get()),
            kAction);
    require(avfilter_link(source_, 0, bwdif, 0), kAction);
    require(avfilter_link(bwdif, 0, sink_, 0), kAction);
    require(avfilter_graph_config(graph_.get(), nullptr), kAction);
  }

  [[nodiscard]] bool takes(const AVFrame& frame) const {
    return frame.width == width_ && frame.height == height_ && frame.format == format_;
  }
  std::vector<ArchivedPicture> add(ArchivedPicture picture) {
    media::Frame frame = std::move(picture.frame);
    waiting_.push_back(std::move(picture));
    require(av_buffersrc_add_frame(source_, frame.get()), kAction);
    return take();
  }
  std::vector<ArchivedPicture> finish() {
    require(av_buffersrc_close(source_, AV_NOPTS_VALUE, 0), kAction);
    return take();
  }

 private:
  /// Pictures come out in the order they went in, one for one.
  std::vector<ArchivedPicture> take() {
    std::vector<ArchivedPicture> ready;
    for (;;) {
      media::Frame frame = media::make_frame();
      const int result = av_buffersink_get_frame(sink_, frame.get());
      if (result == AVERROR(EAGAIN) || result == AVERROR_EOF || waiting_.empty()) return ready;
      require(result, kAction);
      ready.push_back(std::move(waiting_.front()));
      waiting_.pop_front();
      ready.back().frame = std::move(frame);
    }
  }

  int width_, height_, format_;
  media::FilterGraph graph_;
  AVFilterContext* source_ = nullptr;
  AVFilterContext* sink_ = nullptr;
  std::deque<ArchivedPicture> waiting_;  // without their frames
};

ViewingPictures::ViewingPictures(const ViewingFormat& format) : format_(format) {}

ViewingPictures::~ViewingPictures() = default;

std::vector<ArchivedPicture> ViewingPictures::add(ArchivedPicture picture) {
  std::vector<ArchivedPicture> ready;
  if (deinterlacer_ && !deinterlacer_->takes(*picture.frame)) {
    ready = deinterlacer_->finish();
    deinterlacer_.reset();
  }
  if (!deinterlacer_ && media::is_interlaced(*picture.frame)) {
    deinterlacer_ = std::make_unique<Deinterlacer>(*picture.frame);
  }
  if (deinterlacer_) {
    for (ArchivedPicture& done : deinterlacer_->add(std::move(picture))) ready.push_back(std::move(done));
  } else {
    ready.push_back(std::move(picture));
  }
  for (ArchivedPicture& done : ready) done.frame = converted(*done.frame);
  return ready;
}

std::vector<ArchivedPicture> ViewingPictures::finish() {
  std::vector<ArchivedPicture> ready;
  if (deinterlacer_) ready = deinterlacer_->finish();
  deinterlacer_.reset();
  for (ArchivedPicture& done : ready) done.frame = converted(*done.frame);
  return ready;
}

media::Frame ViewingPictures::converted(const AVFrame& frame) {
  const bool full_range = frame.color_range == AVCOL_RANGE_JPEG;
  if (frame.format == AV_PIX_FMT_YUV420P && frame.width == format_.width && frame.height == format_.height &&
      matrix_of(frame) == format_.matrix && !full_range) {
    return media::reference(frame);
  }
  const Placement place = placement_of(frame, format_);
  const auto from = static_cast<AVPixelFormat>(frame.format);
  scaler_.reset(sws_getCachedContext(scaler_.release(), frame.width, frame.height, from, place.width,
                                     place.height, AV_PIX_FMT_YUV420P, SWS_BICUBIC, nullptr, nullptr,
                                     nullptr));
  if (!scaler_) {
    const char* const name = av_get_pix_fmt_name(from);
    throw Error("pictures of the format " + std::string(name == nullptr ? "(unknown)" : name) +
                " cannot be shown; export the stream instead");
  }
  constexpr int kUnchanged = 1 << 16;
  sws_setColorspaceDetails(scaler_.get(), sws_getCoefficients(matrix_of(frame)), full_range ? 1 : 0,
                           sws_getCoefficients(format_.matrix), 0, 0, kUnchanged, kUnchanged);
  media::Frame copy = media::make_frame();
  copy->width = format_.width;
  copy->height = format_.height;
  copy->format = AV_PIX_FMT_YUV420P;
  require(av_frame_get_buffer(copy.get(), 0), kAction);
  if (place.width != format_.width || place.height != format_.height) {
    const std::array<std::ptrdiff_t, 4> lines{copy->linesize[0], copy->linesize[1], copy->linesize[2], 0};
    require(av_image_fill_black(copy->data, lines.data(), AV_PIX_FMT_YUV420P, AVCOL_RANGE_MPEG, copy->width,
                                copy->height),
            kAction);
  }
  const std::array<std::uint8_t*, 4> into{
      copy->data[0] + std::ptrdiff_t{place.top} * copy->linesize[0] + place.left,
      copy->data[1] + std::ptrdiff_t{place.top / 2} * copy->linesize[1] + place.left / 2,
      copy->data[2] + std::ptrdiff_t{place.top / 2} * copy->linesize[2] + place.left / 2, nullptr};
  require(sws_scale(scaler_.get(), frame.data, frame.linesize, 0, frame.height, into.data(), copy->linesize),
          kAction);
  return copy;
}

}  // namespace kiroku::playback
