// Somebody plays sound into a room, or puts other sound into a case: from the loudspeaker's sound through an
// echoing theatre to what is said of it.
#include <functional>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "light/light_judge.h"
#include "light/sound_code.h"
#include "light/sound_finder.h"
#include "tests/support/lit_ledger.h"
#include "tests/support/theatre_sound.h"

namespace kiroku::light {
namespace {

using test::Samples;

constexpr int kRate = SoundCoder::kRate;
constexpr std::int64_t kPeriodNs = kSoundPeriodSeconds * test::kLitSecond;
constexpr double kFaint = -25;  // dB beside talk

/// What is heard of a loudspeaker in the theatre: in period i of the case what `code` says, or nothing.
Samples theatre(int periods, const std::function<std::optional<std::uint64_t>(int period)>& code) {
  static const SoundCoder coder;
  constexpr std::size_t kLate = kRate / 5;
  Samples sound(static_cast<std::size_t>((periods + 1) * SoundCoder::kPeriodSamples), 0.0F);
  for (int period = 0; period < periods; ++period) {
    if (const auto word = code(period))
      test::add(sound, test::at_level(test::as_samples(coder.sound_of(*word)), kFaint),
                static_cast<std::size_t>(period * SoundCoder::kPeriodSamples) + kLate);
  }
  return test::in_a_room(sound, 0.5, 1);
}

Samples with_talk(Samples sound) {
  test::add(sound, test::talk(sound.size(), 2));
  test::add(sound, test::at_level(test::ventilation(sound.size(), 3), -15));
  return sound;
}

LightReport judged(const LedgerLights& ledger, const Samples& sound, int periods) {
  const std::vector<std::int16_t> samples = test::as_16_bit(test::thinned(sound));
  LightJudge judge(ledger, kSoundPeriodSeconds);
  SoundFinder finder;
  for (int period = 0; period < periods; ++period) {
    const std::int64_t first = std::int64_t{period} * SoundFinder::kPeriodSamples;
    const auto stretch = std::span(samples).subspan(
        static_cast<std::size_t>(first), 2 * static_cast<std::size_t>(SoundFinder::kPeriodSamples));
    std::vector<TimedSighting> heard;
    for (const HeardCode& code : finder.read({first, stretch}, SoundFinder::kPeriodSamples))
      heard.push_back({code.sample * test::kLitSecond / SoundFinder::kRate, code.sighting});
    judge.hear(period * kPeriodNs, (period + 1) * kPeriodNs, heard);
  }
  return judge.finish();
}

class SoundAttack : public testing::Test {
 protected:
  static constexpr int kPeriods = 6;
  const LedgerLights ledger_ = test::lights_of(test::lit_lines(60, 1));
  const LedgerLights other_ = test::lights_of(test::lit_lines(60, 2));
  [[nodiscard]] static std::uint64_t code_of(const LedgerLights& ledger, int period) {
    return test::shown_in(ledger, test::kLitBegin + period * kSoundPeriodSeconds);
  }
};

TEST_F(SoundAttack, TheSoundOfTheRoomHolds) {
  const Samples live = theatre(kPeriods, [&](int period) { return code_of(ledger_, period); });
  const LightReport report = judged(ledger_, with_talk(live), kPeriods);
  EXPECT_EQ(report.answer, LightAnswer::kAgrees);
  EXPECT_EQ(report.agreeing, 6U);
  EXPECT_EQ(report.exact, 6U);
  EXPECT_EQ(report.beside_foreign, 0U);
}

TEST_F(SoundAttack, SoundOfAnotherDayDisagrees) {
  const Samples prepared = theatre(kPeriods, [&](int period) { return code_of(other_, period); });
  const LightReport report = judged(ledger_, with_talk(prepared), kPeriods);
  EXPECT_EQ(report.answer, LightAnswer::kDisagrees);
  EXPECT_EQ(report.agreeing, 0U);
  EXPECT_EQ(report.foreign, 6U);
}

TEST_F(SoundAttack, ASplicedPartIsToldWithItsPlace) {
  const Samples spliced = theatre(
      kPeriods, [&](int period) { return code_of(period == 2 || period == 3 ? other_ : ledger_, period); });
  const LightReport report = judged(ledger_, with_talk(spliced), kPeriods);
  EXPECT_EQ(report.answer, LightAnswer::kDisagrees);
  EXPECT_EQ(report.agreeing, 4U);
  ASSERT_EQ(report.stretches.size(), 1U);
  EXPECT_EQ(report.stretches[0].light, SecondLight::kForeign);
  EXPECT_EQ(report.stretches[0].start_ns, 2 * kPeriodNs);
  EXPECT_EQ(report.stretches[0].end_ns, 4 * kPeriodNs);
}

TEST_F(SoundAttack, LoopedSoundIsToldWithTheTimeThatItRepeats) {
  const Samples looped =
      theatre(kPeriods, [&](int period) { return code_of(ledger_, period < 3 ? period : period - 3); });
  const LightReport report = judged(ledger_, with_talk(looped), kPeriods);
  EXPECT_EQ(report.answer, LightAnswer::kDisagrees);
  EXPECT_EQ(report.agreeing, 3U);
  EXPECT_EQ(report.old, 3U);
  ASSERT_EQ(report.stretches.size(), 1U);
  EXPECT_EQ(report.stretches[0].light, SecondLight::kOld);
  EXPECT_EQ(report.stretches[0].shown_second, test::kLitBegin);
}

TEST_F(SoundAttack, PreparedSoundWithoutCodesIsNeverAConfirmation) {
  const Samples prepared = theatre(kPeriods, [](int) { return std::nullopt; });
  const LightReport report = judged(ledger_, with_talk(prepared), kPeriods);
  EXPECT_EQ(report.answer, LightAnswer::kNotSeen);
  EXPECT_EQ(report.unread, 6U);
}

// Sounds add up: what is played into the room is heard beside the loudspeaker that follows the ledger.
TEST_F(SoundAttack, ARecordingThatIsPlayedIntoTheRoomIsToldBesideTheLiveCodes) {
  Samples room = theatre(kPeriods, [&](int period) { return code_of(ledger_, period); });
  const Samples played = theatre(kPeriods, [&](int period) { return code_of(other_, period); });
  test::add(room, played, kRate);
  const LightReport report = judged(ledger_, with_talk(room), kPeriods);
  EXPECT_EQ(report.agreeing, 6U);
  EXPECT_GE(report.beside_foreign, 4U);
}

}  // namespace
}  // namespace kiroku::light
