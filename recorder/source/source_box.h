// The inside of a box that a source of pictures is opened, demuxed and decoded in: what the program
// kiroku-decoder does as "source". Outside is boxed_source.h.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "media/box/picture_memory.h"

struct AVCodecContext;
struct AVPacket;

namespace kiroku::recorder {

/// What a source does for the box that it works in.
struct BoxHooks {
  /// Called once, as soon as nothing more needs to be opened. Throws kiroku::Error.
  std::function<void()> close;
  /// Called for the decoder of pictures before it is opened.
  std::function<void(AVCodecContext& codec)> lend;
  /// Gives an empty packet memory from which a picture needs no copy; false where there is none.
  std::function<bool(AVPacket& packet, int bytes)> make_packet;
};

/// Kinds of messages.
enum class ToSourceBox : std::uint32_t {
  kOpen = 1,  // JSON: the address, how to open it, the case clock's zero
  kBegin,     // 8 bytes: the case clock's zero; pictures may come
  kTaken,     // a picture or sound was taken: one more may come
};
enum class FromSourceBox : std::uint32_t {
  kOpened = 1,  // JSON: what Source's getters say
  kFailed,      // JSON: "usage" and "text"
  kPicture,     // PictureMessage
  kSound,       // SoundMessage, then the samples, channel by channel where they are planar
  kEnded,       // the end of a file
};

struct PictureMessage {
  media::PictureNote note;
  std::int64_t time_ns = 0;
  std::uint64_t lost_before = 0;
  std::uint32_t lost_on_the_way = 0, time_break = 0;  // TimeBreak
  std::uint32_t turn = 0, is_turned = 0;              // PictureTreatment
};
struct SoundMessage {
  std::int64_t time_ns = 0;
  std::int32_t sample_rate = 0, channels = 0, sample_format = -1, samples = 0;
};

/// So many pictures and pieces of sound may be on their way.
inline constexpr unsigned kMostOnTheWay = 3;

/// Until the other end goes; then the process ends. The channel and the memory are where child.h says.
[[noreturn]] void run_source_box();

}  // namespace kiroku::recorder
