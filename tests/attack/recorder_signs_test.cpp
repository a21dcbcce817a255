// Whoever can write to the archive's disk, and has no key, prepares a case or the log and waits for the
// recorder's next start: what that signs is believed everywhere.
#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <memory>
#include <string>
#include <sys/file.h>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/log_entry.h"
#include "archive/reading/replica.h"
#include "archive/upkeep/holds.h"
#include "archive/upkeep/recovery.h"
#include "archive/upkeep/retention.h"
#include "archive/verify/found_files.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/log_reading.h"
#include "base/descriptor.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "tests/attack/attacked_case.h"
#include "tests/support/report_text.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::CaseRecovery;
using archive::Verdict;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::ThrowsMessage;

constexpr const char* kFirstSegment = "segments/endoscope/00000000.ts.age";

/// An archive, and the recorder that starts again after somebody was at its disk.
class NextStart : public ::testing::Test {
 protected:
  /// A closed case.
  void write_case() { folder_ = SampleCase::write(archive_); }
  /// A case whose recorder died after its last checkpoint; `more` may go on before it does.
  void cut_off_case(const std::function<void(SampleCase&)>& more = {}) {
    SampleCase sample(archive_);
    sample.record();
    sample.writer().checkpoint(archive_.now());
    if (more) {
      more(sample);
    }
    folder_ = sample.folder();
  }

  std::vector<CaseRecovery> start(const archive::VerifyOptions& trusting = {}) {
    const auto log = open_log();
    archive::RecoveryOptions options;
    options.trust = trusting.trust;
    options.carry_on = [this](const archive::CutOffCase& cut) {
      asked_to_carry_on_.push_back(cut.case_id);
      return "";
    };
    options.archive = archive_.folder();
    options.key = &archive_.key();
    options.device_name = SampleArchive::kDeviceName;
    options.boot_id = "00000000-0000-4000-8000-000000000000";
    options.log = log.get();
    options.now = [this] { return archive_.now().utc; };
    options.stamp = [this](const archive::StoredCheckpoint& over) {
      archive::CheckpointStamp stamp;
      stamp.authority = SampleArchive::kAuthorityName;
      stamp.response = archive_.stamp(over.note);
      stamp.facts = SampleArchive::facts_of(stamp.response);
      return std::vector<archive::CheckpointStamp>{stamp};
    };
    const auto lock = archive::RecordingLock::take(archive::real_file_system(), archive_.folder());
    return archive::recover_archive(archive::real_file_system(), options, lock);
  }
  std::unique_ptr<archive::ApplianceLog> open_log() {
    return archive::ApplianceLog::open(archive::real_file_system(), archive_.log_folder(), archive_.key(),
                                       SampleArchive::kDeviceName);
  }

  /// Adds a line that nobody signs to the case's ledger.
  void add_line(archive::CaseEntryBody body) {
    std::vector<std::string> all = lines(folder_);
    archive::CaseEntry entry = archive::parse_case_entry(all.back()).entry.value();
    entry.seq = all.size();
    entry.body = std::move(body);
    write_file(ledger(), read_file(ledger()) + archive::to_line(entry) + "\n");
  }
  void add_log_line(archive::LogEntryBody body) {
    const fs::path file = archive_.log_folder() / archive::kLedgerFile;
    std::vector<std::string> all = lines(archive_.log_folder());
    archive::LogEntry entry = archive::parse_log_entry(all.back()).entry.value();
    entry.seq = all.size();
    entry.body = std::move(body);
    write_file(file, read_file(file) + archive::to_line(entry) + "\n");
  }
  /// What the next line's checkpoint does: the device signs the log as it is.
  void sign_log() {
    const std::vector<std::string> all = lines(archive_.log_folder());
    crypto::MerkleFrontier tree;
    for (const std::string& line : all) {
      tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    }
    const crypto::Checkpoint text{archive::log_origin(SampleArchive::kDeviceName), all.size(), tree.root()};
    write_file(archive_.log_folder() / archive::note_path(all.size()),
               crypto::sign_note(text.to_text(), SampleArchive::kDeviceName, archive_.key()));
  }
  /// Takes away lines and notes from `size` entries on.
  void cut_back(const fs::path& folder, std::uint64_t size) {
    const std::vector<std::string> all = lines(folder);
    std::string text;
    for (std::uint64_t number = 0; number < size; ++number) {
      text += all.at(number) + "\n";
    }
    write_file(folder / archive::kLedgerFile, text);
    for (std::uint64_t each = size + 1; each <= all.size(); ++each) {
      fs::remove(folder / archive::note_path(each));
    }
  }
  static std::vector<std::string> lines(const fs::path& folder) {
    std::istringstream text(read_file(folder / archive::kLedgerFile));
    std::vector<std::string> all;
    for (std::string line; std::getline(text, line);) {
      all.push_back(line);
    }
    return all;
  }

  [[nodiscard]] fs::path ledger() const { return folder_ / archive::kLedgerFile; }
  [[nodiscard]] archive::VerificationReport verify(bool with_log = true) const {
    archive::VerifyOptions options = archive_.options();
    if (!with_log) {
      options.log.reset();
    }
    return archive::verify_case(folder_, options);
  }
  [[nodiscard]] archive::VerificationReport verify_log() const {
    return archive::verify_log(archive_.log_folder(), archive_.options());
  }

  SampleArchive archive_;
  fs::path folder_;
  std::vector<std::string> asked_to_carry_on_;
};

// -- a case that was closed

TEST_F(NextStart, RemovesNothingForAnErasureThatNobodySigned) {
  write_case();
  const std::string sound = read_file(ledger());
  add_line(archive::ErasedEntry{"endoscope", 0, 2, "room: 30 days"});
  // What a recorder leaves that dies between the line and its checkpoint. It excuses nothing.
  EXPECT_EQ(summary(verify()), "incomplete\nend-not-covered ledger.jsonl 11") << details(verify());
  fs::rename(folder_ / kFirstSegment, archive_.folder() / "film");
  EXPECT_EQ(verify().verdict, Verdict::kTampered) << details(verify());
  EXPECT_THAT(summary(verify()), HasSubstr("file-missing"));
  fs::rename(archive_.folder() / "film", folder_ / kFirstSegment);
  const auto finished = start();
  ASSERT_EQ(finished.size(), 1U);
  EXPECT_THAT(finished[0].problem, HasSubstr("stated an erasure that nobody had signed"));
  EXPECT_TRUE(fs::exists(folder_ / kFirstSegment));
  EXPECT_EQ(read_file(ledger()), sound);
  EXPECT_EQ(summary(verify()), "intact");
}

TEST_F(NextStart, SignsNoSecondHistoryOfACaseThatTheLogKnowsLonger) {
  write_case();
  const std::uint64_t close = 10;  // the notes before it are of 3 and 6 entries or more
  cut_back(folder_, 7);
  ASSERT_LT(lines(folder_).size(), close);
  const std::string cut = read_file(ledger());
  const auto refused = start();
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
  EXPECT_THAT(refused[0].problem, HasSubstr("the appliance log knows"));
  EXPECT_EQ(read_file(ledger()), cut);
  EXPECT_EQ(verify(false).verdict, Verdict::kIncomplete);
  EXPECT_EQ(verify().verdict, Verdict::kTampered);
}

TEST_F(NextStart, SignsNoLedgerWhoseCheckpointsWereTakenAway) {
  write_case();
  std::vector<std::string> all = lines(folder_);
  // Anything may stand there: the newest checkpoint, which must fit, is none.
  const auto mark = std::find_if(all.begin(), all.end(), [](const std::string& line) {
    return line.find("\"mark\"") != std::string::npos;
  });
  ASSERT_NE(mark, all.end());
  char& digit = (*mark)[mark->find("\"commitment\":\"") + 15];
  digit = digit == '0' ? '1' : '0';
  std::string text;
  for (const std::string& line : all) {
    text += line + "\n";
  }
  write_file(ledger(), text);
  for (const auto& note : fs::directory_iterator(folder_ / archive::kCheckpointsFolder)) {
    fs::remove(note.path());
  }
  const auto refused = start();
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
  EXPECT_THAT(refused[0].problem, HasSubstr("are not those whose root the appliance log states"));
  EXPECT_EQ(read_file(ledger()), text);
  EXPECT_TRUE(fs::is_empty(folder_ / archive::kCheckpointsFolder)) << "nothing was signed";
}

// Without its newest checkpoints a closed case reads as one that was cut off before its end.
TEST_F(NextStart, SignsNoSecondHistoryWhereTheNewestCheckpointsWereTakenAway) {
  write_case();
  const std::uint64_t close = 10;
  for (std::uint64_t each = close; each <= lines(folder_).size(); ++each) {
    fs::remove(folder_ / archive::note_path(each));
  }
  const std::string sound = read_file(ledger());
  const auto refused = start();
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
  EXPECT_THAT(refused[0].problem, HasSubstr("the appliance log knows a checkpoint of it over"));
  EXPECT_EQ(read_file(ledger()), sound) << "close and all behind it stands there still";
}

// -- a case that was cut off

TEST_F(NextStart, EntersNoTokenOfAnybody) {
  cut_off_case();
  SampleArchive stranger;
  const std::uint64_t newest = archive::newest_note(folder_);
  const std::string note = read_file(folder_ / archive::note_path(newest));
  const Bytes token = stranger.stamp(note);
  const std::string name = archive::token_path(newest, "stranger");
  write_file(folder_ / name, std::string(text_of(token)));
  const archive::VerifyOptions options = archive_.options();
  const auto recovered = start(options);
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_THAT(recovered[0].problem, HasSubstr(name + " is left as it is"));
  EXPECT_EQ(recovered[0].tokens, 0U);
  EXPECT_EQ(verify().verdict, Verdict::kIntactWithGaps) << details(verify());
}

TEST_F(NextStart, WritesAndRemovesNothingThroughALink) {
  cut_off_case();
  const fs::path elsewhere = archive_.folder().parent_path() / "elsewhere";
  for (const char* each : {"segments/endoscope", "checkpoints", "segments"}) {
    fs::rename(folder_ / each, elsewhere);
    fs::create_directory_symlink(elsewhere, folder_ / each);
    const auto refused = start();
    ASSERT_EQ(refused.size(), 1U);
    EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
    EXPECT_THAT(refused[0].problem, HasSubstr(std::string(each) + " is a symbolic link"));
    fs::remove(folder_ / each);
    fs::rename(elsewhere, folder_ / each);
  }
  EXPECT_EQ(start().at(0).outcome, CaseRecovery::Outcome::kRecovered);
}

// The log's line may stand there unsigned, where the machine stopped or its disk was full at that moment.
TEST_F(NextStart, TakesUpACaseThatItsOwnCheckpointsShowToBeTheDevices) {
  cut_off_case();
  const std::vector<std::string> log = lines(archive_.log_folder());
  const auto opened = std::find_if(log.begin(), log.end(), [](const std::string& line) {
    return line.find("\"case-opened\"") != std::string::npos;
  });
  ASSERT_NE(opened, log.end());
  const auto size = static_cast<std::uint64_t>(opened - log.begin()) + 1;
  ASSERT_TRUE(fs::remove(archive_.log_folder() / archive::note_path(size)));
  const auto recovered = start();
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].outcome, CaseRecovery::Outcome::kRecovered) << recovered[0].problem;
  EXPECT_THAT(asked_to_carry_on_, ::testing::ElementsAre(folder_.filename().string()));
  EXPECT_EQ(verify().verdict, Verdict::kIntactWithGaps) << details(verify());
}

TEST_F(NextStart, AnErasureBeforeCloseExcusesNothing) {
  cut_off_case();
  add_line(archive::ErasedEntry{"endoscope", 0, 2, "room: 30 days"});
  fs::remove(folder_ / kFirstSegment);
  const archive::VerificationReport report = verify(false);
  EXPECT_EQ(report.verdict, Verdict::kTampered);
  EXPECT_THAT(summary(report), ::testing::AllOf(HasSubstr("erased-before-close"), HasSubstr("file-missing")));
  ASSERT_EQ(start().size(), 1U);
  EXPECT_THAT(summary(verify(false)), HasSubstr("tampered\n"));
  EXPECT_TRUE(fs::exists(folder_ / "segments/endoscope/00000001.ts.age")) << "nothing more was removed";
}

TEST_F(NextStart, ALossDoesNotPassForTheCasesEnd) {
  cut_off_case();
  archive::CloseEntry close;
  close.reason = "operator";
  const auto bytes = [&](const char* file) { return fs::file_size(folder_ / file); };
  close.totals["endoscope"] = {3, 150, 0, 3 * bytes(kFirstSegment)};
  close.totals["vitals"] = {1, 6, 0, bytes("segments/vitals/00000000.jsonl.age")};
  add_line(close);
  ASSERT_EQ(start().size(), 1U);
  const archive::VerificationReport report = verify();
  EXPECT_EQ(report.verdict, Verdict::kIntactWithGaps) << details(report);
  EXPECT_THAT(summary(report), ::testing::AllOf(HasSubstr("recovered"), HasSubstr("gap")));
  EXPECT_THAT(details(report), HasSubstr("from a close or an erasure on that nobody had signed"));
}

TEST_F(NextStart, WhatNobodyHadSignedIsSaid) {
  cut_off_case(
      [this](SampleCase& sample) { sample.writer().append({archive::MarkEntry{}}, archive_.now()); });
  const std::uint64_t last = lines(folder_).size() - 1;
  const std::string number = std::to_string(last);
  EXPECT_THAT(details(verify(false)), HasSubstr("nobody has signed the entries from " + number + " on"));
  ASSERT_EQ(start().size(), 1U);
  EXPECT_THAT(details(verify(false)),
              HasSubstr("the entries from " + number + " to " + number + " had no signature until then"));
}

class NeverRecorded : public NextStart, public ::testing::WithParamInterface<bool> {
 protected:
  /// Puts a line right behind the first one, and numbers those that follow anew.
  void insert_second_line(const archive::CaseEntryBody& body) {
    std::string text;
    std::uint64_t number = 0;
    for (const std::string& line : lines(folder_)) {
      archive::CaseEntry entry = archive::parse_case_entry(line).entry.value();
      entry.seq = number++;
      text += archive::to_line(entry) + "\n";
      if (number == 1) {
        entry.seq = number++;
        entry.body = body;
        text += archive::to_line(entry) + "\n";
      }
    }
    write_file(ledger(), text);
  }
};

TEST_P(NeverRecorded, CaseIsNotSigned) {
  {
    SampleCase sample(archive_, false);  // made by somebody else, of public keys alone
    sample.record();
    folder_ = sample.folder();
  }
  for (const auto& note : fs::directory_iterator(folder_ / archive::kCheckpointsFolder)) {
    fs::remove(note.path());
  }
  if (GetParam()) {
    // As though power had failed right after the opening, and again in the recovery.
    insert_second_line(archive::RecoveredEntry{"00000000-0000-4000-8000-000000000000", "crash", ""});
  }
  open_log()->shutdown();
  const std::string first_line = lines(folder_).at(0);
  add_log_line(archive::CaseOpenedEntry{folder_.filename().string(), crypto::sha256(bytes_of(first_line))});
  for (int start_number = 0; start_number < 2; ++start_number) {
    const auto refused = start();
    ASSERT_EQ(refused.size(), 1U);
    EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
    EXPECT_THAT(refused[0].problem, HasSubstr("nobody signed in the appliance log that it was opened"));
    open_log()->shutdown();  // signs what stands in the log by now
  }
  EXPECT_TRUE(fs::is_empty(folder_ / archive::kCheckpointsFolder)) << "nothing was signed";
}

INSTANTIATE_TEST_SUITE_P(WithAClaimedRecovery, NeverRecorded, ::testing::Bool());

/// One line, and films beside it: what a recorder leaves that dies right after a case's opening, but for the
/// films.
class FilmsBesideAnOpening : public NextStart, public ::testing::WithParamInterface<bool> {};

TEST_P(FilmsBesideAnOpening, AreNotSigned) {
  {
    SampleCase sample(archive_, false);
    for (std::uint64_t index = 0; index < 3; ++index) {
      sample.segment(0, index, {});
    }
    folder_ = sample.folder();
  }
  open_log()->shutdown();
  const std::string text = read_file(ledger());
  if (GetParam()) {
    add_log_line(archive::CaseOpenedEntry{folder_.filename().string(),
                                          crypto::sha256(bytes_of(lines(folder_).at(0)))});
  }
  const auto refused = start();
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused);
  EXPECT_THAT(refused[0].problem, HasSubstr("nobody signed that case"));
  EXPECT_EQ(read_file(ledger()), text);
  EXPECT_TRUE(fs::is_empty(folder_ / archive::kCheckpointsFolder)) << "nothing was signed";
}

TEST_P(FilmsBesideAnOpening, NamedByAClaimedRecoveryAreNotSigned) {
  archive::SegmentEntry film;
  {
    SampleCase sample(archive_, false);
    film = sample.segment(0, 0, {0, 1'000'000'000});
    film.counted = false;
    folder_ = sample.folder();
  }
  add_line(archive::RecoveredEntry{"00000000-0000-4000-8000-000000000000", "crash", ""});
  add_line(film);
  add_line(archive::GapEntry{"endoscope", {1'000'000'000, 2'000'000'000}, archive::GapCause::kInterrupted});
  open_log()->shutdown();
  if (GetParam()) {
    add_log_line(archive::CaseOpenedEntry{folder_.filename().string(),
                                          crypto::sha256(bytes_of(lines(folder_).at(0)))});
  }
  const auto refused = start();
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].outcome, CaseRecovery::Outcome::kRefused) << details(verify());
  EXPECT_TRUE(fs::is_empty(folder_ / archive::kCheckpointsFolder)) << "nothing was signed";
}

INSTANTIATE_TEST_SUITE_P(KnownToTheLog, FilmsBesideAnOpening, ::testing::Bool());

// Somebody wants the recorder to begin by itself, or their subject in its next case.
TEST_F(NextStart, AnOpeningThatNobodySignedIsNotCarriedOn) {
  {
    const SampleCase sample(archive_, false);
    folder_ = sample.folder();
  }
  const auto recovered = start();
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].outcome, CaseRecovery::Outcome::kRecovered);
  EXPECT_THAT(recovered[0].problem, HasSubstr("it is not carried on"));
  EXPECT_TRUE(asked_to_carry_on_.empty());
}

// -- the log

TEST_F(NextStart, ALineThatNobodySignedDoesNotExcuseACase) {
  write_case();
  ASSERT_EQ(summary(verify_log()), "intact");
  add_log_line(archive::CaseErasedEntry{folder_.filename().string(), {}, "10 years"});
  fs::remove_all(folder_);
  const archive::VerificationReport before = verify_log();
  EXPECT_EQ(before.verdict, Verdict::kTampered);
  EXPECT_THAT(summary(before), HasSubstr("case-missing"));
  {
    const auto log = open_log();
    log->shutdown();  // signed now, with what stood before it
  }
  const archive::VerificationReport after = verify_log();
  EXPECT_EQ(after.verdict, Verdict::kTampered);
  EXPECT_THAT(summary(after), HasSubstr("case-missing"));
}

TEST_F(NextStart, ALogThatSomebodyWroteAnewAndTheRecorderSignedIsUnproven) {
  write_case();
  const fs::path other = SampleCase::write(archive_);
  // Everything about the first case goes, and every checkpoint that tells of it.
  std::string text;
  std::uint64_t number = 0;
  for (const std::string& line : lines(archive_.log_folder())) {
    if (line.find(folder_.filename()) == std::string::npos) {
      archive::LogEntry entry = archive::parse_log_entry(line).entry.value();
      entry.seq = number++;
      text += archive::to_line(entry) + "\n";
    }
  }
  write_file(archive_.log_folder() / archive::kLedgerFile, text);
  fs::remove_all(folder_);
  for (const auto& note : fs::directory_iterator(archive_.log_folder() / archive::kCheckpointsFolder)) {
    fs::remove(note.path());
  }
  EXPECT_THAT(summary(verify_log()), HasSubstr("log-tail-unsigned"));
  {
    const auto log = open_log();
    log->shutdown();
  }
  const archive::VerificationReport after = verify_log();
  EXPECT_EQ(after.verdict, Verdict::kUnproven);
  EXPECT_THAT(summary(after), HasSubstr("log-signed-late"));
}

TEST_F(NextStart, ACaseIsMissingWhereAnotherOrNothingLiesInItsPlace) {
  write_case();
  const fs::path other = SampleCase::write(archive_);
  write_file(ledger(), "");
  EXPECT_THAT(summary(verify_log()), HasSubstr("case-missing"));
  fs::remove_all(folder_);
  fs::copy(other, folder_, fs::copy_options::recursive);
  EXPECT_THAT(summary(verify_log()), HasSubstr("case-missing"));
}

TEST_F(NextStart, ALogWhoseCasesAreAllGoneSaysThatItDidNotLookForThem) {
  write_case();
  fs::remove_all(folder_);
  fs::remove(archive_.folder() / ".reserve");
  EXPECT_EQ(summary(verify_log()), "intact\ncases-not-looked-for ledger.jsonl -");
}

// A recorder signs each line at once, and counts on none before. So the next start takes back the last one
// that has no signature: whoever made it up has nothing signed, and accuses nobody.
TEST_F(NextStart, ALineThatNobodySignedIsTakenBack) {
  write_case();
  const std::string id = folder_.filename().string();
  crypto::Sha256Digest made_up{};
  made_up.fill(std::byte{7});
  for (const archive::LogEntryBody& lie :
       {archive::LogEntryBody(archive::CaseCheckpointEntry{id, 3, made_up}),
        archive::LogEntryBody(archive::CaseCheckpointEntry{id, 300, made_up}),
        archive::LogEntryBody(archive::CaseClosedEntry{id, 12, made_up, made_up}),
        archive::LogEntryBody(archive::AccessEntry{id, "exported", "nobody"})}) {
    add_log_line(lie);
    open_log()->shutdown();
    EXPECT_EQ(summary(verify()), "intact") << details(verify());
    EXPECT_EQ(summary(verify_log()), "intact") << details(verify_log());
    EXPECT_THAT(read_file(archive_.log_folder() / archive::kLedgerFile), Not(HasSubstr("\"07070707")));
  }
}

// A cut-off case is brought to its end although somebody wrote into the log that it had more entries.
TEST_F(NextStart, ALineThatNobodySignedKeepsNoCaseFromItsEnd) {
  cut_off_case();
  add_log_line(archive::CaseCheckpointEntry{folder_.filename().string(), 300, {}});
  const auto finished = start();
  ASSERT_EQ(finished.size(), 1U);
  EXPECT_EQ(finished[0].outcome, CaseRecovery::Outcome::kRecovered) << finished[0].problem;
  EXPECT_EQ(verify().verdict, Verdict::kIntactWithGaps) << details(verify());
}

// One crash leaves one such line. Where more lack their checkpoint somebody took those away.
TEST_F(NextStart, TakesNothingBackWhereSeveralLinesLackTheirCheckpoint) {
  write_case();
  const std::uint64_t size = lines(archive_.log_folder()).size();
  fs::remove(archive_.log_folder() / archive::note_path(size));
  fs::remove(archive_.log_folder() / archive::note_path(size - 1));
  open_log()->shutdown();
  const std::vector<std::string> after = lines(archive_.log_folder());
  ASSERT_EQ(after.size(), size + 2);
  EXPECT_THAT(after[size], HasSubstr("found no signature of this device over entries"));
}

// What keeps nobody from recording, and nobody from knowing what is held.
TEST_F(NextStart, WhatSomebodyStatesOfTheLogOrOfItsDeviceIsPutAside) {
  write_case();
  const std::string id = folder_.filename().string();
  open_log()->case_held(id, "court order", "anna");
  const crypto::VerifierKey device(SampleArchive::kDeviceName, archive_.key().public_key());
  const crypto::SigningKey stranger =
      crypto::SigningKey::generate().with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  const std::uint64_t size = lines(archive_.log_folder()).size();
  for (const archive::LogEntryBody& lie :
       {archive::LogEntryBody(
            archive::LogDamageEntry{size, {}, archive::root_of_log(archive_.log_folder(), size)}),
        archive::LogEntryBody(archive::LogDamageEntry{size + 90, {}, {}}),
        archive::LogEntryBody(archive::DeviceMlDsaEntry{
            crypto::verifier_key_of(SampleArchive::kDeviceName, stranger).ml_dsa()->to_string()}),
        archive::LogEntryBody(archive::DeviceHardwareEntry{"test+00000000+Ag=="}),
        archive::LogEntryBody(archive::BootEntry{"b9", "stranger"})}) {
    const std::size_t before = lines(archive_.log_folder()).size();
    add_log_line(lie);
    EXPECT_THAT(archive::why_held(archive::read_holds(archive_.log_folder(), device), id),
                HasSubstr("court order"))
        << "before the next start, too";
    open_log()->shutdown();
    EXPECT_EQ(lines(archive_.log_folder()).size(), before + 3);
    EXPECT_EQ(summary(verify()), "intact") << details(verify());
    EXPECT_EQ(summary(verify_log()), "intact") << details(verify_log());
    EXPECT_THAT(archive::why_held(archive::read_holds(archive_.log_folder(), device), id),
                HasSubstr("court order"));
  }
}

// Recorders of before signed over it.
TEST_F(NextStart, AClaimOfDamageThatTheDevicesCheckpointRefutesTakesNoHoldAway) {
  write_case();
  const std::string id = folder_.filename().string();
  open_log()->case_held(id, "court order", "anna");
  const crypto::VerifierKey device(SampleArchive::kDeviceName, archive_.key().public_key());
  const std::uint64_t size = lines(archive_.log_folder()).size();
  add_log_line(archive::LogDamageEntry{size, {}, archive::root_of_log(archive_.log_folder(), size)});
  add_log_line(archive::ShutdownEntry{});
  sign_log();
  EXPECT_THAT(summary(verify_log()), HasSubstr("intact\nlog-damage-refuted"));
  EXPECT_EQ(verify().verdict, Verdict::kIntact) << details(verify());
  EXPECT_THAT(archive::why_held(archive::read_holds(archive_.log_folder(), device), id),
              HasSubstr("court order"));
}

// Recorders of before left such lines where they were, and signed what came next.
TEST_F(NextStart, ALineThatNobodySignedDoesNotAccuseACase) {
  write_case();
  const std::string id = folder_.filename().string();
  crypto::Sha256Digest made_up{};
  made_up.fill(std::byte{7});
  const std::string log = read_file(archive_.log_folder() / archive::kLedgerFile);
  const std::uint64_t size = lines(archive_.log_folder()).size();
  for (const archive::LogEntryBody& lie :
       {archive::LogEntryBody(archive::CaseCheckpointEntry{id, 3, made_up}),
        archive::LogEntryBody(archive::CaseCheckpointEntry{id, 300, made_up}),
        archive::LogEntryBody(archive::CaseClosedEntry{id, 12, made_up, made_up}),
        archive::LogEntryBody(archive::CaseOpenedEntry{"20200101T000000Z-00000000", made_up})}) {
    add_log_line(lie);
    add_log_line(archive::ShutdownEntry{});
    sign_log();
    for (const archive::VerificationReport& report : {verify(), verify_log()}) {
      EXPECT_NE(report.verdict, Verdict::kTampered) << details(report);
    }
    const std::string told = summary(verify()) + summary(verify_log());
    EXPECT_THAT(told, HasSubstr("log-entry-doubted"));
    // The log as it was before.
    write_file(archive_.log_folder() / archive::kLedgerFile, log);
    fs::remove(archive_.log_folder() / archive::note_path(size + 2));
  }
}

// -- the end of a case

// One authority refuses at once, another takes its time: whoever verifies meanwhile sees no tampering.
TEST_F(NextStart, ACaseWhoseEndIsBeingWrittenIsIncomplete) {
  {
    SampleCase sample(archive_);
    sample.record();
    sample.writer().close("operator", archive_.now());
    const archive::StoredCheckpoint end = sample.writer().checkpoint(archive_.now(), true);
    sample.writer().append({archive::TokenMissedEntry{end.size, "swiss", "refused"}}, archive_.now());
    folder_ = sample.folder();
  }
  EXPECT_EQ(verify().verdict, Verdict::kIncomplete) << details(verify());
  EXPECT_THAT(summary(verify()), HasSubstr("end-not-covered"));
  ASSERT_EQ(start().size(), 1U);
  EXPECT_EQ(verify().verdict, Verdict::kIntactWithGaps) << details(verify());
}

// An authority that is slow answers behind `close` what it was asked at the case's beginning.
TEST_F(NextStart, AnAnswerThatComesBehindCloseToAnEarlierQuestionIsNoTampering) {
  {
    SampleCase sample(archive_);
    const archive::StoredCheckpoint earlier = sample.writer().checkpoint(archive_.now(), true);
    const Bytes response = archive_.stamp(earlier.note);
    sample.record();
    sample.writer().close("operator", archive_.now());
    const archive::StoredCheckpoint end = sample.writer().checkpoint(archive_.now(), true);
    sample.writer().append({archive::TokenMissedEntry{end.size, "swiss", "refused"}}, archive_.now());
    sample.writer().add_token(earlier, "slow", response, SampleArchive::facts_of(response), archive_.now());
    folder_ = sample.folder();
  }
  EXPECT_EQ(verify().verdict, Verdict::kIncomplete) << details(verify());
  EXPECT_THAT(summary(verify()), HasSubstr("end-not-covered"));
  ASSERT_EQ(start().size(), 1U);
  EXPECT_EQ(verify().verdict, Verdict::kIntactWithGaps) << details(verify());
}

// A recorder closes a case that was cut off, and goes on in a new one: nothing else follows `recovered`.
TEST_F(NextStart, ARecordingThatGoesOnBehindRecoveredIsTampered) {
  SampleCase sample(archive_);
  sample.record();
  sample.writer().append({archive::RecoveredEntry{"boot", "crash", ""}}, archive_.now());
  archive_.now_ns += 20'000'000'000;
  sample.writer().append({archive::ClockEntry{true, 0, 0, 0, {}}}, archive_.now());
  sample.close();
  folder_ = sample.folder();
  EXPECT_EQ(verify().verdict, Verdict::kTampered) << details(verify());
  EXPECT_THAT(summary(verify()), HasSubstr("entry-after-recovered ledger.jsonl"));
}

// The case is made first, and entered in the log then: a crash may come between.
TEST_F(NextStart, ACaseThatTheLogDoesNotKnowYetIsIncomplete) {
  folder_ = SampleCase(archive_).folder();
  cut_back(archive_.log_folder(), 1);
  EXPECT_EQ(verify().verdict, Verdict::kIncomplete) << details(verify());
  EXPECT_THAT(summary(verify()), HasSubstr("log-case-not-entered"));
}

TEST_F(NextStart, ALogThatWasCutBackSaysThatItKnowsNoEndOfAClosedCase) {
  write_case();
  cut_back(archive_.log_folder(), 3);
  EXPECT_THAT(summary(verify()), HasSubstr("log-case-open log/ledger.jsonl 1"));
}

// -- tokens' names are known before

TEST_F(NextStart, AFileUnderATokensNameKeepsNoCaseFromItsEnd) {
  for (const std::uint64_t planted : {1U, 60U}) {
    cut_off_case();
    // The next checkpoint is behind `recovered`, two gaps and `close`.
    const std::uint64_t entries = lines(folder_).size();
    std::uint64_t left = planted;
    for (std::uint64_t size = entries + 1; left > 0 && size < entries + 100; ++size) {
      const fs::path token = folder_ / archive::token_path(size, SampleArchive::kAuthorityName);
      if (planted == 1 && size != entries + 4) {
        continue;
      }
      write_file(token, "planted");
      --left;
    }
    const auto finished = start();
    ASSERT_EQ(finished.size(), 1U);
    EXPECT_EQ(finished[0].outcome, CaseRecovery::Outcome::kRecovered) << finished[0].problem;
    EXPECT_EQ(finished[0].stamped, planted == 1);
    EXPECT_THAT(read_file(ledger()), HasSubstr("something else lay in tokens/"));
    EXPECT_TRUE(start().empty()) << "it was finished";
    EXPECT_THAT(summary(verify()), HasSubstr("token-missed"));
  }
}

// -- erasing

TEST_F(NextStart, ALinkThatLeadsBackToTheCaseIsNoReplica) {
  write_case();
  const fs::path elsewhere = archive_.folder().parent_path() / "replica";
  fs::create_directory(elsewhere);
  const fs::path link = elsewhere / folder_.filename();
  fs::create_directory_symlink(folder_, link);
  EXPECT_EQ(archive::why_not_replicated(folder_, "endoscope", link), "it is the case itself");
  fs::remove(link);
  fs::copy(folder_, link, fs::copy_options::recursive);
  EXPECT_EQ(archive::why_not_replicated(folder_, "endoscope", link), std::nullopt);
}

/// The recorder's own erasing of a stream that is due.
class Erasing : public NextStart {
 protected:
  archive::Erasure erase(const archive::RetentionOptions& with = {}) {
    const auto log = open_log();
    archive::RetentionOptions options = with;
    options.key = &archive_.key();
    options.device_name = SampleArchive::kDeviceName;
    options.log = log.get();
    return archive::erase_stream(archive::real_file_system(), options, folder_, "endoscope", "room: 30 days");
  }
};

// Whoever can write to the disk has a key of their own. They let the log name it by a start of the machine,
// and sign with it.
TEST_F(NextStart, AKeyThatTheLogNamesInsteadReleasesNoHold) {
  write_case();
  const std::string case_id = folder_.filename().string();
  const std::uint64_t hold = open_log()->case_held(case_id, "a court order", "anna");
  const crypto::SigningKey key = crypto::SigningKey::generate();
  const std::string name = "or3-b";
  add_log_line(archive::BootEntry{"another boot", crypto::verifier_key_of(name, key).to_string()});
  add_log_line(archive::CaseReleasedEntry{case_id, hold, "released", "anna"});
  const std::uint64_t size = lines(archive_.log_folder()).size();
  const crypto::Checkpoint text{archive::log_origin(name), size,
                                archive::root_of_log(archive_.log_folder(), size)};
  write_file(archive_.log_folder() / archive::note_path(size), crypto::sign_note(text.to_text(), name, key));
  // The next start signs over both.
  const auto log = open_log();
  log->boot("the next start");
  log->shutdown();
  const archive::Holds holds = archive::read_holds(archive_.log_folder(), archive_.device());
  EXPECT_THAT(archive::why_held(holds, case_id), HasSubstr("a court order"));
}

// What the log lost with its checkpoints, a case that was opened later still states.
TEST_F(NextStart, ALogThatWasCutBackBeforeALaterCaseReleasesNothing) {
  write_case();
  const std::string case_id = folder_.filename().string();
  const std::uint64_t before = lines(archive_.log_folder()).size();
  open_log()->case_held(case_id, "a court order", "anna");
  const fs::path later = SampleCase::write(archive_);
  cut_back(archive_.log_folder(), before);
  const auto read = [&] { archive::read_holds(archive_.log_folder(), archive_.device()); };
  EXPECT_THAT(read,
              ThrowsMessage<Error>(HasSubstr("when case " + later.filename().string() + " was opened")));
  // Nor where the log has grown again.
  for (int more = 0; more < 20; ++more) open_log()->access(case_id, "watched", "anna");
  EXPECT_THAT(read,
              ThrowsMessage<Error>(HasSubstr("when case " + later.filename().string() + " was opened")));
  // Nor where a folder of somebody's, which is found first, states what fits, of the same size.
  const std::string made_up = "20200101T000000Z-00000000";
  fs::create_directory(archive_.folder() / made_up);
  const std::string opening = lines(later).front();
  const auto stated = std::get<archive::OpenEntry>(archive::parse_case_entry(opening).entry.value().body);
  crypto::MerkleFrontier grown;
  for (const std::string& line : lines(archive_.log_folder())) {
    if (grown.size() < stated.appliance_log_size) grown.append(crypto::merkle_leaf_hash(bytes_of(line)));
  }
  std::string fitting = opening;
  const auto replace = [&](const std::string& from, const std::string& to) {
    ASSERT_NE(fitting.find(from), std::string::npos) << from;
    fitting.replace(fitting.find(from), from.size(), to);
  };
  replace(later.filename().string(), made_up);
  replace(crypto::to_hex(stated.appliance_log_root), crypto::to_hex(grown.root()));
  write_file(archive_.folder() / made_up / "ledger.jsonl", fitting + "\n");
  EXPECT_THAT(read,
              ThrowsMessage<Error>(HasSubstr("when case " + later.filename().string() + " was opened")));
}

// Whoever names the log's folder otherwise is told the same.
TEST_F(NextStart, ALogThatWasCutBackIsToldHoweverItsFolderIsNamed) {
  write_case();
  const std::string case_id = folder_.filename().string();
  const std::uint64_t before = lines(archive_.log_folder()).size();
  open_log()->case_held(case_id, "a court order", "anna");
  SampleCase::write(archive_);
  cut_back(archive_.log_folder(), before);
  const fs::path here = fs::current_path();
  for (const fs::path& named : {fs::path("log"), fs::path("./log/"), archive_.log_folder() / ""}) {
    fs::current_path(archive_.folder());
    EXPECT_THAT([&] { archive::read_holds(named, archive_.device()); },
                ThrowsMessage<Error>(HasSubstr("its end was removed")))
        << named;
    fs::current_path(here);
  }
}

// A case that was recorded without a log, or beside one that was begun just then, accuses no log.
TEST_F(NextStart, ACaseThatStatesNoEntryAccusesNoLog) {
  write_case();
  cut_back(archive_.log_folder(), 0);
  for (const fs::directory_entry& each : fs::directory_iterator(archive_.folder())) {
    const fs::path ledger = each.path() / "ledger.jsonl";
    if (each.path() == archive_.log_folder() || !fs::exists(ledger)) continue;
    std::string text = lines(each.path()).front();
    const auto stated = std::get<archive::OpenEntry>(archive::parse_case_entry(text).entry.value().body);
    const std::string size = "\"size\":" + std::to_string(stated.appliance_log_size);
    ASSERT_NE(text.find(size), std::string::npos);
    text.replace(text.find(size), size.size(), "\"size\":0");
    write_file(ledger, text + "\n");
  }
  EXPECT_TRUE(archive::read_holds(archive_.log_folder(), archive_.device()).empty());
}

// Whoever chooses cases by their age reads ledgers that nobody verified: one that looks old for that moment.
TEST_F(Erasing, AsksAgainWhetherACaseMayGoWhenItsLedgerIsHeld) {
  write_case();
  archive::RetentionOptions options;
  UtcTime opened;
  options.may_go = [&](const archive::OpenEntry& open, UtcTime at) {
    EXPECT_EQ(open.case_id, folder_.filename());
    opened = at;
    return false;
  };
  EXPECT_THROW(erase(options), UsageError);
  EXPECT_EQ(opened, SampleArchive::opened_at());
  EXPECT_TRUE(fs::exists(folder_ / kFirstSegment));
  EXPECT_EQ(summary(verify()), "intact");
}

// The battery of a recorder was empty: it recorded 400 days ago, by its clock, and the authority knew better.
TEST_F(Erasing, ACaseOfAClockThatWasBehindIsAsOldAsItsTokensSay) {
  const UtcTime recorded = SampleArchive::opened_at() + std::chrono::hours(400 * 24);
  archive_.authority_time = [recorded](std::int64_t mono_ns) {
    return recorded + std::chrono::duration_cast<UtcTime::duration>(std::chrono::nanoseconds(mono_ns));
  };
  write_case();
  archive::RetentionOptions options;
  std::vector<UtcTime> told;
  options.may_go = [&](const archive::OpenEntry&, UtcTime opened) {
    told.push_back(opened);
    return told.size() > 1;
  };
  EXPECT_THROW(erase(options), UsageError);
  // What an erasure enters later says nothing of when the case was opened: the other streams stay as old.
  options.now = [&] { return recorded + std::chrono::hours(30 * 24); };
  EXPECT_GT(erase(options).segments, 0U);
  options.now = utc_now;
  erase(options);
  ASSERT_EQ(told.size(), 3U);
  for (const UtcTime each : told) {
    EXPECT_LT(std::chrono::abs(each - recorded), std::chrono::seconds(2)) << format_utc(each);
  }
}

// A consent may be given again until the turn to erase is taken: it is asked for in the turn, not before.
TEST_F(Erasing, AsksWhetherACaseMayGoInItsTurn) {
  write_case();
  archive::RetentionOptions options;
  bool in_turn = false;
  options.may_go = [&](const archive::OpenEntry&, UtcTime /*opened*/) {
    const Descriptor archive(::open(archive_.folder().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    in_turn = ::flock(archive.number(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    return true;
  };
  EXPECT_GT(erase(options).segments, 0U);
  EXPECT_TRUE(in_turn);
}

TEST_F(Erasing, RemovesNoOtherCasesFilmsThroughALink) {
  const fs::path other = SampleCase::write(archive_);
  write_case();
  fs::remove_all(folder_ / "segments/endoscope");
  fs::create_directory_symlink(other / "segments/endoscope", folder_ / "segments/endoscope");
  EXPECT_THROW(erase(), Error);
  EXPECT_TRUE(fs::exists(other / kFirstSegment));
}

// -- time

TEST_F(NextStart, AMissedTokenOfAnEarlierCheckpointDoesNotExcuseTheEnd) {
  {
    SampleCase sample(archive_);
    sample.record();
    sample.writer().close("operator", archive_.now());
    sample.writer().append({archive::TokenMissedEntry{3, "swiss", "no answer"}}, archive_.now());
    sample.writer().finish(archive_.now());
    folder_ = sample.folder();
  }
  const archive::VerificationReport report = verify();
  EXPECT_EQ(report.verdict, Verdict::kUnproven) << details(report);
  EXPECT_THAT(summary(report), HasSubstr("end-not-stamped"));
}

}  // namespace
}  // namespace kiroku::test
