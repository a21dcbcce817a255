#include "trainer/exclusion/live_attempt.h"

#include <condition_variable>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/unit/trainer/made_object.h"

namespace kiroku::trainer {
namespace {

std::shared_ptr<const ExclusionBody> shared_body() {
  static const std::shared_ptr<const ExclusionBody> kBody = [] {
    OrganObject object = made_object(ObjectKind::kLiver, 900);
    ExclusionTask task = exclusion_task(ObjectKind::kLiver);
    task.hold_s = 0.3;
    return std::make_shared<const ExclusionBody>(std::move(object), task);
  }();
  return kBody;
}

ExclusionOptions options() {
  ExclusionOptions small;
  small.width = 320;
  small.height = 240;
  return small;
}

/// What a listener was told.
class Told {
 public:
  LiveListener listener() {
    return {[this](const ExclusionBody&) { note([this] { ++began; }); },
            [this](const LiveView& view) {
              note([&] {
                ++pictures;
                EXPECT_EQ(view.picture, pictures);
                EXPECT_GE(view.input, input);
                input = view.input;
                share = view.attempt->visible_share;
                EXPECT_EQ(view.attempt->picture->width, 320);
              });
            },
            [this](const LiveOutcome& outcome) { note([&] { over = outcome; }); },
            [this](const std::string& sentence) { note([&] { failed = sentence; }); }};
  }
  template <typename Ready>
  bool wait(const Ready& ready, std::chrono::milliseconds most = std::chrono::seconds(30)) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, most, ready);
  }

  int began = 0;
  std::uint64_t pictures = 0, input = 0;
  double share = 0;
  std::optional<LiveOutcome> over;
  std::string failed;

 private:
  template <typename Change>
  void note(const Change& change) {
    const std::lock_guard guard(mutex_);
    change();
    changed_.notify_all();
  }
  std::mutex mutex_;
  std::condition_variable changed_;
};

TEST(LiveAttempt, IsDoneByPointersAndTellsHowLongInputTook) {
  Told told;
  LiveAttempt attempt(shared_body, options(), 3, told.listener());
  ASSERT_TRUE(told.wait([&] { return told.pictures > 0; }));
  std::uint64_t number = 0;
  const auto is_over = [&] { return told.over.has_value(); };
  for (int step = 0; step < 400 && !told.wait(is_over, std::chrono::milliseconds(20)); ++step) {
    const double up = 0.105 * std::clamp((step - 30) / 60.0, 0.0, 1.0);
    attempt.point({++number, {{0, 0.5, 0.66 - up, 0}}});
  }
  ASSERT_TRUE(told.wait(is_over)) << told.share << told.failed;
  EXPECT_EQ(told.began, 1);
  EXPECT_EQ(told.over->ending, Ending::kDone);
  EXPECT_TRUE(told.over->outcome.score.done);
  EXPECT_GT(told.input, 10U);
  EXPECT_EQ(told.over->outcome.pictures, told.pictures);
  EXPECT_GT(told.over->input_to_force.median.count(), 0);
  EXPECT_GT(told.over->input_to_picture.median, told.over->input_to_force.median);
  EXPECT_FALSE(told.over->outcome.motion.times_s.empty());
  // Over: nothing is moved any more, and nothing asked.
  EXPECT_NO_THROW(attempt.point({++number, {}}));
}

TEST(LiveAttempt, IsDoneByInstrumentsInTrocarsWhoseTipsPointersLead) {
  Told told;
  ExclusionOptions with_instruments = options();
  with_instruments.touch = Touch::kTrocar;
  LiveAttempt attempt(shared_body, with_instruments, 2, told.listener());
  ASSERT_TRUE(told.wait([&] { return told.pictures > 0; }));
  std::uint64_t number = 0;
  const auto is_over = [&] { return told.over.has_value(); };
  for (int step = 0; step < 400 && !told.wait(is_over, std::chrono::milliseconds(20)); ++step) {
    const double up = 0.15 * std::clamp((step - 30) / 60.0, 0.0, 1.0);
    attempt.point({++number, {{0, 0.5, 0.66 - up, 0}}});
  }
  ASSERT_TRUE(told.wait(is_over)) << told.share << told.failed;
  EXPECT_EQ(told.over->ending, Ending::kDone) << told.share;
  const ExclusionOutcome& outcome = told.over->outcome;
  EXPECT_GT(outcome.peak_wall_n, 1);
  EXPECT_EQ(outcome.faults.unsound + outcome.faults.jumps, 0U);
  // What is kept are the handles: outside, a third of a metre from where the tips were.
  const std::vector<Trocar> trocars = trocars_of(shared_body()->task(), 2);
  ASSERT_FALSE(outcome.motion.poses.empty());
  for (std::size_t i = 0; i < 2; ++i) {
    const sim::Pose& handle = outcome.motion.poses.back()[i];
    EXPECT_LT(trocars[i].pose.to_tool(handle.position_m).z(), -0.04);
    EXPECT_GT(instrument_at(trocars[i], handle).depth_m, 0.1);
  }
}

TEST(LiveAttempt, ThatIsGivenUpIsNotDone) {
  Told told;
  LiveAttempt attempt(shared_body, options(), 2, told.listener());
  ASSERT_TRUE(told.wait([&] { return told.pictures > 1; }));
  attempt.give_up();
  ASSERT_TRUE(told.wait([&] { return told.over.has_value(); }));
  EXPECT_EQ(told.over->ending, Ending::kGivenUp);
  EXPECT_FALSE(told.over->outcome.score.done);
}

TEST(LiveAttempt, WhoseTimeIsOverSaysSo) {
  Told told;
  ExclusionOptions brief = options();
  brief.most_s = 0.3;
  const LiveAttempt attempt(shared_body, brief, 2, told.listener());
  ASSERT_TRUE(told.wait([&] { return told.over.has_value(); }));
  EXPECT_EQ(told.over->ending, Ending::kTimeOver);
}

TEST(LiveAttempt, ThatIsLeftIsBrokenOff) {
  Told told;
  {
    const LiveAttempt attempt(shared_body, options(), 2, told.listener());
    ASSERT_TRUE(told.wait([&] { return told.pictures > 0; }));
  }
  ASSERT_TRUE(told.over);
  EXPECT_EQ(told.over->ending, Ending::kBrokenOff);
}

TEST(LiveAttempt, TellsWhyItCouldNotBegin) {
  Told told;
  const LiveAttempt attempt([]() -> std::shared_ptr<const ExclusionBody> { throw Error("no such organ"); },
                            options(), 2, told.listener());
  ASSERT_TRUE(told.wait([&] { return !told.failed.empty(); }));
  EXPECT_EQ(told.failed, "no such organ");
  EXPECT_FALSE(told.over);
  EXPECT_THROW(LiveAttempt(shared_body, options(), 0, told.listener()), UsageError);
}

TEST(LiveAttempt, RefusesInputThatIsNone) {
  Told told;
  LiveAttempt attempt(shared_body, options(), 2, told.listener());
  ASSERT_TRUE(told.wait([&] { return told.pictures > 0; }));
  EXPECT_THROW(attempt.point({1, {{4, 0.5, 0.5, 0}}}), UsageError);
  EXPECT_NO_THROW(attempt.point({1, {{2, 0.5, 0.5, 0}}}));
}

}  // namespace
}  // namespace kiroku::trainer
