// When an authority may be asked again. Times are given by the caller, from one steady clock; nothing here
// looks at a clock. Not thread-safe.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <random>

namespace kiroku::recorder {

struct BackOffPolicy {
  /// After one, two, three failures in a row the authority is left alone for `first`, twice, four times as
  /// long, and so on, at most for `longest`: a network that comes back is noticed within that time, and an
  /// outage of a night costs some dozens of requests. Each pause is made up to a quarter longer or shorter by
  /// chance, so that recorders which lost the network together do not all come back together.
  std::chrono::nanoseconds first = std::chrono::seconds(30);
  std::chrono::nanoseconds longest = std::chrono::minutes(10);
  /// Least time from one request to the next, whatever came of it.
  std::chrono::nanoseconds min_interval{0};
};

class BackOff {
 public:
  using Time = std::chrono::steady_clock::time_point;

  BackOff(BackOffPolicy policy, std::uint32_t seed) : policy_(policy), chance_(seed) {}

  /// A request goes out.
  void asked(Time now);
  void succeeded();
  /// `leave_alone_for`: what the authority itself asked for.
  void failed(Time now, std::optional<std::chrono::nanoseconds> leave_alone_for);

  /// What another run of the program left: failures in a row, and the two times below.
  void adopt(unsigned failures, Time limit, Time next);

  [[nodiscard]] unsigned failures() const { return failures_; }
  /// Earliest time that the authority's own limits allow: min_interval and what it asked for.
  [[nodiscard]] Time limit() const { return limit_; }
  /// The same, and failures in a row waited for, too.
  [[nodiscard]] Time next() const { return std::max(limit_, retry_); }

 private:
  BackOffPolicy policy_;
  std::minstd_rand chance_;
  unsigned failures_ = 0;
  Time limit_{}, retry_{};
};

}  // namespace kiroku::recorder
