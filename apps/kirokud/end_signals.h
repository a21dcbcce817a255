// What asks kirokud to end, as something to wait for.
#pragma once

#include <atomic>
#include <chrono>
#include <csignal>

namespace kiroku::apps {

/// SIGINT, SIGTERM and SIGHUP, as a descriptor that becomes readable. They are blocked in every thread that
/// is started from now on, so that they interrupt nothing there. A signalfd would not do: libraries start
/// threads before main() (OpenBLAS, which FFmpeg's filters stand on), and a signal that one of those takes
/// would end the process.
class EndSignals {
 public:
  /// Throws kiroku::Error. One object a process.
  EndSignals();

  /// The signal that came within `limit`, 0 if none did. Called by the thread that made the object.
  [[nodiscard]] int wait(std::chrono::seconds limit) const;

 private:
  // The handler's.
  static inline std::atomic<int> number_ = 0;
  static inline std::atomic<int> descriptor_ = -1;
  sigset_t before_{};
};

}  // namespace kiroku::apps
