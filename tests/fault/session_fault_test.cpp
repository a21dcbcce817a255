// The whole recorder with its threads: a short case of pictures, vital signs and a mark, in which one file
// system call fails, or all from it on, or the program dies. Where the session lives on it closes the case
// itself; else the next start does. Either way the case must verify.
#include <cerrno>
#include <chrono>
#include <iostream>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/upkeep/recovery.h"
#include "archive/verify/verifier.h"
#include "recorder/checkpoint_stamper.h"
#include "tests/fault/fault_step.h"
#include "tests/support/decoded_video.h"
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

constexpr std::size_t kUsualStep = 23;

class SessionFault : public testing::Test {
 protected:
  [[nodiscard]] fs::path archive() const { return bench_ / "archive"; }

  void clear() const {
    fs::remove_all(archive());
    fs::create_directory(archive());
  }

  [[nodiscard]] std::unique_ptr<ApplianceLog> log(archive::FileSystem& files) const {
    return ApplianceLog::open(files, archive() / "log", *bench_.options().key, "test");
  }

  void record(FaultFileSystem& files) const {
    const auto log = this->log(files);
    SessionOptions options = bench_.options();
    options.files = &files;
    options.log = log.get();
    options.video = {bench_.stream("room", "synthetic:pattern?size=64x48&rate=10&speed=max")};
    options.vitals = {bench_.stream("vitals", "synthetic:patient?waves=0&speed=max")};
    options.duration = 1s;
    options.stamp_interval = 50ms;
    Session session(options);
    session.mark("incision");
    session.run();
  }

  std::vector<archive::CaseRecovery> recover() const {
    archive::FileSystem& files = archive::real_file_system();
    const auto log = this->log(files);
    const SessionOptions known = bench_.options();
    archive::RecoveryOptions options;
    options.archive = archive();
    options.key = known.key;
    options.device_name = known.device_name;
    options.boot_id = archive::kernel_boot_id();
    options.log = log.get();
    options.stamp = checkpoint_stamper(known.authorities, known.trust, nullptr);
    const archive::RecordingLock lock = archive::RecordingLock::take(files, archive());
    return archive::recover_archive(files, options, lock);
  }

  /// What does not hold, one sentence each.
  std::vector<std::string> broken() const {
    const SessionOptions known = bench_.options();
    archive::VerifyOptions options;
    options.devices = {crypto::VerifierKey(known.device_name, known.key->public_key())};
    options.trust = known.trust;
    options.log = archive() / "log";
    options.threads = 1;
    std::vector<std::string> problems;
    for (const fs::directory_entry& entry : fs::directory_iterator(archive())) {
      if (!archive::is_case_id(entry.path().filename().string())) continue;
      const archive::VerificationReport report = archive::verify_case(entry.path(), options);
      if (report.verdict == archive::Verdict::kIntact || report.verdict == archive::Verdict::kIntactWithGaps)
        continue;
      std::string text = "the case is " + std::string(archive::verdict_name(report.verdict)) + ":";
      for (const archive::Finding& finding : report.findings) {
        text += "\n  " + finding.code + " " + finding.file + ": " + finding.text;
      }
      problems.push_back(text);
    }
    return problems;
  }

  std::size_t calls() const {
    clear();
    FaultFileSystem files(archive());
    record(files);
    EXPECT_THAT(broken(), testing::IsEmpty());
    return files.count();
  }

  template <typename Prepare>
  void try_each_call(const std::string& fault, const Prepare& prepare) {
    const std::size_t calls = this->calls();
    ASSERT_GT(calls, 150U);
    std::size_t points = 0, recovered = 0;
    for (std::size_t at = 0; at < calls; at += test::fault_step(kUsualStep)) {
      clear();
      FaultFileSystem files(archive());
      prepare(files, at);
      try {
        record(files);
      } catch (const test::Killed&) {  // NOLINT(bugprone-empty-catch): what this test is about
      } catch (const Error&) {         // NOLINT(bugprone-empty-catch): likewise
      }
      for (const archive::CaseRecovery& recovery : recover()) {
        EXPECT_EQ(recovery.problem, "") << fault << " at call " << at;
        ++recovered;
      }
      EXPECT_THAT(broken(), testing::IsEmpty()) << fault << " at call " << at << " of " << calls;
      ++points;
      ASSERT_FALSE(HasFailure());
    }
    std::cout << fault << ": " << points << " points of " << calls << ", " << recovered
              << " cases brought to their end by the next start\n";
  }

  RecorderBench bench_;
};

TEST_F(SessionFault, OneInputOutputError) {
  try_each_call("EIO once", [](FaultFileSystem& files, std::size_t at) { files.fail("", EIO, at, 1); });
}

TEST_F(SessionFault, InputOutputErrorsFromThenOn) {
  try_each_call("EIO for good", [](FaultFileSystem& files, std::size_t at) { files.fail("", EIO, at); });
}

TEST_F(SessionFault, OneFullDisk) {
  try_each_call("ENOSPC once", [](FaultFileSystem& files, std::size_t at) { files.fail("", ENOSPC, at, 1); });
}

TEST_F(SessionFault, AFullDiskFromThenOn) {
  try_each_call("ENOSPC for good",
                [](FaultFileSystem& files, std::size_t at) { files.fail("", ENOSPC, at); });
}

TEST_F(SessionFault, ADiskThatTakesNoMoreSegments) {
  try_each_call("ENOSPC in segments",
                [](FaultFileSystem& files, std::size_t at) { files.fail("write", ENOSPC, at, 3); });
}

TEST_F(SessionFault, Death) {
  try_each_call("kill", [](FaultFileSystem& files, std::size_t at) { files.kill_at(at); });
}

/// At its own pace, cut off at a moment: what was never flushed is gone.
TEST_F(SessionFault, APowerCutCostsASecondAtMost) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  constexpr std::int64_t kFrames = 20;            // a second
  constexpr std::int64_t kMachine = kSecond / 2;  // a machine that is busy with other things
  std::int64_t most_pictures = 0, most_lines = 0;
  for (const auto moment : {650ms, 1130ms, 1610ms, 2090ms, 2570ms, 3050ms}) {
    clear();
    FaultFileSystem files(archive());
    std::int64_t cut_ns = 0;
    {
      const auto log = this->log(files);
      SessionOptions options = bench_.options();
      options.files = &files;
      options.log = log.get();
      options.segment_duration = 2s;
      options.video = {bench_.stream("room", "synthetic:pattern?size=64x48&rate=20")};
      options.vitals = {bench_.stream("vitals", "synthetic:patient?waves=0")};
      Session session(options);
      std::thread cut([&] {
        EXPECT_TRUE(test::eventually(
            [&] { return session.status().now_ns >= std::chrono::nanoseconds(moment).count(); }));
        files.kill_at(0);
        cut_ns = session.status().now_ns;
        session.stop();
      });
      EXPECT_ANY_THROW(session.run());
      cut.join();
    }
    files.lose_power();
    for (const archive::CaseRecovery& recovery : recover()) EXPECT_EQ(recovery.problem, "");
    EXPECT_THAT(broken(), testing::IsEmpty());
    for (const fs::directory_entry& entry : fs::directory_iterator(archive())) {
      if (!archive::is_case_id(entry.path().filename().string())) continue;
      const test::RecordedCase recorded = bench_.read(entry.path());
      const auto pictures = recorded.segments("room");
      const Bytes film = recorded.joined("room");
      const std::size_t frames = film.empty() ? 0 : test::decode_video(film).frames.size();
      const std::int64_t start_ns = pictures.empty() ? 0 : pictures.front().span.start_ns;
      most_pictures =
          std::max(most_pictures, cut_ns - start_ns - static_cast<std::int64_t>(frames) * kSecond / kFrames);
      std::int64_t lines_ns = 0;
      for (const auto& segment : recorded.segments("vitals")) {
        if (segment.counted) lines_ns = std::max(lines_ns, segment.span.end_ns);
      }
      most_lines = std::max(most_lines, cut_ns - lines_ns);
    }
    ASSERT_FALSE(HasFailure());
  }
  EXPECT_LE(most_pictures, kSecond + kMachine);
  EXPECT_LE(most_lines, kSecond + kMachine);
  std::cout << "power cut: lost at most " << most_pictures / 1'000'000 << " ms of pictures, "
            << most_lines / 1'000'000 << " ms of lines\n";
}

}  // namespace
}  // namespace kiroku::recorder
