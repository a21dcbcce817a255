#include "archive/upkeep/recovery.h"

#include <algorithm>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/ledger_tail.h"
#include "archive/format/log_entry.h"
#include "archive/upkeep/holds.h"
#include "archive/upkeep/retention.h"
#include "archive/verify/found_files.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/log_reading.h"
#include "evidence/shared_token.h"
#include "tests/support/case_kit.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/sample_case.h"
#include "timestamp/token.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::contents;
using test::entries_of;
using test::FaultFileSystem;
using test::SampleArchive;
using test::SampleCase;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::ThrowsMessage;

const char* const kBoot = "00000000-0000-4000-8000-000000000000";

/// An archive whose recorder died, and the start after it.
class RecoveryTest : public testing::Test {
 protected:
  RecoveryOptions options() {
    RecoveryOptions options;
    options.archive = archive_.folder();
    options.key = &archive_.key();
    options.device_name = SampleArchive::kDeviceName;
    options.boot_id = kBoot;
    options.log = log();
    options.now = [this] { return archive_.now().utc; };
    options.stamp = [this](const StoredCheckpoint& over) {
      CheckpointStamp stamp;
      stamp.authority = SampleArchive::kAuthorityName;
      stamp.response = archive_.stamp(over.note);
      stamp.facts = SampleArchive::facts_of(stamp.response);
      return std::vector<CheckpointStamp>{stamp};
    };
    return options;
  }

  ApplianceLog* log() {
    if (!log_) {
      log_ = ApplianceLog::open(real_file_system(), archive_.log_folder(), archive_.key(),
                                SampleArchive::kDeviceName);
    }
    return log_.get();
  }

  std::vector<CaseRecovery> recover() { return recover(options()); }
  std::vector<CaseRecovery> recover(const RecoveryOptions& options) {
    return recover(options, real_file_system());
  }
  std::vector<CaseRecovery> recover(const RecoveryOptions& options, FileSystem& files) {
    const RecordingLock lock = RecordingLock::take(files, archive_.folder());
    return recover_archive(files, options, lock);
  }

  VerificationReport verify(const fs::path& folder) { return verify_case(folder, archive_.options()); }
  static std::vector<std::string> codes(const VerificationReport& report) {
    std::vector<std::string> codes;
    for (const Finding& finding : report.findings) {
      codes.push_back(finding.code);
    }
    return codes;
  }

  static std::vector<std::string> types(const fs::path& folder) {
    std::vector<std::string> types;
    for (const CaseEntry& entry : entries_of(folder)) {
      types.emplace_back(type_of(entry.body));
    }
    return types;
  }

  /// The time of last change of a file, as case-clock time.
  static void change_at(const fs::path& file, std::int64_t mono_ns) {
    const auto utc = SampleArchive::opened_at() +
                     std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::nanoseconds(mono_ns));
    fs::last_write_time(file, std::chrono::file_clock::from_sys(utc));
  }

  SampleArchive archive_;
  std::unique_ptr<ApplianceLog> log_;
};

// The profile was changed and the recorder died: nobody knows the new one but by the file's name.
TEST_F(RecoveryTest, AdoptsASegmentOfAnotherProfileThanItsStreams) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    folder = sample.folder();
    sample.record();
    const auto cut = sample.writer().begin_segment(0, 3, "lossless");
    cut->write(Bytes(200'000, std::byte{7}));
  }
  change_at(folder / "segments/endoscope/00000003.mkv.age.part", 8 * kSecond);
  archive_.now_ns = 60 * kSecond;
  const std::vector<CaseRecovery> recovered = recover();
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].problem, "");
  EXPECT_EQ(recovered[0].segments, 1U);
  const VerificationReport report = verify(folder);
  EXPECT_EQ(report.verdict, Verdict::kIntactWithGaps);
  EXPECT_THAT(codes(report), testing::Contains("segment-uncounted"));
  EXPECT_TRUE(fs::exists(folder / "segments/endoscope/00000003.mkv.age.part"));
}

TEST_F(RecoveryTest, AnArchiveThatWasLeftProperlyIsLeftAlone) {
  const fs::path folder = SampleCase::write(archive_);
  const std::string before = contents(folder / "ledger.jsonl");
  EXPECT_THAT(recover(), IsEmpty());
  EXPECT_EQ(contents(folder / "ledger.jsonl"), before);
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntact);
}

TEST_F(RecoveryTest, AnExcerptIsNoCaseThatMustBeBroughtToItsEnd) {
  const fs::path folder = SampleCase::write(archive_);
  fs::remove_all(folder / "segments");
  fs::rename(folder / kLedgerFile, folder / "ledger-part.jsonl");
  std::ofstream(folder / "excerpt.json") << "{}\n";
  EXPECT_THAT(recover(), IsEmpty());
  EXPECT_FALSE(fs::exists(folder / kLedgerFile));
}

TEST_F(RecoveryTest, AdoptsATokenThatOthersShareAndNoOtherOfThatAuthorityBesideIt) {
  fs::path folder;
  std::uint64_t size = 0;
  {
    SampleCase sample(archive_);
    folder = sample.folder();
    sample.record();
    const StoredCheckpoint over = sample.writer().checkpoint(archive_.now());
    size = over.size;
    std::string why;
    const Bytes own = archive_.stamp(over.note);
    const Bytes digest = crypto::digest(crypto::HashAlgorithm::kSha256, bytes_of(over.note));
    const Bytes shared = evidence::StampedRound({{digest}}, [&](crypto::HashAlgorithm, ByteView) {
                           return timestamp::parse_response(own, why)->token;
                         }).file_of(0);
    real_file_system().write_durably(folder / token_path(size, "embedded", TokenForm::kShared), shared);
    real_file_system().write_durably(folder / token_path(size, "swiss"), own);
    real_file_system().write_durably(folder / token_path(size, "swiss", TokenForm::kShared), shared);
  }
  archive_.now_ns = 60 * kSecond;
  const std::vector<CaseRecovery> recovered = recover();
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].problem, "");
  EXPECT_EQ(recovered[0].tokens, 2U);
  std::ifstream ledger(folder / kLedgerFile);
  const std::string lines{std::istreambuf_iterator<char>(ledger), {}};
  EXPECT_THAT(lines, HasSubstr(token_path(size, "embedded", TokenForm::kShared)));
  EXPECT_THAT(lines, HasSubstr(token_path(size, "swiss")));
  EXPECT_THAT(lines, Not(HasSubstr(token_path(size, "swiss", TokenForm::kShared))));
}

TEST_F(RecoveryTest, AdoptsWhatWasDurableAndStatesWhatWasLost) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    folder = sample.folder();
    sample.record();
    // A segment that was finished and not entered, one that was being written, a token without its entry.
    sample.segment(0, 3, {});
    const auto cut = sample.writer().begin_segment(0, 4);
    cut->write(Bytes(200'000, std::byte{7}));
    const auto empty = sample.writer().begin_segment(1, 1);
    const StoredCheckpoint over = sample.writer().checkpoint(archive_.now());
    real_file_system().write_durably(folder / token_path(over.size, "embedded"), archive_.stamp(over.note));
    std::ofstream(folder / "ledger.jsonl", std::ios::app) << R"({"type":"segment","seq":)";
    std::ofstream(folder / "checkpoints/00000099.note.part") << "half";
  }
  change_at(folder / "segments/endoscope/00000003.ts.age", 8 * kSecond);
  change_at(folder / "segments/endoscope/00000004.ts.age.part", 9 * kSecond + 500'000'000);
  archive_.now_ns = 60 * kSecond;

  const std::vector<CaseRecovery> recovered = recover();
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].problem, "");
  EXPECT_EQ(recovered[0].outcome, CaseRecovery::Outcome::kRecovered);
  EXPECT_EQ(recovered[0].after, "crash");
  EXPECT_EQ(recovered[0].segments, 2U);
  EXPECT_EQ(recovered[0].incomplete, 1U);
  EXPECT_EQ(recovered[0].tokens, 1U);
  EXPECT_TRUE(recovered[0].stamped);
  EXPECT_THAT(recovered[0].truncated, HasSubstr("24 bytes behind the last whole line of the ledger"));
  EXPECT_THAT(recovered[0].truncated, HasSubstr("endoscope/00000004.ts.age.part, of which"));
  EXPECT_THAT(recovered[0].truncated, HasSubstr("vitals/00000001.jsonl.age.part, removed"));

  const VerificationReport report = verify(folder);
  EXPECT_EQ(report.verdict, Verdict::kIntactWithGaps);
  EXPECT_THAT(codes(report),
              testing::UnorderedElementsAre("recovered", "segment-uncounted", "segment-uncounted",
                                            "segment-incomplete", "gap", "gap"));
  const std::vector<CaseEntry> entries = entries_of(folder);
  std::vector<SegmentEntry> found;
  std::vector<GapEntry> gaps;
  for (const CaseEntry& entry : entries) {
    const auto* segment = std::get_if<SegmentEntry>(&entry.body);
    if (segment != nullptr && !segment->counted) {
      found.push_back(*segment);
    } else if (const auto* gap = std::get_if<GapEntry>(&entry.body)) {
      gaps.push_back(*gap);
    }
  }
  ASSERT_EQ(found.size(), 2U);
  EXPECT_TRUE(found[0].complete);
  EXPECT_EQ(found[0].span.start_ns, 6 * kSecond);
  EXPECT_EQ(found[0].span.end_ns, 8 * kSecond);
  EXPECT_FALSE(found[1].complete);
  EXPECT_EQ(found[1].span.start_ns, 8 * kSecond);
  EXPECT_EQ(found[1].span.end_ns, 9 * kSecond + 500'000'000);
  ASSERT_EQ(gaps.size(), 2U);
  EXPECT_EQ(gaps[0].span.start_ns, 9 * kSecond + 500'000'000);
  EXPECT_EQ(gaps[0].span.end_ns, 60 * kSecond);
  EXPECT_EQ(gaps[0].cause, GapCause::kInterrupted);
  EXPECT_EQ(gaps[1].span.start_ns, 6 * kSecond) << "nothing of the vital signs' next segment was sealed";
  EXPECT_EQ(std::get<CloseEntry>(entries[entries.size() - 2].body).reason, "recovered");
  EXPECT_EQ(read_log(archive_.log_folder()).back().type, "case-closed");
  EXPECT_THAT(recover(), IsEmpty()) << "once is enough";
}

TEST_F(RecoveryTest, AGapOfSoundAccountsForNoPictures) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    sample.writer().append({GapEntry{"endoscope", {0, 20 * kSecond}, GapCause::kInterrupted, true}},
                           archive_.now());
    folder = sample.folder();
  }
  archive_.now_ns = 60 * kSecond;
  const std::vector<CaseRecovery> recovered = recover();
  ASSERT_EQ(recovered.size(), 1U);
  ASSERT_FALSE(recovered[0].gaps.empty());
  EXPECT_EQ(recovered[0].gaps[0].stream, "endoscope");
  EXPECT_EQ(recovered[0].gaps[0].span.start_ns, 6 * kSecond);
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
}

TEST_F(RecoveryTest, AnotherBootMeansThatPowerWasLost) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
  }
  archive_.now_ns = 3600 * kSecond;
  RecoveryOptions other_boot = options();
  other_boot.boot_id = "11111111-0000-4000-8000-000000000000";
  const auto recovered = recover(other_boot);
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].after, "power-loss");
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
  EXPECT_EQ(entries_of(folder).back().at.mono_ns, 3600 * kSecond);
}

TEST_F(RecoveryTest, AWallClockSetWildlyWrongCarriesTheCaseClockOnForAMonthAtMost) {
  for (const std::int64_t seconds : {-1'000'000, 400 * 24 * 3600}) {
    archive_.clear();
    log_.reset();
    fs::path folder;
    {
      SampleCase sample(archive_);
      sample.record();
      folder = sample.folder();
    }
    RecoveryOptions wrong = options();
    wrong.stamp = {};
    wrong.now = [seconds] { return SampleArchive::opened_at() + std::chrono::seconds(seconds); };
    ASSERT_EQ(recover(wrong).size(), 1U);
    const std::int64_t mono_ns = entries_of(folder).back().at.mono_ns;
    EXPECT_EQ(mono_ns, seconds < 0 ? 6 * kSecond : (6 + 30LL * 24 * 3600) * kSecond);
    const VerificationReport report = verify(folder);
    EXPECT_EQ(report.verdict, Verdict::kIntactWithGaps);
    EXPECT_THAT(codes(report), Contains("token-missed"));
  }
}

TEST_F(RecoveryTest, BringsAClosedCaseToItsEnd) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    archive_.now_ns = 7 * kSecond;
    sample.writer().close("operator", archive_.now());
    sample.writer().checkpoint(archive_.now());
    folder = sample.folder();
  }
  archive_.now_ns = 200'000 * kSecond;  // two days later
  const auto recovered = recover();
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].problem, "");
  EXPECT_EQ(recovered[0].outcome, CaseRecovery::Outcome::kFinished);
  EXPECT_TRUE(recovered[0].stamped);
  const VerificationReport report = verify(folder);
  EXPECT_EQ(report.verdict, Verdict::kIntact);
  EXPECT_THAT(codes(report), IsEmpty());
  EXPECT_EQ(entries_of(folder).back().at.mono_ns, 7 * kSecond) << "after close the case clock stands";
}

// A recorder that dies while it adds a line behind `close`: half of it, zeros where a power cut kept it from
// the disk, or both.
TEST_F(RecoveryTest, HalfALineBehindCloseIsNoTampering) {
  const fs::path folder = SampleCase::write(archive_);
  const std::string whole = contents(folder / kLedgerFile);
  const std::size_t entries = entries_of(folder).size();
  const std::string line = whole.substr(whole.rfind('\n', whole.size() - 2) + 1);
  VerifyOptions with_key = archive_.options();
  with_key.identities = &archive_.identities();
  for (const std::string& tail :
       {std::string("{"), line.substr(0, line.size() / 2), line.substr(0, line.size() - 1),
        std::string(4096, '\0'), line.substr(0, 20) + std::string(100, '\0'),
        std::string(100, '\0') + line}) {
    SCOPED_TRACE(testing::PrintToString(tail.substr(0, 30)) + " of " + std::to_string(tail.size()));
    log_.reset();
    std::ofstream(folder / kLedgerFile, std::ios::app | std::ios::binary) << tail;
    for (const VerifyOptions& options : {archive_.options(), with_key}) {
      const VerificationReport torn = verify_case(folder, options);
      EXPECT_EQ(torn.verdict, Verdict::kIncomplete) << testing::PrintToString(codes(torn));
      EXPECT_THAT(codes(torn), Contains("ledger-torn"));
      EXPECT_EQ(torn.entries, entries);
    }
    const auto recovered = recover();
    ASSERT_THAT(recovered, testing::SizeIs(1));
    EXPECT_EQ(recovered[0].outcome, CaseRecovery::Outcome::kFinished) << recovered[0].problem;
    EXPECT_EQ(contents(folder / kLedgerFile), whole);
    EXPECT_EQ(verify(folder).verdict, Verdict::kIntact);
  }
}

TEST_F(RecoveryTest, TellsTheLogWhatItNeverHeard) {
  fs::path folder;
  {
    const SampleCase sample(archive_, false);  // as if killed before case-opened
    folder = sample.folder();
  }
  ASSERT_EQ(recover().size(), 1U);
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
  EXPECT_EQ(log()->case_state(folder.filename().string()), ApplianceLog::CaseState::kClosed);
}

TEST_F(RecoveryTest, DoesNotSignForeignCases) {
  fs::path folder;
  {
    SampleCase sample(archive_, false);  // never in the log, and yet with segments
    sample.record();
    folder = sample.folder();
  }
  const std::string before = contents(folder / "ledger.jsonl");
  const auto refused = recover();
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
  EXPECT_THAT(refused[0].problem, HasSubstr("the appliance log does not know case"));
  EXPECT_EQ(contents(folder / "ledger.jsonl"), before);

  const crypto::SigningKey other = crypto::SigningKey::generate();
  RecoveryOptions options = this->options();
  options.key = &other;
  const auto foreign = recover(options);
  ASSERT_EQ(foreign.size(), 1U);
  EXPECT_THAT(foreign[0].problem, HasSubstr("recorded by another device"));
  EXPECT_EQ(contents(folder / "ledger.jsonl"), before);
}

TEST_F(RecoveryTest, DoesNotSignALedgerThatWasChanged) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
  }
  const auto refused_after = [&](const std::string& ledger, const std::string& why, bool with_log = true) {
    std::ofstream(folder / "ledger.jsonl", std::ios::trunc) << ledger;
    RecoveryOptions options = this->options();
    options.log = with_log ? options.log : nullptr;
    const auto refused = recover(options);
    ASSERT_EQ(refused.size(), 1U);
    EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
    EXPECT_THAT(refused[0].problem, HasSubstr(why));
    EXPECT_EQ(contents(folder / "ledger.jsonl"), ledger);
  };
  const std::string ledger = contents(folder / "ledger.jsonl");
  std::string changed = ledger;
  changed[changed.find("\"offset_ns\":0") + 12] = '1';
  refused_after(changed, "are not those whose root the appliance log states");
  refused_after(changed, "does not fit its ledger", false);
  refused_after(ledger.substr(0, ledger.find('\n') + 1), "the appliance log knows");
  refused_after(ledger.substr(0, ledger.find('\n') + 1), "covers", false);
  refused_after(ledger + "{}\n", "is no entry");
  std::ofstream(folder / "ledger.jsonl", std::ios::trunc) << ledger;
  EXPECT_EQ(recover()[0].outcome, CaseRecovery::Outcome::kRecovered);
}

TEST_F(RecoveryTest, RemovesACaseThatWasNeverBegun) {
  const fs::path hidden = archive_.folder() / ".new-20260805T091502Z-3f9c21ab";
  fs::create_directories(hidden / "segments/room");
  std::ofstream(hidden / "subject.json.age.part") << "half";
  fs::create_symlink(archive_.folder(), hidden / "link");
  fs::create_directories(archive_.folder() / ".new-something-else");
  const auto removed = recover();
  ASSERT_EQ(removed.size(), 1U);
  EXPECT_EQ(removed[0].outcome, CaseRecovery::Outcome::kNotBegun);
  EXPECT_EQ(removed[0].case_id, "20260805T091502Z-3f9c21ab");
  EXPECT_FALSE(fs::exists(hidden));
  EXPECT_TRUE(fs::exists(archive_.folder() / ".new-something-else"));
}

TEST_F(RecoveryTest, LeavesACaseAloneThatIsBeingWritten) {
  SampleCase sample(archive_);
  sample.record();
  const auto refused = recover();
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
  EXPECT_THAT(refused[0].problem, HasSubstr("another process is writing"));
  sample.close();
  EXPECT_EQ(verify(sample.folder()).verdict, Verdict::kIntact);
}

TEST_F(RecoveryTest, OneBadCaseDoesNotKeepTheOthersFromBeingRecovered) {
  fs::path bad;
  fs::path good;
  {
    SampleCase first(archive_);
    first.record();
    SampleCase second(archive_);
    second.record();
    bad = std::min(first.folder(), second.folder());
    good = std::max(first.folder(), second.folder());
  }
  fs::resize_file(bad / "ledger.jsonl", 0);
  const auto results = recover();
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(results[0].outcome, CaseRecovery::Outcome::kRefused);
  EXPECT_EQ(results[1].outcome, CaseRecovery::Outcome::kRecovered);
  EXPECT_EQ(verify(good).verdict, Verdict::kIntactWithGaps);
}

TEST_F(RecoveryTest, AFolderThatNobodyCanReadKeepsTheRecorderFromNothing) {
  const auto folder = [this](const std::string& id) {
    const fs::path made = archive_.folder() / id;
    fs::create_directories(made);
    return made;
  };
  folder("20200101T000000Z-00000000");
  std::ofstream(folder("20200101T000000Z-00000001") / "checkpoints") << "a file in the place of a folder";
  // A hole of a terabyte, which takes 4 KiB of the disk.
  const fs::path sparse = folder("20200101T000000Z-00000002");
  fs::create_directories(sparse / "checkpoints");
  std::ofstream(sparse / "ledger.jsonl").close();
  fs::resize_file(sparse / "ledger.jsonl", std::uintmax_t{1} << 40U);
  std::ofstream(sparse / "ledger.jsonl", std::ios::app) << '\n';
  const std::vector<CaseRecovery> found = recover();
  ASSERT_EQ(found.size(), 3U);
  for (const CaseRecovery& each : found) {
    EXPECT_EQ(each.outcome, CaseRecovery::Outcome::kRefused) << each.case_id;
    EXPECT_THAT(each.problem, Not(IsEmpty()));
  }
}

// The start waits for recovery: a file of 8 TiB takes no room on the disk and three hours to read.
TEST_F(RecoveryTest, LeavesAPartAsideThatIsAHoleOfTebibytes) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
    sample.writer().begin_segment(0, 3)->write(Bytes(200'000, std::byte{7}));
    sample.writer().begin_segment(1, 1)->write(Bytes(200'000, std::byte{7}));
  }
  const fs::path hole = folder / "segments/endoscope/00000003.ts.age.part";
  fs::resize_file(hole, std::uintmax_t{8} << 40U);
  const auto results = recover();
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].outcome, CaseRecovery::Outcome::kRecovered);
  EXPECT_THAT(results[0].problem,
              HasSubstr("00000003.ts.age.part is left as it is: it has 8796093022208 bytes"));
  EXPECT_THAT(results[0].truncated, HasSubstr("endoscope/00000003.ts.age.part and what follows it, left"));
  EXPECT_EQ(results[0].segments, 1U) << "the other stream's";
  EXPECT_TRUE(fs::exists(hole));
  const VerificationReport report = verify(folder);
  EXPECT_EQ(report.verdict, Verdict::kIntactWithGaps);
  EXPECT_THAT(codes(report), Contains("part-file"));
  EXPECT_THAT(recover(), IsEmpty());
}

TEST_F(RecoveryTest, TakesUpNoMoreThanARecorderThatDiesLeaves) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
    for (std::uint64_t index = 3; index < 6; ++index) {
      sample.writer().begin_segment(0, index)->write(Bytes(200'000, std::byte{7}));
    }
  }
  RecoveryOptions limited = options();
  limited.most_found_bytes = 500'000;
  const auto results = recover(limited);
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].segments, 2U);
  EXPECT_THAT(results[0].problem, HasSubstr("00000005.ts.age.part is left as it is: more lies there"));
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
}

// Whoever can write to the disk between a crash and the next start: what the recorder signs as film is film
// by its form, and the time of what is not is lost and stated.
TEST_F(RecoveryTest, EntersNothingAsCompleteThatNobodySealed) {
  for (const std::string& planted : {std::string(), std::string("no film"), std::string(200'000, '\0')}) {
    archive_.clear();
    log_.reset();
    fs::path folder;
    {
      SampleCase sample(archive_);
      sample.record();
      folder = sample.folder();
      sample.writer().begin_segment(0, 3)->write(Bytes(200'000, std::byte{7}));
    }
    fs::remove(folder / "segments/endoscope/00000003.ts.age.part");
    for (const char* name : {"00000003", "00000004", "00000005"}) {
      std::ofstream(folder / "segments/endoscope" / (std::string(name) + ".ts.age")) << planted;
    }
    archive_.now_ns = 60 * kSecond;
    const auto results = recover();
    ASSERT_EQ(results.size(), 1U);
    EXPECT_EQ(results[0].outcome, CaseRecovery::Outcome::kRecovered);
    EXPECT_EQ(results[0].segments, 0U);
    EXPECT_THAT(results[0].problem,
                HasSubstr("00000003.ts.age is left as it is: it has the name of a segment"));
    EXPECT_THAT(results[0].truncated, HasSubstr("endoscope/00000003.ts.age and what follows it, left"));
    EXPECT_TRUE(fs::exists(folder / "segments/endoscope/00000005.ts.age"));
    std::vector<Span> gaps;
    for (const CaseEntry& entry : entries_of(folder)) {
      const auto* gap = std::get_if<GapEntry>(&entry.body);
      if (gap != nullptr && gap->stream == "endoscope") gaps.push_back(gap->span);
    }
    ASSERT_EQ(gaps.size(), 1U);
    EXPECT_EQ(gaps[0].start_ns, 6 * kSecond);
    EXPECT_EQ(gaps[0].end_ns, 60 * kSecond);
    EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
    EXPECT_THAT(recover(), IsEmpty());
  }
}

TEST_F(RecoveryTest, TakesUpThePartBesideWhatSomebodyPutThere) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
    sample.writer().begin_segment(0, 3)->write(Bytes(200'000, std::byte{7}));
  }
  std::ofstream(folder / "segments/endoscope/00000003.ts.age") << "no film";
  const auto results = recover();
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].segments, 1U);
  EXPECT_EQ(results[0].incomplete, 1U);
  EXPECT_THAT(results[0].truncated, HasSubstr("endoscope/00000003.ts.age, left as it is"));
  EXPECT_THAT(results[0].truncated, HasSubstr("endoscope/00000003.ts.age.part, of which"));
  EXPECT_TRUE(fs::exists(folder / "segments/endoscope/00000003.ts.age"));
}

// A monitor may have said nothing, and then its segment is sealed, and empty.
TEST_F(RecoveryTest, EntersWhatWasSealedWithNothingInItOfAMonitor) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
    for (const std::size_t stream : {0U, 1U}) {
      const auto segment = sample.writer().begin_segment(stream, stream == 0 ? 3 : 1);
      segment->seal();
      segment->commit();
    }
  }
  const auto results = recover();
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].segments, 1U);
  EXPECT_THAT(results[0].truncated, HasSubstr("endoscope/00000003.ts.age and what follows it, left"));
  EXPECT_THAT(results[0].truncated, Not(HasSubstr("vitals/00000001.jsonl.age")));
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
}

TEST_F(RecoveryTest, TakesUpNoMoreFilesThanARecorderHolds) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
  }
  const fs::path films = folder / "segments/endoscope";
  for (std::uint64_t index = 3; index < 103; ++index) {
    fs::copy_file(films / "00000002.ts.age", folder / segment_path("endoscope", index, "ts"));
  }
  archive_.now_ns = 1'000 * kSecond;
  const auto results = recover();
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].segments, kMostFoundSegments);
  EXPECT_THAT(results[0].problem, HasSubstr("00000067.ts.age is left as it is: more files lie there"));
  EXPECT_THAT(results[0].truncated, HasSubstr("endoscope/00000067.ts.age and what follows it, left"));
  EXPECT_TRUE(fs::exists(films / "00000102.ts.age"));
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
  EXPECT_THAT(recover(), IsEmpty());
}

TEST_F(RecoveryTest, JudgesNoMoreTokensThanARecorderLeaves) {
  fs::path folder;
  StoredCheckpoint over;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
    over = sample.writer().checkpoint(archive_.now());
    real_file_system().write_durably(folder / token_path(over.size, "embedded"), archive_.stamp(over.note));
  }
  for (int i = 0; i < 100; ++i) {
    std::ofstream(folder / token_path(1, "planted-" + std::to_string(i))) << "<html>";
  }
  const auto results = recover();
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].tokens, 1U) << "the newest are looked at";
  EXPECT_TRUE(results[0].stamped);
}

TEST_F(RecoveryTest, LeavesATokenAsideThatIsNone) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
    std::ofstream(folder / "tokens/00000001.swiss.tsr") << "<html>";
  }
  const auto results = recover();
  ASSERT_EQ(results.size(), 1U);
  EXPECT_THAT(results[0].problem, HasSubstr("tokens/00000001.swiss.tsr is left as it is"));
  const VerificationReport report = verify(folder);
  EXPECT_EQ(report.verdict, Verdict::kIntactWithGaps);
  EXPECT_THAT(codes(report), Contains("token-not-entered"));
}

// -- a disk that cannot be read

TEST_F(RecoveryTest, APartThatCannotBeReadIsNotRemovedAsEmpty) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
    const auto cut = sample.writer().begin_segment(0, 3);
    cut->write(Bytes(200'000, std::byte{7}));
  }
  const fs::path part = folder / "segments/endoscope/00000003.ts.age.part";
  const std::string before = contents(part);
  FaultFileSystem files(archive_.folder());
  const std::string read = "read " + part.lexically_relative(archive_.folder()).generic_string();
  for (const auto fault : {FaultFileSystem::ReadFault::kFails, FaultFileSystem::ReadFault::kEndsEarly}) {
    files.fail_reading(read, fault);
    const auto refused = recover(options(), files);
    ASSERT_EQ(refused.size(), 1U);
    EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
    EXPECT_THAT(refused[0].problem, HasSubstr("00000003.ts.age.part"));
    EXPECT_EQ(contents(part), before);
  }
  files.heal();
  const auto recovered = recover(options(), files);
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].problem, "");
  EXPECT_EQ(recovered[0].incomplete, 1U);
  EXPECT_EQ(contents(part), before);
}

TEST_F(RecoveryTest, ATokenThatCannotBeReadIsNotJudgedAndComesIntoTheLedgerLater) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
    const StoredCheckpoint over = sample.writer().checkpoint(archive_.now());
    real_file_system().write_durably(folder / token_path(over.size, "embedded"), archive_.stamp(over.note));
  }
  FaultFileSystem files(archive_.folder());
  const std::string tokens = (folder / kTokensFolder).lexically_relative(archive_.folder()).generic_string();
  for (const std::string call : {"open ", "read "}) {
    files.fail_reading(call + tokens + "/", FaultFileSystem::ReadFault::kFails);
    const auto refused = recover(options(), files);
    ASSERT_EQ(refused.size(), 1U);
    EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
    EXPECT_THAT(refused[0].problem, HasSubstr("Input/output error"));
    EXPECT_THAT(types(folder), Not(Contains("close")));
  }
  files.heal();
  const auto recovered = recover(options(), files);
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].problem, "");
  EXPECT_EQ(recovered[0].tokens, 1U);
}

TEST_F(RecoveryTest, ALogThatEndsEarlyExcusesNothing) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
  }
  const std::string before = contents(folder / "ledger.jsonl");
  FaultFileSystem files(archive_.folder());
  const RecoveryOptions with_log = options();
  files.fail_reading("read log/ledger.jsonl", FaultFileSystem::ReadFault::kEndsEarly);
  const auto refused = recover(with_log, files);
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
  EXPECT_THAT(refused[0].problem, HasSubstr("check the disk"));
  EXPECT_EQ(contents(folder / "ledger.jsonl"), before);
}

TEST_F(RecoveryTest, AFolderThatCannotBeExaminedKeepsTheRecorderFromNothing) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
  }
  fs::create_directories(archive_.folder() / "20200101T000000Z-00000000");
  FaultFileSystem files(archive_.folder());
  files.fail_reading("examine 20200101T000000Z-00000000", FaultFileSystem::ReadFault::kFails);
  const auto results = recover(options(), files);
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(results[0].outcome, CaseRecovery::Outcome::kRefused);
  EXPECT_THAT(results[0].problem, HasSubstr("Input/output error"));
  EXPECT_EQ(results[1].folder, folder);
  EXPECT_EQ(results[1].outcome, CaseRecovery::Outcome::kRecovered);
}

TEST(RecordingLock, KeepsASecondRecorderOff) {
  const test::TemporaryFolder folder;
  const auto first = std::make_unique<RecordingLock>(RecordingLock::take(real_file_system(), folder.path()));
  try {
    RecordingLock::take(real_file_system(), folder.path());
    FAIL() << "taken twice";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("another recorder (process " + std::to_string(::getpid()) + ")"));
  }
}

TEST(RecordingLock, IsFreeAgainWhenItsHolderIsGone) {
  const test::TemporaryFolder folder;
  { const RecordingLock first = RecordingLock::take(real_file_system(), folder.path()); }
  EXPECT_NO_THROW(RecordingLock::take(real_file_system(), folder.path()));
}

TEST(LedgerTail, FindsCloseHoweverMuchFollows) {
  SampleArchive archive;
  fs::path folder;
  {
    SampleCase sample(archive);
    sample.record();
    sample.writer().close("operator", archive.now());
    for (int i = 0; i < 3; ++i) {
      sample.writer().append({TokenMissedEntry{1, "swiss", std::string(90'000, 'x')}}, archive.now());
    }
    sample.writer().finish(archive.now());
    folder = sample.folder();
  }
  const auto tail = read_ledger_tail(folder);
  ASSERT_TRUE(tail);
  EXPECT_TRUE(tail->closed);
  EXPECT_TRUE(tail->covered);
  EXPECT_EQ(tail->entries, entries_of(folder).size());
  std::ofstream(folder / "ledger.jsonl", std::ios::app) << "{";
  EXPECT_FALSE(read_ledger_tail(folder)) << "a torn end is no end";
}

// -- retention

class RetentionTest : public RecoveryTest {
 protected:
  RetentionOptions retention() {
    const RecoveryOptions same = options();
    RetentionOptions retention;
    retention.key = same.key;
    retention.device_name = same.device_name;
    retention.log = same.log;
    retention.stamp = same.stamp;
    retention.now = same.now;
    return retention;
  }
  Erasure erase(const fs::path& folder, const std::string& stream) {
    return erase_stream(real_file_system(), retention(), folder, stream, "room: 30 days");
  }
};

TEST_F(RetentionTest, BytesGoAndTheProofStays) {
  const fs::path folder = SampleCase::write(archive_);
  archive_.now_ns = 40LL * 24 * 3600 * kSecond;
  const Erasure erasure = erase(folder, "endoscope");
  EXPECT_EQ(erasure.segments, 3U);
  EXPECT_GT(erasure.bytes, 3U * 70'000);
  EXPECT_TRUE(erasure.stamped);
  EXPECT_TRUE(fs::is_empty(folder / "segments/endoscope"));
  const VerificationReport report = verify(folder);
  EXPECT_EQ(report.verdict, Verdict::kIntactWithGaps);
  EXPECT_THAT(codes(report), ElementsAre("segments-erased"));
  EXPECT_EQ(report.findings[0].text,
            "3 segments of endoscope (0 to 2) were erased by the policy \"room: 30 days\", as the recorder "
            "states it");
  ASSERT_EQ(report.streams.size(), 2U);
  EXPECT_EQ(report.streams[0].erased_segments, 3U);
  EXPECT_EQ(report.streams[1].erased_segments, 0U);
  EXPECT_THAT(recover(), IsEmpty());

  const Erasure again = erase(folder, "endoscope");
  EXPECT_EQ(again.segments, 0U) << "what is erased is not erased again";
  const Erasure rest = erase(folder, "vitals");
  EXPECT_EQ(rest.segments, 1U);
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntactWithGaps);
  EXPECT_NE(verify_log(archive_.log_folder(), archive_.options()).verdict, Verdict::kTampered);
}

TEST_F(RetentionTest, AnErasedStreamDoesNotExcuseTheWholeCase) {
  const fs::path folder = SampleCase::write(archive_);
  erase(folder, "endoscope");
  fs::remove_all(folder);
  const VerificationReport report = verify_log(archive_.log_folder(), archive_.options());
  EXPECT_THAT(codes(report), Contains("case-missing"));
}

TEST_F(RetentionTest, NothingIsErasedThatIsNotClosed) {
  fs::path folder;
  {
    SampleCase sample(archive_);
    sample.record();
    folder = sample.folder();
    EXPECT_THROW(erase(folder, "endoscope"), UsageError) << "being recorded";
  }
  EXPECT_THROW(erase(folder, "endoscope"), UsageError) << "left unclosed";
  EXPECT_TRUE(fs::exists(folder / "segments/endoscope/00000000.ts.age"));
  recover();
  EXPECT_EQ(erase(folder, "endoscope").segments, 3U);
}

TEST_F(RetentionTest, RefusesWhatMakesNoSense) {
  const fs::path folder = SampleCase::write(archive_);
  EXPECT_THROW(erase(folder, "nobody"), UsageError);
  EXPECT_THROW(erase_stream(real_file_system(), retention(), folder, "vitals", ""), UsageError);
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntact);
}

TEST_F(RetentionTest, WhatIsHeldIsKeptUntilEveryHoldIsReleased) {
  const fs::path folder = SampleCase::write(archive_);
  const std::string id = folder.filename().string();
  const std::uint64_t first = log()->case_held(id, "court order", "anna");
  const std::uint64_t second = log()->case_held(id, "complaint", "ben");
  const auto said = [&] {
    try {
      erase(folder, "endoscope");
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(said(),
              AllOf(HasSubstr("under legal hold since 2"), HasSubstr("by anna): court order; 1 more")));
  log()->case_released(id, first, "settled", "anna");
  EXPECT_THAT(said(), HasSubstr("by ben): complaint"));
  log()->case_released("20200101T000000Z-00000000", second, "of another case", "ben");
  EXPECT_THAT(said(), HasSubstr("complaint"));
  EXPECT_THAT(codes(verify(folder)), IsEmpty());
  log()->case_released(id, second, "settled", "ben");
  EXPECT_EQ(said(), "");
  EXPECT_THAT(codes(verify(folder)), ElementsAre("segments-erased"));
}

TEST_F(RetentionTest, AHoldThatSomebodyTookOutOfTheLogLetsNothingGo) {
  const fs::path folder = SampleCase::write(archive_);
  log()->case_held(folder.filename().string(), "court order", "anna");
  log()->access("*", "unlocked", "ben");
  const fs::path ledger = archive_.log_folder() / "ledger.jsonl";
  const auto lines = read_log(archive_.log_folder());
  std::string without;
  for (const LogLine& line : lines) {
    without += line.type == "case-held" ? "" : line.json + "\n";
  }
  std::ofstream(ledger, std::ios::binary) << without;
  EXPECT_THAT([&] { read_holds(archive_.log_folder(), archive_.device()); },
              ThrowsMessage<Error>(HasSubstr("nobody can tell which cases are under legal hold")));
  EXPECT_THAT(codes(verify_log(archive_.log_folder(), archive_.options())), Contains("ledger-cut"));
  // With as many lines as before, and without the checkpoints that speak against them.
  std::string other;
  for (const LogLine& line : lines) {
    other += line.type == "case-held" ? lines.back().json + "\n" : line.json + "\n";
  }
  std::ofstream(ledger, std::ios::binary) << other;
  EXPECT_THAT([&] { read_holds(archive_.log_folder(), archive_.device()); },
              ThrowsMessage<Error>(HasSubstr("does not fit its newest checkpoint")));
  for (const auto& note : fs::directory_iterator(archive_.log_folder() / "checkpoints")) {
    fs::remove(note);
  }
  const LogEntry first = parse_log_entry(lines.front().json).entry.value();
  std::ofstream(ledger, std::ios::binary)
      << lines.front().json << "\n"
      << to_line({1, first.at, CaseHeldEntry{folder.filename().string(), "made up", "nobody"}}) << "\n";
  EXPECT_THAT([&] { read_holds(archive_.log_folder(), archive_.device()); },
              ThrowsMessage<Error>(HasSubstr("has no checkpoint")));
}

TEST_F(RetentionTest, AReleaseThatNobodySignedReleasesNothingAndAHoldThatNobodySignedHolds) {
  const fs::path folder = SampleCase::write(archive_);
  const std::string id = folder.filename().string();
  const std::uint64_t hold = log()->case_held(id, "court order", "anna");
  const auto add = [&](LogEntryBody body) {
    const auto lines = read_log(archive_.log_folder());
    const LogEntry last = parse_log_entry(lines.back().json).entry.value();
    std::ofstream(archive_.log_folder() / "ledger.jsonl", std::ios::app)
        << to_line({lines.size(), last.at, std::move(body)}) << "\n";
  };
  add(CaseReleasedEntry{id, hold, "settled", "nobody"});
  EXPECT_THAT(why_held(read_holds(archive_.log_folder(), archive_.device()), id), HasSubstr("court order"));
  add(CaseHeldEntry{"20200101T000000Z-00000000", "made up", "nobody"});
  EXPECT_EQ(read_holds(archive_.log_folder(), archive_.device()).size(), 2U);
}

TEST_F(RetentionTest, AnErasureThatWasCutOffWaitsWhileItsCaseIsHeld) {
  const fs::path folder = SampleCase::write(archive_);
  const std::string id = folder.filename().string();
  {
    const auto writer = CaseWriter::resume(real_file_system(), folder, archive_.key(),
                                           SampleArchive::kDeviceName, log(), [](const CaseEntry&) {});
    writer->append({ErasedEntry{"endoscope", 0, 2, "room: 30 days"}}, archive_.now());
    writer->checkpoint(archive_.now());
  }
  const std::uint64_t hold = log()->case_held(id, "court order", "anna");
  EXPECT_THAT(recover(), IsEmpty()) << "nothing may be done";
  EXPECT_THAT(codes(verify(folder)), Contains("erased-file-present"));
  log()->case_released(id, hold, "settled", "anna");
  EXPECT_THAT(recover(), IsEmpty()) << "whoever releases it has not said that it may go";
  EXPECT_THAT(codes(verify(folder)), Contains("erased-file-present"));
  EXPECT_EQ(erase(folder, "endoscope").left_before, 3U);
  EXPECT_THAT(codes(verify(folder)), ElementsAre("segments-erased"));
  const auto lines = read_log(archive_.log_folder());
  EXPECT_EQ(std::ranges::count(lines, "erased", &LogLine::type), 1) << "the log knows it, too";
}

TEST_F(RetentionTest, AnErasureThatWasCutOffWaitsWhereAConsentWasGivenAgain) {
  const fs::path folder = SampleCase::write(archive_);
  const std::string id = folder.filename().string();
  const ConsentStatement statement{id, {"teaching"}, {}, {}, "anna"};
  log()->consent_given(statement);
  RetentionOptions failing = retention();
  failing.stamp = [](const StoredCheckpoint&) -> std::vector<CheckpointStamp> { throw Error("no power"); };
  EXPECT_THAT([&] { erase_stream(real_file_system(), failing, folder, "endoscope", "no consent"); },
              ThrowsMessage<ErasureCutOff>(AllOf(HasSubstr("no power"), HasSubstr("`kiroku recover`"))));
  log()->consent_withdrawn(statement);
  log()->consent_given(statement);
  EXPECT_THAT(why_erasure_waits(archive_.log_folder(), id), HasSubstr("a consent was given again"));
  EXPECT_THAT(recover(), IsEmpty());
  EXPECT_THAT(codes(verify(folder)), Contains("erased-file-present"));
}

TEST_F(RetentionTest, WhatWasChangedIsNotStatedAsErased) {
  const fs::path folder = SampleCase::write(archive_);
  const fs::path changed = folder / "segments/endoscope/00000001.ts.age";
  fs::remove(folder / "segments/endoscope/00000000.ts.age");
  std::fstream(changed, std::ios::in | std::ios::out | std::ios::binary).seekp(5'000).write("changed", 7);
  const Erasure erasure = erase(folder, "endoscope");
  EXPECT_EQ(erasure.segments, 1U);
  EXPECT_THAT(erasure.not_as_recorded,
              ElementsAre("segments/endoscope/00000000.ts.age is missing",
                          "segments/endoscope/00000001.ts.age has another hash than its ledger says"));
  EXPECT_TRUE(fs::exists(changed));
  EXPECT_FALSE(fs::exists(folder / "segments/endoscope/00000002.ts.age"));
  EXPECT_EQ(verify(folder).verdict, Verdict::kTampered);
}

TEST_F(RetentionTest, AnErasureThatWasCutOffIsBroughtToItsEnd) {
  const fs::path folder = SampleCase::write(archive_);
  {
    const auto writer = CaseWriter::resume(real_file_system(), folder, archive_.key(),
                                           SampleArchive::kDeviceName, log(), [](const CaseEntry&) {});
    writer->append({ErasedEntry{"endoscope", 0, 2, "room: 30 days"}}, archive_.now());
    writer->checkpoint(archive_.now());
  }
  EXPECT_THAT(codes(verify(folder)), Contains("erased-file-present"));
  const auto finished = recover();
  ASSERT_EQ(finished.size(), 1U);
  EXPECT_EQ(finished[0].problem, "");
  EXPECT_EQ(finished[0].outcome, CaseRecovery::Outcome::kFinished);
  EXPECT_EQ(finished[0].erased_files, 3U);
  EXPECT_THAT(codes(verify(folder)), ElementsAre("segments-erased"));
  std::vector<std::string> types;
  for (const LogLine& line : read_log(archive_.log_folder())) {
    types.push_back(line.type);
  }
  EXPECT_EQ(std::count(types.begin(), types.end(), "erased"), 1);
  EXPECT_EQ(std::count(types.begin(), types.end(), "case-closed"), 1);
  EXPECT_THAT(recover(), IsEmpty());
}

TEST_F(RetentionTest, AnErasureThatWasCutOffBeforeItWasSignedIsTakenBack) {
  const fs::path folder = SampleCase::write(archive_);
  const std::string before = contents(folder / "ledger.jsonl");
  {
    const auto writer = CaseWriter::resume(real_file_system(), folder, archive_.key(),
                                           SampleArchive::kDeviceName, log(), [](const CaseEntry&) {});
    writer->append({ErasedEntry{"endoscope", 0, 2, "room: 30 days"}}, archive_.now());
  }
  const auto finished = recover();
  ASSERT_EQ(finished.size(), 1U);
  EXPECT_THAT(finished[0].problem, HasSubstr("stated an erasure that nobody had signed"));
  EXPECT_EQ(contents(folder / "ledger.jsonl"), before);
  EXPECT_EQ(verify(folder).verdict, Verdict::kIntact);
  EXPECT_THAT(recover(), IsEmpty());
  EXPECT_EQ(erase(folder, "endoscope").segments, 3U);
}

}  // namespace
}  // namespace kiroku::archive
