#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/ledger_entry.h"
#include "base/error.h"
#include "light/ledger_follower.h"
#include "light/ledger_lights.h"
#include "light/light_code.h"
#include "light/light_judge.h"
#include "light/light_picture.h"
#include "light/picture_finder.h"
#include "tests/support/lit_ledger.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::light {
namespace {

using testing::HasSubstr;

using test::lights_of;
using test::shown_in;

constexpr std::int64_t kBegin = test::kLitBegin;
constexpr std::int64_t kSecond = test::kLitSecond;

std::vector<std::string> lines_of(int seconds, std::int64_t salt) { return test::lit_lines(seconds, salt); }

/// A picture of a grey room in which a display hangs.
class Room {
 public:
  Room() : samples_(kWidth * kHeight) {}
  void show(std::optional<std::uint64_t> code, int cell = 3, bool cover_right = false) {
    for (std::size_t i = 0; i < samples_.size(); ++i)
      samples_[i] = static_cast<std::uint8_t>(110 + (i % kWidth) / 16 + (i * 7919 % 13));
    if (!code) return;
    const GreyPicture picture = light_picture(code, cell);
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x) {
        const bool lit = picture.samples[static_cast<std::size_t>(y * picture.width + x)] > 0;
        const bool covered = cover_right && x > picture.width / 2;
        samples_[static_cast<std::size_t>((kTop + y) * kWidth + kLeft + x)] =
            static_cast<std::uint8_t>(covered ? 100 + (x * 31 + y * 17) % 40
                                      : lit   ? 200
                                              : 40);
      }
    }
  }
  /// A frame with cells like a code's, which is none: its lower half is the mirror of its upper one.
  void show_no_code(std::uint64_t cells) {
    show(cells);
    const GreyPicture picture = light_picture(cells, 3);
    for (int y = 0; y < picture.height / 2; ++y) {
      const auto row = samples_.begin() + (kTop + y) * kWidth + kLeft;
      std::copy(row, row + picture.width,
                samples_.begin() + (kTop + picture.height - 1 - y) * kWidth + kLeft);
    }
  }
  /// The edge of a door, with noise.
  void show_edge(int at, unsigned seed) {
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      seed = seed * 1664525U + 1013904223U;
      samples_[i] =
          static_cast<std::uint8_t>((static_cast<int>(i % kWidth) < at ? 60U : 140U) + (seed >> 28U));
    }
  }
  /// As a lens out of focus does, with a standard deviation in pixels.
  void blur(double deviation) {
    const int radius = static_cast<int>(std::ceil(3 * deviation));
    for (const int step : {1, kWidth}) {
      const std::vector<std::uint8_t> before = samples_;
      const auto last = static_cast<int>(samples_.size()) - 1;
      for (int at = 0; at <= last; ++at) {
        double sum = 0, weights = 0;
        for (int i = -radius; i <= radius; ++i) {
          const double weight = std::exp(-i * i / (2 * deviation * deviation));
          sum += weight * before[static_cast<std::size_t>(std::clamp(at + i * step, 0, last))];
          weights += weight;
        }
        samples_[static_cast<std::size_t>(at)] = static_cast<std::uint8_t>(std::lround(sum / weights));
      }
    }
  }
  [[nodiscard]] GreyView view() const { return {samples_.data(), kWidth, kHeight, kWidth}; }

 private:
  static constexpr int kWidth = 320, kHeight = 180, kLeft = 150, kTop = 60;
  std::vector<std::uint8_t> samples_;
};

/// Ten pictures a second of what `code` says that the display shows in a second of the case.
LightReport judged(const LedgerLights& ledger, int seconds,
                   const std::function<std::optional<std::uint64_t>(std::int64_t second)>& code) {
  LightJudge judge(ledger);
  PictureFinder finder;
  Room room;
  for (int i = 0; i < seconds * 10; ++i) {
    room.show(code(i / 10));
    finder.search(room.view());
    judge.add(i * kSecond / 10 + kSecond / 20, finder.read(room.view()));
  }
  return judge.finish();
}

// The value of another program: sha256sum, of which the first 49 bits.
TEST(LightCode, IsWhatAnybodyCanMakeOfTheLedger) {
  EXPECT_EQ(light_code(3, crypto::Sha256Digest{}, kBegin), 0xe52652e9a6f0ULL);
}

TEST(LightCode, ShowsTheOppositeAtTheOtherSideOfTheCentre) {
  const std::uint64_t code = light_code(1, crypto::Sha256Digest{}, kBegin);
  int bright = 0;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      EXPECT_NE(is_bright(code, row, column), is_bright(code, kRows - 1 - row, kColumns - 1 - column));
      bright += is_bright(code, row, column) ? 1 : 0;
    }
  }
  EXPECT_EQ(bright, kCodeBits) << "a display that is always equally bright";
}

TEST(PictureFinderTest, ReadsWhatADisplayShows) {
  Room room;
  for (const int cell : {2, 3, 7}) {
    const std::uint64_t code = light_code(static_cast<std::uint64_t>(cell), crypto::Sha256Digest{}, kBegin);
    room.show(code, cell);
    PictureFinder finder;
    finder.search(room.view());
    ASSERT_EQ(finder.places().size(), 1U) << cell;
    const auto sightings = finder.read(room.view());
    ASSERT_EQ(sightings.size(), 1U);
    EXPECT_EQ(sightings[0].words[0], code);
    EXPECT_EQ(sightings[0].opposite, kCodeBits);
    EXPECT_GT(sightings[0].clarity, 0.4);
  }
}

TEST(PictureFinderTest, ReadsACodeWhoseHalfIsCoveredWhereItWasSeenBefore) {
  Room room;
  room.show(light_code(1, crypto::Sha256Digest{}, kBegin));
  PictureFinder finder;
  finder.search(room.view());
  const std::uint64_t code = light_code(2, crypto::Sha256Digest{}, kBegin + 1);
  room.show(code, 3, true);
  const auto sightings = finder.read(room.view());
  ASSERT_EQ(sightings.size(), 1U);
  int least = kCodeBits;
  for (const std::uint64_t word : sightings[0].words) least = std::min(least, std::popcount(word ^ code));
  EXPECT_LE(least, 4);
}

// Cells that are alike by chance look as if they were blurred more than the others.
TEST(PictureFinderTest, ReadsEachCodeThroughALensThatIsOutOfFocus) {
  constexpr int kCell = 3, kCodes = 100, kMostThatCanBeCorrected = 6;
  constexpr double kDeviation = 0.65 * kCell;
  Room room;
  room.show(light_code(1, crypto::Sha256Digest{}, kBegin), kCell);
  PictureFinder finder;
  finder.search(room.view());
  for (int i = 0; i < kCodes; ++i) {
    const std::uint64_t code = light_code(2, crypto::Sha256Digest{}, kBegin + i);
    room.show(code, kCell);
    room.blur(kDeviation);
    const auto sightings = finder.read(room.view());
    ASSERT_EQ(sightings.size(), 1U);
    EXPECT_LE(std::popcount(sightings[0].words[0] ^ code), kMostThatCanBeCorrected) << i;
  }
}

// Where a display hung once, each cell is unlike its opposite, too.
TEST(PictureFinderTest, AnEdgeAccusesNobody) {
  const LedgerLights ledger = lights_of(lines_of(20, 1));
  LightJudge judge(ledger);
  const std::vector<Place> places{{{{150, 60}, {195, 60}, {195, 85}, {150, 85}}}};
  PictureFinder finder(places);
  Room room;
  for (int second = 0; second < 20; ++second) {
    room.show_edge(172, static_cast<unsigned>(second));
    for (int i = 0; i < 5; ++i) judge.add(second * kSecond + i * kSecond / 5, finder.read(room.view()));
  }
  const LightReport report = judge.finish();
  EXPECT_EQ(report.foreign + report.old + report.agreeing, 0U);
  EXPECT_EQ(report.unread, 20U);
}

TEST(PictureFinderTest, FindsNothingInAnEmptyRoomAndInPicturesOfNoSize) {
  Room room;
  room.show(std::nullopt);
  PictureFinder finder;
  finder.search(room.view());
  EXPECT_TRUE(finder.places().empty());
  finder.search({nullptr, 0, 0, 0});
  const std::uint8_t one = 0;
  finder.search({&one, 1, 1, 1});
  EXPECT_TRUE(finder.places().empty());
}

// What was refused is not looked at again as long as it stays the same: a display that begins to show codes
// there is another sight.
TEST(PictureFinderTest, FindsACodeWhereSomethingElseWasRefused) {
  Room room;
  PictureFinder finder;
  const std::uint64_t code = light_code(1, crypto::Sha256Digest{}, kBegin);
  for (int i = 0; i < 3; ++i) {
    room.show_no_code(code);
    finder.search(room.view());
    EXPECT_TRUE(finder.places().empty());
  }
  room.show(code);
  finder.search(room.view());
  ASSERT_EQ(finder.places().size(), 1U);
  EXPECT_EQ(finder.read(room.view())[0].words[0], code);
}

TEST(PictureFinderTest, LooksAtNoPlaceThatIsNotInThePicture) {
  Room room;
  room.show(light_code(1, crypto::Sha256Digest{}, kBegin));
  const std::vector<Place> places{{{{-5, -5}, {20, -5}, {20, 10}, {-5, 10}}},
                                  {{{1e5, 1e5}, {2e5, 1e5}, {2e5, 2e5}, {1e5, 2e5}}},
                                  {{{7, 7}, {7, 7}, {7, 7}, {7, 7}}}};
  EXPECT_TRUE(PictureFinder(places).read(room.view()).empty());
}

TEST(LightJudgeTest, APicturedSecondAgreesWithItsLedger) {
  const LedgerLights ledger = lights_of(lines_of(20, 1));
  const LightReport report =
      judged(ledger, 10, [&](std::int64_t second) { return shown_in(ledger, kBegin + second); });
  EXPECT_EQ(report.answer, LightAnswer::kAgrees);
  EXPECT_EQ(report.seconds, 10U);
  EXPECT_EQ(report.agreeing, 10U);
  ASSERT_EQ(report.delays_ns.size(), 10U);
  EXPECT_EQ(report.delays_ns.front(), kSecond / 20);
  EXPECT_EQ(report.delays_ns.back(), kSecond / 20);
  EXPECT_EQ(report.exact, 10U);
  EXPECT_EQ(report.exact_entries, 10U);
  EXPECT_EQ(report.exact_shown_ns / kSecond, 9);
}

// A line of 200 bytes would take hundreds of codes, and each second of film is compared with all of them.
TEST(LedgerLightsTest, OfALedgerWhoseEntriesStandMinutesApartForDaysAreRefused) {
  EXPECT_NO_THROW(lights_of(test::lit_lines(1'000, 1, 600))) << "a week of silence";
  EXPECT_NO_THROW(lights_of(test::lit_lines(40'000, 1, 20)));
  EXPECT_THROW(lights_of(test::lit_lines(2'000, 1, 600)), Error);
}

/// Of a display whose cells say `word`, in whichever half.
Sighting sighting_of(std::uint64_t word) {
  Sighting sighting;
  sighting.words.fill(word);
  sighting.opposite = kCodeBits;
  sighting.clarity = 1;
  return sighting;
}

LightReport judged_words(const LedgerLights& ledger, int seconds,
                         const std::function<std::uint64_t(std::int64_t second)>& word) {
  LightJudge judge(ledger);
  for (int i = 0; i < seconds * 10; ++i)
    judge.add(i * kSecond / 10 + kSecond / 20, std::vector{sighting_of(word(i / 10))});
  return judge.finish();
}

// Whoever writes a ledger finds lines whose codes are so near to what a film from before shows.
TEST(LightJudgeTest, ACodeThatWasCorrectedAgreesAndSaysNothingOfWhen) {
  const LedgerLights ledger = lights_of(lines_of(20, 1));
  const LightReport corrected = judged_words(
      ledger, 10, [&](std::int64_t second) { return shown_in(ledger, kBegin + second) ^ 0b10100U; });
  EXPECT_EQ(corrected.agreeing, 10U);
  EXPECT_EQ(corrected.exact, 0U);
  EXPECT_EQ(corrected.exact_entries, 0U);
  const LightReport later = judged_words(ledger, 10, [&](std::int64_t second) {
    return shown_in(ledger, kBegin + second) ^ (second < 7 ? 1U : 0b10100U);
  });
  EXPECT_EQ(later.exact, 7U);
  EXPECT_EQ(later.exact_entries, 7U) << "the last code that was read well, not the last that agrees";
  EXPECT_EQ(later.exact_shown_ns / kSecond, 6);
}

// With millions of lines in a second, noise is near to the code of one of them.
TEST(LightJudgeTest, ALedgerInWhichAnyPictureFitsIsNotCompared) {
  std::vector<std::string> lines;
  for (int i = 0; i < 4'000; ++i) {
    archive::CaseEntry entry;
    entry.seq = static_cast<std::uint64_t>(i);
    entry.at = {UtcTime(std::chrono::milliseconds(kBegin * 1'000 + i * 2)), i * kSecond / 500};
    entry.body = archive::ClockEntry{true, i, 0, 0, 0};
    lines.push_back(archive::to_line(entry));
  }
  const LedgerLights ledger = lights_of(lines);
  const LightReport report = judged_words(ledger, 8, [&](std::int64_t second) {
    return ledger.codes_of(kBegin + second, kBegin + second).front().code;
  });
  EXPECT_EQ(report.agreeing, 0U);
  EXPECT_EQ(report.old + report.foreign, 0U) << "and accuses nobody";
  EXPECT_EQ(report.crowded, 8U);
  EXPECT_EQ(report.answer, LightAnswer::kNotSeen);
}

TEST(LightJudgeTest, OfAFilmWithoutADisplayNothingCouldBeChecked) {
  const LedgerLights ledger = lights_of(lines_of(20, 1));
  const LightReport report = judged(ledger, 10, [](std::int64_t) { return std::nullopt; });
  EXPECT_EQ(report.answer, LightAnswer::kNotSeen);
  EXPECT_EQ(report.unread, 10U);
}

TEST(LightJudgeTest, AFilmOfAnotherDayDisagrees) {
  const LedgerLights ledger = lights_of(lines_of(20, 1)), other = lights_of(lines_of(20, 2));
  const LightReport report =
      judged(ledger, 10, [&](std::int64_t second) { return shown_in(other, kBegin + second); });
  EXPECT_EQ(report.answer, LightAnswer::kDisagrees);
  EXPECT_EQ(report.foreign, 10U);
  ASSERT_EQ(report.stretches.size(), 1U);
  EXPECT_EQ(report.stretches[0].light, SecondLight::kForeign);
}

TEST(LightJudgeTest, APartOfAnotherDayIsTold) {
  const LedgerLights ledger = lights_of(lines_of(40, 1)), other = lights_of(lines_of(40, 2));
  const LightReport report = judged(ledger, 30, [&](std::int64_t second) {
    return shown_in(second >= 10 && second < 13 ? other : ledger, kBegin + second);
  });
  EXPECT_EQ(report.answer, LightAnswer::kDisagrees);
  EXPECT_EQ(report.agreeing, 27U);
  ASSERT_EQ(report.stretches.size(), 1U);
  EXPECT_EQ(report.stretches[0].start_ns / kSecond, 10);
  EXPECT_EQ(report.stretches[0].seconds, 3U);
}

TEST(LightJudgeTest, ALoopedCameraIsToldWithTheSecondThatItRepeats) {
  const LedgerLights ledger = lights_of(lines_of(60, 1));
  const LightReport report = judged(ledger, 40, [&](std::int64_t second) {
    return shown_in(ledger, kBegin + (second < 20 ? second : second - 15));
  });
  EXPECT_EQ(report.answer, LightAnswer::kDisagrees);
  EXPECT_EQ(report.agreeing, 20U);
  EXPECT_EQ(report.old, 20U);
  ASSERT_EQ(report.stretches.size(), 1U);
  EXPECT_EQ(report.stretches[0].light, SecondLight::kOld);
  EXPECT_EQ(report.stretches[0].shown_second, kBegin + 5);
}

TEST(LightJudgeTest, APreparedFilmInTheMiddleIsToldAsUnread) {
  const LedgerLights ledger = lights_of(lines_of(60, 1));
  const LightReport report = judged(ledger, 30, [&](std::int64_t second) -> std::optional<std::uint64_t> {
    if (second >= 10 && second < 20) return std::nullopt;
    return shown_in(ledger, kBegin + second);
  });
  EXPECT_EQ(report.answer, LightAnswer::kInPart);
  EXPECT_EQ(report.unread, 10U);
}

TEST(LedgerLightsTest, CodesOfAHostileLedgerAreBounded) {
  LedgerLights lights;
  // Entries that claim to be millennia apart.
  for (int i = 0; i < 10; ++i) {
    archive::CaseEntry entry;
    entry.seq = static_cast<std::uint64_t>(i);
    entry.at = {UtcTime(std::chrono::seconds(i % 2 == 0 ? 0 : 250'000'000'000)), i};
    entry.body = archive::ClockEntry{true, 0, 0, 0, 0};
    lights.add_line(archive::to_line(entry));
  }
  lights.finish();
  EXPECT_LT(lights.codes().size(), 10U * 610);
  // Nanoseconds of the year 9892 do not fit into 64 bits.
  EXPECT_LT(lights.utc_ns_at(1), std::int64_t{8'500'000'000} * kSecond);
  EXPECT_GT(lights.utc_ns_at(1), std::int64_t{7'500'000'000} * kSecond);
  EXPECT_THROW(lights.add_line("{}"), Error);
}

TEST(LedgerFollowerTest, ShowsWhatAVerifierMakesOfTheLedgerLater) {
  const test::TemporaryFolder folder;
  const std::vector<std::string> lines = lines_of(5, 1);
  std::ofstream file(folder / "ledger.jsonl", std::ios::binary);
  file << lines[0] << "\n" << lines[1].substr(0, 20) << std::flush;
  LedgerFollower follower(folder.path());
  EXPECT_EQ(follower.entries(), 1U) << "a line that is being written is none yet";
  file << lines[1].substr(20) << "\n" << lines[2] << "\n" << std::flush;
  follower.read_on();
  ASSERT_EQ(follower.entries(), 3U);
  const auto shown = follower.light_at(kBegin + 2);
  ASSERT_TRUE(shown);
  EXPECT_EQ(shown->code, shown_in(lights_of(lines), kBegin + 2));
  EXPECT_FALSE(follower.light_at(kBegin + 2 + LedgerLights::kLongestSilence + 1)) << "nobody writes it";
}

TEST(LedgerFollowerTest, ALedgerThatBecameShorterIsOver) {
  const test::TemporaryFolder folder;
  const std::vector<std::string> lines = lines_of(2, 1);
  std::ofstream(folder / "ledger.jsonl", std::ios::binary) << lines[0] << "\n" << lines[1] << "\n";
  LedgerFollower follower(folder.path());
  std::ofstream(folder / "ledger.jsonl", std::ios::binary) << lines[0] << "\n";
  follower.read_on();
  EXPECT_TRUE(follower.is_over());
  EXPECT_FALSE(follower.light_at(kBegin));
}

}  // namespace
}  // namespace kiroku::light
