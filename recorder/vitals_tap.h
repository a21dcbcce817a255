// Vital signs for whoever looks on while they are recorded. The recorder offers each line and never waits;
// what nobody takes in time is lost to them, and only to them. One thread offers at a time and one takes.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "media/vital_line.h"

namespace kiroku::recorder {

class VitalsTap {
 public:
  VitalsTap();
  ~VitalsTap();
  VitalsTap(const VitalsTap&) = delete;
  VitalsTap& operator=(const VitalsTap&) = delete;

  /// By the thread that records: a session begins, whose clock begins at zero.
  void begin() noexcept;
  /// By the same thread. Keeps a copy of a sample or an alarm; everything else (a device's own message names
  /// the patient) is passed over. No lock, no system call but for the copy's memory; where the kMostWaiting
  /// lines that fit are there already the line is lost.
  void offer(const media::VitalLine& line) noexcept;

  /// By one thread: what came since, in order; `line` is null where a session begins. Returns how many.
  std::size_t take(const std::function<void(const media::VitalLine* line)>& visit);

  /// How many wait, at most kMostWaiting. By the thread that offers.
  [[nodiscard]] std::size_t waiting() const;
  /// Lines that were not taken in time. From any thread.
  [[nodiscard]] std::uint64_t lost() const;

  static constexpr std::size_t kMostWaiting = 2048;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder
