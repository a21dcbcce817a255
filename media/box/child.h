// A decoder in a box: the program kiroku-decoder, which holds no key, sees nothing but what it is to decode,
// and can do nothing but decode it (sandbox.h). It is started anew, never forked off, so that it has no page
// of this process. An object belongs to one thread.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <sys/types.h>
#include <vector>

#include "base/descriptor.h"
#include "media/box/channel.h"

namespace kiroku::media {

/// Where a boxed program finds what it was given.
inline constexpr int kChannelDescriptor = 3;
inline constexpr int kMemoryDescriptor = 4;

/// Memory without a name, shared by two processes, zero at first, of a size that neither can change.
/// Throws kiroku::IoError.
Descriptor make_shared_memory(std::size_t bytes);

/// A shared mapping; unmapped when the object goes. Throws kiroku::IoError where there is no room.
class Mapping {
 public:
  Mapping() = default;
  Mapping(int descriptor, std::size_t bytes, int protection, std::size_t offset = 0);
  ~Mapping();
  Mapping(Mapping&& other) noexcept;
  Mapping& operator=(Mapping&& other) noexcept;
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  [[nodiscard]] std::byte* data() const { return data_; }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

class BoxedChild {
 public:
  /// Starts `kiroku-decoder ROLE`, found beside this program or where it is installed, with an environment
  /// that is empty. `memory` is shared with it and stays the caller's. Throws kiroku::IoError where it cannot
  /// be started.
  BoxedChild(const std::string& role, const Descriptor& memory);
  /// As end().
  ~BoxedChild();
  BoxedChild(const BoxedChild&) = delete;
  BoxedChild& operator=(const BoxedChild&) = delete;

  [[nodiscard]] Channel& channel() { return channel_; }
  [[nodiscard]] pid_t process() const { return process_; }
  /// Closes the channel, which tells it to end, waits so long, then kills it and waits until it is gone: for
  /// ever where a driver keeps it.
  void end(std::chrono::milliseconds patience = std::chrono::milliseconds(0));
  /// Waits until it has ended by itself, killing it after `patience`; says how, for people: "was killed by
  /// SIGSYS, as it asked for what it may not".
  std::string how_it_ended(std::chrono::milliseconds patience = std::chrono::seconds(2));
  /// Whether it was SIGKILL, which nothing inside gives itself: by a person, or for want of memory.
  [[nodiscard]] bool killed_from_outside() const;
  /// Of its processors' time so far.
  [[nodiscard]] std::chrono::nanoseconds processor_time() const;

 private:
  struct Started {
    pid_t process = -1;
    Descriptor socket;
  };
  static Started start(const std::string& role, const Descriptor& memory);
  bool reap(bool wait);

  Started started_;
  const pid_t process_;
  const Descriptor watched_;   // pidfd_open(2): becomes readable when it has ended
  std::optional<int> status_;  // as of waitpid(2), once it was waited for
  bool killed_ = false;        // by end()
  Channel channel_;
};

/// Starts a decoder that closes the widest box and ends. "" where it could, else one sentence on why not.
/// `waiting` is called some ten times a second meanwhile; it may be empty. Thread-safe.
std::string why_no_box(const std::function<void()>& waiting = {});
/// The inside of it: what the program kiroku-decoder does as "probe".
[[noreturn]] void run_box_probe();

/// Beside this program, where it is installed, or where a build has it; empty where there is none.
std::filesystem::path find_decoder_program();

}  // namespace kiroku::media
