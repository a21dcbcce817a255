#include "recorder/source/source.h"

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <algorithm>
#include <condition_variable>
#include <mutex>

#include "media/libav_filter_library.h"
#include "recorder/source/source_guard.h"
#include "recorder/source/synthetic_source.h"

namespace kiroku::recorder {

bool is_believable(Rational rate) {
  constexpr std::int64_t kMostASecond = 1'000, kLongestSeconds = 10;
  return rate.numerator > 0 && rate.denominator > 0 && rate.numerator <= kMostASecond * rate.denominator &&
         rate.denominator <= kLongestSeconds * rate.numerator;
}

PictureFormat format_of(const AVFrame& frame) {
  return {frame.width,       frame.height,
          frame.format,      {frame.sample_aspect_ratio.num, frame.sample_aspect_ratio.den},
          frame.color_range, frame.color_primaries,
          frame.color_trc,   frame.colorspace};
}

void state_range_apart(AVFrame& frame) {
  AVPixelFormat plain = AV_PIX_FMT_NONE;
  switch (frame.format) {
    case AV_PIX_FMT_YUVJ420P:
      plain = AV_PIX_FMT_YUV420P;
      break;
    case AV_PIX_FMT_YUVJ422P:
      plain = AV_PIX_FMT_YUV422P;
      break;
    case AV_PIX_FMT_YUVJ444P:
      plain = AV_PIX_FMT_YUV444P;
      break;
    case AV_PIX_FMT_YUVJ440P:
      plain = AV_PIX_FMT_YUV440P;
      break;
    case AV_PIX_FMT_YUVJ411P:
      plain = AV_PIX_FMT_YUV411P;
      break;
    default:
      return;
  }
  frame.format = plain;
  frame.color_range = AVCOL_RANGE_JPEG;
}

SoundFormat sound_format_of(const AVFrame& frame) {
  return {frame.sample_rate, frame.ch_layout.nb_channels, frame.format};
}

std::string PictureFormat::to_string() const {
  const char* name = av_get_pix_fmt_name(static_cast<AVPixelFormat>(pixel_format));
  return std::to_string(width) + "x" + std::to_string(height) + " " + (name == nullptr ? "unknown" : name);
}

bool wait_until(const CaseClock& clock, std::int64_t due_ns, const std::atomic<bool>& interrupted,
                Pulse* pulse) {
  // In steps, so that an interruption is noticed within a tenth of a second.
  constexpr std::int64_t kStepNs = 100'000'000;
  std::mutex mutex;
  std::condition_variable nothing;
  std::unique_lock lock(mutex);
  while (!interrupted) {
    const std::int64_t left = due_ns - clock.now_ns();
    if (left <= 0) return true;
    if (pulse != nullptr) ++*pulse;
    clock.time().wait_until(nothing, lock,
                            clock.time().now() + std::chrono::nanoseconds(std::min(left, kStepNs)));
  }
  return false;
}

namespace {

/// Pictures of a camera may need it at any time, and an upgrade during an operation may replace it.
void load_filters_while_they_are_there() {
  try {
    media::load_filter_library();
  } catch (const Error&) {  // the encoder that needs it says the same
  }
}

}  // namespace

std::unique_ptr<Source> open_source(const SourceAddress& address, const CaseClock& clock,
                                    const OpeningTerms& terms) {
  if (address.kind == SourceKind::kSynthetic) return open_synthetic_source(address, clock, terms.sound);
  load_filters_while_they_are_there();
  const std::shared_ptr<SourceGuard> guard = terms.guard ? terms.guard : std::make_shared<SourceGuard>();
  return guard->open(address, clock, terms);
}

}  // namespace kiroku::recorder
