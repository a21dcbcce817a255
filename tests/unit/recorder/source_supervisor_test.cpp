// Losing a source and taking it up again, by a clock that the test moves.
#include "recorder/source_supervisor.h"

#include <deque>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/moved_clock.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using archive::GapCause;
using testing::ElementsAre;
using testing::HasSubstr;

/// Gives its pictures and is lost then, or waits to be interrupted.
class BriefCamera : public Source {
 public:
  BriefCamera(int pictures, bool is_lost, bool is_live)
      : pictures_(pictures), lost_(is_lost), live_(is_live) {}
  [[nodiscard]] PictureFormat format() const override { return {64, 48, 0, {}}; }
  [[nodiscard]] Rational frame_rate() const override { return {25, 1}; }
  [[nodiscard]] bool is_live() const override { return live_; }
  [[nodiscard]] std::string input() const override { return "64x48 of a test"; }
  std::optional<TimedFrame> read() override {
    if (given_ < pictures_) {
      TimedFrame timed;
      timed.frame = media::make_frame();
      if (turned_from >= 0 && given_ >= turned_from) timed.treatment = {Turn::kMirrored, true};
      timed.time_ns = given_++ * 1'000'000'000;
      return timed;
    }
    if (decoder_lost) throw DecoderLost("its decoder crashed");
    if (lost_) throw Error("the cable was pulled");
    while (live_ && !interrupted()) std::this_thread::yield();
    if (silent_at_end) throw SourceSilent("its driver does not answer");
    return {};
  }

  bool decoder_lost = false, silent_at_end = false;
  int turned_from = -1;  // from this picture on; -1: none is

 private:
  const int pictures_;
  int given_ = 0;
  const bool lost_, live_;
};

class SourceSupervisorTest : public testing::Test {
 protected:
  /// The camera as it is opened the first time, the second time ...; null: it cannot be opened.
  std::shared_ptr<SourceGuard> guard(std::deque<std::unique_ptr<Source>> cameras) {
    const auto left = std::make_shared<std::deque<std::unique_ptr<Source>>>(std::move(cameras));
    return std::make_shared<SourceGuard>(
        SourceGuard::Limits{}, SourceGuard::Tell{},
        [left, this](const SourceAddress&, const CaseClock&, const OpeningTerms&) -> std::unique_ptr<Source> {
          opened_at.push_back(clock.now_ns());
          if (left->empty()) throw Error("no such camera");
          std::unique_ptr<Source> camera = std::move(left->front());
          left->pop_front();
          if (!camera) throw Error("no such camera");
          return camera;
        });
  }
  static std::unique_ptr<Source> camera(int pictures, bool is_lost = true, bool is_live = true) {
    return std::make_unique<BriefCamera>(pictures, is_lost, is_live);
  }
  SourceSupervisor::Terms terms(std::shared_ptr<SourceGuard> guarded) {
    return {parse_source_address("/dev/video-of-a-test", Presence::kMayBeAbsent), false, nullptr,
            std::move(guarded)};
  }
  /// What comes next: 'p' a picture, 'l' a loss, '.' nothing more.
  char next() {
    const std::optional<QueueItem> item = queue.pop();
    if (!item) return '.';
    if (const auto* lost = std::get_if<SourceLost>(&*item)) {
      causes.push_back(lost->cause);
      return 'l';
    }
    return 'p';
  }
  /// Moves the clock by tenths of seconds, which are the steps in which a pause is waited for.
  void let_pass(std::chrono::milliseconds time) {
    for (; time > 0ms; time -= 100ms) {
      moved.await_waiting(1);
      moved.move(100ms);
    }
  }

  [[nodiscard]] LaneContext context() { return {clock, sleeps, store, facts, problems, 2s, end_ns}; }

  test::MovedClock moved;
  const CaseClock clock{moved};
  SleepWatch sleeps{clock};
  SegmentStore store{nullptr, 1};
  FactQueue facts;
  ProblemLog problems;
  std::optional<std::int64_t> end_ns;
  FrameQueue queue{1U << 20};
  std::vector<std::int64_t> opened_at;  // written while the test waits for what comes of it
  std::vector<GapCause> causes;
};

TEST_F(SourceSupervisorTest, APipeWhoseDecoderIsLostHasNotEnded) {
  auto crashing = std::make_unique<BriefCamera>(1, true, true);
  crashing->decoder_lost = true;
  std::deque<std::unique_ptr<Source>> cameras;
  cameras.push_back(nullptr);
  cameras.push_back(camera(1, false));
  SourceSupervisor::Terms of_pipe = terms(guard(std::move(cameras)));
  of_pipe.address.kind = SourceKind::kPipe;
  SourceSupervisor supervisor(context(), std::move(of_pipe), std::move(crashing), queue);
  supervisor.start();
  EXPECT_EQ(next(), 'p');
  EXPECT_EQ(next(), 'l');
  EXPECT_EQ(problems.latest(), "its decoder crashed");
  let_pass(3s);
  EXPECT_EQ(next(), 'p');
  supervisor.stop();
  EXPECT_THAT(opened_at, ElementsAre(1'000'000'000, 3'000'000'000));
}

TEST_F(SourceSupervisorTest, ALostSourceIsTakenUpAgainAfterPausesThatGrow) {
  std::deque<std::unique_ptr<Source>> cameras;
  for (int i = 0; i < 6; ++i) cameras.push_back(nullptr);
  cameras.push_back(camera(1, false));
  SourceSupervisor supervisor(context(), terms(guard(std::move(cameras))), camera(2), queue);
  supervisor.start();
  EXPECT_EQ(next(), 'p');
  EXPECT_EQ(next(), 'p');
  EXPECT_EQ(next(), 'l');
  EXPECT_EQ(problems.latest(), "the cable was pulled");
  EXPECT_FALSE(supervisor.live());
  let_pass(63s);
  EXPECT_EQ(next(), 'p');
  EXPECT_THAT(opened_at, ElementsAre(1'000'000'000, 3'000'000'000, 7'000'000'000, 15'000'000'000,
                                     31'000'000'000, 47'000'000'000, 63'000'000'000));
  EXPECT_THAT(causes, ElementsAre(GapCause::kDeviceRemoved)) << "the test's device is no file";
  EXPECT_THAT(problems.latest(), HasSubstr("no such camera"));
  EXPECT_TRUE(supervisor.live());
  EXPECT_FALSE(supervisor.ended());
  supervisor.stop();
  EXPECT_EQ(next(), '.');
  EXPECT_TRUE(supervisor.ended());
}

TEST_F(SourceSupervisorTest, ASourceThatIsNotThereIsStatedAsLostAndWaitedFor) {
  std::deque<std::unique_ptr<Source>> cameras;
  cameras.push_back(camera(1, false));
  SourceSupervisor supervisor(context(), terms(guard(std::move(cameras))), nullptr, queue);
  supervisor.start();
  EXPECT_EQ(next(), 'l');
  EXPECT_EQ(supervisor.input(), "");
  let_pass(1s);
  EXPECT_EQ(next(), 'p');
  EXPECT_EQ(supervisor.input(), "64x48 of a test");
  EXPECT_THAT(opened_at, ElementsAre(1'000'000'000));
}

// The ledger states how the first picture is shown.
TEST_F(SourceSupervisorTest, TellsWhereSourcesAreShownOtherwiseThanTheFirstPicture) {
  auto changing = std::make_unique<BriefCamera>(4, true, true),
       again = std::make_unique<BriefCamera>(2, false, true);
  changing->turned_from = 2;
  std::deque<std::unique_ptr<Source>> cameras;
  cameras.push_back(std::move(again));
  std::vector<std::string> told;
  SourceSupervisor::Terms asked = terms(guard(std::move(cameras)));
  asked.turned = [&](const std::string& sentence) { told.push_back(sentence); };
  SourceSupervisor supervisor(context(), std::move(asked), std::move(changing), queue);
  supervisor.start();
  for (const char expected : {'p', 'p', 'p', 'p', 'l'}) EXPECT_EQ(next(), expected);
  let_pass(1s);
  for (const char expected : {'p', 'p'}) EXPECT_EQ(next(), expected);
  supervisor.stop();
  supervisor.join();
  EXPECT_THAT(
      told,
      ElementsAre(HasSubstr("from 2.000 s of the case's clock on: its pictures are mirrored left to right"),
                  HasSubstr("its pictures are recorded as they are coded, and it says nothing else")));
}

TEST_F(SourceSupervisorTest, ADamagedFileDoesNotComeBack) {
  SourceSupervisor supervisor(context(), terms(guard({})), camera(1, true, false), queue);
  supervisor.start();
  EXPECT_EQ(next(), 'p');
  EXPECT_EQ(next(), '.');
  EXPECT_TRUE(supervisor.ended());
  EXPECT_FALSE(supervisor.reached_end());
  EXPECT_EQ(problems.latest(), "the cable was pulled");
}

TEST_F(SourceSupervisorTest, NothingIsTakenFromTheEndOfTheRecordingOn) {
  end_ns = 2'000'000'000;
  SourceSupervisor supervisor(context(), terms(guard({})), camera(9, false, false), queue);
  supervisor.start();
  EXPECT_EQ(next(), 'p');
  EXPECT_EQ(next(), 'p');
  EXPECT_EQ(next(), '.');
  EXPECT_TRUE(supervisor.reached_end());
}

TEST_F(SourceSupervisorTest, AStopEndsAPauseAsItEndsAWaitForPictures) {
  SourceSupervisor paused(context(), terms(guard({})), camera(0), queue);
  paused.start();
  EXPECT_EQ(next(), 'l');
  moved.await_waiting(1);
  paused.stop();
  moved.move(100ms);
  paused.join();
  EXPECT_EQ(next(), '.');

  FrameQueue other(1U << 20);
  SourceSupervisor waiting(context(), terms(guard({})), camera(0, false), other);
  waiting.start();
  waiting.stop();
  waiting.join();
  EXPECT_TRUE(waiting.ended());
}

TEST_F(SourceSupervisorTest, ASourceGivenUpJustBeforeTheStopIsLostAllTheSame) {
  auto silent = std::make_unique<BriefCamera>(1, false, true);
  silent->silent_at_end = true;
  SourceSupervisor supervisor(context(), terms(guard({})), std::move(silent), queue);
  supervisor.start();
  EXPECT_EQ(next(), 'p');
  supervisor.stop();
  EXPECT_EQ(next(), 'l');
  EXPECT_EQ(next(), '.');
  EXPECT_EQ(problems.latest(), "its driver does not answer");
  EXPECT_TRUE(opened_at.empty());
}

}  // namespace
}  // namespace kiroku::recorder
