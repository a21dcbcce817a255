// One short case, written call by call; at every file system call the program dies, the power fails, or the
// call fails and the program gives up. Then the next start recovers, and the case must verify. The same for
// what recovery and erasing read.
#include <array>
#include <cerrno>
#include <fstream>
#include <iostream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/upkeep/recovery.h"
#include "archive/upkeep/retention.h"
#include "tests/fault/fault_step.h"
#include "tests/support/case_kit.h"
#include "tests/support/empty_log.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::FaultFileSystem;
using test::SampleArchive;
using test::SampleCase;

std::string text_in(const fs::path& file) {
  std::ifstream input(file, std::ios::binary);
  std::ostringstream text;
  text << input.rdbuf();
  return text.str();
}

/// Up to and with the last LF.
std::string whole_lines(const fs::path& ledger) {
  const std::string text = text_in(ledger);
  return text.substr(0, text.rfind('\n') + 1);
}

CheckpointStamper stamper_of(SampleArchive& archive) {
  return [&archive](const StoredCheckpoint& over) {
    CheckpointStamp stamp;
    stamp.authority = SampleArchive::kAuthorityName;
    stamp.response = archive.stamp(over.note);
    stamp.facts = SampleArchive::facts_of(stamp.response);
    return std::vector<CheckpointStamp>{stamp};
  };
}

std::vector<CaseRecovery> recover(FileSystem& files, SampleArchive& archive) {
  archive.now_ns = 100 * kSecond;
  const auto log = ApplianceLog::open(files, archive.log_folder(), archive.key(), SampleArchive::kDeviceName);
  RecoveryOptions options;
  options.archive = archive.folder();
  options.key = &archive.key();
  options.device_name = SampleArchive::kDeviceName;
  options.boot_id = "another";
  options.log = log.get();
  options.now = [&archive] { return archive.now().utc; };
  options.stamp = stamper_of(archive);
  const RecordingLock lock = RecordingLock::take(files, archive.folder());
  return recover_archive(files, options, lock);
}

std::vector<fs::path> cases_in(const SampleArchive& archive) {
  std::vector<fs::path> cases;
  for (const fs::directory_entry& entry : fs::directory_iterator(archive.folder())) {
    if (is_case_id(entry.path().filename().string())) {
      cases.push_back(entry.path());
    }
  }
  return cases;
}

/// What does not hold in the archive after recovery: one sentence each.
std::vector<std::string> broken(const SampleArchive& archive) {
  std::vector<std::string> problems;
  const auto judge = [&](const VerificationReport& report, const std::string& what) {
    if (report.verdict == Verdict::kIntact || report.verdict == Verdict::kIntactWithGaps) {
      return;
    }
    std::string text = what + " is " + std::string(verdict_name(report.verdict)) + ":";
    for (const Finding& finding : report.findings) {
      text += "\n  " + finding.code + " " + finding.file + ": " + finding.text;
    }
    problems.push_back(text);
  };
  VerifyOptions options = archive.options();
  options.identities = &archive.identities();
  for (const fs::path& folder : cases_in(archive)) {
    judge(verify_case(folder, options), "the case");
  }
  const VerificationReport log = verify_log(archive.log_folder(), options);
  if (!test::is_empty_log(archive.log_folder())) {
    judge(log, "the log");
  } else if (log.verdict != Verdict::kUnproven) {
    problems.push_back("a log without an entry is " + std::string(verdict_name(log.verdict)));
  }
  return problems;
}

/// The story: a case with everything in it, one segment of which is never finished.
void record(FileSystem& files, SampleArchive& archive) {
  SampleCase sample(archive, true, files);
  sample.record();
  archive.now_ns = 6'500'000'000;
  const auto begun = sample.writer().begin_segment(0, 3);
  begun->write(Bytes(100'000, std::byte{7}));
  begun->sync();
  begun->write(Bytes(100'000, std::byte{8}));
  begun->seal();
  SegmentEntry entry;
  entry.stream = "endoscope";
  entry.index = 3;
  entry.file = begun->commit();
  entry.span = {6 * kSecond, 6'900'000'000};
  entry.time_base = "1/90000";
  entry.first_pts = 540'000;
  entry.frames = 20;
  sample.writer().append({entry}, archive.now());
  sample.close();
}

std::size_t calls_of_the_story(SampleArchive& archive) {
  archive.clear();
  FaultFileSystem files(archive.folder());
  record(files, archive);
  EXPECT_THAT(broken(archive), testing::IsEmpty());
  return files.count();
}

enum class Fault { kKill, kPowerCut, kInputOutputError, kDiskFull, kDiskFullForGood };

class ArchiveFault : public testing::TestWithParam<Fault> {};

TEST_P(ArchiveFault, AtEveryFileSystemCallIsRecoveredFrom) {
  SampleArchive archive;
  const std::size_t calls = calls_of_the_story(archive);
  ASSERT_GT(calls, 130U);
  std::size_t cases = 0;
  for (std::size_t at = 0; at < calls; ++at) {
    archive.clear();
    FaultFileSystem files(archive.folder());
    switch (GetParam()) {
      case Fault::kKill:
      case Fault::kPowerCut:
        files.kill_at(at);
        break;
      case Fault::kInputOutputError:
        files.fail("", EIO, at, 1);
        break;
      case Fault::kDiskFull:
        files.fail("", ENOSPC, at, 1);
        break;
      case Fault::kDiskFullForGood:
        files.fail("", ENOSPC, at);
        break;
    }
    try {
      record(files, archive);
    } catch (const test::Killed&) {   // NOLINT(bugprone-empty-catch): what this test is about
    } catch (const kiroku::Error&) {  // NOLINT(bugprone-empty-catch): likewise
    }
    if (GetParam() == Fault::kPowerCut) {
      files.lose_power();
    }
    std::string claimed;
    for (const fs::path& folder : cases_in(archive)) {
      claimed = whole_lines(folder / kLedgerFile);
    }
    for (const CaseRecovery& recovery : recover(real_file_system(), archive)) {
      EXPECT_EQ(recovery.problem, "") << "at call " << at;
      EXPECT_NE(recovery.outcome, CaseRecovery::Outcome::kRefused) << "at call " << at;
    }
    EXPECT_THAT(broken(archive), testing::IsEmpty()) << "at call " << at;
    for (const fs::path& folder : cases_in(archive)) {
      const std::string kept = text_in(folder / kLedgerFile);
      // A `close` that nobody had signed yet is cut off and stated again by recovery, which says so.
      const std::size_t last = claimed.size() < 2 ? 0 : claimed.rfind('\n', claimed.size() - 2) + 1;
      if (claimed.find(R"("type":"close")", last) != std::string::npos &&
          kept.find("from a close or an erasure on that nobody had signed") != std::string::npos) {
        claimed.resize(last);
      }
      EXPECT_TRUE(kept.starts_with(claimed)) << "at call " << at;
      ++cases;
    }
    EXPECT_TRUE(recover(real_file_system(), archive).empty()) << "once is enough; at call " << at;
    if (HasFailure()) {
      break;
    }
  }
  std::cout << calls << " points, " << cases << " cases left behind and brought to their end\n";
}

std::string name_of(const testing::TestParamInfo<Fault>& fault) {
  constexpr std::array<const char*, 5> kNames{"Kill", "PowerCut", "InputOutputError", "DiskFull",
                                              "DiskFullForGood"};
  return kNames.at(static_cast<std::size_t>(fault.param));
}

INSTANTIATE_TEST_SUITE_P(All, ArchiveFault,
                         testing::Values(Fault::kKill, Fault::kPowerCut, Fault::kInputOutputError,
                                         Fault::kDiskFull, Fault::kDiskFullForGood),
                         name_of);

/// Recovery is cut off at each of its own calls, and again, until it gets through.
TEST(RecoveryFault, AtEveryCallOfRecoveryIsRecoveredFrom) {
  SampleArchive archive;
  const std::size_t calls = calls_of_the_story(archive);
  std::size_t points = 0;
  constexpr std::size_t kUsualStep = 79;  // of the story's calls
  constexpr std::size_t kFirst = 30;      // before it there is no case
  for (std::size_t died_at = kFirst; died_at < calls; died_at += test::fault_step(kUsualStep)) {
    for (const bool power : {false, true}) {
      bool through = false;
      for (std::size_t at = 0; !through; ++at) {
        archive.clear();
        {
          FaultFileSystem files(archive.folder());
          files.kill_at(died_at);
          EXPECT_THROW(record(files, archive), test::Killed);
          if (power) {
            files.lose_power();
          }
        }
        FaultFileSystem files(archive.folder());
        files.kill_at(at);
        try {
          recover(files, archive);
          through = true;
        } catch (const test::Killed&) {
          if (power) {
            files.lose_power();
          }
          ++points;
        }
        for (const CaseRecovery& recovery : recover(real_file_system(), archive)) {
          EXPECT_EQ(recovery.problem, "") << died_at << ", then " << at;
        }
        EXPECT_THAT(broken(archive), testing::IsEmpty()) << died_at << ", then " << at;
        ASSERT_FALSE(testing::Test::HasFailure());
      }
    }
  }
  std::cout << points << " points\n";
}

/// Retention: either everything is still there and nothing is stated, or it is stated and goes.
TEST(RetentionFault, AtEveryCallOfErasingIsRecoveredFrom) {
  SampleArchive archive;
  std::size_t points = 0;
  for (const bool power : {false, true}) {
    bool through = false;
    for (std::size_t at = 0; !through; ++at) {
      archive.clear();
      const fs::path folder = SampleCase::write(archive);
      FaultFileSystem files(archive.folder());
      files.kill_at(at);
      const auto erase = [&](FileSystem& on) {
        archive.now_ns = 100 * kSecond;
        const auto log =
            ApplianceLog::open(on, archive.log_folder(), archive.key(), SampleArchive::kDeviceName);
        RetentionOptions options;
        options.key = &archive.key();
        options.device_name = SampleArchive::kDeviceName;
        options.log = log.get();
        options.stamp = stamper_of(archive);
        options.now = [&archive] { return archive.now().utc; };
        return erase_stream(on, options, folder, "endoscope", "30 days");
      };
      try {
        erase(files);
        through = true;
      } catch (const test::Killed&) {
        if (power) {
          files.lose_power();
        }
        ++points;
      }
      for (const CaseRecovery& recovery : recover(real_file_system(), archive)) {
        EXPECT_THAT(recovery.problem,
                    testing::AnyOf("", testing::HasSubstr("an erasure that nobody had signed")))
            << "at call " << at;
      }
      EXPECT_THAT(broken(archive), testing::IsEmpty()) << "at call " << at;
      const bool stated = text_in(folder / kLedgerFile).find(R"("type":"erased")") != std::string::npos;
      EXPECT_EQ(fs::is_empty(folder / "segments/endoscope"), stated) << "at call " << at;
      EXPECT_LE(erase(real_file_system()).segments, stated ? 0U : 3U);
      EXPECT_TRUE(fs::is_empty(folder / "segments/endoscope"));
      EXPECT_THAT(broken(archive), testing::IsEmpty()) << "at call " << at << ", erased again";
      ASSERT_FALSE(testing::Test::HasFailure());
    }
  }
  std::cout << points << " points\n";
}

/// What of a case must not depend on how often its recovery was hindered: its segments, its tokens, its end.
std::vector<std::string> substance_of(const SampleArchive& archive) {
  std::vector<std::string> substance;
  for (const fs::path& folder : cases_in(archive)) {
    for (const CaseEntry& entry : test::entries_of(folder)) {
      if (const auto* segment = std::get_if<SegmentEntry>(&entry.body)) {
        substance.push_back(segment->file.file + " " + std::to_string(segment->file.bytes));
      } else if (const auto* token = std::get_if<TokenEntry>(&entry.body)) {
        substance.push_back("token of " + token->authority + (token->checkpoint == 0 ? " over nothing" : ""));
      } else if (const auto* close = std::get_if<CloseEntry>(&entry.body)) {
        substance.push_back("close " + close->reason);
      } else if (const auto* erased = std::get_if<ErasedEntry>(&entry.body)) {
        substance.push_back("erased " + erased->stream + " " + std::to_string(erased->first_index) + " " +
                            std::to_string(erased->last_index));
      }
    }
  }
  return substance;
}

std::string name_of(FaultFileSystem::ReadFault fault) {
  constexpr std::array<const char*, 3> kNames{"fails", "gives half", "ends early"};
  return kNames.at(static_cast<std::size_t>(fault));
}

constexpr std::array kReadFaults{FaultFileSystem::ReadFault::kFails, FaultFileSystem::ReadFault::kHalf,
                                 FaultFileSystem::ReadFault::kEndsEarly};

/// A disk that cannot be read for a moment: either recovery comes to the same end as on a good one, or it
/// says what it could not read, and the next start comes to that end. Nothing is lost or judged by it.
TEST(RecoveryFault, AtEveryReadOfRecoveryNothingIsLostOrMisjudged) {
  SampleArchive archive;
  const std::size_t calls = calls_of_the_story(archive);
  std::size_t points = 0, told = 0;
  // The story is cut off between a token and its entry, within segments, and behind its close.
  for (const std::size_t before_its_end : {95U, 40U, 18U, 6U}) {
    const auto die = [&] {
      archive.clear();
      FaultFileSystem files(archive.folder());
      files.kill_at(calls - before_its_end);
      EXPECT_THROW(record(files, archive), test::Killed);
    };
    die();
    recover(real_file_system(), archive);
    const std::vector<std::string> wanted = substance_of(archive);
    for (const FaultFileSystem::ReadFault fault : kReadFaults) {
      constexpr std::size_t kUsualStep = 11;  // of recovery's reads
      for (std::size_t at = 0;; at += test::fault_step(kUsualStep)) {
        die();
        FaultFileSystem files(archive.folder());
        files.fail_reading("", fault, at, 1);
        bool is_told = false;
        std::string what = name_of(fault) + " at read " + std::to_string(at);
        try {
          for (const CaseRecovery& recovery : recover(files, archive)) {
            is_told = is_told || !recovery.problem.empty();
            what += ": " + recovery.problem;
          }
        } catch (const kiroku::Error& error) {
          is_told = true;
          what += std::string(": ") + error.what();
        }
        if (files.faults_played() == 0) {
          break;
        }
        ++points;
        told += is_told ? 1U : 0U;
        EXPECT_TRUE(!is_told || fault != FaultFileSystem::ReadFault::kHalf) << what;
        if (!is_told) {
          EXPECT_EQ(substance_of(archive), wanted) << what;
        }
        for (const CaseRecovery& recovery : recover(real_file_system(), archive)) {
          EXPECT_EQ(recovery.problem, "") << what;
        }
        EXPECT_EQ(substance_of(archive), wanted) << what;
        EXPECT_THAT(broken(archive), testing::IsEmpty()) << what;
        ASSERT_FALSE(testing::Test::HasFailure()) << what;
      }
    }
  }
  EXPECT_GT(told, 0U);
  std::cout << points << " points, of which " << told << " were told\n";
}

/// The same of an erasure: it is done, or said to have failed and can be asked for again.
TEST(RetentionFault, AtEveryReadOfErasingNothingElseIsLostOrMisjudged) {
  SampleArchive archive;
  const auto erase = [&](FileSystem& on) {
    archive.now_ns = 100 * kSecond;
    const auto log = ApplianceLog::open(on, archive.log_folder(), archive.key(), SampleArchive::kDeviceName);
    RetentionOptions options;
    options.key = &archive.key();
    options.device_name = SampleArchive::kDeviceName;
    options.log = log.get();
    options.stamp = stamper_of(archive);
    options.now = [&archive] { return archive.now().utc; };
    return erase_stream(on, options, cases_in(archive).at(0), "endoscope", "30 days");
  };
  std::size_t points = 0, told = 0;
  for (const FaultFileSystem::ReadFault fault : kReadFaults) {
    constexpr std::size_t kUsualStep = 7;  // of its reads
    for (std::size_t at = 0;; at += test::fault_step(kUsualStep)) {
      archive.clear();
      const fs::path folder = SampleCase::write(archive);
      FaultFileSystem files(archive.folder());
      files.fail_reading("", fault, at, 1);
      std::string what = name_of(fault) + " at read " + std::to_string(at);
      bool is_told = false;
      try {
        erase(files);
      } catch (const kiroku::Error& error) {
        is_told = true;
        what += std::string(": ") + error.what();
      }
      if (files.faults_played() == 0) {
        break;
      }
      ++points;
      told += is_told ? 1U : 0U;
      EXPECT_TRUE(!is_told || fault != FaultFileSystem::ReadFault::kHalf) << what;
      EXPECT_TRUE(is_told || fs::is_empty(folder / "segments/endoscope")) << what;
      for (const CaseRecovery& recovery : recover(real_file_system(), archive)) {
        EXPECT_THAT(recovery.problem,
                    testing::AnyOf("", testing::HasSubstr("an erasure that nobody had signed")))
            << what;
      }
      EXPECT_THAT(broken(archive), testing::IsEmpty()) << what;
      const bool stated = text_in(folder / kLedgerFile).find(R"("type":"erased")") != std::string::npos;
      EXPECT_EQ(fs::is_empty(folder / "segments/endoscope"), stated) << what;
      EXPECT_FALSE(fs::is_empty(folder / "segments/vitals")) << what;
      erase(real_file_system());
      EXPECT_TRUE(fs::is_empty(folder / "segments/endoscope")) << what;
      EXPECT_THAT(broken(archive), testing::IsEmpty()) << what << ", erased again";
      ASSERT_FALSE(testing::Test::HasFailure()) << what;
    }
  }
  EXPECT_GT(told, 0U);
  std::cout << points << " points, of which " << told << " were told\n";
}

}  // namespace
}  // namespace kiroku::archive
