// The sound of a display (light/sound_code.h) as samples in step with the clock, for a player behind a pipe.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <thread>
#include <vector>

#include "light/sound_code.h"

namespace kiroku::apps {

/// The code that begins to sound in this second of Unix time; nothing where none does.
using CodeOfSecond = std::function<std::optional<std::uint64_t>()>;

/// Writes samples from construction to destruction by a thread of its own: raw PCM, signed 16 bits, little
/// endian, one channel, SoundCoder::kRate a second, silence between codes. Never ahead of the clock by more
/// than a piece. Where the reader takes them late, what was due is left out, so that a code is never late by
/// more than the pipe holds.
class SoundPlayer {
 public:
  /// `descriptor` stays the caller's. `ended` is called once, from the thread, when nobody reads any more.
  SoundPlayer(int descriptor, const light::SoundCoder& coder, CodeOfSecond code, std::function<void()> ended);
  ~SoundPlayer();
  SoundPlayer(const SoundPlayer&) = delete;
  SoundPlayer& operator=(const SoundPlayer&) = delete;

 private:
  void run();
  /// Whether all was taken; false once nobody reads, or it is to end.
  bool write(const std::vector<std::int16_t>& piece);

  const int descriptor_;
  const light::SoundCoder& coder_;
  const CodeOfSecond code_;
  const std::function<void()> ended_;
  std::atomic<bool> ending_ = false;
  std::thread thread_;
};

}  // namespace kiroku::apps
