#include "recorder/source/picture_turn.h"

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <cstdlib>
#include <cstring>
#include <utility>

#include "media/libav_versions.h"

namespace kiroku::recorder {
namespace {

/// Where a pixel comes from: rows and columns changed first, then counted from the other end.
struct Way {
  bool transposed = false, from_right = false, from_below = false;
};

Way way_of(Turn turn) {
  switch (turn) {
    case Turn::kClockwise:
      return {true, false, true};
    case Turn::kHalf:
      return {false, true, true};
    case Turn::kAnticlockwise:
      return {true, true, false};
    case Turn::kMirrored:
      return {false, true, false};
    case Turn::kUpsideDown:
      return {false, false, true};
    case Turn::kTransposed:
      return {true, false, false};
    case Turn::kTransversed:
      return {true, true, true};
    case Turn::kNone:
    case Turn::kOther:
      break;
  }
  return {};
}

int shifted(int length, int shift) { return -((-length) >> shift); }

/// Bytes from one sample of a plane to the next; 0 where they differ within it, or are none.
int step_of(const AVPixFmtDescriptor& format, int plane) {
  int step = 0;
  for (int i = 0; i < format.nb_components; ++i) {
    if (format.comp[i].plane != plane) continue;
    if (step != 0 && step != format.comp[i].step) return 0;
    step = format.comp[i].step;
  }
  return step;
}

const char* words_of(Turn turn) {
  switch (turn) {
    case Turn::kClockwise:
      return "turned by 90 degrees clockwise";
    case Turn::kHalf:
      return "turned by 180 degrees";
    case Turn::kAnticlockwise:
      return "turned by 90 degrees anticlockwise";
    case Turn::kMirrored:
      return "mirrored left to right";
    case Turn::kUpsideDown:
      return "mirrored upside down";
    case Turn::kTransposed:
      return "mirrored about the diagonal from the upper left";
    case Turn::kTransversed:
      return "mirrored about the diagonal from the upper right";
    case Turn::kNone:
    case Turn::kOther:
      break;
  }
  return "turned by another angle, or distorted";
}

template <int kStep>
void permute(const AVFrame& from, AVFrame& to, int plane, const Way& way, int width, int height) {
  const int from_width = way.transposed ? height : width, from_height = way.transposed ? width : height;
  for (int y = 0; y < height; ++y) {
    std::uint8_t* out = to.data[plane] + std::ptrdiff_t{y} * to.linesize[plane];
    for (int x = 0; x < width; ++x, out += kStep) {
      int column = way.transposed ? y : x, row = way.transposed ? x : y;
      if (way.from_right) column = from_width - 1 - column;
      if (way.from_below) row = from_height - 1 - row;
      std::memcpy(
          out, from.data[plane] + std::ptrdiff_t{row} * from.linesize[plane] + std::ptrdiff_t{column} * kStep,
          kStep);
    }
  }
}

void permute(const AVFrame& from, AVFrame& to, int plane, int step, const Way& way, int width, int height) {
  switch (step) {
    case 1:
      return permute<1>(from, to, plane, way, width, height);
    case 2:
      return permute<2>(from, to, plane, way, width, height);
    case 3:
      return permute<3>(from, to, plane, way, width, height);
    case 4:
      return permute<4>(from, to, plane, way, width, height);
    case 6:
      return permute<6>(from, to, plane, way, width, height);
    default:
      return permute<8>(from, to, plane, way, width, height);
  }
}

}  // namespace

Turn turn_of(const std::int32_t* matrix) {
  // Where a pixel's column and row go: (a x + c y, b x + d y).
  const std::int64_t a = matrix[0], b = matrix[1], c = matrix[3], d = matrix[4];
  if (b == 0 && c == 0 && a != 0 && std::abs(a) == std::abs(d)) {
    if (a > 0) return d > 0 ? Turn::kNone : Turn::kUpsideDown;
    return d > 0 ? Turn::kMirrored : Turn::kHalf;
  }
  if (a == 0 && d == 0 && b != 0 && std::abs(b) == std::abs(c)) {
    if (b > 0) return c > 0 ? Turn::kTransposed : Turn::kClockwise;
    return c > 0 ? Turn::kAnticlockwise : Turn::kTransversed;
  }
  return Turn::kOther;
}

Turn turn_of(const AVFrame& frame, Turn of_stream, std::optional<Turn> before) {
  const AVFrameSideData* const said = av_frame_get_side_data(&frame, AV_FRAME_DATA_DISPLAYMATRIX);
  constexpr std::size_t kNumbers = 9;
  std::int32_t matrix[kNumbers];
  if (said == nullptr || said->size < sizeof matrix)
    return media::is_key_frame(frame) ? of_stream : before.value_or(of_stream);
  std::memcpy(matrix, said->data, sizeof matrix);
  return turn_of(matrix);
}

bool can_turn(const AVFrame& frame, Turn turn) {
  if (turn == Turn::kNone || turn == Turn::kOther) return false;
  if (media::is_interlaced(frame) && turn != Turn::kMirrored) return false;
  const AVPixFmtDescriptor* const format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  constexpr std::uint64_t kNoSamples =
      AV_PIX_FMT_FLAG_BITSTREAM | AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_HWACCEL;
  if (format == nullptr || (format->flags & kNoSamples) != 0) return false;
  const bool transposed = way_of(turn).transposed;
  if (transposed && format->log2_chroma_w != format->log2_chroma_h) return false;
  // Of an odd number of columns the last chroma sample stands for one of them alone.
  if (frame.width % (1 << format->log2_chroma_w) != 0 || frame.height % (1 << format->log2_chroma_h) != 0)
    return false;
  for (int plane = 0; plane < av_pix_fmt_count_planes(static_cast<AVPixelFormat>(frame.format)); ++plane) {
    const int step = step_of(*format, plane);
    if (step != 1 && step != 2 && step != 3 && step != 4 && step != 6 && step != 8) return false;
  }
  return true;
}

media::Frame turned(const AVFrame& frame, Turn turn) {
  const Way way = way_of(turn);
  media::Frame made = media::make_frame();
  made->format = frame.format;
  made->width = way.transposed ? frame.height : frame.width;
  made->height = way.transposed ? frame.width : frame.height;
  media::require(av_frame_get_buffer(made.get(), 0), "turn a picture");
  media::require(av_frame_copy_props(made.get(), &frame), "turn a picture");
  av_frame_remove_side_data(made.get(), AV_FRAME_DATA_DISPLAYMATRIX);
  if (way.transposed && frame.sample_aspect_ratio.num > 0)
    made->sample_aspect_ratio = {frame.sample_aspect_ratio.den, frame.sample_aspect_ratio.num};
  const auto format = static_cast<AVPixelFormat>(frame.format);
  const AVPixFmtDescriptor& described = *av_pix_fmt_desc_get(format);
  for (int plane = 0; plane < av_pix_fmt_count_planes(format); ++plane) {
    // Of two planes or more the second and third are chroma; a fourth is as large as the first.
    const bool chroma = (described.flags & AV_PIX_FMT_FLAG_RGB) == 0 && (plane == 1 || plane == 2);
    permute(frame, *made, plane, step_of(described, plane), way,
            chroma ? shifted(made->width, described.log2_chroma_w) : made->width,
            chroma ? shifted(made->height, described.log2_chroma_h) : made->height);
  }
  return made;
}

FieldOrder field_order_of(const AVFrame& frame) {
  if (!media::is_interlaced(frame)) return FieldOrder::kProgressive;
  return media::is_upper_field_first(frame) ? FieldOrder::kUpperFirst : FieldOrder::kLowerFirst;
}

bool are_shown_alike(const PictureTreatment& one, const PictureTreatment& other) {
  return one.turn == other.turn && one.is_turned == other.is_turned;
}

std::string turn_text(const PictureTreatment& treatment) {
  if (treatment.turn == Turn::kNone) return {};
  if (treatment.is_turned)
    return std::string("its pictures are ") + words_of(treatment.turn) + ", as it says that they are shown";
  return std::string("its pictures are recorded as they are coded, and it says that they are shown ") +
         words_of(treatment.turn);
}

std::string ledger_text(const PictureTreatment& treatment) {
  std::string text = turn_text(treatment);
  if (!text.empty()) text = "; " + text;
  if (treatment.fields == FieldOrder::kUpperFirst) text += "; interlaced, upper field first";
  if (treatment.fields == FieldOrder::kLowerFirst) text += "; interlaced, lower field first";
  return text;
}

}  // namespace kiroku::recorder
