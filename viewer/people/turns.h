// Turns at what holds a thread, a disk or a program: so many at a time, and of one person fewer, so that
// nobody takes them all. Thread-safe.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
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
    /// Whoever has as many as may be waits so long for one of their own to be given back; nobody waits for
    /// others'. Of several waits of one person the newest goes on: the pages of the others were left.
    Clock::Duration patience{0};
  };
  /// What whoever gets none is told, where all are taken or as many of their own as may be; the latter may
  /// begin with who they are.
  struct Sentences {
    std::string others, own;
    bool own_names_person = false;
    int own_status = 503;
  };
  /// `clock` must outlive it.
  Turns(Limits limits, Sentences sentences, const Clock& clock = Clock::system());
  Turns(const Turns&) = delete;
  Turns& operator=(const Turns&) = delete;

  /// One turn, from construction to destruction; `turns` must outlive it. `person` as Session::person().
  class Turn {
   public:
    /// Refusal where there is none: 503, or Sentences::own_status where their own are in the way, and then
    /// after the limits' patience, which it blocks.
    Turn(Turns& turns, std::string person);
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    Turns& turns_;
    const std::string person_;
  };

 private:
  // With the mutex.
  [[nodiscard]] bool has_all_of_own(const std::string& person) const;
  [[noreturn]] void refuse_own(const std::string& person) const;
  void wait_for_own(const std::string& person, std::unique_lock<std::mutex>& lock);

  const Limits limits_;
  const Sentences sentences_;
  const Clock& clock_;
  std::mutex mutex_;
  std::condition_variable given_back_;
  std::size_t taken_ = 0;
  std::map<std::string, std::size_t> of_person_;
  std::map<std::string, std::uint64_t> waiting_;  // who waits, and the number of their newest wait
  std::uint64_t waits_ = 0;
};

}  // namespace kiroku::viewer
