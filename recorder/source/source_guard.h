// Between the recorder and what a source is read through: a driver, a file system or a library that may never
// come back from a call. Thread-safe.
//
// Each opened source has a thread of its own, which opens, reads and closes it and owns whatever that needs.
// Whoever reads the source waits for that thread, never in the driver, and never longer than the limits say.
// A thread that does not come back is given up: it is told of, counted, and left behind with what it holds.
// It closes the source and ends by itself if the driver ever lets it go.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "base/clock.h"
#include "recorder/source/source.h"
#include "recorder/source/source_address.h"

namespace kiroku::recorder {

/// One for each configured source, for as long as the recorder lives: over all openings and all cases.
class SourceGuard : public std::enable_shared_from_this<SourceGuard> {
 public:
  struct Limits {
    /// A thread that gives no sign of life for so long, though something was asked of it, is given up; and a
    /// live source that sends nothing for so long is lost.
    std::chrono::nanoseconds silence = std::chrono::seconds(5);
    /// A thread that was told to end, and has not so long after, is given up.
    std::chrono::nanoseconds ending = std::chrono::seconds(5);
    /// While so many threads are given up and have not come back, the source is not opened again.
    unsigned most_stuck = 4;
  };
  /// A sentence for people; called from any thread.
  using Tell = std::function<void(const std::string& sentence)>;
  /// What opens a source; called on the source's own thread, with a clock and terms that outlive the source.
  using Maker =
      std::function<std::unique_ptr<Source>(const SourceAddress&, const CaseClock&, const OpeningTerms&)>;

  /// As parse_source_address().
  using LookUp = std::function<SourceAddress(const std::string& text, Presence presence)>;

  SourceGuard();
  /// `tell` may be empty. `make`, `look_up` and `time` are the recorder's own unless a test gives others;
  /// `time`, by which the limits are judged, must outlive the guard and whoever reads through it.
  explicit SourceGuard(Limits limits, Tell tell = {}, Maker make = {}, LookUp look_up = parse_source_address,
                       const Clock& time = Clock::system());

  /// As parse_source_address(), but for a file system that does not answer: then as if the path were not
  /// looked at, where it may be absent, else it throws kiroku::Error.
  SourceAddress look_up(const std::string& text, Presence presence);
  /// Opens a source that is read through a thread of its own. `clock` must outlive the source; it may be
  /// restarted until the first read(). Throws kiroku::Error as open_source() does, and where the thread does
  /// not come back, or too many have not.
  std::unique_ptr<Source> open(const SourceAddress& address, const CaseClock& clock,
                               const OpeningTerms& terms);

  /// Threads that were given up and have not come back.
  [[nodiscard]] unsigned stuck() const { return stuck_; }
  /// Threads that were given up since the recorder started.
  [[nodiscard]] std::uint64_t given_up() const { return given_up_; }
  [[nodiscard]] const Limits& limits() const { return limits_; }

 private:
  class Thread;
  class Guarded;
  void give_up(const std::string& source, const char* doing);
  void came_back(const std::string& source);

  const Limits limits_;
  const Tell tell_;
  const Maker make_;
  const LookUp look_up_;
  const Clock& time_;
  std::atomic<unsigned> stuck_ = 0;
  std::atomic<std::uint64_t> given_up_ = 0;
};

/// Threads of all sources of this process that were given up and have not come back. While there are any, a
/// process must end without destroying what they may still use: see end_process().
unsigned stuck_source_threads();

/// What main() ends with: returns `status`; where threads are stuck, ends the process at once with it, after
/// standard output and error were flushed. Everything that must last is closed by then.
int end_process(int status);

}  // namespace kiroku::recorder
