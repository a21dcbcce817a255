#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "light/light_code.h"
#include "light/light_judge.h"
#include "light/sound_code.h"
#include "light/sound_finder.h"
#include "tests/support/lit_ledger.h"
#include "tests/support/theatre_sound.h"

namespace kiroku::light {
namespace {

using test::Samples;

constexpr std::uint64_t kCode = 0x0'a53c'96f1'28deULL & kCodeMask;
constexpr int kLead = SoundCoder::kRate;  // samples before a code begins

const SoundCoder& coder() {
  static const SoundCoder made;
  return made;
}

/// A stretch in which one code begins after a second, at a level beside talk.
Samples code_at(double db, std::uint64_t code = kCode) {
  Samples sound(kLead + 6 * SoundCoder::kRate, 0.0F);
  test::add(sound, test::at_level(test::as_samples(coder().sound_of(code)), db), kLead);
  return sound;
}

std::vector<HeardCode> heard_in(const Samples& sound, SoundFinder& finder) {
  const std::vector<std::int16_t> samples = test::as_16_bit(test::thinned(sound));
  return finder.read({0, samples}, 2 * SoundFinder::kRate);
}
std::vector<HeardCode> heard_in(const Samples& sound) {
  SoundFinder finder;
  return heard_in(sound, finder);
}

int differing(std::uint64_t word, std::uint64_t code) {
  const int differ = std::popcount(word ^ code);
  return std::min(differ, kCodeBits - differ);
}
/// Of all that may be a code, in how many bits the likest is another one.
int least_differing(const std::vector<HeardCode>& heard, std::uint64_t code = kCode) {
  int least = kCodeBits;
  for (const HeardCode& one : heard) least = std::min(least, differing(one.sighting.words[0], code));
  return least;
}

// Values of another program: Python's hashlib, and the sum of cosines as the reference says it.
TEST(SoundCode, IsWhatAnybodyCanMakeOfTheCode) {
  const auto turns = carrier_turns(0);
  EXPECT_THAT(std::vector<int>(turns.begin(), turns.begin() + 12),
              testing::ElementsAre(3, 0, 2, 1, 1, 3, 2, 0, 2, 0, 1, 3));
  EXPECT_THAT(std::vector<int>(turns.end() - 4, turns.end()), testing::ElementsAre(2, 1, 0, 2));
  const std::size_t slot = 7 * SoundCoder::kSlotSamples;
  for (const bool is_one : {true, false}) {
    const auto sound = coder().sound_of(is_one ? kCodeMask : 0);
    ASSERT_EQ(sound.size(), 49U * 4'608);
    const int sign = is_one ? 1 : -1;
    EXPECT_NEAR(sound[slot + 1'000], sign * -5'378, 1);
    EXPECT_NEAR(sound[slot + 2'304], sign * -2'365, 1);
    EXPECT_NEAR(sound[slot + 4'000], sign * -2'872, 1);
  }
}

TEST(SoundCode, IsAsLoudAsItIsSaidToBeAndNeverCut) {
  const auto sound = coder().sound_of(kCode);
  double power = 0;
  int most = 0;
  for (const std::int16_t sample : sound) {
    power += static_cast<double>(sample) * sample / (32'768.0 * 32'768.0);
    most = std::max(most, std::abs(static_cast<int>(sample)));
  }
  const double level = std::sqrt(power / static_cast<double>(sound.size()));
  EXPECT_NEAR(20 * std::log10(level), -20, 0.3);
  EXPECT_LT(most, 32'000);
  EXPECT_LT(std::abs(sound.front()), 10) << "it begins without a click";
}

TEST(SoundFinderTest, ReadsWhatALoudspeakerPlaysAndWhen) {
  const auto heard = heard_in(code_at(0));
  ASSERT_FALSE(heard.empty());
  const Sighting& sighting = heard[0].sighting;
  for (const std::uint64_t word : sighting.words) EXPECT_EQ(differing(word, kCode), 0);
  EXPECT_EQ(sighting.opposite, kCodeBits);
  EXPECT_GT(sighting.clarity, 0.6);
  EXPECT_NEAR(static_cast<double>(heard[0].sample), SoundFinder::kRate, SoundFinder::kRate * 0.016);
}

TEST(SoundFinderTest, AWireThatIsTurnedRoundTurnsNothingElse) {
  Samples sound = code_at(0);
  for (float& sample : sound) sample = -sample;
  EXPECT_EQ(least_differing(heard_in(sound)), 0);
}

TEST(SoundFinderTest, ReadsFaintCodesInAnEchoingTheatre) {
  Samples sound = test::in_a_room(code_at(-30), 0.5, 1);
  test::add(sound, test::talk(sound.size(), 2));
  test::add(sound, test::at_level(test::ventilation(sound.size(), 3), -15));
  test::add(sound, test::beeps(sound.size()));
  EXPECT_LE(least_differing(heard_in(sound)), 1) << "30 dB below talk, under beeps as loud as talk";
}

TEST(SoundFinderTest, ReadsWhatACardPlaysWhoseCrystalIsOff) {
  for (const double ppm : {-100.0, 100.0}) {
    Samples sound = test::of_a_crystal(code_at(-30), ppm);
    test::add(sound, test::at_level(test::ventilation(sound.size(), 3), -15));
    EXPECT_LE(least_differing(heard_in(sound)), 1) << ppm;
  }
}

// Half of the carriers under a sound that is a thousand times as strong.
TEST(SoundFinderTest, HalfOfTheCarriersIsEnough) {
  Samples sound = code_at(-20);
  for (std::size_t i = 0; i < sound.size(); ++i) {
    const double time = static_cast<double>(i) / SoundCoder::kRate;
    for (int hz = 5'100; hz < 7'000; hz += 60)
      sound[i] += static_cast<float>(0.02 * std::sin(2 * 3.14159265 * (hz + 9 * std::sin(time * 3)) * time));
  }
  const auto heard = heard_in(sound);
  ASSERT_FALSE(heard.empty());
  EXPECT_LE(differing(heard[0].sighting.words[1], kCode), 1);
  EXPECT_GT(differing(heard[0].sighting.words[2], kCode), 4) << "else nothing was drowned";
}

TEST(SoundFinderTest, HearsTwoLoudspeakersThatPlayDifferentCodes) {
  constexpr std::uint64_t kOther = 0x1'5ac3'690e'd721ULL & kCodeMask;
  Samples sound = code_at(-6);
  test::add(sound, test::at_level(test::as_samples(coder().sound_of(kOther)), -10),
            kLead + SoundCoder::kRate / 2);
  const auto heard = heard_in(sound);
  EXPECT_LE(least_differing(heard, kCode), 1);
  EXPECT_LE(least_differing(heard, kOther), 1);
}

// So faint that a search takes noise for likelier.
TEST(SoundFinderTest, LooksWhereACodeBeganBefore) {
  Samples sound = code_at(-31);
  test::add(sound, test::at_level(test::ventilation(sound.size(), 9), 0));
  EXPECT_GT(least_differing(heard_in(sound)), 12);
  SoundFinder knowing;
  ASSERT_EQ(least_differing(heard_in(code_at(0), knowing)), 0);
  ASSERT_EQ(knowing.phases().size(), 1U);
  EXPECT_NEAR(knowing.phases()[0], SoundFinder::kRate, SoundFinder::kRate * 0.016);
  SoundFinder again(knowing.phases());
  EXPECT_LT(least_differing(heard_in(sound, again)), 10);
}

TEST(SoundFinderTest, HearsNothingInSilenceAndInTooLittle) {
  EXPECT_TRUE(heard_in(Samples(7 * SoundCoder::kRate, 0.0F)).empty());
  SoundFinder finder;
  EXPECT_TRUE(finder.read({0, {}}, SoundFinder::kRate).empty());
  const std::vector<std::int16_t> almost(SoundFinder::kCodeSamples - 1, 100);
  EXPECT_TRUE(finder.read({0, almost}, SoundFinder::kRate).empty());
  EXPECT_TRUE(finder.phases().empty());
}

TEST(SoundFinderTest, NoiseIsNoClearCode) {
  for (const HeardCode& one : heard_in(test::ventilation(7 * SoundCoder::kRate, 4))) {
    EXPECT_LT(one.sighting.opposite, SoundFinder::kClearlyHeard);
    EXPECT_LT(one.sighting.clarity, 0.4);
  }
}

TEST(SoundFinderTest, PhasesOfWhoeverSaysThemAreBounded) {
  const std::vector<int> phases{-1, SoundFinder::kPeriodSamples, 2'000'000'000, 5, 6, 7};
  const SoundFinder finder(phases);
  EXPECT_THAT(finder.phases(),
              testing::ElementsAre(0, SoundFinder::kPeriodSamples - 1, SoundFinder::kPeriodSamples - 1, 5));
}

TimedSighting heard_at(std::int64_t case_ns, std::uint64_t word) {
  TimedSighting heard{case_ns, {}};
  heard.sighting.words.fill(word);
  heard.sighting.opposite = kCodeBits;
  heard.sighting.clarity = 1;
  return heard;
}

constexpr std::int64_t kPeriod = kSoundPeriodSeconds * test::kLitSecond;

TEST(SoundJudge, StretchesAgreeWithTheirLedger) {
  const LedgerLights ledger = test::lights_of(test::lit_lines(40, 1));
  LightJudge judge(ledger, kSoundPeriodSeconds);
  for (int i = 0; i < 6; ++i) {
    const std::uint64_t code = test::shown_in(ledger, test::kLitBegin + 5 * i);
    const std::vector<TimedSighting> heard{heard_at(i * kPeriod + 300'000'000, code)};
    judge.hear(i * kPeriod, (i + 1) * kPeriod, heard);
  }
  const LightReport report = judge.finish();
  EXPECT_EQ(report.answer, LightAnswer::kAgrees);
  EXPECT_EQ(report.seconds, 6U);
  EXPECT_EQ(report.exact, 6U);
  EXPECT_EQ(report.exact_entries, 26U);
  EXPECT_EQ(report.exact_shown_ns, 5 * kPeriod + 300'000'000) << "when the code began, not its stretch";
  ASSERT_EQ(report.delays_ns.size(), 6U);
  EXPECT_EQ(report.delays_ns.back(), 300'000'000);
}

// A display plays no code of another second: one would be one more that noise could fit.
TEST(SoundJudge, CodesOfSecondsThatNoCodeBeginsWithAreNone) {
  const LedgerLights ledger = test::lights_of(test::lit_lines(40, 1));
  LightJudge judge(ledger, kSoundPeriodSeconds);
  const std::vector<TimedSighting> heard{
      heard_at(7 * test::kLitSecond, test::shown_in(ledger, test::kLitBegin + 6))};
  judge.hear(kPeriod, 2 * kPeriod, heard);
  const LightReport report = judge.finish();
  EXPECT_EQ(report.agreeing, 0U);
}

/// Six stretches, in the first of which codes of their time are heard with so many bits turned over.
LightReport judged_with(const LedgerLights& ledger, const std::vector<std::uint64_t>& turned) {
  LightJudge judge(ledger, kSoundPeriodSeconds);
  for (std::size_t i = 0; i < 6; ++i) {
    const auto at = static_cast<std::int64_t>(i);
    std::vector<TimedSighting> heard;
    if (i < turned.size())
      heard.push_back(heard_at(at * kPeriod, test::shown_in(ledger, test::kLitBegin + 5 * at) ^ turned[i]));
    judge.hear(at * kPeriod, (at + 1) * kPeriod, heard);
  }
  return judge.finish();
}

TEST(SoundJudge, OneReadingAloneThatNoiseMayGiveIsNotSeen) {
  const LedgerLights ledger = test::lights_of(test::lit_lines(40, 1));
  const LightReport chance = judged_with(ledger, {0xf});
  EXPECT_EQ(chance.answer, LightAnswer::kNotSeen);
  EXPECT_EQ(chance.agreeing, 1U) << "it is counted all the same";
  EXPECT_TRUE(chance.delays_ns.empty());
  EXPECT_EQ(judged_with(ledger, {0xf, 0xf}).answer, LightAnswer::kInPart);
  EXPECT_EQ(judged_with(ledger, {1}).answer, LightAnswer::kInPart) << "nearly to the bit";
}

TEST(SoundJudge, AnOldCodeIsFoundBesideOtherWords) {
  const LedgerLights ledger = test::lights_of(test::lit_lines(40, 1));
  const std::uint64_t old = test::shown_in(ledger, test::kLitBegin);
  for (const std::uint64_t other : {std::uint64_t{1}, kCodeMask - 1}) {
    LightJudge judge(ledger, kSoundPeriodSeconds);
    const std::vector<TimedSighting> heard{heard_at(4 * kPeriod, other), heard_at(4 * kPeriod, old)};
    judge.hear(4 * kPeriod, 5 * kPeriod, heard);
    const LightReport report = judge.finish();
    EXPECT_EQ(report.old, 1U) << other;
    EXPECT_EQ(report.answer, LightAnswer::kDisagrees);
  }
}

TEST(SoundJudge, SoundWithoutACodeAccusesNobody) {
  const LedgerLights ledger = test::lights_of(test::lit_lines(40, 1));
  LightJudge judge(ledger, kSoundPeriodSeconds);
  for (int i = 0; i < 6; ++i) judge.hear(i * kPeriod, (i + 1) * kPeriod, {});
  const LightReport report = judge.finish();
  EXPECT_EQ(report.answer, LightAnswer::kNotSeen);
  EXPECT_EQ(report.unread, 6U);
}

}  // namespace
}  // namespace kiroku::light
