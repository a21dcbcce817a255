// A recorder dies while a room records, and the start that carries the operation on dies as well: at each of
// its file system calls, from recovery to the new case's first moment. The start after it must leave one
// unbroken chain of cases, whatever was done already.
#include <chrono>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/upkeep/recovery.h"
#include "archive/verify/verifier.h"
#include "recorder/daemon/room.h"
#include "tests/fault/fault_step.h"
#include "tests/support/eventually.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/recording.h"

namespace kiroku::recorder {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using archive::ApplianceLog;
using test::FaultFileSystem;
using test::RecorderBench;

constexpr std::size_t kUsualResumptionStep = 19;
constexpr const char* kRoom = "or-1";
constexpr const char* kSubject = R"({"patient":{"id":"7"}})";

class ResumptionFault : public testing::Test {
 protected:
  /// A start of the recorder, up to the moment at which its room records or the machine dies.
  struct Start {
    std::unique_ptr<ApplianceLog> log;
    std::shared_ptr<RunningNote> note;
    std::unique_ptr<Room> room;
    std::string refused;  // why nothing is carried on
  };

  [[nodiscard]] fs::path archive() const { return bench_ / "archive"; }

  void start(archive::FileSystem& files, Start& started) const {
    SessionOptions session = bench_.options();
    started.log = ApplianceLog::open(files, archive() / "log", *session.key, session.device_name);
    started.note = std::make_shared<RunningNote>(files, archive(), kRoom);
    ResumptionPlanner::Context context;
    context.archive = archive();
    context.boot_id = archive::kernel_boot_id();
    context.tell = [&](const std::string& /*room*/, const std::string& sentence) {
      started.refused = sentence;
    };
    ResumptionPlanner planner(context, {{kRoom, 10min, 24h, started.note}});

    archive::RecoveryOptions recovery;
    recovery.archive = archive();
    recovery.key = session.key;
    recovery.device_name = session.device_name;
    recovery.boot_id = context.boot_id;
    recovery.log = started.log.get();
    recovery.carry_on = [&](const archive::CutOffCase& cut) { return planner.carry_on(cut); };
    {
      const archive::RecordingLock lock = archive::RecordingLock::take(files, archive());
      for (const archive::CaseRecovery& each : archive::recover_archive(files, recovery, lock)) {
        EXPECT_EQ(each.problem, "");
      }
    }
    RoomPlan plan;
    plan.name = kRoom;
    plan.session = std::move(session);
    plan.session.files = &files;
    plan.session.log = started.log.get();
    plan.session.authorities.clear();
    plan.session.video = {bench_.stream("endoscope", "synthetic:pattern?size=64x48&rate=20")};
    plan.running = started.note;
    plan.resume = planner.of(kRoom);
    started.room = std::make_unique<Room>(std::move(plan), RoomListener());
  }

  template <typename Condition>
  static bool until(const Condition& holds) {
    return test::eventually(holds);
  }
  static bool records(const Room& room) { return room.status().state == RoomState::kRecording; }

  /// The first case, whose recorder dies; what is on the disk then is kept for every try. `late`: whom it is
  /// about became known while it ran.
  void record_first(bool late) const {
    FaultFileSystem files(archive());
    Start first;
    start(files, first);
    first.room->start("operator", to_bytes(late ? R"({"patient":{"id":"wrong"}})" : kSubject));
    if (late) first.room->add_subject(to_bytes(kSubject));
    ASSERT_TRUE(until([&] { return first.room->status().session.streams.at(0).segments > 0; }));
    files.kill_at(0);
    first.room.reset();
    fs::rename(archive(), kept());
  }
  [[nodiscard]] fs::path kept() const { return bench_ / "kept"; }
  void restore() const {
    fs::remove_all(archive());
    fs::copy(kept(), archive(), fs::copy_options::recursive);
  }

  /// Starts, and dies at the call number `at`, or as soon as the room records.
  void start_and_die(std::size_t at, bool power) const {
    FaultFileSystem files(archive());
    files.kill_at(at);
    {
      Start second;
      try {
        start(files, second);
        EXPECT_TRUE(until([&] { return records(*second.room) || files.count() >= at; }));
        files.kill_at(0);
      } catch (const test::Killed&) {  // NOLINT(bugprone-empty-catch): what this test is about
      }
    }
    if (power) files.lose_power();
  }

  /// How many calls a start makes until its room records.
  [[nodiscard]] std::size_t calls() const {
    restore();
    FaultFileSystem files(archive());
    Start second;
    start(files, second);
    EXPECT_TRUE(until([&] { return records(*second.room); }));
    return files.count();
  }

  /// The start after it: the room records by itself, and its case is ended as usual.
  void start_again() const {
    Start third;
    start(archive::real_file_system(), third);
    ASSERT_TRUE(until([&] { return records(*third.room); })) << third.refused << third.room->status().problem;
    EXPECT_EQ(third.room->status().subject, SubjectState::kCarriedOver);
    const std::string id = third.room->status().case_id;
    third.room->stop("operator", true);
    EXPECT_EQ(bench_.read(archive() / id).subject(), kSubject);
  }

  /// What is not as it must be: one chain of cases, each sound.
  void expect_one_chain() const {
    const SessionOptions known = bench_.options();
    archive::VerifyOptions options;
    options.devices = {crypto::VerifierKey(known.device_name, known.key->public_key())};
    options.trust = known.trust;
    options.log = archive() / "log";
    options.threads = 1;
    EXPECT_NE(archive::verify_log(archive() / "log", options).verdict, archive::Verdict::kTampered);
    std::size_t cases = 0;
    std::map<std::string, int> links;
    for (const fs::directory_entry& entry : fs::directory_iterator(archive())) {
      if (!archive::is_case_id(entry.path().filename().string())) continue;
      ++cases;
      const archive::VerificationReport report = archive::verify_case(entry.path(), options);
      EXPECT_NE(report.verdict, archive::Verdict::kTampered);
      for (const archive::Finding& finding : report.findings) {
        if (finding.code == "carrying-on-holds")
          ++links[finding.entry ? "names an earlier" : "announces a later"];
        EXPECT_TRUE(finding.code != "carrying-on-broken" && finding.code != "carried-on-not-here")
            << finding.code << ": " << finding.text;
      }
    }
    EXPECT_GE(cases, 2U);
    EXPECT_LE(cases, 3U);
    EXPECT_EQ(links["names an earlier"], cases - 1);
    EXPECT_EQ(links["announces a later"], cases - 1);
  }

  void die_at_each_call(bool power, bool late) const {
    record_first(late);
    const std::size_t calls = this->calls();
    ASSERT_GT(calls, 40U);
    std::size_t points = 0;
    for (std::size_t at = 0; at <= calls && !HasFailure();
         at += test::fault_step(kUsualResumptionStep), ++points) {
      SCOPED_TRACE("call " + std::to_string(at) + " of " + std::to_string(calls));
      restore();
      start_and_die(at, power);
      start_again();
      expect_one_chain();
    }
    std::cout << points << " points of " << calls << "\n";
  }

  RecorderBench bench_;
};

TEST_F(ResumptionFault, AKillAtEachCallOfTheStartThatCarriesOn) { die_at_each_call(false, false); }

TEST_F(ResumptionFault, APowerCutAtEachCallOfTheStartThatCarriesOn) { die_at_each_call(true, false); }

TEST_F(ResumptionFault, AKillAtEachCallOfTheStartThatCarriesOnWithALateSubject) {
  die_at_each_call(false, true);
}

TEST_F(ResumptionFault, APowerCutAtEachCallOfTheStartThatCarriesOnWithALateSubject) {
  die_at_each_call(true, true);
}

}  // namespace
}  // namespace kiroku::recorder
