// Turns at what holds a thread, a disk or a program: so many at a time, and of one person fewer, so that
// nobody takes them all. Thread-safe.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <map>
#include <mutex>
#include <string>

#include "base/clock.h"

namespace kiroku::viewer {

/// How long a workplace waits for the end of a connection before: its page may have been left a moment ago.
constexpr Clock::Duration kPatienceForPlaces = std::chrono::seconds(5);

class Turns {
 public:
  struct Limits {
    std::size_t all = 2, of_person = 1;
    /// Whoever finds none waits so long for one to be given back.
    Clock::Duration patience{0};
  };
  /// What whoever gets none is told, where all are taken or as many of their own as may be.
  struct Sentences {
    std::string others, own;
  };
  /// `clock` must outlive it.
  Turns(Limits limits, Sentences sentences, const Clock& clock = Clock::system());
  Turns(const Turns&) = delete;
  Turns& operator=(const Turns&) = delete;

  /// One turn, from construction to destruction; `turns` must outlive it. `person` as Session::person().
  class Turn {
   public:
    /// Blocks as long as the limits' patience; Refusal 503 where there is none even then.
    Turn(Turns& turns, std::string person);
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    Turns& turns_;
    const std::string person_;
  };

 private:
  /// Why `person` gets none now; nullptr where there is one. The mutex must be held.
  [[nodiscard]] const std::string* refusal_of(const std::string& person) const;

  const Limits limits_;
  const Sentences sentences_;
  const Clock& clock_;
  std::mutex mutex_;
  std::condition_variable given_back_;
  std::size_t taken_ = 0;
  std::map<std::string, std::size_t> of_person_;
};

}  // namespace kiroku::viewer
