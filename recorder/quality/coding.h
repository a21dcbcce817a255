// The ways of coding that a clip is tried by, and one way's pictures back again.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "media/libav_handles.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {

/// The first four are Kiroku's own: what its recorder writes. The others stand beside them.
enum class CodingFamily { kMpeg2, kMpeg2Chroma422, kLossless, kUncompressed, kH264, kH265 };
/// "mpeg2", "mpeg2-422", "lossless", "uncompressed", "h264", "h265".
std::string_view coding_word(CodingFamily family);
/// Throws kiroku::UsageError that lists the words.
CodingFamily parse_coding(std::string_view word);
/// Whether it takes a bit rate.
bool has_rate(CodingFamily family);

struct Coding {
  CodingFamily family = CodingFamily::kMpeg2;
  std::int64_t bit_rate = 0;  // bit/s; 0 where the family has none
  /// For people: "MPEG-2 4:2:0, 4 Mbit/s".
  [[nodiscard]] std::string name() const;
  /// Whether 'kiroku record' writes it.
  [[nodiscard]] bool is_ours() const;
};
/// Every profile of Kiroku and a ladder of rates: MPEG-2 from 1 to 15 Mbit/s and, with all its colours, to
/// 25, H.264, H.265.
std::vector<Coding> usual_codings();

/// Pictures through one encoder and its decoder. An object belongs to one thread.
class RoundTrip {
 public:
  /// Kiroku's own codings are the recorder's (encoder/video_encoder.h), in its segments of two seconds, so
  /// that bytes are those that are archived before they are sealed. H.264 and H.265: x264 and x265, preset
  /// "medium", at most 1.5 times the rate over a second, a key frame every two seconds, in one Matroska file.
  /// Throws kiroku::Error where libavcodec lacks the encoder or the coding cannot hold such pictures.
  RoundTrip(const Coding& coding, const PictureFormat& format, Rational frame_rate);
  ~RoundTrip();
  RoundTrip(const RoundTrip&) = delete;
  RoundTrip& operator=(const RoundTrip&) = delete;

  /// What comes out, in the order of showing: as many pictures as went in, all after finish().
  using Taker = std::function<void(media::Frame decoded)>;
  /// `picture` is of the stated format; its pts is its time in nanoseconds.
  void put(const AVFrame& picture, const Taker& take);
  void finish(const Taker& take);
  /// Of the container, so far; all after finish().
  [[nodiscard]] std::uint64_t bytes() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace kiroku::recorder
