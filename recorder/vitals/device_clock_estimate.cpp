#include "recorder/vitals/device_clock_estimate.h"

#include <algorithm>
#include <vector>

namespace kiroku::recorder {

std::optional<std::int64_t> DeviceClockEstimate::add(std::int64_t arrival_ns, UtcTime device_time) {
  last_arrival_ns_ = arrival_ns;
  const std::int64_t zero_us = device_time.time_since_epoch().count() - arrival_ns / 1000;
  const std::int64_t off_us = zeros_us_.empty() ? 0 : zero_us - greatest();
  if (off_us > kStepUs || off_us < -kStepUs) {
    if (!outliers_.empty() && (outliers_.back().zero_us > greatest()) != (off_us > 0)) {
      outliers_.clear();
    }
    outliers_.push_back({zero_us, arrival_ns});
    if (outliers_.size() > kWindow) {
      outliers_.pop_front();
    }
    if (!shows_step()) {
      return std::nullopt;
    }
    const std::int64_t before_us = greatest();
    zeros_us_.clear();
    for (const Outlier& outlier : outliers_) {
      zeros_us_.push_back(outlier.zero_us);
    }
    outliers_.clear();
    messages_ = zeros_us_.size();
    return greatest() - before_us;
  }
  outliers_.clear();
  zeros_us_.push_back(zero_us);
  ++messages_;
  if (zeros_us_.size() > kWindow) {
    zeros_us_.pop_front();
  }
  return std::nullopt;
}

bool DeviceClockEstimate::shows_step() const {
  const auto [least, most] = std::ranges::minmax_element(outliers_, {}, &Outlier::zero_us);
  return outliers_.size() >= kStepMessages &&
         outliers_.back().arrival_ns - outliers_.front().arrival_ns >= kStepSpanNs &&
         most->zero_us - least->zero_us <= kStepUs;
}

std::int64_t DeviceClockEstimate::greatest() const { return *std::ranges::max_element(zeros_us_); }

media::DeviceClock DeviceClockEstimate::estimate() const {
  std::vector<std::int64_t> sorted(zeros_us_.begin(), zeros_us_.end());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::ranges::nth_element(sorted, middle);
  media::DeviceClock clock;
  clock.time_ns = last_arrival_ns_;
  clock.zero = UtcTime(std::chrono::microseconds(greatest()));
  clock.spread_ns = (greatest() - *middle) * 1000;
  clock.messages = messages_;
  return clock;
}

}  // namespace kiroku::recorder
