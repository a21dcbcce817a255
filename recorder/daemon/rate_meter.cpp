#include "recorder/daemon/rate_meter.h"

namespace kiroku::recorder {

void RateMeter::add(Clock::Time now, std::uint64_t bytes) {
  if (!samples_.empty() && now - samples_.back().when < std::chrono::seconds(1)) return;
  samples_.push_back({now, bytes});
  while (samples_.size() > 2 && now - samples_.front().when > kWindow) samples_.pop_front();
}

double RateMeter::bytes_per_second() const {
  if (samples_.size() < 2) return 0;
  const std::chrono::duration<double> span = samples_.back().when - samples_.front().when;
  return static_cast<double>(samples_.back().bytes - samples_.front().bytes) / span.count();
}

}  // namespace kiroku::recorder
