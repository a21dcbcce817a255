#include "recorder/daemon/room.h"

#include <atomic>
#include <fstream>
#include <future>
#include <mutex>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "archive/upkeep/standby_folder.h"
#include "base/error.h"
#include "crypto/age_file.h"
#include "crypto/encoding.h"
#include "recorder/daemon/daemon.h"
#include "recorder/daemon/kept_patient.h"
#include "tests/support/eventually.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/moved_clock.h"
#include "tests/support/observed_file_system.h"
#include "tests/support/recording.h"
#include "tests/support/stuck_source.h"
#include "tests/support/switched_authority.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using test::RecordedCase;
using test::RecorderBench;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr const char* kCamera = "synthetic:pattern?size=64x48&rate=20";
// Refused at once; libav makes no thread for it, which the thread sanitizer could not follow.
constexpr const char* kAbsentCamera = "tcp://127.0.0.1:9";

class RoomTest : public testing::Test {
 protected:
  RoomPlan plan(const std::vector<std::string>& cameras) {
    RoomPlan plan;
    plan.name = "or-1";
    plan.session = bench.options();
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      plan.session.video.push_back(bench.stream("camera-" + std::to_string(i), cameras[i]));
      plan.session.video.back().may_be_absent = true;
    }
    return plan;
  }
  RoomListener listener() {
    RoomListener told;
    told.warn = [this](const std::string& sentence) {
      const std::lock_guard guard(mutex);
      warnings.push_back(sentence);
    };
    told.left = [this](const std::string& sentence) {
      const std::lock_guard guard(mutex);
      left_open.push_back(sentence);
    };
    told.closed = [this](const SessionResult& result) {
      const std::lock_guard guard(mutex);
      results.push_back(result);
    };
    return told;
  }
  [[nodiscard]] std::size_t closed() {
    const std::lock_guard guard(mutex);
    return results.size();
  }

  [[nodiscard]] std::size_t told() {
    const std::lock_guard guard(mutex);
    return warnings.size();
  }

  /// A day's window begins so much later, in whatever zone this machine is.
  void open_window_in(std::chrono::seconds later) {
    std::tm midnight = local_time(time.utc());
    midnight.tm_hour = midnight.tm_min = midnight.tm_sec = 0;
    midnight.tm_isdst = -1;
    const auto day = std::chrono::system_clock::from_time_t(std::mktime(&midnight));
    time.set_utc(std::chrono::floor<UtcTime::duration>(day) - later);
  }

  const RecorderBench bench;
  test::MovedClock time;
  std::mutex mutex;
  std::vector<std::string> warnings;
  std::vector<std::string> left_open;
  std::vector<SessionResult> results;
};

TEST_F(RoomTest, RecordsFromStartToStopWithMarks) {
  Room room(plan({kCamera}), listener());
  EXPECT_EQ(room.status().state, RoomState::kIdle);
  const std::string id = room.start("operator");
  EXPECT_EQ(room.status().state, RoomState::kRecording);
  EXPECT_EQ(room.status().case_id, id);
  ASSERT_TRUE(test::eventually([&] { return room.status().session.streams.at(0).frames >= 10; }));
  room.mark("clip placed");
  EXPECT_EQ(room.stop("operator", true), id);
  EXPECT_EQ(room.status().state, RoomState::kIdle);
  ASSERT_EQ(closed(), 1U);
  EXPECT_EQ(results[0].close_reason, "operator");
  const RecordedCase recorded = bench.read(results[0].folder);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_THAT(recorded.all<archive::MarkEntry>(), SizeIs(1));
}

TEST_F(RoomTest, ADriverThatDoesNotComeBackHoldsNoRoom) {
  test::StuckDriver driver;
  RoomPlan asked = plan({kCamera, "/dev/video-of-a-test"});
  SourceGuard::Limits limits;
  limits.silence = limits.ending = 100ms;
  const auto guarded =
      std::make_shared<SourceGuard>(limits, SourceGuard::Tell{}, test::stuck_camera(driver, 5));
  asked.session.video[1].guard = guarded;
  {
    Room room(std::move(asked), listener());
    room.start("operator");
    ASSERT_TRUE(test::eventually([&] { return room.status().session.streams.at(1).given_up == 1; }));
    room.stop("operator", true);
    EXPECT_EQ(room.status().state, RoomState::kIdle);
  }
  {
    // Whatever was said, also right before the end.
    const std::lock_guard guard(mutex);
    EXPECT_THAT(warnings, Contains(HasSubstr("'/dev/video-of-a-test' has not answered for 0.1 s")));
  }
  const RecordedCase recorded = bench.read(results.at(0).folder);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_THAT(recorded.gaps("camera-1"), SizeIs(1));
  EXPECT_THAT(recorded.gaps("camera-0"), IsEmpty());
  driver.release();
  EXPECT_TRUE(test::eventually([&] { return guarded->stuck() == 0; }));
}

TEST_F(RoomTest, OneCaseAtATime) {
  Room room(plan({kCamera}), listener());
  EXPECT_THROW(room.stop("operator", true), UsageError);
  EXPECT_THROW(room.mark("nothing"), UsageError);
  const std::string first = room.start("operator");
  EXPECT_THROW(room.start("operator"), UsageError);
  room.stop("operator", true);
  EXPECT_NE(room.start("operator"), first);
  room.stop("operator", true);
  EXPECT_EQ(bench.cases(), 2U);
}

// Whoever prepared something while one case ran says so, and the next one is not given it.
TEST_F(RoomTest, WhatIsMeantForOneCaseReachesNoOther) {
  for (const std::chrono::milliseconds pre_roll : {0ms, 500ms}) {
    RoomPlan asked = plan({kCamera});
    asked.rules.pre_roll = pre_roll;
    Room room(std::move(asked), listener());
    const RoomState waits = pre_roll > 0ms ? RoomState::kStandby : RoomState::kIdle;
    const std::vector<std::function<void(const std::string&)>> deeds{
        [&](const std::string& meant) { room.mark("clip", meant); },
        [&](const std::string& meant) { room.add_subject(to_bytes(R"({"patient":"typed"})"), meant); },
        [&](const std::string& meant) {
          room.change_profile({{}, Profile::kLossless, "anna", ""}, meant);
        },
        [&](const std::string& meant) { room.stop("operator", true, meant); }};
    const auto refused = [&](const std::string& meant) {
      std::vector<std::string> sentences;
      for (const auto& deed : deeds) {
        try {
          deed(meant);
          ADD_FAILURE() << "deed " << sentences.size() << " was done";
        } catch (const UsageError& error) {
          sentences.emplace_back(error.what());
        }
      }
      return sentences;
    };
    const std::size_t before = closed();
    const std::string earlier = room.start("operator");
    EXPECT_EQ(room.mark("clip", earlier), earlier);
    EXPECT_EQ(room.stop("operator", true, earlier), earlier);
    ASSERT_TRUE(test::eventually([&] { return room.status().state == waits; }));
    EXPECT_THAT(refused(earlier),
                testing::Each("room or-1 is not recording case " + earlier + ": nothing was done"));
    const std::string later = room.start("operator");
    EXPECT_THAT(refused(earlier), testing::Each("room or-1 is recording case " + later + ", and not case " +
                                                earlier + ": nothing was done"));
    EXPECT_EQ(room.status().state, RoomState::kRecording);
    EXPECT_EQ(room.status().subject, SubjectState::kNone);
    for (const auto& deed : deeds) deed(later);
    ASSERT_EQ(closed(), before + 2);
    // The mark, the patient and the change of profile that meant it, once each.
    EXPECT_THAT(bench.read(results[before].folder).all<archive::MarkEntry>(), SizeIs(1));
    EXPECT_THAT(bench.read(results[before + 1].folder).all<archive::MarkEntry>(), SizeIs(3));
  }
}

TEST_F(RoomTest, BeginsWithoutASourceThatIsAbsentAndStatesTheGap) {
  Room room(plan({kCamera, kAbsentCamera}), listener());
  room.start("operator");
  ASSERT_TRUE(test::eventually([&] { return room.status().session.streams.at(0).frames >= 10; }));
  room.stop("operator", true);
  const RecordedCase recorded = bench.read(results.at(0).folder);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  const auto gaps = recorded.gaps("camera-1");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].span.start_ns, 0);
  EXPECT_EQ(gaps[0].cause, archive::GapCause::kSignalLost);
  EXPECT_THAT(warnings, Contains(HasSubstr("cannot be opened")));
}

TEST_F(RoomTest, TakesUpVitalSignsThatComeLate) {
  const std::string file = (bench / "monitor.csv").string();
  RoomPlan late = plan({kCamera});
  late.session.vitals.push_back(bench.stream("vitals", file));
  late.session.vitals.back().may_be_absent = true;
  Room room(std::move(late), listener());
  room.start("operator");
  std::ofstream(file) << "time,code,value,unit\n0.5,MDC_ECG_HEART_RATE,71,/min\n";
  ASSERT_TRUE(test::eventually([&] { return room.status().session.streams.at(1).frames >= 3; }))
      << room.status().session.streams.at(1).frames << " lines; " << room.status().problem;
  room.stop("operator", true);
  const RecordedCase recorded = bench.read(results.at(0).folder);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  const std::vector<std::string> lines = recorded.lines("vitals");
  ASSERT_THAT(lines, SizeIs(3));
  EXPECT_THAT(lines[0], HasSubstr("source-absent"));
  EXPECT_THAT(lines[1], HasSubstr("source-present"));
  EXPECT_THAT(lines[2], HasSubstr("\"value\":71"));
}

TEST_F(RoomTest, EndsACaseThatNoPictureReaches) {
  RoomPlan silent = plan({kAbsentCamera});
  silent.rules.stop_after_silence = 1s;
  Room room(std::move(silent), listener());
  room.start("operator");
  ASSERT_TRUE(test::eventually([&] { return closed() == 1; }));
  EXPECT_EQ(results[0].close_reason, "silence");
}

TEST_F(RoomTest, EndsACaseThatIsTooLong) {
  RoomPlan bounded = plan({kCamera});
  bounded.rules.longest_case = 1s;
  Room room(std::move(bounded), listener());
  room.start("operator");
  ASSERT_TRUE(test::eventually([&] { return closed() == 1; }));
  EXPECT_EQ(results[0].close_reason, "longest-case");
}

TEST_F(RoomTest, ScheduleStartsByItselfAndRestsAfterAPersonStoppedIt) {
  RoomPlan scheduled = plan({kCamera});
  scheduled.rules.schedule = Schedule::parse({"daily 00:00-12:00"});
  open_window_in(1s);
  Room room(std::move(scheduled), listener(), time);
  time.await_waiting(1);
  EXPECT_EQ(room.status().state, RoomState::kIdle) << "before the window";
  time.move(1s);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
  EXPECT_EQ(room.status().reason, "schedule");
  room.stop("operator", true);
  // The rule is looked at each second.
  for (int looks = 0; looks < 3; ++looks) {
    time.await_waiting(1);
    EXPECT_EQ(room.status().state, RoomState::kIdle);
    time.move(1s);
  }
  time.await_waiting(1);
  EXPECT_EQ(closed(), 1U);
  // The window ends, and another begins.
  time.move(12h);
  time.await_waiting(1);
  time.move(12h);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
  EXPECT_EQ(room.status().reason, "schedule");
}

TEST_F(RoomTest, NoRuleBeginsACaseWhileItIsAboutToEnd) {
  RoomPlan scheduled = plan({kCamera});
  scheduled.rules.schedule = Schedule::parse({"daily 00:00-12:00"});
  open_window_in(1s);
  Room room(std::move(scheduled), listener(), time);
  time.await_waiting(1);
  EXPECT_TRUE(room.begin_no_more());
  for (int looks = 0; looks < 3; ++looks) {
    time.move(1s);
    time.await_waiting(1);
    EXPECT_EQ(room.status().state, RoomState::kIdle);
  }
  room.may_begin_again();
  time.move(1s);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
  EXPECT_FALSE(room.begin_no_more());
}

TEST_F(RoomTest, ClosesTheCaseThatRunsWhenItEnds) {
  {
    Room room(plan({kCamera}), listener());
    room.start("operator");
    ASSERT_TRUE(test::eventually([&] { return room.status().session.streams.at(0).frames > 0; }));
  }
  ASSERT_EQ(closed(), 1U);
  EXPECT_EQ(results[0].close_reason, "shutdown");
  EXPECT_THAT(bench.read(results[0].folder).all<archive::CloseEntry>(), SizeIs(1));
}

TEST_F(RoomTest, BeginsNothingMoreOnceItIsShutDownAndCanStillBeAsked) {
  Room room(plan({kCamera}), listener());
  const std::string id = room.start("operator");
  room.shut_down();
  ASSERT_EQ(closed(), 1U);
  EXPECT_EQ(results[0].close_reason, "shutdown");
  EXPECT_EQ(room.status().case_id, id);
  EXPECT_EQ(room.status().state, RoomState::kIdle);
  EXPECT_EQ(room.running_case(), "");
  EXPECT_THROW(room.start("operator"), Error);
  EXPECT_THROW(room.stop("operator", true), UsageError);
  EXPECT_THROW(room.mark("too late"), UsageError);
  room.shut_down();
  EXPECT_EQ(closed(), 1U);
}

TEST_F(RoomTest, BeginsNothingWhileItIsAboutToEndAndWhoAsksWaits) {
  for (const bool goes_on : {true, false}) {
    Room room(plan({kCamera}), listener());
    EXPECT_TRUE(room.begin_no_more());
    std::future<std::string> asked = std::async(std::launch::async, [&]() -> std::string {
      try {
        return room.start("operator");
      } catch (const Error& error) {
        return error.what();
      }
    });
    if (goes_on) {
      room.may_begin_again();
      const std::string begun = asked.get();
      EXPECT_EQ(begun, room.status().case_id);
      EXPECT_FALSE(room.begin_no_more()) << "a case runs";
      room.stop("operator", true);
    } else {
      room.shut_down();
      EXPECT_EQ(asked.get(), "the recorder is being shut down");
    }
  }
  EXPECT_EQ(bench.cases(), 1U);
}

TEST_F(RoomTest, TheRecorderEndsForANewerOneOnlyWhereEveryRoomRests) {
  DaemonOptions options;
  options.rooms.push_back(plan({kCamera}));
  options.rooms.push_back(plan({kCamera}));
  options.rooms[1].name = "or-2";
  options.archive = bench.options().archive;
  Daemon daemon(std::move(options));
  daemon.handle({{"do", "start"}, {"room", "or-2"}});
  EXPECT_FALSE(daemon.begin_no_more());
  EXPECT_NO_THROW(daemon.handle({{"do", "start"}, {"room", "or-1"}})) << "the other room is as before";
  daemon.handle({{"do", "stop"}, {"room", "or-1"}});
  daemon.handle({{"do", "stop"}, {"room", "or-2"}});
  EXPECT_TRUE(daemon.begin_no_more());
}

TEST_F(RoomTest, ARemarkIsNoProblem) {
  DaemonOptions options;
  options.archive = bench.options().archive;
  options.problems = {"recording goes on without the viewer"};
  options.remarks = {"a rule names no stream"};
  Daemon daemon(std::move(options));
  daemon.add_remark("a newer version waits");
  const nlohmann::ordered_json status = daemon.handle({{"do", "status"}});
  EXPECT_EQ(status["problems"], nlohmann::ordered_json({"recording goes on without the viewer"}));
  EXPECT_EQ(status["remarks"], nlohmann::ordered_json({"a rule names no stream", "a newer version waits"}));
  EXPECT_THAT(daemon.metrics(),
              testing::AllOf(HasSubstr("kiroku_problems 1\n"), HasSubstr("kiroku_remarks 2\n")));
}

TEST_F(RoomTest, AnArchiveThatIsGoneIsToldAndRoomsAreAsBefore) {
  DaemonOptions options;
  options.rooms.push_back(plan({kCamera}));
  options.archive = bench.options().archive / "mount";
  options.listener = listener();
  std::filesystem::create_directory(options.archive);
  Daemon daemon(std::move(options));
  daemon.watch_disk();
  EXPECT_TRUE(daemon.handle({{"do", "status"}})["disk"].is_object());
  EXPECT_THAT(daemon.metrics(), HasSubstr("kiroku_archive_gone 0\n"));
  EXPECT_THAT(daemon.metrics(), HasSubstr("kiroku_problems 0\n"));
  std::filesystem::rename(bench.options().archive / "mount", bench.options().archive / "elsewhere");
  const nlohmann::ordered_json gone = daemon.handle({{"do", "status"}});
  EXPECT_TRUE(gone["disk"].is_null());
  ASSERT_EQ(gone["problems"].size(), 1U);
  EXPECT_THAT(gone["problems"][0].get<std::string>(), HasSubstr("cannot be looked at: No such file"));
  EXPECT_EQ(gone["rooms"][0]["state"], "idle");
  const std::string metrics = daemon.metrics();
  EXPECT_THAT(metrics, HasSubstr("kiroku_room_ended_by_error{room=\"or-1\"} 0\n"));
  EXPECT_THAT(metrics, HasSubstr("kiroku_archive_gone 1\n"));
  EXPECT_THAT(metrics, HasSubstr("kiroku_problems 1\n"));
  EXPECT_THAT(metrics, testing::Not(HasSubstr("kiroku_disk_free_bytes ")));
  daemon.watch_disk();
  daemon.watch_disk();
  EXPECT_EQ(told(), 1U) << "once";
  std::filesystem::rename(bench.options().archive / "elsewhere", bench.options().archive / "mount");
  daemon.watch_disk();
  EXPECT_EQ(told(), 2U);
  EXPECT_TRUE(daemon.handle({{"do", "status"}})["disk"].is_object());
}

TEST_F(RoomTest, ACaseBeginsWithWhatWasRecordedBefore) {
  RoomPlan ahead = plan({kCamera, kAbsentCamera});
  ahead.rules.pre_roll = 1s;
  Room room(std::move(ahead), listener());
  ASSERT_TRUE(test::eventually([&] { return room.status().session.now_ns > 3'000'000'000; }));
  EXPECT_EQ(room.status().state, RoomState::kStandby);
  EXPECT_THAT(room.status().problem, HasSubstr("tcp://127.0.0.1:9")) << "before a case begins without it";
  EXPECT_THROW(room.mark("too early"), UsageError);
  EXPECT_THROW(room.stop("operator", true), UsageError);
  EXPECT_EQ(bench.cases(), 0U);
  const std::string id = room.start("operator");
  const std::int64_t before = room.status().session.streams.at(0).last_ns;
  ASSERT_TRUE(
      test::eventually([&] { return room.status().session.streams.at(0).last_ns > before + 1'000'000'000; }));
  EXPECT_THROW(room.mark("clip\u202e decalp"), UsageError);
  room.mark("clip placed");
  room.stop("operator", true);
  ASSERT_EQ(closed(), 1U);
  const RecordedCase recorded = bench.read(results[0].folder);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  const auto open = recorded.all<archive::OpenEntry>().at(0);
  const std::int64_t decided_ns = recorded.entries().at(0).at.mono_ns;
  EXPECT_GT(open.begins_ns, 1'000'000'000);
  EXPECT_GE(decided_ns - open.begins_ns, 800'000'000) << "a second before, in segments of 200 ms";
  EXPECT_LE(decided_ns - open.begins_ns, 2'000'000'000);
  const auto segments = recorded.segments("camera-0");
  EXPECT_EQ(segments.front().index, 0U);
  const StreamStatus& counted = results[0].last.streams.at(0);
  const archive::StreamTotal total = recorded.all<archive::CloseEntry>().at(0).totals.at("camera-0");
  EXPECT_EQ(counted.segments, total.segments) << "without those that were discarded before";
  EXPECT_EQ(counted.frames, total.frames);
  EXPECT_EQ(counted.bytes, total.bytes);
  EXPECT_EQ(segments.front().span.start_ns, open.begins_ns);
  EXPECT_GT(segments.back().span.end_ns, decided_ns + 900'000'000);
  const auto gaps = recorded.gaps("camera-1");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].span.start_ns, open.begins_ns) << "what was before the case is no gap of it";
  EXPECT_THAT(recorded.all<archive::MarkEntry>(), SizeIs(1));
}

TEST_F(RoomTest, WhatNoCaseNeedsIsDiscardedAndStated) {
  {
    RoomPlan ahead = plan({kCamera});
    ahead.rules.pre_roll = 500ms;
    Room room(std::move(ahead), listener());
    ASSERT_TRUE(test::eventually([&] { return room.status().session.now_ns > 2'000'000'000; }));
    std::size_t segments = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(bench.options().archive)) {
      segments += entry.path().extension() == ".age" ? 1U : 0U;
    }
    EXPECT_LE(segments, 5U) << "of ten that were recorded";
  }
  EXPECT_EQ(closed(), 0U);
  for (const auto& entry : std::filesystem::directory_iterator(bench.options().archive)) {
    EXPECT_FALSE(entry.path().filename().string().starts_with(archive::kStandbyPrefix)) << entry.path();
  }
}

TEST_F(RoomTest, ASignalBeginsACaseAndAPersonEndsIt) {
  RoomPlan ahead = plan({kCamera});
  ahead.rules.pre_roll = 2s;
  ahead.rules.start_on_signal = "camera-0";
  ahead.rules.signal_lasts = 1s;
  Room room(std::move(ahead), listener());
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
  EXPECT_EQ(room.status().reason, "signal");
  const std::string id = room.status().case_id;
  room.stop("operator", true);
  // It goes on all the time that would begin a case, and longer.
  ASSERT_TRUE(test::eventually([&] {
    const RoomStatus status = room.status();
    return status.state == RoomState::kStandby && status.session.now_ns > 2'500'000'000;
  })) << "the same signal";
  ASSERT_EQ(closed(), 1U);
  EXPECT_EQ(results[0].case_id, id);
}

/// What a test makes known.
class StatedProcedure : public ProcedureSource {
 public:
  /// "": nobody is known.
  void state(const std::string& patient) {
    const std::lock_guard guard(mutex_);
    data_.reset();
    if (patient.empty()) return;
    data_ = ProcedureData{};
    data_->patient_id = patient;
  }
  [[nodiscard]] ProcedureChoice choose(UtcTime /*at*/) const override {
    if (broken) throw Error("it broke");
    const std::lock_guard guard(mutex_);
    return {data_};
  }
  [[nodiscard]] std::vector<ProcedureData> list(UtcTime /*at*/) const override {
    const std::lock_guard guard(mutex_);
    return data_ ? std::vector{*data_} : std::vector<ProcedureData>();
  }
  void hurry() override { ++hurried; }
  [[nodiscard]] std::optional<Clock::Duration> changed_at() const override {
    const std::lock_guard guard(mutex_);
    return changed_;
  }
  /// Somebody came to the room, or left it, now.
  void change() {
    const std::lock_guard guard(mutex_);
    changed_ = Clock::system().since_boot();
  }
  [[nodiscard]] std::vector<ProcedureWay> ways() const override {
    return {{"worklist", false, "does not answer"}};
  }
  void ended(const ProcedureData& data, UtcTime /*at*/) override { note(data.patient_id); }
  void cut_off(const ProcedureData& data, UtcTime /*at*/) override { note("cut off " + data.patient_id); }
  /// Of whom cases have ended, or were cut off, since this was asked last.
  std::vector<std::string> take_ended() {
    const std::lock_guard guard(mutex_);
    return std::exchange(ended_of_, {});
  }
  std::atomic<int> hurried = 0;
  std::atomic<bool> broken = false;

 private:
  void note(const std::string& one) {
    const std::lock_guard guard(mutex_);
    ended_of_.push_back(one);
  }
  mutable std::mutex mutex_;
  std::vector<std::string> ended_of_;
  std::optional<ProcedureData> data_;
  std::optional<Clock::Duration> changed_;
};

// The patient before lay there until then.
TEST_F(RoomTest, WhatWasRecordedBeforeAPatientCameIsNoneOfTheirCase) {
  const auto procedure = std::make_shared<StatedProcedure>();
  procedure->state("4711");
  procedure->change();  // before anything is recorded
  RoomPlan ahead = plan({kCamera});
  ahead.session.vitals.push_back(bench.stream("vitals", "synthetic:patient?waves=0"));
  ahead.procedure = procedure;
  ahead.rules.pre_roll = 1min;
  for (const bool at_once : {false, true}) {
    UtcTime came;
    {
      Room room(ahead, listener());
      ASSERT_TRUE(test::eventually([&] { return room.status().session.now_ns > 2'000'000'000; }));
      came = utc_now();
      procedure->change();
      if (!at_once) {
        const std::int64_t then = room.status().session.now_ns;
        ASSERT_TRUE(test::eventually([&] { return room.status().session.now_ns > then + 1'500'000'000; }));
      }
      room.start("operator");
      const std::int64_t before = room.status().session.streams.at(0).last_ns;
      ASSERT_TRUE(test::eventually(
          [&] { return room.status().session.streams.at(0).last_ns > before + 1'000'000'000; }));
      room.stop("operator", true);
    }
    const RecordedCase recorded = bench.read(results.at(at_once ? 1 : 0).folder);
    EXPECT_THAT(recorded.broken_rules(), IsEmpty());
    const archive::Moment opened = recorded.entries().at(0).at;
    const auto utc_of = [&](std::int64_t mono_ns) {
      return opened.utc - std::chrono::microseconds((opened.mono_ns - mono_ns) / 1000);
    };
    for (const char* stream : {"camera-0", "vitals"}) {
      const auto segments = recorded.segments(stream);
      ASSERT_FALSE(segments.empty());
      EXPECT_EQ(segments.front().index, 0U);
      EXPECT_GE(utc_of(segments.front().span.start_ns) - came, -1ms) << stream;
      // Nothing of the case itself is lost for that.
      EXPECT_LE(segments.front().span.start_ns, opened.mono_ns + 1'000'000'000) << stream;
    }
    const auto open = recorded.all<archive::OpenEntry>().at(0);
    EXPECT_LT(open.begins_ns == 0 ? opened.mono_ns : open.begins_ns, opened.mono_ns + 1);
    EXPECT_GE(opened.mono_ns - (open.begins_ns == 0 ? opened.mono_ns : open.begins_ns),
              at_once ? 0 : 1'000'000'000)
        << "since then it is their own";
    ASSERT_THAT(recorded.lines("events"), SizeIs(1));
    EXPECT_THAT(recorded.lines("events")[0],
                HasSubstr(R"(\"kind\":\"ahead-left-out\",\"text\":\"what was recorded ahead before 20)"));
    EXPECT_THAT(recorded.all<archive::MarkEntry>(), SizeIs(1)) << "the ledger commits to it";
  }
}

TEST_F(RoomTest, WithoutAChangeOfPatientsACaseBeginsWithAllThatWasRecordedAhead) {
  const auto procedure = std::make_shared<StatedProcedure>();
  procedure->change();
  RoomPlan ahead = plan({kCamera});
  ahead.procedure = procedure;
  ahead.rules.pre_roll = 1min;
  {
    Room room(std::move(ahead), listener());
    ASSERT_TRUE(test::eventually([&] { return room.status().session.now_ns > 2'000'000'000; }));
    room.start("operator");
    room.stop("operator", true);
  }
  const RecordedCase recorded = bench.read(results.at(0).folder);
  EXPECT_GE(recorded.entries().at(0).at.mono_ns - recorded.segments("camera-0").front().span.start_ns,
            1'500'000'000);
  for (const std::string& event : recorded.lines("events"))
    EXPECT_THAT(event, testing::Not(HasSubstr("ahead-left-out")));
}

TEST_F(RoomTest, ProcedureDataBecomeTheSubjectUnlessAPersonGaveOne) {
  for (const std::chrono::milliseconds pre_roll : {0ms, 500ms}) {
    const auto procedure = std::make_shared<StatedProcedure>();
    procedure->state("4711");
    RoomPlan known = plan({kCamera});
    known.procedure = procedure;
    known.rules.pre_roll = pre_roll;
    Room room(std::move(known), listener());
    room.start("operator");
    EXPECT_EQ(room.status().subject, SubjectState::kFound);
    room.stop("operator", true);
    ASSERT_TRUE(test::eventually(
        [&] { return room.status().state == (pre_roll > 0ms ? RoomState::kStandby : RoomState::kIdle); }));
    room.start("operator", to_bytes("{\"patient\":\"given\"}"));
    EXPECT_EQ(room.status().subject, SubjectState::kGiven);
    room.stop("operator", true);
    EXPECT_EQ(procedure->hurried, 0);
  }
  ASSERT_EQ(closed(), 4U);
  for (const std::size_t found : {0U, 2U}) {
    EXPECT_THAT(bench.read(results[found].folder).subject(), HasSubstr("4711"));
    EXPECT_EQ(bench.read(results[found + 1].folder).subject(), "{\"patient\":\"given\"}");
  }
}

TEST_F(RoomTest, ProcedureDataThatComeLateAreAnEventOfTheCase) {
  const auto procedure = std::make_shared<StatedProcedure>();
  RoomPlan unknown = plan({kCamera});
  unknown.procedure = procedure;
  Room room(std::move(unknown), listener());
  room.start("operator");
  EXPECT_EQ(room.status().subject, SubjectState::kNone);
  EXPECT_THAT(room.status().problem, HasSubstr("worklist: does not answer"));
  EXPECT_EQ(procedure->hurried, 1);
  procedure->state("4711");
  ASSERT_TRUE(test::eventually([&] { return room.status().subject == SubjectState::kLate; }));
  room.stop("operator", true);
  const RecordedCase recorded = bench.read(results.at(0).folder);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_FALSE(recorded.all<archive::OpenEntry>().at(0).subject);
  EXPECT_THAT(recorded.all<archive::MarkEntry>(), SizeIs(2));
  const std::vector<std::string> events = recorded.lines("events");
  ASSERT_THAT(events, SizeIs(2));
  EXPECT_THAT(events[0], HasSubstr("subject-missing"));
  EXPECT_THAT(events[1], HasSubstr(R"(\"subject\":{\"patient\":{\"id\":\"4711\"}})"));
}

TEST_F(RoomTest, APersonSaysWhomTheCaseIsAboutWhileItRuns) {
  const auto procedure = std::make_shared<StatedProcedure>();
  RoomPlan unknown = plan({kCamera});
  unknown.procedure = procedure;
  Room room(std::move(unknown), listener());
  EXPECT_THROW(room.add_subject(to_bytes("{}")), UsageError) << "nothing runs";
  room.start("operator");
  EXPECT_THROW(room.add_subject(to_bytes("not JSON")), Error);
  EXPECT_EQ(room.status().subject, SubjectState::kNone);
  room.add_subject(to_bytes(R"({"patient":"typed"})"));
  EXPECT_EQ(room.status().subject, SubjectState::kLate);
  // What comes by itself afterwards does not replace what a person said.
  procedure->state("4711");
  room.add_subject(to_bytes(R"({"patient":"corrected"})"));
  room.stop("operator", true);
  const RecordedCase recorded = bench.read(results.at(0).folder);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  const std::vector<std::string> events = recorded.lines("events");
  ASSERT_THAT(events, SizeIs(3));
  EXPECT_THAT(events[1], HasSubstr("typed"));
  EXPECT_THAT(events[2], HasSubstr("corrected"));
}

// A person says whom a case is about at its last moment; the next one begins before they are heard out.
TEST_F(RoomTest, APatientSaidAtTheLastMomentKeepsNobodyFromLookingForTheNextOne) {
  std::promise<void> release;
  const std::shared_future<void> released = release.get_future().share();
  std::atomic<bool> held = false;
  RoomListener told = listener();
  told.warn = [&](const std::string& sentence) {
    if (!sentence.starts_with("the procedure became known")) return;
    held = true;
    released.wait();
  };
  const auto procedure = std::make_shared<StatedProcedure>();
  RoomPlan unknown = plan({kCamera});
  unknown.procedure = procedure;
  unknown.profile_rules = {{"liver", {"liver"}, {}, Profile::kLossless, {}}};
  Room room(std::move(unknown), std::move(told));
  const std::string earlier = room.start("operator");
  auto said = std::async(std::launch::async, [&room] {
    return room.add_subject(to_bytes(R"({"procedure":{"description":"liver resection"}})"));
  });
  ASSERT_TRUE(test::eventually([&] { return held.load(); }));
  room.stop("operator", true);
  EXPECT_NE(room.start("operator"), earlier);
  release.set_value();
  EXPECT_EQ(said.get(), earlier) << "of which it was said";
  EXPECT_EQ(room.status().subject, SubjectState::kNone);
  procedure->state("4711");
  EXPECT_TRUE(test::eventually([&] { return room.status().subject == SubjectState::kLate; }));
  room.stop("operator", true);
}

TEST_F(RoomTest, ListsWhatCouldBeDoneInIt) {
  EXPECT_THAT(Room(plan({kCamera}), listener()).procedures(), IsEmpty()) << "nothing is configured";
  const auto procedure = std::make_shared<StatedProcedure>();
  procedure->state("4711");
  RoomPlan known = plan({kCamera});
  known.procedure = procedure;
  Room room(std::move(known), listener());
  ASSERT_THAT(room.procedures(), SizeIs(1));
  EXPECT_EQ(room.procedures()[0].patient_id, "4711");
  EXPECT_GT(procedure->hurried, 0) << "the list is asked for anew";
}

TEST_F(RoomTest, ASourceOfProcedureDataThatFailsEndsNothing) {
  const auto procedure = std::make_shared<StatedProcedure>();
  procedure->broken = true;
  RoomPlan broken = plan({kCamera});
  broken.procedure = procedure;
  Room room(std::move(broken), listener());
  room.start("operator");
  ASSERT_TRUE(test::eventually([&] { return room.status().problem.find("it broke") != std::string::npos; }));
  procedure->broken = false;
  procedure->state("4711");
  ASSERT_TRUE(test::eventually([&] { return room.status().subject == SubjectState::kLate; }));
  room.stop("operator", true);
  EXPECT_EQ(results.at(0).close_reason, "operator");
}

TEST_F(RoomTest, TellsWhyNoCaseCouldBeBegun) {
  RoomPlan impossible = plan({kCamera});
  impossible.session.archive = bench / "no-such-folder";
  Room room(std::move(impossible), listener());
  EXPECT_THROW(room.start("operator"), Error);
  EXPECT_EQ(room.status().state, RoomState::kIdle);
  EXPECT_THAT(room.status().problem, HasSubstr("no-such-folder"));
}

TEST_F(RoomTest, WaitsLongerAfterEachCaseThatTheScheduleCouldNotBegin) {
  test::FaultFileSystem faults(bench.options().archive);
  faults.fail("make_folder .new-", EIO);  // a case's folder, before it has its name
  RoomPlan scheduled = plan({kCamera});
  scheduled.session.files = &faults;
  scheduled.rules.schedule = Schedule::parse({"daily 00:00-24:00"});
  const Room room(std::move(scheduled), listener(), time);
  const auto told_of = [&](std::size_t tries, const std::string& next) {
    ASSERT_TRUE(test::eventually([&] { return told() >= tries; }));
    const std::lock_guard guard(mutex);
    EXPECT_THAT(warnings.at(tries - 1), AllOf(HasSubstr("could be begun"), HasSubstr(next)));
  };
  time.await_waiting(1);
  time.move(1s);
  told_of(1, "the next try is in 1 s");
  time.await_waiting(1);
  time.move(1s);
  told_of(2, "the next try is in 2 s");
  time.await_waiting(1);
  time.move(1s);
  time.await_waiting(1);
  EXPECT_EQ(told(), 2U) << "too early";
  time.move(1s);
  told_of(3, "the next try is in 4 s");
}

TEST_F(RoomTest, APersonNeedNotWaitForTheNextTry) {
  test::FaultFileSystem faults(bench.options().archive);
  faults.fail("make_folder .new-", EIO);
  RoomPlan ahead = plan({kCamera});
  ahead.session.files = &faults;
  ahead.rules.pre_roll = 1s;
  Room room(std::move(ahead), listener());
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kStandby; }));
  EXPECT_THROW(room.start("operator"), Error);
  faults.heal();
  EXPECT_FALSE(room.start("operator").empty());
  room.stop("operator", true);
}

TEST_F(RoomTest, ACaseThatADiskKeepsFromBeingClosedIsToldAsLeftOpen) {
  test::FaultFileSystem faults(bench.options().archive);
  RoomPlan failing = plan({kCamera});
  failing.session.files = &faults;
  std::string id;
  {
    Room room(std::move(failing), listener());
    id = room.start("operator");
    faults.fail("sync", EIO);
    ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kIdle; }));
    EXPECT_THAT(room.status().problem, HasSubstr(id + " could not be closed; the recorder's next start"));
  }
  const std::lock_guard guard(mutex);
  EXPECT_THAT(left_open, testing::ElementsAre(HasSubstr(id + " could not be closed")));
  EXPECT_THAT(results, IsEmpty());
}

// "kiroku case stop && kiroku export …" goes on only with a case that is closed.
TEST_F(RoomTest, WhoWaitsForTheEndIsToldThatItCouldNotBeClosed) {
  test::FaultFileSystem faults(bench.options().archive);
  RoomPlan failing = plan({kCamera});
  failing.session.files = &faults;
  Room room(std::move(failing), listener());
  const std::string id = room.start("operator");
  faults.fail("write " + id + "/ledger.jsonl", EIO);
  std::string refused = "nothing";
  try {
    room.stop("operator", true);
  } catch (const Error& error) {
    refused = error.what();
  }
  // A line may come before the end and fail, too: then there is nothing to end.
  EXPECT_THAT(refused, testing::AnyOf(HasSubstr(id + " could not be closed"), HasSubstr("is not recording")));
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kIdle; }));
  faults.heal();
  // Of the next one it says nothing.
  const std::string next = room.start("operator");
  EXPECT_EQ(room.stop("operator", true), next);
}

TEST_F(RoomTest, SaysThatNothingIsRecordedSinceADiskErrorEndedACase) {
  test::FaultFileSystem faults(bench.options().archive);
  RoomPlan failing = plan({kCamera});
  failing.session.files = &faults;
  Room room(std::move(failing), listener());
  const std::string first = room.start("operator");
  EXPECT_FALSE(room.status().ended_by_error);
  faults.fail("sync", EIO);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kIdle; }));
  EXPECT_TRUE(room.status().ended_by_error);
  EXPECT_THAT(room.status().problem, HasSubstr("nothing is recorded any more: begin another one"));
  faults.heal();
  EXPECT_NE(room.start("operator"), first);
  EXPECT_FALSE(room.status().ended_by_error);
  room.stop("operator", true);
  EXPECT_FALSE(room.status().ended_by_error);
}

TEST_F(RoomTest, AfterADiskErrorAnotherCaseBeginsWhereTheRoomMayGoOn) {
  test::FaultFileSystem faults(bench.options().archive);
  RoomPlan failing = plan({kCamera});
  failing.session.files = &faults;
  failing.rules.resume_within = 10min;
  Room room(std::move(failing), listener(), time);
  const std::string first = room.start("operator", to_bytes(bytes_of(R"({"patient":{"id":"7"}})")));
  faults.fail("sync", EIO);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kIdle; }));
  EXPECT_TRUE(room.status().ended_by_error);
  EXPECT_THAT(room.status().problem,
              HasSubstr("nothing is recorded until another one is begun; the next try"));
  // The disk still fails, and is tried again.
  const std::size_t before = told();
  time.await_waiting(1);
  time.move(1s);
  ASSERT_TRUE(test::eventually([&] { return told() > before; }));
  EXPECT_TRUE(room.status().ended_by_error);
  faults.heal();
  time.await_waiting(1);
  time.move(5s);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
  const RoomStatus status = room.status();
  EXPECT_NE(status.case_id, first);
  EXPECT_FALSE(status.ended_by_error);
  EXPECT_EQ(status.subject, SubjectState::kCarriedOver);
  room.stop("operator", true);
  EXPECT_EQ(bench.read(bench.options().archive / status.case_id).subject(), R"({"patient":{"id":"7"}})");
}

/// A room that goes on after an error, with somebody in the hospital who is planned around now.
class GoingOn : public RoomTest {
 protected:
  [[nodiscard]] RoomPlan failing_plan(std::chrono::milliseconds pre_roll) {
    RoomPlan failing = plan({kCamera});
    failing.session.files = &faults;
    failing.procedure = procedure;
    failing.rules.pre_roll = pre_roll;
    return failing;
  }
  /// An error ends the case, and the next patient is booked meanwhile; the case after it, which runs.
  std::string break_and_go_on(Room& room) {
    const std::string before = room.status().case_id;
    faults.fail("create " + before + "/segments", ENOSPC);
    EXPECT_TRUE(test::eventually([&] { return room.status().ended_by_error; }));
    faults.heal();
    procedure->state("next");
    EXPECT_TRUE(test::eventually([&] {
      time.move(1s);
      const RoomStatus now = room.status();
      return now.state == RoomState::kRecording && now.case_id != before;
    }));
    return room.status().case_id;
  }
  /// Nothing is looked up while the case runs, either.
  /// That no subject is known is told once the case records, so a moment after.
  static void expect_told(const Room& room, std::string_view words) {
    EXPECT_TRUE(test::eventually([&] { return room.status().problem.find(words) != std::string::npos; }))
        << room.status().problem;
  }
  void expect_no_late_subject(Room& room) {
    for (int looks = 0; looks < 2; ++looks) {
      time.move(2s);
      const Clock::Time moved = time.now();
      EXPECT_TRUE(test::eventually([&] { return room.heartbeat() >= moved; }));
    }
    EXPECT_EQ(room.status().subject, SubjectState::kNone);
  }
  [[nodiscard]] RecordedCase read(const std::string& id) const {
    return bench.read(bench.options().archive / id);
  }

  test::FaultFileSystem faults{bench.options().archive};
  const std::shared_ptr<StatedProcedure> procedure = std::make_shared<StatedProcedure>();
};

TEST_F(GoingOn, AfterAnErrorTheCaseIsAboutWhomItWasSaidToBeLast) {
  for (const std::chrono::milliseconds pre_roll : {0ms, 500ms}) {
    RoomPlan failing = failing_plan(pre_roll);
    failing.rules.resume_within = 10min;
    Room room(std::move(failing), listener(), time);
    room.start("operator", to_bytes(R"({"patient":"wrong"})"));
    room.add_subject(to_bytes(R"({"patient":"corrected"})"));
    const std::string second = break_and_go_on(room);
    EXPECT_EQ(room.status().subject, SubjectState::kCarriedOver);
    const std::string third = break_and_go_on(room);
    EXPECT_EQ(room.status().subject, SubjectState::kCarriedOver);
    room.stop("operator", true);
    EXPECT_EQ(read(second).subject(), R"({"patient":"corrected"})");
    EXPECT_EQ(read(third).subject(), R"({"patient":"corrected"})");
  }
}

/// Cases that can be found by who has the site's search key.
class Findable : public GoingOn {
 protected:
  Findable() {
    std::ofstream(bench / "search.key", std::ios::binary) << site.key_for("or-1").text().text();
    std::filesystem::permissions(bench / "search.key", std::filesystem::perms(0600));
  }
  [[nodiscard]] std::string about(const std::string& id) const {
    std::ifstream in(search::note_file(bench / "search", id), std::ios::binary);
    const auto note = search::SearchNote::parse(std::string{std::istreambuf_iterator<char>(in), {}});
    if (!note) return "no note";
    search::NoteReader reader(site.clone());
    for (const char* patient : {"1", "2"}) {
      const search::SearchWords asked{patient, "", "", ""};
      if (reader.read("or-1", id, *note, asked) == search::NoteReader::Answer::kFits) return patient;
    }
    return "nobody";
  }
  const search::SiteKey site = search::SiteKey::make();
  const std::shared_ptr<search::NoteWriter> notes =
      std::make_shared<search::NoteWriter>(bench / "search.key", bench / "search");
};

TEST_F(Findable, ByWhomTheCaseIsAboutAndTheCasesThatGoOnWithIt) {
  for (const std::chrono::milliseconds pre_roll : {0ms, 500ms}) {
    RoomPlan failing = failing_plan(pre_roll);
    failing.rules.resume_within = 10min;
    failing.session.search = notes;
    Room room(std::move(failing), listener(), time);
    room.start("operator", to_bytes(R"({"patient":{"id":"1"}})"));
    const std::string first = room.status().case_id;
    EXPECT_EQ(about(first), "1");
    room.add_subject(to_bytes(R"({"patient":{"id":"0002"}})"));
    EXPECT_EQ(about(first), "2") << "corrected";
    const std::string second = break_and_go_on(room);
    const std::string third = break_and_go_on(room);
    EXPECT_EQ(about(second), "2");
    EXPECT_EQ(about(third), "2");
    room.stop("operator", true);
    room.start("operator", to_bytes(R"({"patient":{"id":"1"}})"));
    EXPECT_EQ(about(room.status().case_id), "1") << "another operation";
    room.stop("operator", true);
  }
}

TEST_F(Findable, AfterACrashByWhomTheCaseBeforeWasAbout) {
  const std::string earlier = "20260805T081502Z-3f9c21ab", later = "20260805T091502Z-3f9c21ab";
  notes->write(earlier, {"1", "", "", ""});
  RoomPlan resumed = plan({kCamera});
  resumed.session.search = notes;
  resumed.resume.emplace();
  resumed.resume->case_id = later;
  resumed.resume->earlier = {earlier, 7, {}};
  resumed.resume->reason = "operator";
  resumed.resume->within = 10min;
  resumed.resume->sealed_subject = crypto::seal_bytes(to_bytes("{}"), bench.options().event_recipients);
  Room room(std::move(resumed), listener(), time);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
  EXPECT_EQ(about(later), "1");
  room.stop("operator", true);
}

TEST_F(Findable, WhatCannotBeNotedIsToldAndRecorded) {
  RoomPlan unnoted = plan({kCamera});
  unnoted.session.search = notes;
  std::filesystem::remove(bench / "search.key");
  Room room(std::move(unnoted), listener());
  const std::string id = room.start("operator", to_bytes(R"({"patient":{"id":"1"}})"));
  EXPECT_TRUE(test::eventually([&] {
    return room.status().session.last_problem.find("cannot be found by its patient") != std::string::npos;
  }));
  room.stop("operator", true);
  EXPECT_EQ(about(id), "no note");
  EXPECT_THAT(read(id).broken_rules(), IsEmpty());
}

TEST_F(GoingOn, AfterAnErrorNoPatientIsLookedUpForAnOperationThatHadNone) {
  for (const std::chrono::milliseconds pre_roll : {0ms, 500ms}) {
    procedure->state("");
    RoomPlan failing = failing_plan(pre_roll);
    failing.rules.resume_within = 10min;
    Room room(std::move(failing), listener(), time);
    room.start("operator");
    const std::string second = break_and_go_on(room);
    EXPECT_EQ(room.status().subject, SubjectState::kNone);
    expect_told(room, "a person must say whom it is about");
    expect_no_late_subject(room);
    EXPECT_THAT(room.procedures(), SizeIs(1)) << "to choose from";
    room.stop("operator", true);
    EXPECT_FALSE(read(second).all<archive::OpenEntry>().at(0).subject);
  }
}

// Whose signal it is nobody knows; that there was a patient is not to be forgotten, either.
TEST_F(GoingOn, ASignalAfterAnErrorBeginsACaseThatIsToldToBeWithoutThePatientOfBefore) {
  RoomPlan failing = failing_plan(500ms);
  failing.rules.start_on_signal = "camera-0";
  failing.rules.signal_lasts = 1s;
  Room room(std::move(failing), listener(), time);
  room.start("operator", to_bytes(R"({"patient":"typed"})"));
  const std::string second = break_and_go_on(room);
  EXPECT_EQ(room.status().reason, "signal");
  EXPECT_EQ(room.status().subject, SubjectState::kNone);
  expect_told(room, "after one whose subject it is not given");
  room.stop("operator", true);
  EXPECT_FALSE(read(second).all<archive::OpenEntry>().at(0).subject);
}

TEST_F(GoingOn, ASubjectThatTheNoteDoesNotProveIsToldToBeWithheld) {
  RoomPlan resumed = plan({kCamera});
  resumed.procedure = procedure;
  resumed.resume.emplace();
  resumed.resume->case_id = "20260805T091502Z-3f9c21ab";
  resumed.resume->earlier = {"20260805T081502Z-3f9c21ab", 7, {}};
  resumed.resume->reason = "operator";
  resumed.resume->within = 10min;
  resumed.resume->is_subject_withheld = true;
  Room room(std::move(resumed), listener(), time);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
  expect_told(room, "after one whose subject it is not given");
  room.stop("operator", true);
}

TEST_F(GoingOn, AWindowThatGoesOnAfterAnErrorKeepsItsPatient) {
  procedure->state("first");
  RoomPlan failing = failing_plan(0ms);
  failing.rules.schedule = Schedule::parse({"daily 00:00-24:00"});
  Room room(std::move(failing), listener(), time);
  time.await_waiting(1);
  time.move(1s);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
  EXPECT_EQ(room.status().subject, SubjectState::kFound);
  const std::string second = break_and_go_on(room);
  EXPECT_EQ(room.status().reason, "schedule");
  EXPECT_EQ(room.status().subject, SubjectState::kCarriedOver);
  room.stop("operator", true);
  EXPECT_THAT(read(second).subject(), HasSubstr("first"));
}

TEST_F(GoingOn, AfterACrashNoPatientIsLookedUpForAnOperationThatHadNone) {
  procedure->state("next");
  RoomPlan resumed = plan({kCamera});
  resumed.procedure = procedure;
  resumed.resume.emplace();
  resumed.resume->case_id = "20260805T091502Z-3f9c21ab";
  resumed.resume->earlier = {"20260805T081502Z-3f9c21ab", 7, {}};
  resumed.resume->reason = "operator";
  resumed.resume->within = 10min;
  Room room(std::move(resumed), listener(), time);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
  EXPECT_EQ(room.status().carries_on, "20260805T081502Z-3f9c21ab");
  expect_told(room, "a person must say whom it is about");
  expect_no_late_subject(room);
  room.add_subject(to_bytes(R"({"patient":"chosen"})"));
  EXPECT_EQ(room.status().subject, SubjectState::kLate);
  room.stop("operator", true);
}

// The subject is sealed; by which numbers monitors name its patient is kept in memory alone.
TEST_F(GoingOn, AfterACrashMonitorsAndPlanAreComparedWithWhomTheCaseWasAbout) {
  std::ofstream(bench / "monitor.hl7", std::ios::binary)
      << "MSH|^~\\&|MON|W|||20260101120001+0000||ORU^R01|1|P|2.6\rPID|||A1^^^H^MR\rPV1||I|OR1\rOBX|1|NM|"
         "147842^MDC_ECG_HEART_RATE^MDC|1|72\r";
  const auto with_monitor = [&] {
    RoomPlan monitored = plan({kCamera});
    monitored.session.vitals.push_back(bench.stream("vitals", (bench / "monitor.hl7").string()));
    return monitored;
  };
  Bytes memory;
  std::string first;
  {
    RoomPlan kept = with_monitor();
    kept.session.vitals.clear();
    Bytes at_crash;
    kept.memory.keep = [&](ByteView state) { memory = to_bytes(state); };
    Room room(std::move(kept), listener(), time);
    first = room.start("operator", to_bytes(R"({"patient":{"id":"wrong"}})"), crypto::Sha256Digest{}, {"C3"});
    room.add_subject(to_bytes(R"({"patient":{"id":"B2"}})"));
    at_crash = memory;
    room.stop("operator", true);
    EXPECT_TRUE(memory.empty()) << "the operation is over";
    memory = std::move(at_crash);
  }
  const KeptPatient known = read_kept_patient(memory);
  EXPECT_EQ(known.case_id, first);
  const Bytes sealed =
      crypto::seal_bytes(to_bytes(R"({"patient":{"id":"B2"}})"), bench.options().event_recipients);
  const auto go_on = [&](const KeptPatient& patient) {
    RoomPlan resumed = with_monitor();
    resumed.resume.emplace();
    resumed.resume->case_id = archive::new_case_id(utc_now());
    resumed.resume->earlier = {first, 7, {}};
    resumed.resume->reason = "operator";
    resumed.resume->within = 10min;
    resumed.resume->sealed_subject = sealed;
    resumed.memory.earlier = kept_bytes(patient);
    Room room(std::move(resumed), listener(), time);
    EXPECT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
    EXPECT_TRUE(test::eventually([&] { return room.status().session.streams.at(1).frames > 0; }));
    const std::string id = room.stop("operator", true);
    std::string events;
    const RecordedCase recorded = read(id);
    EXPECT_THAT(recorded.broken_rules(), IsEmpty());
    if (!recorded.all<archive::MarkEntry>().empty()) {
      for (const std::string& line : recorded.lines("events")) events += line;
    }
    return events;
  };
  KeptPatient own = known;
  own.sealed_subject = crypto::to_hex(crypto::sha256(sealed));
  const std::string said = go_on(own);
  EXPECT_THAT(said, HasSubstr("a monitor's messages name another patient"));
  EXPECT_THAT(said, HasSubstr("the CT of the sealed plan states another patient's number"));
  EXPECT_THAT(go_on(known), IsEmpty()) << "that is of another subject than the one that is carried over";
  own.case_id = "20260805T081502Z-3f9c21ab";
  EXPECT_THAT(go_on(own), IsEmpty());
}

// Else the patient is there still, and taken for the next case.
TEST_F(GoingOn, WhomAnEarlierProcessRecordedIsNotedAsCutOffAndAsEndedWithWhatGoesOn) {
  const Bytes subject = to_bytes(R"({"patient":{"id":"4711"}})");
  const Bytes sealed = crypto::seal_bytes(subject, bench.options().event_recipients);
  const KeptPatient kept{"20260805T081502Z-3f9c21ab",
                         crypto::to_hex(crypto::sha256(sealed)),
                         {},
                         {},
                         std::string(text_of(subject))};
  for (const bool goes_on : {false, true}) {
    RoomPlan next = plan({kCamera});
    next.procedure = procedure;
    next.memory.earlier = kept_bytes(kept);
    if (goes_on) {
      next.resume.emplace();
      next.resume->case_id = archive::new_case_id(utc_now());
      next.resume->earlier = {kept.case_id, 7, {}};
      next.resume->reason = "operator";
      next.resume->within = 10min;
      next.resume->sealed_subject = sealed;
    }
    Room room(std::move(next), listener(), time);
    EXPECT_THAT(procedure->take_ended(), testing::ElementsAre("cut off 4711"));
    if (!goes_on) continue;
    ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kRecording; }));
    room.stop("operator", true);
    EXPECT_THAT(procedure->take_ended(), testing::ElementsAre("4711"));
  }
}

TEST_F(GoingOn, AnotherPatientWhoIsNamedWhileACaseRunsIsTold) {
  procedure->state("4711");
  RoomPlan watched = plan({kCamera, kAbsentCamera});
  watched.procedure = procedure;
  Room room(std::move(watched), listener(), time);
  const std::string id = room.start("operator");
  ASSERT_EQ(room.status().subject, SubjectState::kFound);
  expect_told(room, "tcp://127.0.0.1:9");
  procedure->state("next");
  time.move(11s);
  expect_told(room, "name another patient for this room now");
  for (int looks = 0; looks < 3; ++looks) {
    time.move(1s);
    const Clock::Time moved = time.now();
    ASSERT_TRUE(test::eventually([&] { return room.heartbeat() >= moved; }));
  }
  EXPECT_THAT(room.status().problem, HasSubstr("another patient"))
      << "no problem of before comes back over it";
  room.stop("operator", true);
  std::string events;
  for (const std::string& line : read(id).lines("events")) events += line;
  EXPECT_THAT(events, HasSubstr("patient-differs"));
}

TEST_F(RoomTest, WhoBeginsACaseByAnotherPatientsPlanIsToldAtOnce) {
  DaemonOptions asked;
  asked.rooms.push_back(plan({kCamera}));
  asked.archive = bench.options().archive;
  asked.listener = listener();
  Daemon daemon(std::move(asked));
  const auto start = [&](const nlohmann::json& patients) {
    const nlohmann::ordered_json answer = daemon.handle({{"do", "start"},
                                                         {"subject", {{"patient", {{"id", "B2"}}}}},
                                                         {"plan", std::string(64, 'a')},
                                                         {"plan_patients", patients}});
    daemon.handle({{"do", "stop"}});
    return answer.value("warning", "");
  };
  EXPECT_EQ(start({"A1"}), kPlanOfAnother);
  {
    const std::lock_guard guard(mutex);
    EXPECT_THAT(warnings, Contains(HasSubstr(kPlanOfAnother)));
  }
  EXPECT_EQ(start({"B2"}), "");
  EXPECT_EQ(start(nlohmann::json::array()), "");
  EXPECT_THROW(start("A1"), UsageError);
  EXPECT_THROW(start({std::string(1000, 'x')}), UsageError);
}

TEST_F(GoingOn, TheRoomsNoteHasWhomTheCaseWasSaidToBeAboutLast) {
  const auto note =
      std::make_shared<RunningNote>(archive::real_file_system(), bench.options().archive, "or-1");
  RoomPlan noted = plan({kCamera});
  noted.procedure = procedure;
  noted.running = note;
  time.suspend(1s);
  Room room(std::move(noted), listener(), time);
  const std::string id = room.start("operator");
  EXPECT_EQ(note->read()->suspended, 1s) << "before the case";
  procedure->state("4711");
  const auto kept = [&] {
    const auto running = note->read();
    const bool is_signed_here =
        running && running->subject && is_signed(*running->subject, bench.options().key->public_key());
    return is_signed_here
               ? std::string(text_of(crypto::unseal_bytes(running->subject->sealed, bench.identities())))
               : std::string();
  };
  ASSERT_TRUE(test::eventually([&] {
    time.move(1s);
    return kept().find("4711") != std::string::npos;
  }));
  room.add_subject(to_bytes(R"({"patient":"corrected"})"));
  EXPECT_EQ(kept(), R"({"patient":"corrected"})");
  EXPECT_EQ(note->read()->subject->case_id, id);
  room.stop("operator", true);
  EXPECT_FALSE(note->read());
}

// The note that a crash would leave may fail where the case's own files do not.
TEST_F(GoingOn, ANoteThatCannotBeWrittenIsToldAndTriedAgain) {
  const auto note = std::make_shared<RunningNote>(faults, bench.options().archive, "or-1");
  RoomPlan noted = plan({kCamera});
  noted.running = note;
  Room room(std::move(noted), listener(), time);
  room.start("operator");
  faults.fail("create .running", EIO);
  room.add_subject(to_bytes(R"({"patient":"corrected"})"));
  EXPECT_THAT(room.status().problem, HasSubstr("would go on with the subject of before"));
  EXPECT_EQ(room.status().subject, SubjectState::kLate) << "in the case it is";
  EXPECT_FALSE(note->read()->subject);
  faults.heal();
  EXPECT_TRUE(test::eventually([&] {
    time.move(1s);
    return note->read()->subject.has_value();
  }));
  room.stop("operator", true);
}

// What people are told of a rule takes a while, in which the search would still go on.
TEST_F(GoingOn, NothingThatIsFoundComesAfterWhatAPersonSaid) {
  RoomPlan ruled = plan({kCamera});
  ruled.procedure = procedure;
  ruled.profile_rules = {{"mucosa", {"EMR"}, {}, Profile::kLossless, {}}};
  Room* running = nullptr;
  RoomListener told = listener();
  told.warn = [&](const std::string& sentence) {
    if (sentence.find("rule mucosa") == std::string::npos) return;
    procedure->state("4711");
    for (int looks = 0; looks < 2; ++looks) {
      time.move(2s);
      const Clock::Time moved = time.now();
      EXPECT_TRUE(test::eventually([&] { return running->heartbeat() >= moved; }));
    }
  };
  Room room(std::move(ruled), told, time);
  running = &room;
  room.start("operator");
  room.add_subject(to_bytes(R"({"patient":"typed","procedure":"EMR"})"));
  room.stop("operator", true);
  std::vector<std::string> subjects;
  for (const std::string& event : bench.read(results.at(0).folder).lines("events")) {
    if (event.find(R"(\"subject\":{)") != std::string::npos) subjects.push_back(event);
  }
  ASSERT_THAT(subjects, SizeIs(1));
  EXPECT_THAT(subjects[0], HasSubstr("typed"));
}

// A start that waited for the one before it to be carried out would begin a case by itself when that one has
// ended: the next patient's, under the name that was given for this one.
TEST_F(RoomTest, AStartWhileAnotherBeginsIsRefusedAndBeginsNothingLater) {
  for (const std::chrono::milliseconds pre_roll : {0ms, 500ms}) {
    std::promise<void> release;
    const std::shared_future<void> released = release.get_future().share();
    std::atomic<bool> making = false;
    test::ObservedFileSystem slow([&](const std::filesystem::path& file) {
      if (file.string().find("/.new-") == std::string::npos) return;
      making = true;
      released.wait();
    });
    RoomPlan ahead = plan({kCamera});
    ahead.session.files = &slow;
    ahead.rules.pre_roll = pre_roll;
    Room room(std::move(ahead), listener());
    const RoomState waits = pre_roll > 0ms ? RoomState::kStandby : RoomState::kIdle;
    ASSERT_TRUE(test::eventually([&] { return room.status().state == waits; }));
    const std::size_t before = bench.cases();
    const auto start = [&room] { return room.start("operator"); };
    auto first = std::async(std::launch::async, start);
    ASSERT_TRUE(test::eventually([&] { return making.load(); }));
    EXPECT_EQ(room.status().state, RoomState::kStarting);
    auto second = std::async(std::launch::async, start);
    EXPECT_TRUE(test::eventually([&] { return second.wait_for(0s) == std::future_status::ready; }, 5s));
    release.set_value();
    EXPECT_EQ(room.stop("operator", true), first.get());
    EXPECT_THROW(second.get(), UsageError);
    ASSERT_TRUE(test::eventually([&] { return room.status().state == waits; }));
    EXPECT_EQ(bench.cases(), before + 1);
  }
}

class ClosingRoom : public RoomTest {
 protected:
  /// A room whose cases wait for an authority when they are closed.
  [[nodiscard]] RoomPlan slow_plan() {
    RoomPlan slow = plan({kCamera});
    std::shared_ptr<timestamp::StampSource>& source = slow.session.authorities.at(0).source;
    authority = std::make_shared<test::SwitchedAuthority>(source);
    authority->held = true;
    source = authority;
    return slow;
  }
  [[nodiscard]] DaemonOptions options(RoomPlan slow) {
    DaemonOptions asked;
    asked.archive = bench.options().archive;
    asked.time = &time;
    asked.listener = listener();
    asked.rooms.push_back(std::move(slow));
    return asked;
  }
  static std::string state(Daemon& daemon) { return daemon.handle({{"do", "status"}})["rooms"][0]["state"]; }
  /// A room that records may be silent for half a minute, and then systemd hears nothing of any room.
  void expect_healthy_while_it_closes(Daemon& daemon) {
    EXPECT_TRUE(test::eventually([&] { return state(daemon) == "closing"; }, 20s)) << state(daemon);
    time.move(2min);
    EXPECT_TRUE(daemon.healthy());
    time.move(10min);
    EXPECT_FALSE(daemon.healthy()) << "no authority takes so long";
  }
  std::shared_ptr<test::SwitchedAuthority> authority;
};

TEST_F(ClosingRoom, ARoomThatARuleEndsIsClosing) {
  RoomPlan bounded = slow_plan();
  bounded.rules.longest_case = 1s;
  Daemon daemon(options(std::move(bounded)));
  daemon.handle({{"do", "start"}});
  expect_healthy_while_it_closes(daemon);
  authority->release();
  EXPECT_TRUE(test::eventually([&] { return state(daemon) == "idle"; }));
}

TEST_F(ClosingRoom, ARoomThatAnErrorEndsIsClosingAndWhoStopsItThenEndsTheOperation) {
  test::FaultFileSystem faults(bench.options().archive);
  RoomPlan failing = slow_plan();
  failing.session.files = &faults;
  failing.rules.resume_within = 10min;
  Daemon daemon(options(std::move(failing)));
  const std::string id = daemon.handle({{"do", "start"}})["case"];
  faults.fail("create " + id + "/segments", ENOSPC);
  expect_healthy_while_it_closes(daemon);
  faults.heal();
  EXPECT_EQ(daemon.handle({{"do", "stop"}, {"wait", false}})["case"], id);
  authority->release();
  ASSERT_TRUE(test::eventually([&] { return state(daemon) == "idle"; }));
  const nlohmann::json room = daemon.handle({{"do", "status"}})["rooms"][0];
  EXPECT_EQ(room["reason"], "disk-full");
  EXPECT_EQ(room["tries_again"], false);
  EXPECT_EQ(room["ended_by_error"], false);
}

TEST_F(RoomTest, WhoStopsAfterAnErrorEndsTheOperation) {
  test::FaultFileSystem faults(bench.options().archive);
  RoomPlan failing = plan({kCamera});
  failing.session.files = &faults;
  failing.rules.resume_within = 10min;
  const auto note =
      std::make_shared<RunningNote>(archive::real_file_system(), bench.options().archive, "or-1");
  failing.running = note;
  Room room(std::move(failing), listener(), time);
  const std::string first = room.start("operator", to_bytes(bytes_of(R"({"patient":{"id":"7"}})")));
  EXPECT_FALSE(room.status().tries_again);
  faults.fail("sync", EIO);
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kIdle; }));
  EXPECT_TRUE(room.status().tries_again);
  ASSERT_TRUE(note->read());
  EXPECT_EQ(room.stop("operator", false), first);
  EXPECT_FALSE(room.status().tries_again);
  EXPECT_FALSE(room.status().ended_by_error);
  EXPECT_FALSE(note->read()) << "nor does the recorder's next start carry it on";
  EXPECT_THROW(room.stop("operator", false), UsageError) << "it is ended already";
  faults.heal();
  for (int looks = 0; looks < 3; ++looks) {
    time.await_waiting(1);
    EXPECT_EQ(room.status().state, RoomState::kIdle);
    time.move(1min);
  }
  time.await_waiting(1);
  EXPECT_EQ(bench.cases(), 1U);
}

TEST_F(RoomTest, WhoStopsWhileTheCaseAfterAnErrorIsMadeEndsThatOne) {
  std::atomic<bool> broken = false, held = false, making = false;
  test::ObservedFileSystem files([&](const std::filesystem::path& file) {
    if (broken) throw IoError("make", file, EIO);
    if (held && file.string().find("/.new-") != std::string::npos) {
      making = true;
      held.wait(true);
    }
  });
  RoomPlan failing = plan({kCamera});
  failing.session.files = &files;
  failing.rules.resume_within = 10min;
  Room room(std::move(failing), listener(), time);
  const std::string first = room.start("operator");
  broken = true;
  ASSERT_TRUE(test::eventually([&] { return room.status().tries_again; }));
  ASSERT_TRUE(test::eventually([&] { return room.status().state == RoomState::kIdle; }));
  held = true;
  broken = false;
  time.await_waiting(1);
  time.move(5s);
  ASSERT_TRUE(test::eventually([&] { return making.load(); }));
  auto stopped = std::async(std::launch::async, [&room] { return room.stop("operator", true); });
  EXPECT_TRUE(test::eventually([&] { return !room.status().tries_again; }, 5s));
  held = false;
  held.notify_all();
  const std::string second = stopped.get();
  EXPECT_NE(second, first);
  EXPECT_EQ(room.status().state, RoomState::kIdle);
  EXPECT_EQ(room.status().case_id, second);
  EXPECT_EQ(room.status().reason, "operator");
  EXPECT_FALSE(room.status().tries_again);
}

TEST_F(RoomTest, RecordingAheadThatFailsIsNoCase) {
  test::FaultFileSystem faults(bench.options().archive);
  RoomPlan ahead = plan({kCamera});
  ahead.session.files = &faults;
  ahead.rules.pre_roll = 500ms;
  Room room(std::move(ahead), listener());
  room.start("operator");
  const std::string first = room.stop("operator", true);
  faults.fail("remove", EIO);  // what no case needs any more stays
  ASSERT_TRUE(test::eventually([&] { return room.status().problem.starts_with("recording ahead ended"); }));
  faults.heal();
  const RoomStatus status = room.status();
  EXPECT_EQ(status.cases, 1U);
  EXPECT_EQ(status.case_id, first);
  EXPECT_EQ(status.reason, "operator");
  const std::lock_guard guard(mutex);
  EXPECT_THAT(left_open, IsEmpty());
}

}  // namespace
}  // namespace kiroku::recorder
