#include "archive/verify/segment_times.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "tests/support/nanoseconds.h"

namespace kiroku::archive {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

StreamInfo camera(const std::string& extension = "ts") {
  return {"room",
          "video",
          extension == "ts" ? "video/mp2t" : "video/x-matroska",
          "x",
          extension == "ts" ? "mpeg2" : "lossless",
          "",
          {},
          "arrival",
          extension};
}
StreamInfo vital_signs() {
  return {"room", "vitals", std::string(kLinesMedia), "x", "jsonl", "", {}, "arrival", "jsonl"};
}

/// Segments of a stream as they are taken, and the codes that come of them.
class Taken {
 public:
  explicit Taken(const StreamInfo& info = camera()) : info_(info), times_(info, findings_) {}

  /// Of five seconds unless it is said otherwise; `first_pts` in the stream's unit.
  Taken& segment(std::int64_t start_ns, std::int64_t first_pts, bool interrupted = false,
                 std::uint64_t frames = 125) {
    SegmentEntry entry = made(start_ns, first_pts);
    entry.frames = frames;
    return take(entry, interrupted);
  }
  Taken& take(const SegmentEntry& entry, bool interrupted = false) {
    times_.take(entry, ++entries_, interrupted);
    return *this;
  }
  [[nodiscard]] SegmentEntry made(std::int64_t start_ns, std::int64_t first_pts) const {
    SegmentEntry entry;
    entry.stream = "room";
    entry.file.file = segment_path("room", entries_, info_.extension);
    entry.span = {start_ns, start_ns + 5 * kSecond};
    entry.first_pts = first_pts;
    entry.time_base = info_.extension == "ts"    ? "1/90000"
                      : info_.extension == "mkv" ? "1/1000"
                                                 : "1/1000000000";
    entry.frames = 125;
    return entry;
  }
  std::vector<std::string> codes() {
    std::vector<std::string> all;
    for (const Finding& each : findings_.take()) all.push_back(each.code);
    return all;
  }

 private:
  StreamInfo info_;
  FindingList findings_;
  SegmentTimes times_;
  std::uint64_t entries_ = 0;
};

constexpr std::int64_t kDelay = 45'000;  // of what recorders write into MPEG-TS

TEST(SegmentTimes, AnyConstantWillDo) {
  for (const std::int64_t constant :
       {kDelay, std::int64_t{0}, std::int64_t{-900'000}, std::int64_t{1} << 40}) {
    Taken taken;
    for (int i = 0; i < 100; ++i) taken.segment(i * 5 * kSecond + i, constant + i * 450'000);
    EXPECT_THAT(taken.codes(), IsEmpty()) << constant;
  }
}

TEST(SegmentTimes, ABurstIsStampedUpToASecondLater) {
  EXPECT_THAT(Taken().segment(0, 90'000).segment(5 * kSecond, 450'000).segment(10 * kSecond, 990'000).codes(),
              IsEmpty());
  EXPECT_THAT(Taken(camera("mkv")).segment(0, 1'000).segment(5 * kSecond, 5'000).codes(), IsEmpty());
}

// A thousand pictures a second are a millisecond apart at least, so they are late by more and more.
TEST(SegmentTimes, NoPictureHasTheStampOfTheOneBefore) {
  Taken fast(camera("mkv"));
  for (int i = 0; i < 20; ++i) fast.segment(i * 5 * kSecond, i * 10'000, false, 10'000);
  EXPECT_THAT(fast.codes(), IsEmpty());
  Taken slow(camera("mkv"));
  for (int i = 0; i < 20; ++i) slow.segment(i * 5 * kSecond, i * 10'000, false, 125);
  EXPECT_THAT(slow.codes(), ElementsAre("segment-times-late"));
}

TEST(SegmentTimes, SegmentsThatChangePlacesDiffer) {
  const auto codes = Taken()
                         .segment(0, 0)
                         .segment(5 * kSecond, 900'000)
                         .segment(10 * kSecond, 450'000)
                         .segment(15 * kSecond, 1'350'000)
                         .codes();
  EXPECT_THAT(codes, UnorderedElementsAre("segment-times-differ", "segment-times-late"));
}

TEST(SegmentTimes, FilmThatIsMovedByMinutesIsLate) {
  EXPECT_THAT(
      Taken().segment(0, 0).segment(5 * kSecond, 310 * 90'000).segment(10 * kSecond, 315 * 90'000).codes(),
      ElementsAre("segment-times-late"));
}

// What was never coded has no stamp, and whoever writes the entry states as much of it as they like.
TEST(SegmentTimes, DroppedPicturesExplainNothing) {
  Taken taken;
  SegmentEntry first = taken.made(0, 0);
  first.dropped = std::uint64_t{1} << 32;
  EXPECT_THAT(taken.take(first).segment(5 * kSecond, 310 * 90'000).codes(),
              ElementsAre("segment-times-late"));
}

// A recorder from before the bound had such stamps of a camera that stated a third of its rate.
TEST(SegmentTimes, WhatAnOlderRecorderMayHaveStampedIsOnlyLate) {
  Taken taken;
  for (int i = 0; i < 100; ++i) taken.segment(i * 5 * kSecond, i * 600'000);
  EXPECT_THAT(taken.codes(), ElementsAre("segment-times-late"));
}

// A recorder that begins anew may stamp earlier than the one before it did.
TEST(SegmentTimes, BehindAGapTheOrderIsNotAsked) {
  EXPECT_THAT(
      Taken().segment(0, 0).segment(5 * kSecond, 900'000).segment(10 * kSecond, 450'000, true).codes(),
      ElementsAre("segment-times-late"));
  EXPECT_THAT(Taken().segment(0, 0).segment(3'600 * kSecond, 3'600 * 90'000 + 80'000, true).codes(),
              IsEmpty());
}

TEST(SegmentTimes, FoundSegmentsStateNoStamps) {
  Taken taken;
  taken.segment(0, 0);
  SegmentEntry found = taken.made(5 * kSecond, 0);
  found.counted = false;
  found.time_base.clear();
  EXPECT_THAT(taken.take(found).codes(), IsEmpty());
}

TEST(SegmentTimes, TheUnitIsThatOfTheMedia) {
  Taken taken;
  SegmentEntry entry = taken.made(0, 0);
  entry.time_base = "1/1000";
  EXPECT_THAT(taken.take(entry).codes(), ElementsAre("segment-times-differ"));
}

TEST(SegmentTimes, EachContainerHasItsOwnConstant) {
  Taken taken;
  taken.segment(0, kDelay);
  SegmentEntry other = taken.made(5 * kSecond, 5'000);
  other.file.file = segment_path("room", 1, "mkv");
  other.profile = "lossless";
  other.time_base = "1/1000";
  EXPECT_THAT(taken.take(other).segment(10 * kSecond, kDelay + 900'000).codes(), IsEmpty());
}

TEST(SegmentTimes, LinesBeginWithTheirSegment) {
  EXPECT_THAT(Taken(vital_signs()).segment(7, 7).codes(), IsEmpty());
  EXPECT_THAT(Taken(vital_signs()).segment(7, 8).codes(), ElementsAre("segment-times-differ"));
}

TEST(SegmentTimes, NumbersAtTheirBoundsOverflowNothing) {
  constexpr std::int64_t kLargest = (std::int64_t{1} << 53) - 1;
  for (const std::string extension : {"ts", "mkv"}) {
    Taken taken(camera(extension));
    for (const std::int64_t start : {std::int64_t{0}, kLargest}) {
      for (const std::int64_t stamp : {-kLargest, kLargest, std::int64_t{0}}) {
        SegmentEntry entry = taken.made(start, stamp);
        entry.frames = entry.dropped = static_cast<std::uint64_t>(kLargest);
        taken.take(entry);
      }
    }
    EXPECT_THAT(taken.codes(), testing::Contains("segment-times-differ"));
  }
}

}  // namespace
}  // namespace kiroku::archive
