// Media in memory or behind decryption as a libav demuxer's input. An object belongs to one thread.
#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "base/error.h"
#include "crypto/byte_source.h"
#include "media/libav_handles.h"

struct AVStream;

namespace kiroku::media {

/// The media itself is damaged, or not what it was said to be; as opposed to a file that cannot be read or
/// does not decrypt.
class MediaError : public Error {
 public:
  using Error::Error;
};

/// Fills a buffer from where the last call ended; 0 at the end. May throw.
using SequentialReader = std::function<std::size_t(std::span<std::byte>)>;

/// What is written by hands we do not trust is opened only as what it should be: the container is the one
/// that `media` names, only the codecs of format 1 are tried, and no other file or address is opened whatever
/// the media says.
class SegmentInput {
 public:
  /// One segment, or any plaintext by offset, which must outlive the object. `media` as StreamInfo::media:
  /// "video/mp2t" or "video/x-matroska". `name` stands in errors. Throws MediaError if that is no such media,
  /// and whatever the source throws.
  SegmentInput(const crypto::ByteSource& source, const std::string& media, std::string name);
  /// A run of bytes without seeking: many MPEG-TS segments one after the other.
  SegmentInput(SequentialReader reader, const std::string& media, std::string name);
  ~SegmentInput();
  SegmentInput(const SegmentInput&) = delete;
  SegmentInput& operator=(const SegmentInput&) = delete;

  [[nodiscard]] AVFormatContext& context() { return *context_; }
  /// The video stream; throws MediaError if there is none.
  [[nodiscard]] AVStream& video();
  /// The first stream of sound; null if there is none.
  [[nodiscard]] AVStream* sound();
  /// The next packet, in the order of the file. False at the end. Throws MediaError if the media is damaged,
  /// and whatever the source threw.
  bool read(AVPacket& packet);

 private:
  struct Io;

  void open(const std::string& media);
  [[nodiscard]] AVStream* first_of(int type);
  void check(int result);

  std::string name_;
  std::unique_ptr<Io> io_;
  InputContext context_;
};

}  // namespace kiroku::media
