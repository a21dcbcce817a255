// What is stated of missing sound, on plain times.
#include "recorder/sound_gaps.h"

#include <vector>

#include <gtest/gtest.h>

#include "tests/support/nanoseconds.h"

namespace kiroku::recorder {
namespace {

using archive::GapCause;

constexpr std::int64_t kPiece = kSecond / 50;

/// Sound from `from_ns` on until `to_ns`, without a hole.
void hear(SoundGaps& sound, std::int64_t from_ns, std::int64_t to_ns) {
  for (std::int64_t at_ns = from_ns; at_ns < to_ns; at_ns += kPiece)
    EXPECT_FALSE(sound.heard(at_ns, at_ns + kPiece)) << at_ns;
}
void expect(const std::optional<Gap>& gap, std::int64_t start_ns, std::int64_t end_ns, GapCause cause) {
  ASSERT_TRUE(gap.has_value());
  EXPECT_EQ(gap->span.start_ns, start_ns);
  EXPECT_EQ(gap->span.end_ns, end_ns);
  EXPECT_EQ(gap->cause, cause);
}

TEST(SoundGaps, OfWholeSoundAreNone) {
  SoundGaps sound;
  hear(sound, kSecond / 5, 100 * kSecond);  // a device takes its time to start
  EXPECT_FALSE(sound.piece_before(100 * kSecond));
  EXPECT_FALSE(sound.gap_at_close(100 * kSecond + kSecond / 2));
}

TEST(SoundGaps, StateAHoleWithItsCauseOnce) {
  SoundGaps sound;
  hear(sound, 0, 10 * kSecond);
  sound.lost(GapCause::kDeviceRemoved);
  expect(sound.heard(15 * kSecond, 15 * kSecond + kPiece), 10 * kSecond, 15 * kSecond,
         GapCause::kDeviceRemoved);
  hear(sound, 15 * kSecond + kPiece, 20 * kSecond);
  expect(sound.heard(21 * kSecond, 22 * kSecond), 20 * kSecond, 21 * kSecond, GapCause::kSignalLost);
}

TEST(SoundGaps, LeaveJitterToSilence) {
  SoundGaps sound;
  hear(sound, 0, kSecond);
  EXPECT_FALSE(sound.heard(kSecond + SoundGaps::kSmallestNs, 2 * kSecond));
  EXPECT_FALSE(sound.heard(2 * kSecond - kPiece, 2 * kSecond)) << "what overlaps is no hole";
  EXPECT_FALSE(sound.heard(2 * kSecond, 3 * kSecond));
}

TEST(SoundGaps, OfHoursAreStatedPieceByPiece) {
  SoundGaps sound;
  hear(sound, 0, 10 * kSecond);
  sound.lost(GapCause::kDeviceRemoved);
  int pieces = 0;
  for (std::int64_t at_ns = 10 * kSecond; at_ns <= 200 * kSecond; at_ns += kPiece) {
    if (const auto piece = sound.piece_before(at_ns)) {
      expect(piece, 10 * kSecond + pieces * SoundGaps::kPieceNs,
             10 * kSecond + (pieces + 1) * SoundGaps::kPieceNs, GapCause::kDeviceRemoved);
      ++pieces;
    }
  }
  EXPECT_EQ(pieces, 3);
  expect(sound.heard(200 * kSecond, 201 * kSecond), 190 * kSecond, 200 * kSecond, GapCause::kDeviceRemoved);
}

// A sound card that crackles would else write ten lines of the ledger a second.
TEST(SoundGaps, ThatComeFastGrowLongerAndSoFewer) {
  SoundGaps sound;
  std::vector<Gap> gaps;
  std::int64_t heard_until_ns = 0, heard_ns = 0;
  constexpr std::int64_t kEach = SoundGaps::kSmallestNs + kPiece + 1;
  for (std::int64_t at_ns = 0; at_ns < 80 * kSecond; at_ns += kEach) {
    if (sound.leaves_out(at_ns)) continue;
    if (const auto gap = sound.heard(at_ns, at_ns + kPiece)) {
      EXPECT_EQ(gap->span.start_ns, heard_until_ns) << "all that is left out is stated";
      EXPECT_EQ(gap->span.end_ns, at_ns);
      gaps.push_back(*gap);
    }
    heard_until_ns = at_ns + kPiece;
    heard_ns += kPiece;
  }
  EXPECT_GT(heard_ns, 5 * kSecond);
  EXPECT_GT(gaps.size(), GapPace::kMostGaps);
  EXPECT_LE(gaps.size(), 10 * GapPace::kMostGaps);
}

TEST(SoundGaps, LastUntilTheCaseIsClosed) {
  SoundGaps sound;
  sound.lost(GapCause::kDeviceRemoved);
  expect(sound.gap_at_close(30 * kSecond), 0, 30 * kSecond, GapCause::kDeviceRemoved);
  hear(sound, kSecond / 2, 20 * kSecond);
  expect(sound.gap_at_close(30 * kSecond), 20 * kSecond, 30 * kSecond, GapCause::kSignalLost);
}

}  // namespace
}  // namespace kiroku::recorder
