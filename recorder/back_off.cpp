#include "recorder/back_off.h"

namespace kiroku::recorder {

void BackOff::asked(Time now) { limit_ = std::max(limit_, now + policy_.min_interval); }

void BackOff::succeeded() {
  failures_ = 0;
  retry_ = {};
}

void BackOff::failed(Time now, std::optional<std::chrono::nanoseconds> leave_alone_for) {
  ++failures_;
  std::chrono::nanoseconds pause = policy_.first;
  for (unsigned i = 1; i < failures_ && pause < policy_.longest; ++i) pause *= 2;
  std::uniform_real_distribution<double> factor(0.75, 1.25);
  const auto varied =
      std::chrono::duration<double, std::nano>(std::min(pause, policy_.longest)) * factor(chance_);
  retry_ = now + std::chrono::duration_cast<std::chrono::nanoseconds>(varied);
  if (leave_alone_for) limit_ = std::max(limit_, now + *leave_alone_for);
}

void BackOff::adopt(unsigned failures, Time limit, Time next) {
  failures_ = failures;
  limit_ = limit;
  retry_ = next;
}

}  // namespace kiroku::recorder
