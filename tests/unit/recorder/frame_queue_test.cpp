#include "recorder/frame_queue.h"

#include "tests/support/nanoseconds.h"

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixfmt.h>
}

#include <thread>

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

// 64 x 48 in 4:2:0.
constexpr std::size_t kPictureBytes = 64 * 48 * 3 / 2;

TimedFrame frame_at(std::int64_t time_ns, std::uint64_t lost_before = 0) {
  TimedFrame timed;
  timed.frame = media::make_frame();
  timed.frame->format = AV_PIX_FMT_YUV420P;
  timed.frame->width = 64;
  timed.frame->height = 48;
  timed.time_ns = time_ns;
  timed.lost_before = lost_before;
  return timed;
}

QueuedFrame popped(FrameQueue& queue) { return std::get<QueuedFrame>(std::move(queue.pop().value())); }

TEST(FrameQueue, DropsWholeFramesWhenFullAndStatesThemWithTheNext) {
  FrameQueue queue(2 * kPictureBytes);
  EXPECT_TRUE(queue.push(frame_at(0), false));
  EXPECT_TRUE(queue.push(frame_at(100), false));
  EXPECT_FALSE(queue.push(frame_at(200), false));
  EXPECT_FALSE(queue.push(frame_at(300), false));
  EXPECT_EQ(popped(queue).dropped_before, 0U);
  EXPECT_TRUE(queue.push(frame_at(400), false));
  EXPECT_EQ(popped(queue).frame.time_ns, 100);
  const QueuedFrame next = popped(queue);
  EXPECT_EQ(next.frame.time_ns, 400);
  EXPECT_EQ(next.dropped_before, 2U);
  EXPECT_EQ(next.dropped_since_ns, 200);
  EXPECT_EQ(queue.dropped(), 2U);
  EXPECT_FALSE(queue.unstated_drops().has_value());
}

TEST(FrameQueue, TakesAPictureLargerThanItsBudgetWhenEmpty) {
  FrameQueue queue(1);
  EXPECT_TRUE(queue.push(frame_at(0), false));
  EXPECT_FALSE(queue.push(frame_at(1), false));
}

TEST(FrameQueue, StatesDropsThatNoFrameFollows) {
  FrameQueue queue(kPictureBytes);
  queue.push(frame_at(0), false);
  queue.push(frame_at(100), false);
  queue.finish();
  EXPECT_EQ(popped(queue).frame.time_ns, 0);
  EXPECT_FALSE(queue.pop().has_value());
  const std::optional<QueuedFrame> drops = queue.unstated_drops();
  ASSERT_TRUE(drops.has_value());
  EXPECT_EQ(drops->dropped_before, 1U);
  EXPECT_EQ(drops->dropped_since_ns, 100);
}

TEST(FrameQueue, CountsWhatTheSourceLost) {
  FrameQueue queue(2 * kPictureBytes);
  queue.push(frame_at(0), false);
  queue.push(frame_at(400, 3), false);
  EXPECT_EQ(popped(queue).dropped_before, 0U);
  const QueuedFrame next = popped(queue);
  EXPECT_EQ(next.dropped_before, 3U);
  EXPECT_EQ(next.dropped_since_ns, 100);
  EXPECT_EQ(queue.dropped(), 3U);
}

TEST(FrameQueue, LetsAPatientSourceWaitForRoom) {
  FrameQueue queue(kPictureBytes);
  queue.push(frame_at(0), true);
  std::thread source([&] { EXPECT_TRUE(queue.push(frame_at(1), true)); });
  EXPECT_EQ(popped(queue).frame.time_ns, 0);
  EXPECT_EQ(popped(queue).frame.time_ns, 1);
  source.join();
  EXPECT_EQ(queue.dropped(), 0U);
}

TEST(FrameQueue, LetsAWaitingSourceGoWhenItsConsumerFailed) {
  FrameQueue queue(kPictureBytes);
  queue.push(frame_at(0), true);
  std::thread source([&] { EXPECT_FALSE(queue.push(frame_at(1), true)); });
  queue.abandon();
  source.join();
}

TEST(FrameQueue, TakesFewPiecesOfSoundHoweverSmallTheyAre) {
  FrameQueue queue(8 * kLeastFrameBytes);
  int taken = 0;
  for (int i = 0; i < 1000; ++i) {
    TimedFrame timed;
    timed.is_sound = true;
    timed.frame = media::make_frame();
    timed.frame->format = AV_SAMPLE_FMT_U8;
    timed.frame->sample_rate = 48'000;
    timed.frame->nb_samples = 1;
    av_channel_layout_default(&timed.frame->ch_layout, 1);
    if (queue.push(std::move(timed), false)) ++taken;
  }
  EXPECT_EQ(taken, 8);
}

struct Told {
  std::uint64_t taken = 0, dropped = 0, gaps = 0;
};
/// A camera that sends `rate` pictures a second for `lasts_ns`, of which `coded_rate` are coded, on plain
/// times. Each gap reaches from the first picture that is missing to the next one that is taken.
Told send(FrameQueue& queue, std::int64_t lasts_ns, std::int64_t rate, std::int64_t coded_rate,
          std::uint64_t lost_each = 0) {
  Told told;
  std::int64_t coded = 0, last_ns = -1;
  const std::int64_t step_ns = kSecond / rate;
  const auto code = [&] {
    const QueuedFrame item = popped(queue);
    ++told.taken;
    told.dropped += item.dropped_before;
    if (item.dropped_before > 0) {
      ++told.gaps;
      if (lost_each == 0) {
        EXPECT_EQ(item.dropped_since_ns, last_ns + step_ns);
      }
      EXPECT_EQ(item.frame.time_ns - last_ns,
                static_cast<std::int64_t>(item.dropped_before / (1 + lost_each) + 1) * step_ns);
    }
    last_ns = item.frame.time_ns;
  };
  std::int64_t waiting = 0;
  for (std::int64_t i = 0; i < lasts_ns / step_ns; ++i) {
    const std::int64_t now_ns = i * step_ns;
    for (; waiting > 0 && coded < now_ns * coded_rate / kSecond; --waiting, ++coded) code();
    if (waiting == 0) coded = now_ns * coded_rate / kSecond;
    TimedFrame frame = frame_at(now_ns, i == 0 ? 0 : lost_each);
    frame.lost_on_the_way = lost_each > 0;
    if (queue.push(std::move(frame), false)) ++waiting;
  }
  for (; waiting > 0; --waiting) code();
  if (const auto rest = queue.unstated_drops()) told.dropped += rest->dropped_before;
  return told;
}

TEST(FrameQueue, StatesFewHolesOfACameraThatSendsFasterThanCanBeCoded) {
  FrameQueue queue(10 * kPictureBytes);
  const Told told = send(queue, 16 * kSecond, 10'000, 2'000);
  EXPECT_LE(told.gaps, 100U) << "and no thousands a second";
  EXPECT_EQ(told.taken + told.dropped, 160'000U) << "each picture is recorded, or counted as dropped";
  EXPECT_GT(told.taken, 100U);
}

TEST(FrameQueue, StatesFewHolesOfACameraWhoseNetworkLosesEachSecondPicture) {
  FrameQueue queue(1000 * kPictureBytes);
  const Told told = send(queue, 16 * kSecond, 1000, 1000, 1);
  EXPECT_LE(told.gaps, 3 * LossPace::kMostGaps);
  EXPECT_EQ(told.taken + told.dropped, 2 * 16'000U - 1);
}

// A film waits for room, and its times may break before every picture: each break would be a line of the
// ledger.
TEST(FrameQueue, StatesFewHolesOfAFilmWhoseTimesBreakAgainAndAgain) {
  FrameQueue queue(1000 * kPictureBytes);
  std::size_t gaps = 0;
  std::uint64_t taken = 0, dropped = 0;
  constexpr std::uint64_t kPictures = 4000;
  for (std::uint64_t i = 0; i < kPictures; ++i) {
    TimedFrame frame = frame_at(static_cast<std::int64_t>(i) * kSecond / 500, i == 0 ? 0 : 1);
    frame.lost_on_the_way = true;
    if (!queue.push(std::move(frame), true)) continue;
    const QueuedFrame item = popped(queue);
    ++taken;
    dropped += item.dropped_before;
    gaps += item.dropped_before > 0 ? 1 : 0;
  }
  if (const auto rest = queue.unstated_drops()) dropped += rest->dropped_before;
  EXPECT_LE(gaps, 2 * LossPace::kMostGaps) << "in 8 s";
  EXPECT_EQ(taken + dropped, 2 * kPictures - 1) << "each picture is recorded, or counted as dropped";
}

TEST(FrameQueue, LeavesOutNothingThatCameOfACameraWhoseNetworkLosesEachSecondPicture) {
  FrameQueue queue(1000 * kPictureBytes);
  const Told told = send(queue, 60 * kSecond, 30, 1000, 1);  // of 60 a second
  EXPECT_EQ(told.taken, 1800U);
}

TEST(FrameQueue, RecordsAsMuchAsCanBeCodedOfACameraThatIsALittleTooFast) {
  FrameQueue queue(10 * kPictureBytes);
  const Told told = send(queue, 60 * kSecond, 30, 20);
  EXPECT_EQ(told.taken + told.dropped, 1800U);
  EXPECT_GT(told.taken, 1000U) << "of 1200 that could be coded";
  EXPECT_LE(told.gaps, 250U);
}

TEST(FrameQueue, KeepsALossInItsPlace) {
  FrameQueue queue(4 * kPictureBytes);
  queue.push(frame_at(0), false);
  queue.push(SourceLost{archive::GapCause::kDeviceRemoved, 7});
  queue.push(frame_at(100), false);
  queue.finish();
  EXPECT_EQ(popped(queue).frame.time_ns, 0);
  EXPECT_EQ(std::get<SourceLost>(queue.pop().value()).cause, archive::GapCause::kDeviceRemoved);
  EXPECT_EQ(popped(queue).frame.time_ns, 100);
  EXPECT_FALSE(queue.pop().has_value());
}

}  // namespace
}  // namespace kiroku::recorder
