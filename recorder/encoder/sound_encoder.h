// Sound to packets that stand beside the pictures: MPEG-1 layer II in MPEG-TS, FLAC (16 or 24 bit) in
// Matroska. One thread.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "media/libav_handles.h"
#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/video_profile.h"
#include "recorder/source/source.h"

struct AVFilterContext;

namespace kiroku::recorder {

/// What is coded stays the same over the whole case: 48 kHz for layer II, the first source's own rate for
/// FLAC, one or two channels. Sound that comes in another form later is converted to it; silence fills holes
/// of up to ten seconds. Longer ones are left out, by whole blocks: all blocks of a case are of one row.
class SoundEncoder {
 public:
  /// How the samples of a source keep to their times.
  enum class Pace {
    /// They are left as they are until they stray by a tenth of a second; then some are dropped, or silence
    /// is filled in.
    kAsTheyCome,
    /// They were taken by a clock of their own, and are resampled so that they never stray by more than some
    /// milliseconds, whatever that clock is wrong by.
    kResampled
  };
  /// Throws kiroku::Error if libavcodec cannot encode it.
  SoundEncoder(const SoundFormat& format, const VideoProfile& profile, Pace pace = Pace::kAsTheyCome);

  /// Takes decoded sound whose first sample belongs to `time_ns` of the case clock; returns the packets that
  /// are complete, none often.
  std::vector<media::Packet> encode(media::Frame sound, std::int64_t time_ns);
  /// What was not a whole packet yet. Nothing may follow.
  std::vector<media::Packet> drain();

  /// For the muxer; valid as long as this object.
  [[nodiscard]] MuxedStream muxed_stream() const;

 private:
  /// A chain of filters between a buffer that frames are put into and one that they are taken from.
  struct Filter {
    media::FilterGraph graph;
    AVFilterContext* source = nullptr;
    AVFilterContext* sink = nullptr;
  };

  static Filter make_filter(const std::string& input, const std::string& description);
  [[nodiscard]] Filter make_converter(const AVFrame& sound) const;
  [[nodiscard]] Filter make_divider() const;
  void take_from_converter(std::vector<media::Packet>& packets);
  void end_converter(std::vector<media::Packet>& packets);
  void add_silence(std::int64_t samples, std::vector<media::Packet>& packets);
  /// Nothing is coded of what lies between, but for what fills the blocks at both ends.
  void pass_over(std::int64_t samples, std::vector<media::Packet>& packets);
  void divide(AVFrame* sound, std::vector<media::Packet>& packets);
  void take_from_divider(std::vector<media::Packet>& packets);
  void take_from_encoder(const AVFrame* sound, std::vector<media::Packet>& packets);

  const Pace pace_;
  media::Codec codec_;
  Filter converter_;  // of the form that sound comes in, to the one that is coded; another when that changes
  SoundFormat converted_format_;
  std::int64_t converted_until_ns_ = 0;  // case clock: the end of what the converter was given
  Filter divider_;  // into the encoder's blocks. It stays: a short block would be the encoder's last
  // In samples of the case clock: where the next that is divided, and the next block, begin.
  std::optional<std::int64_t> next_sample_, next_block_;
};

}  // namespace kiroku::recorder
