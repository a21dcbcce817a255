#include "base/attempt_guard.h"

#include <algorithm>

namespace kiroku {

AttemptGuard::AttemptGuard(AttemptLimits limits) : limits_(limits) {}

std::chrono::seconds AttemptGuard::wait(const std::string& key, Clock::time_point now) const {
  const std::lock_guard guard(mutex_);
  const auto found = failures_.find(key);
  if (found == failures_.end() || found->second.open_again <= now) return std::chrono::seconds(0);
  return std::chrono::ceil<std::chrono::seconds>(found->second.open_again - now);
}

std::chrono::seconds AttemptGuard::longest_wait(const std::string& beginning, Clock::time_point now) const {
  const std::lock_guard guard(mutex_);
  Clock::time_point latest = now;
  for (const auto& [key, failures] : failures_) {
    if (key.starts_with(beginning)) latest = std::max(latest, failures.open_again);
  }
  return std::chrono::ceil<std::chrono::seconds>(latest - now);
}

void AttemptGuard::failed(const std::string& key, Clock::time_point now) {
  const std::lock_guard guard(mutex_);
  make_room(now);
  Failures& failures = failures_[key];
  if (failures.count > 0 && now - failures.last > limits_.memory) failures = {};
  ++failures.count;
  failures.last = now;
  if (failures.count < limits_.free_failures) return;
  // Twice as long each time; beyond 2^20 the longest wait has long been reached.
  const std::size_t doublings = std::min<std::size_t>(failures.count - limits_.free_failures, 20);
  failures.open_again =
      now + std::min(limits_.first_wait * (std::int64_t{1} << doublings), limits_.longest_wait);
}

void AttemptGuard::succeeded(const std::string& key) {
  const std::lock_guard guard(mutex_);
  failures_.erase(key);
}

void AttemptGuard::make_room(Clock::time_point now) {
  if (failures_.size() < limits_.most_remembered) return;
  std::erase_if(failures_, [&](const auto& each) { return now - each.second.last > limits_.memory; });
  if (failures_.size() < limits_.most_remembered) return;
  failures_.erase(std::ranges::min_element(failures_, {}, [](const auto& each) { return each.second.last; }));
}

}  // namespace kiroku
