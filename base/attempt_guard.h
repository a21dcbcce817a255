// Slows down whoever guesses passwords or tokens: after some failures each further one closes the door for
// longer, for each key apart. Thread-safe. Kept in memory alone.
#pragma once

#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>
#include <unordered_map>

namespace kiroku {

struct AttemptLimits {
  std::size_t free_failures = 5;  // of one key before the first wait
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

  /// How long this key still has to wait at `now`; zero: it may try. A key says who tries, and from where
  /// (base/network_address.h).
  [[nodiscard]] std::chrono::seconds wait(const std::string& key, Clock::time_point now) const;
  /// The longest that any key with this beginning has to wait.
  [[nodiscard]] std::chrono::seconds longest_wait(const std::string& beginning, Clock::time_point now) const;
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

}  // namespace kiroku
