#include "recorder/clock/sound_clock.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace kiroku::recorder {
namespace {

// The loop follows what changes over a minute and more, as crystals do with their warmth, and smooths what
// changes faster.
constexpr double kBandwidthHz = 0.02;
// After a long pause a single reading does not decide more than this.
constexpr double kLargestStep = 0.3;

}  // namespace

SoundClock::SoundClock(int rate) : nominal_ns_(1e9 / rate), ns_a_sample_(nominal_ns_) {}

void SoundClock::observe(std::int64_t samples, std::int64_t time_ns) {
  const auto time = static_cast<double>(time_ns);
  if (!last_) {
    last_ = Place{samples, time};
    return;
  }
  const auto passed = static_cast<double>(samples - last_->sample);
  if (passed <= 0) return;
  const double expected = last_->time_ns + passed * ns_a_sample_;
  const double error = time - expected;
  if (std::abs(error) > static_cast<double>(kLargestErrorNs)) {
    if (++contradictions_ < kContradictions) return;
    contradictions_ = 0;
    last_ = Place{samples, time};
    return;
  }
  contradictions_ = 0;
  const double step =
      std::min(2 * std::numbers::pi * kBandwidthHz * passed * nominal_ns_ / 1e9, kLargestStep);
  last_ = Place{samples, expected + std::numbers::sqrt2 * step * error};
  ns_a_sample_ = std::clamp(ns_a_sample_ + step * step * error / passed,
                            nominal_ns_ / (1 + kLargestRateError), nominal_ns_ * (1 + kLargestRateError));
}

std::int64_t SoundClock::time_of(std::int64_t sample) const {
  return std::llround(last_->time_ns + static_cast<double>(sample - last_->sample) * ns_a_sample_);
}

}  // namespace kiroku::recorder
