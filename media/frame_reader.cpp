#include "media/frame_reader.h"

#include <algorithm>
#include <optional>
#include <utility>

extern "C" {
#include <libswscale/swscale.h>

#include <libavformat/avformat.h>
#include <libavutil/frame.h>
#include <libavutil/mathematics.h>
#include <libavutil/pixdesc.h>
}

#include "archive/case_folder.h"
#include "base/error.h"
#include "media/picture_decoder.h"
#include "media/sealed_segment.h"

namespace kiroku::media {
namespace {

constexpr AVRational kNanoseconds{1, 1'000'000'000};

}  // namespace

struct FrameReader::Segment {
  Segment(const archive::CaseReader& recording, const archive::SegmentEntry& stated,
          const crypto::AgeIdentities& identities, const std::string& media)
      : entry(stated),
        plaintext(SealedSegment::open(archive::CaseFolder::open(recording.folder()), entry, identities)),
        input(plaintext, media, entry.file.file),
        decoder(input, entry.file.file) {}

  /// False at the end, also of one that was cut off.
  bool next() {
    try {
      return decoder.next();
    } catch (const MediaError&) {
      if (entry.complete) throw;
      return false;
    }
  }

  /// The first picture is at the segment's start; the others lie as far behind it as their time stamps say.
  std::int64_t time_ns() {
    const std::int64_t pts = decoder.frame().best_effort_timestamp;
    if (!first_pts) first_pts = pts;
    return entry.span.start_ns + av_rescale_q(pts - *first_pts, input.video().time_base, kNanoseconds);
  }

  archive::SegmentEntry entry;
  SealedSegment plaintext;
  SegmentInput input;
  PictureDecoder decoder;
  std::optional<std::int64_t> first_pts;
};

FrameReader::FrameReader(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                         const std::string& stream, std::int64_t from_ns, std::int64_t to_ns)
    : recording_(recording), identities_(identities), media_(recording.stream(stream).media) {
  if (recording.stream(stream).kind != "video") {
    throw UsageError("stream '" + stream + "' has no pictures; choose a video stream");
  }
  segments_ = recording.segments(stream, from_ns, to_ns);
  std::erase_if(segments_,
                [&](const archive::SegmentEntry& segment) { return recording.is_erased(segment); });
}

FrameReader::~FrameReader() = default;

void FrameReader::open_next_segment() {
  segment_.reset();
  const archive::SegmentEntry& entry = segments_[next_segment_++];
  try {
    segment_ = std::make_unique<Segment>(recording_, entry, identities_, media_);
  } catch (const MediaError&) {
    // Cut off before its first picture.
    if (entry.complete) throw;
  }
}

bool FrameReader::next() {
  while (!segment_ || !segment_->next()) {
    if (next_segment_ == segments_.size()) return false;
    open_next_segment();
  }
  time_ns_ = segment_->time_ns();
  return true;
}

const AVFrame& FrameReader::frame() const { return segment_->decoder.frame(); }

std::vector<std::uint8_t> RgbConverter::convert(const AVFrame& frame, int width, int height) {
  constexpr int kChannels = 3, kFirstHdLines = 720, kUnchanged = 1 << 16;
  if (width == 0) width = frame.width;
  if (height == 0) height = frame.height;
  const auto format = static_cast<AVPixelFormat>(frame.format);
  // Without the exact flags swscale's results depend on the processor.
  constexpr int kFlags = SWS_BICUBIC | SWS_ACCURATE_RND | SWS_BITEXACT | SWS_FULL_CHR_H_INT;
  scaler_.reset(sws_getCachedContext(scaler_.release(), frame.width, frame.height, format, width, height,
                                     AV_PIX_FMT_RGB24, kFlags, nullptr, nullptr, nullptr));
  if (!scaler_) {
    const char* const name = av_get_pix_fmt_name(format);
    throw Error(std::string("pictures of the format ") + (name != nullptr ? name : "(unknown)") +
                " cannot be shown: swscale does not know it");
  }
  const bool hd = frame.colorspace == AVCOL_SPC_BT709 ||
                  (frame.colorspace == AVCOL_SPC_UNSPECIFIED && frame.height >= kFirstHdLines);
  const int* const colours = sws_getCoefficients(hd ? SWS_CS_ITU709 : SWS_CS_ITU601);
  const int full_range = frame.color_range == AVCOL_RANGE_JPEG ? 1 : 0;
  sws_setColorspaceDetails(scaler_.get(), colours, full_range, colours, 1, 0, kUnchanged, kUnchanged);
  // Rows of swscale's own choice: it may write beyond the end of one.
  const Frame wide = make_frame();
  wide->width = width;
  wide->height = height;
  wide->format = AV_PIX_FMT_RGB24;
  require(av_frame_get_buffer(wide.get(), 0), "cannot convert a picture");
  require(sws_scale(scaler_.get(), frame.data, frame.linesize, 0, frame.height, wide->data, wide->linesize),
          "cannot convert a picture");
  const std::ptrdiff_t row = std::ptrdiff_t{kChannels} * width;
  std::vector<std::uint8_t> rgb(static_cast<std::size_t>(row * height));
  for (int y = 0; y < height; ++y)
    std::copy_n(wide->data[0] + std::ptrdiff_t{y} * wide->linesize[0], row, rgb.data() + y * row);
  return rgb;
}

}  // namespace kiroku::media
