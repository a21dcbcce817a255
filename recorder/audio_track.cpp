#include "recorder/audio_track.h"

extern "C" {
#include <libavutil/frame.h>
}

#include <utility>

namespace kiroku::recorder {

AudioTrack::AudioTrack(const std::optional<SoundFormat>& format, const VideoProfile& profile,
                       SoundEncoder::Pace pace)
    : profile_(profile), pace_(pace) {
  if (!format || !profile_.audio) return;
  format_ = format;
  encoder_ = std::make_unique<SoundEncoder>(*format, profile_, pace_);
}

void AudioTrack::change_profile(Profile profile) {
  profile_.profile = profile;
  encoder_.reset();
  in_segment_ = false;
  if (format_) encoder_ = std::make_unique<SoundEncoder>(*format_, profile_, pace_);
}

std::optional<MuxedStream> AudioTrack::begin_segment() {
  in_segment_ = encoder_ != nullptr;
  if (!in_segment_) return {};
  return encoder_->muxed_stream();
}

std::vector<media::Packet> AudioTrack::take(TimedFrame audio) {
  if (!encoder_) {
    format_ = sound_format_of(*audio.frame);
    encoder_ = std::make_unique<SoundEncoder>(*format_, profile_, pace_);
  }
  if (!in_segment_) return {};
  return encoder_->encode(std::move(audio.frame), audio.time_ns);
}

std::vector<media::Packet> AudioTrack::drain() {
  if (!in_segment_) return {};
  return encoder_->drain();
}

}  // namespace kiroku::recorder
