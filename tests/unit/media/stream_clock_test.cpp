#include "media/stream_clock.h"

#include <vector>

#include <gtest/gtest.h>

namespace kiroku::media {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;

archive::StreamInfo room() { return {"room", "video", "video/mp2t", "x", "mpeg2", "", {}, "arrival", "ts"}; }

archive::SegmentEntry segment(std::int64_t start_ns, Ticks first_pts) {
  archive::SegmentEntry entry;
  entry.stream = "room";
  entry.file.file = "segments/room/00000000.ts.age";
  entry.span = {start_ns, start_ns + 5 * kSecondNs};
  entry.first_pts = first_pts;
  entry.time_base = "1/90000";
  entry.frames = 125;
  return entry;
}

TEST(StreamClock, TheConstantIsTheLeastDifference) {
  const std::vector<archive::SegmentEntry> segments{segment(0, 45'000 + 80'000),
                                                    segment(5 * kSecondNs, 495'000),
                                                    segment(10 * kSecondNs, 945'000 + 30'000)};
  const StreamClock clock(room(), segments);
  for (const auto& each : segments) EXPECT_EQ(clock.offset_of(each), 45'000);
}

// Whoever holds the device key may state anything; the film of the other segments stays where it was.
TEST(StreamClock, NoSingleEntryMovesAStream) {
  for (const Ticks lie : {-300 * kTicksPerSecond, 300 * kTicksPerSecond}) {
    std::vector<archive::SegmentEntry> segments;
    for (std::int64_t i = 0; i < 5; ++i) segments.push_back(segment(i * 5 * kSecondNs, i * 450'000));
    segments[2].first_pts += lie;
    const StreamClock clock(room(), segments);
    EXPECT_EQ(clock.constant_of("video/mp2t"), 0);
    EXPECT_EQ(clock.offset_of(segments[1]), 0);
    EXPECT_EQ(clock.offset_of(segments[2]), lie) << "it stands where its entry says that it began";
  }
}

TEST(StreamClock, AFoundSegmentHasTheConstantOfTheOthers) {
  archive::SegmentEntry found = segment(10 * kSecondNs, 0);
  found.counted = false;
  found.time_base.clear();
  EXPECT_EQ(StreamClock(room(), {segment(0, 7), found}).offset_of(found), 7);
  EXPECT_FALSE(StreamClock(room(), {found}).offset_of(found));
}

TEST(StreamClock, APictureLiesInItsSegmentAndWhatABurstExplains) {
  const archive::SegmentEntry entry = segment(0, 0);
  EXPECT_TRUE(may_lie(entry, 0, 125));
  EXPECT_TRUE(may_lie(entry, 6 * kTicksPerSecond, 125));
  EXPECT_FALSE(may_lie(entry, 7 * kTicksPerSecond, 125));
  EXPECT_FALSE(may_lie(entry, -20 * kTicksPerSecond, 125));
  EXPECT_TRUE(may_lie(entry, 14 * kTicksPerSecond, 10'000)) << "none is stamped as the one before it";
}

}  // namespace
}  // namespace kiroku::media
