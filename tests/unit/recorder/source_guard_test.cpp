#include "recorder/source/source_guard.h"

#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/session.h"
#include "tests/support/eventually.h"
#include "tests/support/moved_clock.h"
#include "tests/support/recording.h"
#include "tests/support/stuck_source.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using archive::GapCause;
using test::RecordedCase;
using test::RecorderBench;
using test::stuck_camera;
using test::StuckDriver;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr const char* kDevice = "/dev/video-of-a-test";

class SourceGuardTest : public testing::Test {
 protected:
  std::shared_ptr<SourceGuard> guard(SourceGuard::Maker make) {
    return guard({.silence = 5s, .ending = 5s, .most_stuck = 2}, std::move(make));
  }
  std::shared_ptr<SourceGuard> guard(SourceGuard::Limits limits, SourceGuard::Maker make,
                                     SourceGuard::LookUp look_up = parse_source_address) {
    const auto tell = [told = told](const std::string& sentence) {
      const std::lock_guard lock(told->mutex);
      told->sentences.push_back(sentence);
      if (told->then) told->then();
    };
    const auto made = std::make_shared<SourceGuard>(limits, tell, std::move(make), std::move(look_up), time);
    // Time goes on only while a thread waits in the driver that is not given up: how fast this machine opens
    // and reads what works is no matter of the guard's limits.
    movers.emplace_back([this, made](const std::stop_token& ending) {
      while (!ending.stop_requested()) {
        if (driver.waiting() > static_cast<int>(made->stuck())) time.move(20ms);
        std::this_thread::yield();
      }
    });
    return made;
  }
  [[nodiscard]] std::vector<std::string> sentences() const {
    const std::lock_guard lock(told->mutex);
    return told->sentences;
  }
  /// No thread of a test may be left when the process ends.
  void TearDown() override {
    driver.release();
    ASSERT_TRUE(test::eventually([] { return stuck_source_threads() == 0; }));
  }

  struct Told {
    std::mutex mutex;
    std::vector<std::string> sentences;
    std::function<void()> then;  // called after each
  };
  const std::shared_ptr<Told> told = std::make_shared<Told>();
  const SourceAddress address = parse_source_address(kDevice, Presence::kMayBeAbsent);
  CaseClock clock;
  StuckDriver driver;
  test::MovedClock time;
  std::vector<std::jthread> movers;  // the last: they use what is above
};

TEST_F(SourceGuardTest, GivesUpAThreadThatDoesNotComeBackFromReading) {
  const auto guarded = guard(stuck_camera(driver, 2));
  auto source = guarded->open(address, clock, {});
  EXPECT_TRUE(source->is_live());
  EXPECT_EQ(source->format().width, 64);
  EXPECT_TRUE(source->read().has_value());
  EXPECT_TRUE(source->read().has_value());
  EXPECT_THROW(source->read(), Error);
  EXPECT_THROW(source->read(), Error);
  EXPECT_EQ(guarded->stuck(), 1U);
  EXPECT_EQ(stuck_source_threads(), 1U);
  source.reset();
  EXPECT_EQ(driver.waiting(), 1);
  EXPECT_THAT(sentences(), ElementsAre("source '/dev/video-of-a-test' does not come back from its driver or "
                                       "file system (reading): its thread is left behind, 1 of at most 2"));
  driver.release();
  EXPECT_TRUE(test::eventually([&] { return guarded->stuck() == 0; }));
  EXPECT_EQ(guarded->given_up(), 1U);
  EXPECT_THAT(sentences().back(), HasSubstr("a thread that was left behind has come back"));
}

TEST_F(SourceGuardTest, GivesUpAThreadThatDoesNotComeBackFromOpening) {
  const auto guarded = guard(stuck_camera(driver, 2, "opening"));
  EXPECT_THROW(guarded->open(address, clock, {}), Error);
  EXPECT_EQ(guarded->stuck(), 1U);
  EXPECT_THAT(sentences(), ElementsAre(HasSubstr("(opening)")));
}

TEST_F(SourceGuardTest, GivesUpAThreadThatDoesNotComeBackFromClosing) {
  const auto guarded = guard(stuck_camera(driver, 2, "closing"));
  auto source = guarded->open(address, clock, {});
  EXPECT_TRUE(source->read().has_value());
  source.reset();
  EXPECT_EQ(guarded->stuck(), 1U);
  EXPECT_THAT(sentences(), ElementsAre(HasSubstr("(closing)")));
}

TEST_F(SourceGuardTest, WaitsForAThreadThatGivesSignsOfLife) {
  class Patient : public Source {
   public:
    Patient(Pulse* pulse, test::MovedClock& time) : pulse_(pulse), time_(time) {}
    [[nodiscard]] PictureFormat format() const override { return {}; }
    [[nodiscard]] Rational frame_rate() const override { return {}; }
    [[nodiscard]] bool is_live() const override { return true; }
    std::optional<TimedFrame> read() override {
      // Five times as long as a silent one may take.
      for (int i = 0; i < 2500; ++i) {
        time_.move(10ms);
        ++*pulse_;
      }
      return TimedFrame{};
    }

   private:
    Pulse* const pulse_;
    test::MovedClock& time_;
  };
  const auto guarded = guard([this](const SourceAddress&, const CaseClock&, const OpeningTerms& terms) {
    return std::make_unique<Patient>(terms.pulse, time);
  });
  EXPECT_TRUE(guarded->open(address, clock, {})->read().has_value());
  EXPECT_EQ(guarded->given_up(), 0U);
}

TEST_F(SourceGuardTest, AnInterruptionEndsTheWaitForAStuckThread) {
  const auto guarded = guard(stuck_camera(driver, 0));
  const auto source = guarded->open(address, clock, {});
  std::thread operator_thread([&] {
    while (driver.waiting() == 0) std::this_thread::yield();
    source->interrupt();
  });
  EXPECT_FALSE(source->read().has_value());
  operator_thread.join();
}

TEST_F(SourceGuardTest, AnInterruptionAfterTheThreadIsGivenUpHidesNoLoss) {
  const auto guarded = guard(stuck_camera(driver, 0));
  const auto source = guarded->open(address, clock, {});
  told->then = [&] { source->interrupt(); };
  EXPECT_THROW(source->read(), SourceSilent);
  EXPECT_FALSE(source->read().has_value()) << "what was told to end is asked for nothing more";
  told->then = {};
}

TEST_F(SourceGuardTest, OpensNoMoreThanSoManyUntilOneComesBack) {
  const auto guarded = guard(stuck_camera(driver, 0));
  for (int i = 0; i < 2; ++i) EXPECT_THROW(guarded->open(address, clock, {})->read(), Error);
  try {
    guarded->open(address, clock, {});
    FAIL() << "a third thread was made";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("cannot be opened again before one of its 2 stuck threads comes back"));
  }
  EXPECT_EQ(driver.waiting(), 2);
  driver.release();
  ASSERT_TRUE(test::eventually([&] { return guarded->stuck() == 0; }));
  EXPECT_NE(guarded->open(address, clock, {}), nullptr);
}

TEST_F(SourceGuardTest, KeepsWhatWentWrongAndWhatTheClockSays) {
  const auto refusing =
      guard([](const SourceAddress&, const CaseClock&, const OpeningTerms&) -> std::unique_ptr<Source> {
        throw UsageError("no such thing");
      });
  EXPECT_THROW(refusing->open(address, clock, {}), UsageError);
  const auto guarded = guard(stuck_camera(driver, 1));
  const auto source = guarded->open(address, clock, {});
  clock.restart();
  const auto frame = source->read();
  ASSERT_TRUE(frame.has_value());
  EXPECT_EQ(frame->time_ns, 0);
  EXPECT_EQ(stuck_source_threads(), 0U);
}

TEST_F(SourceGuardTest, DoesNotWaitForAFileSystemThatDoesNotAnswer) {
  std::atomic<int> looked = 0;
  const auto guarded = guard({.silence = 5s, .most_stuck = 1}, {},
                             [&looked, wait = driver.wait()](const std::string& text, Presence presence) {
                               ++looked;
                               wait();
                               return parse_source_address(text, presence);
                             });
  EXPECT_EQ(guarded->look_up("/mnt/films/a.ts?loop=1", Presence::kMayBeAbsent).kind, SourceKind::kFile);
  EXPECT_EQ(guarded->stuck(), 1U);
  EXPECT_EQ(guarded->look_up("/mnt/films/a.ts?loop=1", Presence::kMayBeAbsent).location, "/mnt/films/a.ts");
  EXPECT_THROW(guarded->look_up("/mnt/films/a.ts", Presence::kRequired), Error);
  EXPECT_EQ(looked, 1) << "no second thread is given to it";
  EXPECT_THROW(guarded->look_up("gopher://film", Presence::kMayBeAbsent), UsageError);
}

// --- in a session ------------------------------------------------------------------------------------------

class StuckSession : public SourceGuardTest {
 protected:
  [[nodiscard]] SessionOptions options(const std::shared_ptr<SourceGuard>& guarded) const {
    SessionOptions options = bench.options();
    options.video = {bench.stream("endoscope", kDevice), bench.stream("room", kRoom)};
    options.video[0].may_be_absent = true;
    options.video[0].guard = guarded;
    return options;
  }
  /// Runs until the status is as wanted, stops, and reads what was recorded.
  template <typename Condition>
  RecordedCase record_until(SessionOptions options, const Condition& holds) {
    Session session(std::move(options));
    result = session.run([&](const SessionStatus& status) {
      if (holds(status)) session.stop();
    });
    return bench.read(result.folder);
  }

  static constexpr const char* kRoom = "synthetic:pattern?size=64x48&rate=20";
  const RecorderBench bench;
  SessionResult result;
};

TEST_F(StuckSession, EndsAndStatesTheGapToTheEnd) {
  const auto guarded = guard(stuck_camera(driver, 5));
  const RecordedCase recorded = record_until(
      options(guarded), [](const SessionStatus& status) { return status.streams[0].given_up >= 1; });
  EXPECT_EQ(result.close_reason, "operator");
  EXPECT_FALSE(result.last.streams[0].live);
  EXPECT_GE(result.last.streams[0].stuck, 1U);
  EXPECT_EQ(result.last.streams[1].stuck, 0U);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_THAT(recorded.gaps_but_overload("room"), IsEmpty());
  const auto gaps = recorded.gaps("endoscope");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].cause, GapCause::kDeviceRemoved) << "the test's device is no file";
  EXPECT_EQ(gaps[0].span.start_ns, recorded.segments("endoscope").back().span.end_ns);
  EXPECT_GE(gaps[0].span.end_ns, recorded.segments("room").back().span.end_ns - 1'000'000'000);
  EXPECT_EQ(recorded.all<archive::CloseEntry>().at(0).reason, "operator");
}

TEST_F(StuckSession, EndsWhileTheDriverIsBeingWaitedFor) {
  const auto guarded = guard({.silence = 10000h, .ending = 5s}, stuck_camera(driver, 5));
  const RecordedCase recorded =
      record_until(options(guarded), [&](const SessionStatus&) { return driver.waiting() == 1; });
  EXPECT_EQ(result.close_reason, "operator");
  EXPECT_EQ(guarded->stuck(), 1U);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

TEST_F(StuckSession, StatesASilenceThatLastsUntilTheEnd) {
  const auto guarded = guard({.silence = 10000h, .ending = 5s}, stuck_camera(driver, 5));
  const RecordedCase recorded = record_until(options(guarded), [](const SessionStatus& status) {
    return status.streams[0].frames > 0 && status.now_ns - status.streams[0].last_ns > 1'200'000'000;
  });
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_THAT(recorded.gaps_but_overload("room"), IsEmpty());
  ASSERT_THAT(recorded.gaps("endoscope"), SizeIs(1));
  const archive::GapEntry gap = recorded.gaps("endoscope")[0];
  EXPECT_EQ(gap.cause, GapCause::kSignalLost);
  EXPECT_EQ(gap.span.start_ns, recorded.segments("endoscope").back().span.end_ns);
  EXPECT_GE(gap.span.end_ns - gap.span.start_ns, 1'000'000'000);
}

TEST_F(StuckSession, TheNextCaseKnowsOfTheThreadsOfTheOneBefore) {
  const auto guarded = guard(stuck_camera(driver, 0, "opening"));
  for (int i = 0; i < 3; ++i) {
    const RecordedCase recorded = record_until(
        options(guarded), [](const SessionStatus& status) { return status.streams[1].frames >= 5; });
    EXPECT_THAT(recorded.segments("endoscope"), IsEmpty());
    EXPECT_THAT(recorded.gaps("endoscope"), SizeIs(1));
    EXPECT_THAT(recorded.gaps_but_overload("room"), IsEmpty());
  }
  EXPECT_LE(driver.waiting(), 2);
  EXPECT_EQ(result.last.streams[0].stuck, guarded->stuck());
}

TEST_F(StuckSession, TakesTheSourceUpAgainWhenItsDriverWorks) {
  int opened = 0;
  const auto stuck = stuck_camera(driver, 3);
  const auto whole = stuck_camera(driver, 1000);
  const auto guarded = guard([&, stuck, whole](const SourceAddress& its_address, const CaseClock& its_clock,
                                               const OpeningTerms& terms) {
    return (opened++ == 0 ? stuck : whole)(its_address, its_clock, terms);
  });
  const RecordedCase recorded = record_until(
      options(guarded), [](const SessionStatus& status) { return status.streams[0].frames >= 15; });
  EXPECT_EQ(guarded->given_up(), 1U);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  ASSERT_THAT(recorded.gaps("endoscope"), SizeIs(1));
  EXPECT_GT(recorded.segments("endoscope").back().span.end_ns, recorded.gaps("endoscope")[0].span.end_ns);
}

}  // namespace
}  // namespace kiroku::recorder
