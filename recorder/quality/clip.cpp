#include "recorder/quality/clip.h"

extern "C" {
#include <libavutil/common.h>
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <cstdio>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "recorder/encoder/frame_filter.h"
#include "recorder/source/boxed_source.h"

namespace kiroku::recorder {
namespace {

using media::require;

/// Planar YCbCr that loses nothing of it but, of RGB, what rounding takes.
AVPixelFormat planar_form(const AVPixFmtDescriptor& given) {
  const bool deep = given.comp[0].depth > 8;
  const bool coloured = given.nb_components >= 3;
  if ((given.flags & AV_PIX_FMT_FLAG_RGB) != 0 || given.log2_chroma_w == 0)
    return coloured && given.log2_chroma_h == 0 ? (deep ? AV_PIX_FMT_YUV444P10 : AV_PIX_FMT_YUV444P)
                                                : (deep ? AV_PIX_FMT_YUV420P10 : AV_PIX_FMT_YUV420P);
  if (given.log2_chroma_h == 0) return deep ? AV_PIX_FMT_YUV422P10 : AV_PIX_FMT_YUV422P;
  return deep ? AV_PIX_FMT_YUV420P10 : AV_PIX_FMT_YUV420P;
}

bool is_rgb(int pixel_format) {
  const AVPixFmtDescriptor* const described = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(pixel_format));
  return described != nullptr && (described->flags & AV_PIX_FMT_FLAG_RGB) != 0;
}

SourceAddress address_of(const std::filesystem::path& file) {
  if (std::error_code failed; !std::filesystem::is_regular_file(file, failed))
    throw UsageError("there is no film " + file.string() + "; name a file that holds one");
  SourceAddress address;
  address.kind = SourceKind::kFile;
  address.location = file.string();
  address.stated = file.string();
  address.options["speed"] = "max";
  return address;
}

media::Frame own_copy(const AVFrame& lent) {
  media::Frame copy = media::make_frame();
  copy->format = lent.format;
  copy->width = lent.width;
  copy->height = lent.height;
  require(av_frame_get_buffer(copy.get(), 0), "cannot keep a picture");
  require(av_frame_copy(copy.get(), &lent), "cannot keep a picture");
  require(av_frame_copy_props(copy.get(), &lent), "cannot keep a picture");
  return copy;
}

}  // namespace

media::Frame as_format(media::Frame frame, const PictureFormat& wanted,
                       std::unique_ptr<FrameFilter>& filter) {
  if (!filter) {
    const bool was_full = frame->color_range == AVCOL_RANGE_JPEG;
    const bool full = wanted.colour_range == AVCOL_RANGE_JPEG;
    std::string conversion;
    if (is_rgb(frame->format) && !is_rgb(wanted.pixel_format)) {
      conversion = std::string("scale=out_color_matrix=bt709:out_range=") + (full ? "full" : "limited");
    } else if (was_full != full) {
      conversion = std::string("scale=in_range=") + (was_full ? "full" : "limited") +
                   ":out_range=" + (full ? "full" : "limited");
    }
    if (frame->format != wanted.pixel_format) {
      conversion += (conversion.empty() ? "format=" : ",format=") +
                    std::string(av_get_pix_fmt_name(static_cast<AVPixelFormat>(wanted.pixel_format)));
    }
    if (conversion.empty()) return frame;
    filter = std::make_unique<FrameFilter>(format_of(*frame), conversion);
  }
  media::Frame changed = filter->apply(std::move(frame));
  if (!changed) throw Error("a picture was lost while its format was changed");
  changed->color_range = static_cast<AVColorRange>(wanted.colour_range);
  changed->colorspace = static_cast<AVColorSpace>(wanted.colour_space);
  return changed;
}

bool same_samples(const AVFrame& one, const AVFrame& other) {
  const AVPixFmtDescriptor& format = *av_pix_fmt_desc_get(static_cast<AVPixelFormat>(one.format));
  for (int plane = 0; plane < format.nb_components; ++plane) {
    const bool chroma = plane > 0;
    const int width = chroma ? AV_CEIL_RSHIFT(one.width, format.log2_chroma_w) : one.width;
    const int height = chroma ? AV_CEIL_RSHIFT(one.height, format.log2_chroma_h) : one.height;
    const auto bytes = static_cast<std::size_t>(width) * (format.comp[0].depth > 8 ? 2 : 1);
    for (int y = 0; y < height; ++y) {
      if (std::memcmp(one.data[plane] + std::ptrdiff_t{y} * one.linesize[plane],
                      other.data[plane] + std::ptrdiff_t{y} * other.linesize[plane], bytes) != 0)
        return false;
    }
  }
  return true;
}

Clip::Clip(const std::filesystem::path& file, ClipStretch stretch) : file_(file), stretch_(stretch) {
  const SourceAddress address = address_of(file_);
  if (const std::string why = why_unboxed(); !why.empty()) {
    throw Error(file_.string() + " is not decoded, as that is only done in a box: " + why +
                "; 'kiroku doctor' says more");
  }
  source_ = open_boxed_source(address, clock_, {});
  given_ = format_ = source_->format();
  const AVPixFmtDescriptor* const described =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(format_.pixel_format));
  if (described == nullptr) throw Error(file_.string() + " holds pictures of an unknown format");
  format_.pixel_format = planar_form(*described);
  // What has no matrix of its own: the range and the matrix that it is converted by.
  if (is_rgb(given_.pixel_format) || described->nb_components < 3) {
    format_.colour_range = AVCOL_RANGE_MPEG;
    format_.colour_space = AVCOL_SPC_BT709;
  }
}

Clip::~Clip() = default;

int Clip::depth() const {
  return av_pix_fmt_desc_get(static_cast<AVPixelFormat>(format_.pixel_format))->comp[0].depth;
}

media::Frame Clip::converted(media::Frame frame) { return as_format(std::move(frame), format_, filter_); }

media::Frame Clip::next() {
  while (std::optional<TimedFrame> timed = source_->read()) {
    if (timed->is_sound || timed->time_ns < stretch_.from_ns) continue;
    const std::int64_t time_ns = timed->time_ns - stretch_.from_ns;
    if (stretch_.duration_ns && time_ns >= *stretch_.duration_ns) return {};
    if (!(format_of(*timed->frame) == given_)) {
      char seconds[32];
      std::snprintf(seconds, sizeof seconds, "%.3f s", static_cast<double>(timed->time_ns) * 1e-9);
      throw Error(file_.string() + " changes its pictures from " + given_.to_string() + " to " +
                  format_of(*timed->frame).to_string() + " at " + seconds +
                  "; measure the parts by themselves (--from, --duration)");
    }
    media::Frame frame = own_copy(*timed->frame);
    frame->pts = time_ns;
    frame->color_range = static_cast<AVColorRange>(given_.colour_range);
    // Without a range of its own grey is full, as libswscale takes it.
    if (av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame->format))->nb_components < 3 &&
        frame->color_range == AVCOL_RANGE_UNSPECIFIED)
      frame->color_range = AVCOL_RANGE_JPEG;
    return converted(std::move(frame));
  }
  return {};
}

}  // namespace kiroku::recorder
