#include "viewer/live/live_encoder.h"

#include <algorithm>
#include <utility>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/frame.h>
}

#include "media/libav_versions.h"
#include "viewer/playback/case_ticks.h"

namespace kiroku::live {
namespace {

using media::require;
using playback::kTicksPerSecond;
using playback::Ticks;

constexpr const char* kAction = "cannot encode a live picture";

Ticks interval_of(const recorder::Rational& rate) {
  constexpr Ticks kUsual = kTicksPerSecond / 25;
  return rate.numerator > 0 && rate.denominator > 0
             ? std::max<Ticks>(1, kTicksPerSecond * rate.denominator / rate.numerator)
             : kUsual;
}

}  // namespace

LiveEncoder::LiveEncoder(const recorder::PictureTap::Picture& first)
    : format_(recorder::format_of(*first.frame)),
      viewing_(playback::viewing_format_of(*first.frame, interval_of(first.rate))),
      interval_(interval_of(first.rate)),
      pictures_(viewing_),
      codec_(playback::make_viewing_encoder(viewing_, "ultrafast")),
      muxer_(*codec_, 1) {}

bool LiveEncoder::can_take(const recorder::PictureTap::Picture& picture) const {
  return recorder::format_of(*picture.frame) == format_ && playback::ticks_of_ns(picture.time_ns) > last_;
}

std::vector<Fragment> LiveEncoder::encode(recorder::PictureTap::Picture picture, bool want_key) {
  key_wanted_ = key_wanted_ || want_key;
  const Ticks time = playback::ticks_of_ns(picture.time_ns);
  std::vector<Fragment> fragments;
  picture.frame->pts = time;
  for (const auto& ready : pictures_.add({std::move(picture.frame), time, interval_}))
    encode_one(ready, fragments);
  return fragments;
}

void LiveEncoder::encode_one(const playback::ArchivedPicture& picture, std::vector<Fragment>& into) {
  if (picture.time <= last_) return;
  const media::Frame frame = media::reference(*picture.frame);
  const bool is_key = key_wanted_ || picture.time - last_key_ >= kTicksPerSecond;
  frame->pts = last_ = picture.time;
  frame->pict_type = is_key ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
  media::set_interlaced(*frame, false);
  if (is_key) last_key_ = picture.time;
  key_wanted_ = false;
  require(avcodec_send_frame(codec_.get(), frame.get()), kAction);
  const media::Packet packet = media::make_packet();
  while (avcodec_receive_packet(codec_.get(), packet.get()) == 0) {
    const std::int64_t time_ns = playback::ns_of_ticks(packet->pts);
    const bool key = (packet->flags & AV_PKT_FLAG_KEY) != 0;
    packet->duration = interval_;
    muxer_.write(*packet);
    into.push_back({muxer_.fragment(), key, time_ns});
  }
}

}  // namespace kiroku::live
