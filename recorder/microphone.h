// The sound beside a stream's pictures where it comes from a device of its own. A thread reads it; where it
// is lost or absent it is opened again after pauses, and the pictures go on without it. Thread-safe.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "recorder/clock/case_clock.h"
#include "recorder/source/source.h"
#include "recorder/source/source_guard.h"

namespace kiroku::recorder {

class Microphone {
 public:
  /// Both are called from the microphone's thread: `take` with each piece of sound, `tell` with a sentence
  /// for people where it is lost, cannot be opened, or is back.
  using Take = std::function<void(TimedFrame sound)>;
  using Tell = std::function<void(const std::string& sentence)>;

  /// `clock` must outlive it, and must not be restarted after start().
  Microphone(SourceAddress address, const CaseClock& clock, std::shared_ptr<SourceGuard> guard, Take take,
             Tell tell);
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

  const SourceAddress address_;
  const CaseClock& clock_;
  const std::shared_ptr<SourceGuard> guard_;
  const Take take_;
  const Tell tell_;
  std::mutex mutex_;                // guards source_ against stop()
  std::unique_ptr<Source> source_;  // the thread's
  std::atomic<bool> stopping_ = false;
  bool told_ = false;  // that it is not there
  std::thread thread_;
};

}  // namespace kiroku::recorder
