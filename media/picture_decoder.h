// Pictures of one segment, decoded one after the other. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "media/segment_input.h"

namespace kiroku::media {

/// False at the end.
using PacketSource = std::function<bool(AVPacket& packet)>;

/// Damage is told, never concealed.
class PictureDecoder {
 public:
  /// `input` must outlive the object; `name` stands in errors. Throws MediaError where there are no pictures,
  /// or none that this libavcodec can decode.
  PictureDecoder(SegmentInput& input, std::string name);
  /// The same of chosen packets of `stream`, which is borrowed for this call only: `packets` fills an empty
  /// packet with the next one, or says that there is none. Pictures carry the pts of their packets. With more
  /// than one thread the parts of a picture are decoded side by side, and FFV1's wrong checksums are no
  /// longer told: for bytes that a ledger's hash vouches for.
  PictureDecoder(const AVStream& stream, PacketSource packets, std::string name, int threads = 1);
  PictureDecoder(const PictureDecoder&) = delete;
  PictureDecoder& operator=(const PictureDecoder&) = delete;

  /// The next picture in the order of showing; false after the last. Throws MediaError for one that is
  /// damaged or missing a part, and whatever the input throws; what came before it has been given by then.
  bool next();
  /// The picture that next() gave; its pts in the time base of the input's video stream.
  [[nodiscard]] const AVFrame& frame() const { return *frame_; }
  /// From now on only key frames are given; the packets of others are passed over.
  void give_only_key_frames();
  /// Pictures given so far.
  [[nodiscard]] std::uint64_t count() const { return count_; }

 private:
  void send();
  void check(int result) const;

  PacketSource packets_;
  std::string name_;
  Codec codec_;
  Frame frame_ = make_frame();
  Packet packet_ = make_packet();
  std::uint64_t count_ = 0;
};

}  // namespace kiroku::media
