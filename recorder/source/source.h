// Where pictures come from. One thread reads a Source; interrupt() may be called from any.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "base/error.h"
#include "media/libav_handles.h"
#include "recorder/clock/case_clock.h"
#include "recorder/source/picture_turn.h"
#include "recorder/source/source_address.h"

namespace kiroku::recorder {

struct Rational {
  int numerator = 0, denominator = 1;
};

/// Whether a source can have this rate: from one picture in ten seconds to a thousand a second. What states
/// another does not know its own; times, gaps and bits that are counted by it would be none.
[[nodiscard]] bool is_believable(Rational rate);

/// What every frame of a run has in common; when it changes, a new encoder is needed.
struct PictureFormat {
  int width = 0, height = 0;
  int pixel_format = -1;   // AVPixelFormat
  Rational sample_aspect;  // 0/1: unknown
  int colour_range = 0, colour_primaries = 2, colour_transfer = 2,
      colour_space = 2;  // AVCOL_*; 2 is "unspecified"
  /// Whether one encoder can take both: of the same size and pixel format.
  friend bool operator==(const PictureFormat& a, const PictureFormat& b) {
    return a.width == b.width && a.height == b.height && a.pixel_format == b.pixel_format;
  }
  /// For people: "1920x1080 yuv420p".
  [[nodiscard]] std::string to_string() const;
};
PictureFormat format_of(const AVFrame& frame);

/// Some decoders say by the name of the layout that samples are of full range (yuvj420p). The frame gets the
/// layout's plain name, and its range stands in `color_range` alone, as encoders and filters are told it.
void state_range_apart(AVFrame& frame);

/// Whether the coding that pictures come in has taken something of them.
enum class CodingLoss : std::uint8_t { kUnknown, kNone, kPossible, kCertain };
struct SourceCoding {
  std::string name;  // libavcodec's word: "h264"; "" where it is not known
  CodingLoss loss = CodingLoss::kUnknown;
};

/// Decoded sound.
struct SoundFormat {
  int sample_rate = 0, channels = 0;
  int sample_format = -1;  // AVSampleFormat
  friend bool operator==(const SoundFormat&, const SoundFormat&) = default;
};
SoundFormat sound_format_of(const AVFrame& frame);

/// Sound is brought to the rate of the record, so that a second of it at one sample a second would take the
/// memory of 48,000 samples: sources give none slower, faster or longer than these.
inline constexpr int kSlowestSound = 1000, kFastestSound = 768'000, kLongestSoundSeconds = 10;

/// Where a film's own times do not go on: they go back, or further ahead than is followed. How long nothing
/// was recorded there, nobody knows.
enum class TimeBreak : std::uint32_t { kNone, kBack, kAhead };

/// A picture, or a piece of sound, and when it reached this machine (case clock), or when it was due (a file
/// at its own pace), or its own time (unpaced).
struct TimedFrame {
  media::Frame frame;
  std::int64_t time_ns = 0;
  std::uint64_t lost_before = 0;  // frames that the source knows were lost since the last one
  bool lost_on_the_way = false;   // by what sends them or the network, not for want of time here
  Rational rate{25, 1};           // nominal, of the source it came from
  bool is_sound = false;
  TimeBreak time_break = TimeBreak::kNone;  // before this picture
  PictureTreatment treatment = {};          // of this picture
};

/// A run of frames from one opened device, address or file. Disposable: any error ends it, and a fresh one is
/// opened.
class Source {
 public:
  virtual ~Source() = default;
  [[nodiscard]] virtual PictureFormat format() const = 0;
  /// Nominal rate; the real one may differ, which is why frames are stamped.
  [[nodiscard]] virtual Rational frame_rate() const = 0;
  /// What its sound is like; nothing if it has none or none was asked for.
  [[nodiscard]] virtual std::optional<SoundFormat> sound_format() const { return {}; }
  /// Whether frames come when the world sends them, so that losing the source is a fault and not an end.
  [[nodiscard]] virtual bool is_live() const = 0;
  /// What comes, for people: "640x480 yuyv422, 30 a second". "" where nobody needs to be told.
  [[nodiscard]] virtual std::string input() const { return {}; }
  /// What its pictures are coded with. Not known of what is made here (synthetic_source.h).
  [[nodiscard]] virtual SourceCoding coding() const { return {}; }
  /// What its pictures say of how they are shown, and what was done about it.
  [[nodiscard]] virtual PictureTreatment treatment() const { return {}; }
  /// What a person should know of how it was opened: that it gives other pictures than were asked for, or
  /// comes another way. "" where there is nothing.
  [[nodiscard]] virtual std::string remark() const { return {}; }
  /// What others sent is demuxed and decoded in this process, beside its keys (boxed_source.h).
  [[nodiscard]] virtual bool is_unboxed() const { return false; }
  /// Waits for the next frame; nothing at the end of a file or after interrupt(). Throws kiroku::Error when
  /// the source is lost.
  virtual std::optional<TimedFrame> read() = 0;
  /// Makes a waiting read() return.
  void interrupt() { interrupted_ = true; }

 protected:
  [[nodiscard]] bool interrupted() const { return interrupted_; }
  [[nodiscard]] const std::atomic<bool>& interruption() const { return interrupted_; }

 private:
  std::atomic<bool> interrupted_ = false;
};

/// Counted up by what waits, as a sign that it is not stuck.
using Pulse = std::atomic<std::uint64_t>;

/// Waits until the case clock reaches `due_ns`; false if `interrupted` became true first. `pulse` may be
/// null.
bool wait_until(const CaseClock& clock, std::int64_t due_ns, const std::atomic<bool>& interrupted,
                Pulse* pulse = nullptr);

/// The process that decoded a source ended or was killed. That says nothing of the source itself, which may
/// go on: also a pipe, of which any other error may be its end.
class DecoderLost : public Error {
 public:
  using Error::Error;
};

/// The source gave no sign of life for so long that the thread that reads it was given up. It is a loss also
/// where the recording is told to end right after it.
class SourceSilent : public Error {
 public:
  using Error::Error;
};

class SourceGuard;
struct BoxHooks;

/// How long, and whether, opening goes on. Read from the opening thread; `cancelled` may be set from any.
struct OpeningTerms {
  std::chrono::nanoseconds patience = std::chrono::seconds(15);
  const std::atomic<bool>* cancelled = nullptr;
  bool sound = false;                            // also read its sound, if it has any
  std::shared_ptr<SourceGuard> guard = nullptr;  // null: one with the usual limits
  // The guard's, for the source that it opens; both outlive it.
  std::chrono::nanoseconds silence = std::chrono::seconds(5);  // a live source that sends nothing is lost
  Pulse* pulse = nullptr;                                      // may be null
  const BoxHooks* box = nullptr;                               // of the box that it works in (source_box.h)
  std::string remark;                                          // said with what the source remarks itself
};

/// Opens what the address names; `clock` must outlive the source. What a driver, a file system or a network
/// stands behind is opened, read and closed by a thread of its own (source_guard.h), so that no call waits
/// longer than the guard's limits, and demuxed and decoded by a process of its own (boxed_source.h). Throws
/// kiroku::Error in one sentence: not there, no answer, no picture in it, cancelled.
std::unique_ptr<Source> open_source(const SourceAddress& address, const CaseClock& clock,
                                    const OpeningTerms& terms = {});

}  // namespace kiroku::recorder
