#include "viewer/live/live_channel.h"

#include <atomic>
#include <condition_variable>
#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "recorder/source/source.h"
#include "tests/support/decoded_video.h"

namespace kiroku::live {
namespace {

using namespace std::chrono_literals;
using testing::IsEmpty;

/// Keeps what it is sent.
class Keeper final : public Watcher {
 public:
  bool begin(const std::shared_ptr<const Bytes>& init_segment, const std::string& codecs) override {
    const std::lock_guard guard(mutex_);
    films_.push_back(*init_segment);
    codecs_ = codecs;
    return true;
  }
  bool take(const std::shared_ptr<const Bytes>& fragment, std::int64_t /*time_ns*/) override {
    const std::lock_guard guard(mutex_);
    if (refuses) return false;
    append(films_.back(), *fragment);
    ++fragments_;
    came_.notify_all();
    return true;
  }
  /// Returns once it has more than so many. Encoding has low priority, so that a busy machine decides how
  /// long that takes; the test's own limit ends one that hangs.
  void wait_for_more_than(std::size_t fragments) const {
    std::unique_lock lock(mutex_);
    came_.wait(lock, [&] { return fragments_ > fragments; });
  }
  [[nodiscard]] std::vector<Bytes> films() const {
    const std::lock_guard guard(mutex_);
    return films_;
  }
  [[nodiscard]] std::size_t fragments() const {
    const std::lock_guard guard(mutex_);
    return fragments_;
  }
  [[nodiscard]] std::string codecs() const {
    const std::lock_guard guard(mutex_);
    return codecs_;
  }
  std::atomic<bool> refuses = false;

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable came_;
  std::vector<Bytes> films_;
  std::size_t fragments_ = 0;
  std::string codecs_;
};

class LiveChannelTest : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<recorder::Source> open(const std::string& size = "160x120") const {
    return recorder::open_source(
        recorder::parse_source_address("synthetic:endoscope?rate=25&speed=max&size=" + size), clock_);
  }
  /// Offers pictures, each once `keeper`, who refuses nothing, has the one before. A tap that is just being
  /// looked at passes a picture over, as it never waits; then it is offered again.
  void show(recorder::Source& source, int count, const Keeper& keeper) {
    for (int i = 0; i < count; ++i) {
      const std::size_t before = keeper.fragments();
      auto picture = source.read();
      ASSERT_TRUE(picture);
      picture->rate = source.frame_rate();
      std::uint64_t passed_over = 0;
      do {
        passed_over = tap_->passed_over();
        tap_->offer(*picture);
      } while (tap_->passed_over() != passed_over);
      keeper.wait_for_more_than(before);
    }
  }

  recorder::CaseClock clock_;
  std::shared_ptr<recorder::PictureTap> tap_ = std::make_shared<recorder::PictureTap>();
  LiveChannel channel_{tap_, [](const std::string& sentence) { ADD_FAILURE() << sentence; }};
};

TEST_F(LiveChannelTest, SendsEachPictureAsAFragmentThatDecodes) {
  const auto keeper = std::make_shared<Keeper>();
  channel_.add(keeper);
  show(*open(), 60, *keeper);
  ASSERT_EQ(keeper->films().size(), 1U);
  EXPECT_THAT(keeper->codecs(), testing::StartsWith("avc1."));
  const auto video = test::decode_video(keeper->films()[0]);
  ASSERT_EQ(video.frames.size(), 60U);
  EXPECT_THAT(video.complaints, IsEmpty());
  EXPECT_TRUE(video.frames.front().key);
  EXPECT_TRUE(video.frames[25].key);
  EXPECT_EQ(video.frames[1].pts - video.frames[0].pts, 3'600);
}

TEST_F(LiveChannelTest, BeginsWithAKeyFrameForWhoComesLater) {
  const auto first = std::make_shared<Keeper>(), second = std::make_shared<Keeper>();
  const auto source = open();
  channel_.add(first);
  show(*source, 10, *first);
  channel_.add(second);
  show(*source, 5, *second);
  ASSERT_EQ(first->films().size(), 1U);
  EXPECT_EQ(test::decode_video(first->films()[0]).frames.size(), 15U);
  ASSERT_EQ(second->films().size(), 1U);
  const auto joined = test::decode_video(second->films()[0]);
  ASSERT_EQ(joined.frames.size(), 5U);
  EXPECT_TRUE(joined.frames[0].key);
  EXPECT_EQ(joined.frames[0].pts, 10 * 3'600);
}

TEST_F(LiveChannelTest, PicturesKeepTheirTimesWhereOthersWerePassedOver) {
  const auto keeper = std::make_shared<Keeper>();
  const auto source = open();
  channel_.add(keeper);
  std::vector<std::int64_t> offered;
  for (const int passed_over : {0, 0, 3, 1, 7, 0, 30}) {
    for (int i = 0; i < passed_over; ++i) ASSERT_TRUE(source->read());
    show(*source, 1, *keeper);
    offered.push_back((offered.empty() ? 0 : offered.back() + 3'600) + passed_over * 3'600);
  }
  std::vector<std::int64_t> shown;
  for (const auto& frame : test::decode_video(keeper->films().at(0)).frames) shown.push_back(frame.pts);
  EXPECT_EQ(shown, offered);
}

TEST_F(LiveChannelTest, BeginsAnewWhereTheSourceChanges) {
  const auto keeper = std::make_shared<Keeper>();
  channel_.add(keeper);
  show(*open(), 3, *keeper);
  show(*open("320x240"), 4, *keeper);
  ASSERT_EQ(keeper->films().size(), 2U);
  EXPECT_EQ(test::decode_video(keeper->films()[0]).frames.size(), 3U);
  const auto after = test::decode_video(keeper->films()[1]);
  ASSERT_EQ(after.frames.size(), 4U);
  EXPECT_EQ(after.frames[0].width, 320);
}

TEST_F(LiveChannelTest, WhoCouldNotTakeAFragmentGoesOnWithAKeyFrame) {
  const auto slow = std::make_shared<Keeper>(), witness = std::make_shared<Keeper>();
  const auto source = open();
  channel_.add(slow);
  channel_.add(witness);
  show(*source, 2, *witness);
  slow->refuses = true;
  show(*source, 3, *witness);
  slow->refuses = false;
  show(*source, 25, *witness);
  const auto video = test::decode_video(slow->films()[0]);
  EXPECT_THAT(video.complaints, IsEmpty());
  ASSERT_GT(video.frames.size(), 2U);
  EXPECT_TRUE(video.frames[2].key);
  EXPECT_EQ(video.frames[2].pts, 25 * 3'600);
}

TEST_F(LiveChannelTest, AsksForNoPicturesWhileNobodyWatches) {
  const auto keeper = std::make_shared<Keeper>();
  const auto source = open();
  channel_.add(keeper);
  show(*source, 2, *keeper);
  channel_.remove(keeper.get());
  const std::uint64_t offered = tap_->offered();
  for (int i = 0; i < 5; ++i) tap_->offer(*source->read());
  EXPECT_EQ(tap_->offered(), offered);
  EXPECT_EQ(keeper->fragments(), 2U);
}

}  // namespace
}  // namespace kiroku::live
