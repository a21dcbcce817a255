// Slows down whoever guesses passwords: after some failures each further one closes the door for longer, for
// the user's name and for the address apart. Thread-safe. Kept in memory alone.
#pragma once

#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>
#include <unordered_map>

namespace kiroku::viewer {

struct AttemptLimits {
  std::size_t free_failures = 5;  // of one name or address before the first wait
  std::chrono::seconds first_wait{2};
  std::chrono::seconds longest_wait = std::chrono::minutes(5);
  /// Failures are forgotten so long after the last.
  std::chrono::seconds memory = std::chrono::hours(1);
  std::size_t most_remembered = 10'000;
};

class AttemptGuard {
 public:
  using Clock = std::chrono::steady_clock;
  explicit AttemptGuard(AttemptLimits limits = {});

  /// How long this name or address still has to wait at `now`; zero: it may try. `key` as "user:anna",
  /// "address:192.0.2.7".
  [[nodiscard]] std::chrono::seconds wait(const std::string& key, Clock::time_point now) const;
  /// The first_wait after free_failures, twice as long after each further one.
  void failed(const std::string& key, Clock::time_point now);
  void succeeded(const std::string& key);

 private:
  struct Failures {
    std::size_t count = 0;
    Clock::time_point last, open_again;
  };
  void make_room(Clock::time_point now);
  const AttemptLimits limits_;
  mutable std::mutex mutex_;
  std::unordered_map<std::string, Failures> failures_;
};

}  // namespace kiroku::viewer
