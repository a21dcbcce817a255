#include "recorder/picture_tap.h"

#include <thread>

#include <gtest/gtest.h>

#include "recorder/session.h"
#include "tests/support/recording.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;

/// A second of pictures at their own pace, looked at through the tap.
struct Watched {
  std::shared_ptr<PictureTap> tap = std::make_shared<PictureTap>();
  SessionResult record() const {
    const test::RecorderBench bench;
    SessionOptions options = bench.options();
    options.video = {bench.stream("endoscope", "synthetic:pattern?size=64x48&rate=50")};
    options.video[0].tap = tap;
    options.duration = 1s;
    return Session(options).run();
  }
};

TEST(PictureTap, AWatcherThatIsStuckCostsTheRecordingNoPicture) {
  const Watched watched;
  watched.tap->watch(true);
  const SessionResult result = watched.record();
  EXPECT_EQ(result.last.streams[0].dropped, 0U);
  EXPECT_GE(watched.tap->offered(), result.last.streams[0].frames);
  // Of all that nobody took the newest is kept.
  EXPECT_EQ(watched.tap->passed_over() + 1, watched.tap->offered());
}

TEST(PictureTap, AWatcherThatHoldsPicturesCostsTheRecordingNoPicture) {
  const Watched watched;
  watched.tap->watch(true);
  std::atomic<bool> over = false;
  std::vector<PictureTap::Picture> held;
  std::thread watcher([&] {
    while (!over) {
      if (auto picture = watched.tap->take(10ms)) held.push_back(std::move(*picture));
    }
  });
  const SessionResult result = watched.record();
  over = true;
  watcher.join();
  EXPECT_EQ(result.last.streams[0].dropped, 0U);
  EXPECT_GT(held.size(), 10U);
  for (std::size_t i = 1; i < held.size(); ++i) EXPECT_GT(held[i].time_ns, held[i - 1].time_ns);
  EXPECT_LE(held.size() + watched.tap->passed_over(), watched.tap->offered());
}

TEST(PictureTap, KeepsNothingWhileNobodyWatches) {
  const Watched watched;
  EXPECT_EQ(watched.record().last.streams[0].dropped, 0U);
  EXPECT_EQ(watched.tap->offered(), 0U);
  EXPECT_FALSE(watched.tap->take(0ms));
}

}  // namespace
}  // namespace kiroku::recorder
