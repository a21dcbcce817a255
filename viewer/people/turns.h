// Turns at what holds a thread, a disk or a program: so many at a time, and of one person fewer, so that
// nobody takes them all. Thread-safe.
#pragma once

#include <cstddef>
#include <map>
#include <mutex>
#include <string>

namespace kiroku::viewer {

class Turns {
 public:
  struct Limits {
    std::size_t all = 2, of_person = 1;
  };
  /// What whoever gets none is told, where all are taken or as many of their own as may be.
  struct Sentences {
    std::string others, own;
  };
  Turns(Limits limits, Sentences sentences);
  Turns(const Turns&) = delete;
  Turns& operator=(const Turns&) = delete;

  /// One turn, from construction to destruction; `turns` must outlive it. `person` as Session::person().
  class Turn {
   public:
    /// Refusal 503 where there is none.
    Turn(Turns& turns, std::string person);
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    Turns& turns_;
    const std::string person_;
  };

 private:
  const Limits limits_;
  const Sentences sentences_;
  std::mutex mutex_;
  std::size_t taken_ = 0;
  std::map<std::string, std::size_t> of_person_;
};

}  // namespace kiroku::viewer
