#include "recorder/clock/sound_clock.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/nanoseconds.h"

namespace kiroku::recorder {
namespace {

constexpr int kSoundRate = 48'000;
constexpr std::int64_t kHour = 3'600 * kSecond;

/// A card whose crystal is wrong by so much, read at uneven times; its driver counts by what it transfers.
class Card {
 public:
  explicit Card(double wrong_by_ppm, std::int64_t at_once = 1)
      : rate_(kSoundRate * (1 + wrong_by_ppm / 1e6)), at_once_(at_once) {}

  /// Read about fifty times a second until `until_ns`; the largest error after `settled_ns`.
  double follow(SoundClock& clock, std::int64_t until_ns, std::int64_t settled_ns) {
    double worst_ns = 0;
    while (now_ns_ < until_ns) {
      now_ns_ += uneven_(random_);
      const std::int64_t taken = count_at(now_ns_) / at_once_ * at_once_;
      clock.observe(taken + lost_, now_ns_);
      if (now_ns_ < settled_ns) continue;
      const double truth_ns = static_cast<double>(taken) / rate_ * 1e9;
      worst_ns = std::max(worst_ns, std::abs(static_cast<double>(clock.time_of(taken + lost_)) - truth_ns));
    }
    return worst_ns;
  }
  /// Takes none for a while, and does not say so.
  void lose(std::int64_t time_ns) {
    lost_ -= count_at(now_ns_ + time_ns) - count_at(now_ns_);
    now_ns_ += time_ns;
  }
  [[nodiscard]] std::int64_t count_at(std::int64_t time_ns) const {
    return static_cast<std::int64_t>(static_cast<double>(time_ns) / 1e9 * rate_);
  }

 private:
  const double rate_;
  const std::int64_t at_once_;
  std::int64_t now_ns_ = 0, lost_ = 0;
  std::mt19937 random_{7};
  std::uniform_int_distribution<std::int64_t> uneven_{2 * kMs, 38 * kMs};
};

TEST(SoundClock, KeepsToTheMachinesClockOverTenHoursThoughTheCardIsWrongBy100Ppm) {
  for (const double ppm : {-100.0, 0.0, 100.0}) {
    SoundClock clock(kSoundRate);
    Card card(ppm);
    EXPECT_LT(card.follow(clock, 10 * kHour, 0), kMs) << ppm;  // uncorrected: 3.6 s
    EXPECT_NEAR(clock.rate() / kSoundRate, 1 + ppm / 1e6, 5e-6);
  }
}

TEST(SoundClock, SmoothsWhatADriverTransfersAtOnce) {
  SoundClock clock(kSoundRate);
  constexpr std::int64_t kAtOnce = kSoundRate / 100;  // 10 ms
  Card card(100, kAtOnce);
  // A count that is up to 10 ms behind cannot be known better than by its mean.
  EXPECT_LT(card.follow(clock, kHour, 60 * kSecond), 8 * kMs);
  EXPECT_NEAR(clock.rate() / kSoundRate, 1 + 100e-6, 60e-6);
}

TEST(SoundClock, BelievesNoSingleReadingThatContradictsAllBefore) {
  SoundClock clock(kSoundRate);
  Card card(50);
  card.follow(clock, 60 * kSecond, 0);
  const std::int64_t before_ns = clock.time_of(card.count_at(61 * kSecond));
  clock.observe(card.count_at(60 * kSecond + 20 * kMs), 70 * kSecond);
  EXPECT_EQ(clock.time_of(card.count_at(61 * kSecond)), before_ns);
  EXPECT_LT(card.follow(clock, 120 * kSecond, 61 * kSecond), kMs);
}

TEST(SoundClock, BeginsAnewWhereSamplesWereLostWithoutAWord) {
  SoundClock clock(kSoundRate);
  Card card(50);
  card.follow(clock, 60 * kSecond, 0);
  card.lose(kSecond / 2);
  // A fifth of a second later it is believed.
  EXPECT_LT(card.follow(clock, 120 * kSecond, 60 * kSecond + 750 * kMs), kMs);
}

TEST(SoundClock, FollowsNoCardFurtherThanACrystalCanBeWrong) {
  SoundClock clock(kSoundRate);
  Card card(30'000);
  card.follow(clock, 60 * kSecond, 0);
  EXPECT_LE(clock.rate(), kSoundRate * (1 + SoundClock::kLargestRateError) + 1e-6);
}

}  // namespace
}  // namespace kiroku::recorder
