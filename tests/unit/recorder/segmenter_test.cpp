// The rules by which a stream is cut and its gaps are stated, on plain times.
#include "recorder/segmenter.h"

#include <gtest/gtest.h>

#include "tests/support/nanoseconds.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using archive::GapCause;

constexpr std::int64_t kInterval = kSecond / 25;

class SegmenterTest : public testing::Test {
 protected:
  /// Frames from `from_ns` on, one each interval, before `to_ns`.
  static void record(Segmenter& stream, std::int64_t from_ns, std::int64_t to_ns) {
    for (std::int64_t time_ns = from_ns; time_ns < to_ns; time_ns += kInterval)
      stream.frame_recorded(time_ns, kInterval);
  }
  static void expect(const std::optional<Gap>& gap, std::int64_t start_ns, std::int64_t end_ns,
                     GapCause cause) {
    ASSERT_TRUE(gap.has_value());
    EXPECT_EQ(gap->span.start_ns, start_ns);
    EXPECT_EQ(gap->span.end_ns, end_ns);
    EXPECT_EQ(gap->cause, cause);
  }

  SegmentRules rules{.duration = 6s, .end_ns = {}};
};

TEST_F(SegmenterTest, CutsAtTheFirstFrameAtOrAfterAMultipleOfTheDuration) {
  Segmenter stream(rules);
  stream.segment_began(2 * kSecond);
  EXPECT_FALSE(stream.cuts_at(6 * kSecond - 1, 0));
  EXPECT_TRUE(stream.cuts_at(6 * kSecond, 0));
  stream.segment_began(6 * kSecond);
  EXPECT_FALSE(stream.cuts_at(12 * kSecond - 1, 0));
  EXPECT_TRUE(stream.cuts_at(12 * kSecond + 1, 0));
}

TEST_F(SegmenterTest, CutsASegmentBeforeItGrowsTooLarge) {
  Segmenter stream(rules);
  stream.segment_began(0);
  EXPECT_FALSE(stream.cuts_at(kSecond, (960U << 20) - 1));
  EXPECT_TRUE(stream.cuts_at(kSecond, 960U << 20));
}

TEST_F(SegmenterTest, ASegmentNeverLastsBeyondTenSecondsForASilence) {
  EXPECT_EQ(longest_silence_ns(2s, true), 5 * kSecond);
  EXPECT_EQ(longest_silence_ns(6s, true), 4 * kSecond);
  EXPECT_EQ(longest_silence_ns(10s, true), kSecond);
  EXPECT_EQ(longest_silence_ns(2s, false), kSecond) << "before the first frame no segment could hold it";
}

TEST_F(SegmenterTest, AShortSilenceLiesWithinASegmentAndALongOneEndsIt) {
  Segmenter stream(rules);
  record(stream, 0, kSecond);
  const std::int64_t shown_ns = kSecond;
  EXPECT_EQ(stream.end_of_last_frame(100 * kSecond), shown_ns);
  EXPECT_FALSE(stream.silent_before(shown_ns + 4 * kSecond, 100 * kSecond));
  EXPECT_TRUE(stream.silent_before(shown_ns + 4 * kSecond + 1, 100 * kSecond));
  stream.segment_ended(shown_ns);
  stream.absent(GapCause::kOverload);
  EXPECT_FALSE(stream.silent_before(60 * kSecond, 100 * kSecond)) << "it is stated already";
  expect(stream.gap_before(7 * kSecond), shown_ns, 7 * kSecond, GapCause::kOverload);
  EXPECT_FALSE(stream.gap_before(8 * kSecond).has_value());
}

TEST_F(SegmenterTest, BeforeTheFirstFrameASecondOfSilenceIsAGap) {
  Segmenter stream(rules);
  EXPECT_FALSE(stream.silent_before(kSecond, kSecond));
  EXPECT_TRUE(stream.silent_before(kSecond + 1, kSecond + 1));
}

TEST_F(SegmenterTest, TheFirstCauseOfAnAbsenceStands) {
  Segmenter stream(rules);
  record(stream, 0, kSecond);
  stream.segment_ended(kSecond);
  stream.absent(GapCause::kDeviceRemoved);
  stream.absent(GapCause::kFormatChange);
  expect(stream.gap_before(3 * kSecond), kSecond, 3 * kSecond, GapCause::kDeviceRemoved);
}

TEST_F(SegmenterTest, AFailedWriteReplacesWhatWasMissing) {
  Segmenter stream(rules);
  record(stream, 0, 2 * kSecond);
  stream.absent(GapCause::kSignalLost);
  stream.failed(kSecond, GapCause::kDiskFull);
  expect(stream.gap_at_close(9 * kSecond, 9 * kSecond, false), kSecond, 9 * kSecond, GapCause::kDiskFull);
}

TEST_F(SegmenterTest, AFrameStampedAtArrivalIsNotShownBeyondNow) {
  Segmenter stream(rules);
  record(stream, 0, kSecond);
  EXPECT_EQ(stream.end_of_last_frame(kSecond - 10), kSecond - 10);
  EXPECT_EQ(stream.end_of_last_frame(0), kSecond - kInterval + 1) << "and for a moment at least";
  rules.timed_by_arrival = false;
  Segmenter own_times(rules);
  record(own_times, 0, kSecond);
  EXPECT_EQ(own_times.end_of_last_frame(0), kSecond);
}

TEST_F(SegmenterTest, AFrameIsNotShownBeyondTheNextOne) {
  for (const bool timed_by_arrival : {true, false}) {
    rules.timed_by_arrival = timed_by_arrival;
    Segmenter stream(rules);
    record(stream, 0, kSecond);
    const std::int64_t last_ns = kSecond - kInterval;
    EXPECT_EQ(stream.end_of_last_frame(100 * kSecond, last_ns + kInterval / 3), last_ns + kInterval / 3);
    EXPECT_EQ(stream.end_of_last_frame(100 * kSecond, 3 * kSecond), kSecond);
    EXPECT_EQ(stream.end_of_last_frame(100 * kSecond, last_ns), last_ns + 1) << "and for a moment at least";
  }
}

TEST_F(SegmenterTest, ASourceThatStatesFewPicturesASecondHidesNoSilence) {
  Segmenter stream(rules);
  stream.frame_recorded(0, 60 * kSecond);
  EXPECT_EQ(stream.end_of_last_frame(100 * kSecond), kSecond);
  EXPECT_FALSE(stream.silent_before(5 * kSecond, 5 * kSecond));
  EXPECT_TRUE(stream.silent_before(5 * kSecond + 1, 6 * kSecond));
  expect(stream.gap_at_close(30 * kSecond, 30 * kSecond, false), 0, 30 * kSecond, GapCause::kSignalLost);
}

TEST_F(SegmenterTest, NothingIsShownBeyondTheEndOfTheRecording) {
  rules.end_ns = kSecond - 5;
  Segmenter stream(rules);
  record(stream, 0, kSecond);
  EXPECT_EQ(stream.end_of_last_frame(100 * kSecond), kSecond - 5);
}

TEST_F(SegmenterTest, AtTheCloseWhatIsMissingIsStatedUpToIt) {
  Segmenter nothing_came(rules);
  expect(nothing_came.gap_at_close(5 * kSecond, 5 * kSecond, false), 0, 5 * kSecond, GapCause::kSignalLost);

  Segmenter complete(rules);
  record(complete, 0, 5 * kSecond);
  complete.segment_ended(5 * kSecond);
  EXPECT_FALSE(complete.gap_at_close(5 * kSecond, 6 * kSecond, false).has_value());
  EXPECT_FALSE(complete.gap_at_close(6 * kSecond, 6 * kSecond, false).has_value())
      << "a second is no silence";
  expect(complete.gap_at_close(7 * kSecond, 7 * kSecond, false), 5 * kSecond, 7 * kSecond,
         GapCause::kSignalLost);
  EXPECT_FALSE(complete.gap_at_close(7 * kSecond, 7 * kSecond, true).has_value()) << "there was more to come";
}

TEST_F(SegmenterTest, AFileThatStatesItsOwnTimesIsNotSilentAfterItsEnd) {
  rules.timed_by_arrival = false;
  Segmenter file(rules);
  record(file, 0, kSecond);
  file.segment_ended(kSecond);
  EXPECT_FALSE(file.gap_at_close(60 * kSecond, 60 * kSecond, false).has_value());
}

TEST_F(SegmenterTest, AGapNeverEndsBeforeItBegins) {
  Segmenter stream(rules);
  record(stream, 0, 5 * kSecond);
  stream.segment_ended(5 * kSecond);
  stream.absent(GapCause::kSignalLost);
  expect(stream.gap_at_close(4 * kSecond, 4 * kSecond, false), 5 * kSecond, 5 * kSecond,
         GapCause::kSignalLost);
}

TEST(ChangesOfPictures, AreHeldBackOnceThereWereManyInAShortTime) {
  ChangePace pace;
  for (std::size_t i = 0; i < ChangePace::kMostChanges; ++i)
    EXPECT_FALSE(pace.refused_until(static_cast<std::int64_t>(i) * kSecond / 100).has_value());
  EXPECT_EQ(pace.refused_until(kSecond), ChangePace::kWithinNs);
  EXPECT_EQ(pace.refused_until(ChangePace::kWithinNs - 1), ChangePace::kWithinNs);
  EXPECT_FALSE(pace.refused_until(ChangePace::kWithinNs).has_value());
  EXPECT_EQ(pace.refused_until(ChangePace::kWithinNs), ChangePace::kWithinNs + kSecond / 100);
}

TEST(ChangesOfPictures, ThatComeRarelyAreNeverHeldBack) {
  ChangePace pace;
  const std::int64_t apart_ns = ChangePace::kWithinNs / static_cast<std::int64_t>(ChangePace::kMostChanges);
  for (std::int64_t i = 0; i < 1000; ++i) EXPECT_FALSE(pace.refused_until(i * apart_ns).has_value());
}

}  // namespace
}  // namespace kiroku::recorder
