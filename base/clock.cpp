#include "base/clock.h"

#include <ctime>

namespace kiroku {
namespace {

class SystemClock final : public Clock {
 public:
  [[nodiscard]] Time now() const override { return std::chrono::steady_clock::now(); }
  [[nodiscard]] Duration since_boot() const override {
    timespec time{};
    ::clock_gettime(CLOCK_BOOTTIME, &time);
    return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
  }
  [[nodiscard]] UtcTime utc() const override { return utc_now(); }
  void wait_until(std::condition_variable& changed, std::unique_lock<std::mutex>& lock,
                  Time deadline) const override {
    changed.wait_until(lock, deadline);
  }
};

}  // namespace

const Clock& Clock::system() {
  static const SystemClock kClock;
  return kClock;
}

}  // namespace kiroku
