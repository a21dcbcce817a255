// The audio of a stream beside its pictures. Used by one thread.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/sound_encoder.h"
#include "recorder/encoder/video_profile.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {

/// Where the source came late, its audio is first heard of while a segment is open; segments carry it from
/// the next one on. While there are no pictures there is nothing for it to stand beside, and it is left out.
class AudioTrack {
 public:
  /// `format`: of the source, where it is known already. Throws kiroku::Error as SoundEncoder does.
  AudioTrack(const std::optional<SoundFormat>& format, const VideoProfile& profile,
             SoundEncoder::Pace pace = SoundEncoder::Pace::kAsTheyCome);

  /// A segment begins; what it carries of audio, valid as long as this object. Nothing: none.
  std::optional<MuxedStream> begin_segment();
  void end_segment() { in_segment_ = false; }
  /// The packets for the open segment that are complete.
  std::vector<media::Packet> take(TimedFrame audio);
  /// What was not a whole packet yet, for the open segment. Nothing may follow.
  std::vector<media::Packet> drain();
  /// After drain() and the segment's end: from the next segment on it is coded beside pictures of that
  /// profile. What came until then is not repeated.
  void change_profile(Profile profile);

 private:
  VideoProfile profile_;
  const SoundEncoder::Pace pace_;
  std::optional<SoundFormat> format_;      // nothing: no audio, or none yet
  std::unique_ptr<SoundEncoder> encoder_;  // null likewise
  bool in_segment_ = false;
};

}  // namespace kiroku::recorder
