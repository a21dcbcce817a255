#include "media/light/light_job.h"

#include <optional>

extern "C" {
#include <libswscale/swscale.h>

#include <libavformat/avformat.h>
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <nlohmann/json.hpp>

#include "light/picture_finder.h"
#include "media/light/box_answers.h"
#include "media/picture_decoder.h"
#include "media/segment_input.h"
#include "media/stream_clock.h"

namespace kiroku::media {
namespace {

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

}  // namespace

nlohmann::json read_light_in_box(const nlohmann::json& with, JobSegments& segments) {
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
