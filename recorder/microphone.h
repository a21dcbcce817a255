// The sound beside a stream's pictures where it comes from a device of its own. A thread reads it; where it
// is lost or absent it is opened again after pauses, and the pictures go on without it. Thread-safe.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "archive/format/ledger_entry.h"
#include "recorder/clock/case_clock.h"
#include "recorder/source/source.h"
#include "recorder/source/source_guard.h"

namespace kiroku::recorder {

class Microphone {
 public:
  /// All are called from the microphone's thread.
  struct Listener {
    /// Each piece of sound.
    std::function<void(TimedFrame sound)> take;
    /// What comes next does not follow on what came last, and why.
    std::function<void(archive::GapCause cause)> lost;
    /// A sentence for people: it is lost, or cannot be opened, or is back.
    std::function<void(const std::string& sentence)> tell;
  };

  /// `source` was opened from the address; or it is null, which was told already, and is taken up when it can
  /// be opened, after pauses that grow from one second to sixteen. `clock` must outlive it, and must not be
  /// restarted after start().
  Microphone(SourceAddress address, const CaseClock& clock, std::shared_ptr<SourceGuard> guard,
             std::unique_ptr<Source> source, Listener listener);
  ~Microphone();
  Microphone(const Microphone&) = delete;
  Microphone& operator=(const Microphone&) = delete;

  void start();
  /// Makes the thread end; returns at once.
  void stop();
  /// After stop(): waits until the thread has ended; nothing is taken after that.
  void join();

 private:
  void run();
  /// Reads until it is lost or stopped.
  void capture();
  void open();
  void close();

  const SourceAddress address_;
  const CaseClock& clock_;
  const std::shared_ptr<SourceGuard> guard_;
  const Listener listener_;
  std::mutex mutex_;                // guards source_ against stop()
  std::unique_ptr<Source> source_;  // the thread's
  std::atomic<bool> stopping_ = false;
  bool told_ = false;  // of the thread: that it is not there
  std::thread thread_;
};

}  // namespace kiroku::recorder
