#include "archive/writing/appliance_log.h"

#include <cerrno>
#include <fstream>
#include <iterator>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/log_entry.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::FaultFileSystem;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kApplianceCase = "20260805T091502Z-3f9c21ab";
crypto::Sha256Digest digest_of_abc() { return crypto::sha256(bytes_of("abc")); }

class ApplianceLogTest : public testing::Test {
 protected:
  std::unique_ptr<ApplianceLog> open(FileSystem& files) {
    return ApplianceLog::open(files, folder_ / "log", key_, "theatre-1");
  }
  std::unique_ptr<ApplianceLog> open() { return open(files_); }
  [[nodiscard]] std::vector<std::string> types() const {
    std::vector<std::string> types;
    for (const LogLine& line : read_log(folder_ / "log")) {
      types.push_back(line.type);
    }
    return types;
  }
  [[nodiscard]] crypto::Sha256Digest root_of_first(std::uint64_t size) const {
    crypto::MerkleFrontier tree;
    for (const LogLine& line : read_log(folder_ / "log")) {
      if (tree.size() < size) {
        tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
      }
    }
    return tree.root();
  }
  /// The note of that tree size, opened with the device's key.
  [[nodiscard]] std::optional<crypto::Checkpoint> note(std::uint64_t size) const {
    std::ifstream input(folder_ / "log" / note_path(size), std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(input), {}};
    const auto opened = crypto::open_note(text, {crypto::VerifierKey("theatre-1", key_.public_key())});
    return opened.failure ? std::nullopt : crypto::Checkpoint::parse(opened.text);
  }

  TemporaryFolder folder_{test::quick_parent()};
  crypto::SigningKey key_ = crypto::SigningKey::generate();
  FaultFileSystem files_{folder_.path()};
};

TEST_F(ApplianceLogTest, BeginsWithTheBoot) {
  open()->access(kApplianceCase, "export endoscope", "Dr. Sato");
  EXPECT_THAT(types(), ElementsAre("boot", "access"));
  const auto boot = parse_log_entry(read_log(folder_ / "log")[0].json);
  EXPECT_EQ(std::get<BootEntry>(boot.entry->body).device,
            crypto::VerifierKey("theatre-1", key_.public_key()).to_string());
}

TEST_F(ApplianceLogTest, StatesOneBootOnce) {
  const auto log = open();
  log->boot("b1");
  log->boot("b1");
  log->shutdown();
  open()->boot("b1");
  EXPECT_THAT(types(), ElementsAre("boot", "shutdown"));
  open()->boot("b2");
  EXPECT_THAT(types(), ElementsAre("boot", "shutdown", "boot"));
}

TEST_F(ApplianceLogTest, CarriesWhatItIsTold) {
  const auto log = open();
  log->boot("b1");
  log->config_changed(digest_of_abc());
  log->device_key_changed();
  log->plan_sealed(digest_of_abc());
  log->case_opened(kApplianceCase, digest_of_abc());
  log->case_checkpoint(kApplianceCase, 5, digest_of_abc());
  log->case_closed(kApplianceCase, 9, digest_of_abc(), digest_of_abc());
  log->replicated(kApplianceCase, "s3://bucket");
  log->erased(kApplianceCase, std::nullopt, "10 years");
  log->access(kApplianceCase, "what", "who");
  EXPECT_EQ(log->case_held(kApplianceCase, "court order", "anna"), 10U);
  log->case_released(kApplianceCase, 10, "settled", "ben");
  log->shutdown();
  EXPECT_THAT(types(), ElementsAre("boot", "config-changed", "device-key-changed", "plan-sealed",
                                   "case-opened", "case-checkpoint", "case-closed", "replicated", "erased",
                                   "access", "case-held", "case-released", "shutdown"));
  std::uint64_t seq = 0;
  std::int64_t last_ns = 0;
  for (const LogLine& line : read_log(folder_ / "log")) {
    const auto parsed = parse_log_entry(line.json);
    EXPECT_EQ(parsed.entry->seq, seq++);
    EXPECT_GE(parsed.entry->at.mono_ns, last_ns);
    last_ns = parsed.entry->at.mono_ns;
  }
  EXPECT_EQ(log->size(), 13U);
  EXPECT_EQ(log->root(), root_of_first(13));
}

TEST_F(ApplianceLogTest, SignsACheckpointAfterEachEntryThatMatters) {
  const auto log = open();
  log->boot("b1");
  log->case_closed(kApplianceCase, 9, digest_of_abc(), {});
  log->shutdown();
  EXPECT_EQ(note(1), std::nullopt) << "the next one covers the boot";
  EXPECT_EQ(note(2), (crypto::Checkpoint{"kiroku/theatre-1/log", 2, root_of_first(2)}));
  EXPECT_EQ(note(3), (crypto::Checkpoint{"kiroku/theatre-1/log", 3, root_of_first(3)}));
}

TEST_F(ApplianceLogTest, StatesTheMlDsaKeyBeforeAnythingIsSignedWithIt) {
  open()->shutdown();
  const crypto::Secret seed = crypto::Secret::random(crypto::kMlDsaSeedSize);
  const auto both = [&] {
    return crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr)
        .with_ml_dsa({crypto::MlDsaSet::k65, seed.bytes()});
  };
  const crypto::SigningKey key = both();
  const crypto::VerifierKey device = crypto::VerifierKey("theatre-1", key.public_key())
                                         .with_ml_dsa(*crypto::verifier_key_of("theatre-1", key).ml_dsa(), 2);
  {
    const auto log = ApplianceLog::open(files_, folder_ / "log", key, "theatre-1");
    EXPECT_EQ(log->stated_keys().ml_dsa, std::nullopt);
    EXPECT_EQ(log->state_keys().ml_dsa, 2U);
    EXPECT_EQ(log->state_keys().ml_dsa, 2U) << "stated once";
    log->access("*", "what", "who");
  }
  EXPECT_THAT(types(), ElementsAre("boot", "shutdown", "device-ml-dsa-added", "access"));
  EXPECT_EQ(ApplianceLog::open(files_, folder_ / "log", key, "theatre-1")->stated_keys().ml_dsa, 2U);
  for (const std::uint64_t seq : {1U, 2U, 3U})
    EXPECT_TRUE(is_signed_entry(folder_ / "log", device, seq, root_of_first(seq + 1))) << seq;
  EXPECT_FALSE(
      is_signed_entry(folder_ / "log", crypto::verifier_key_of("theatre-1", key), 1, root_of_first(2)))
      << "to whoever knows that it signed with both since the beginning, that entry has no signature";
}

TEST_F(ApplianceLogTest, AKeyWithoutTheStatedHalfSignsNothing) {
  const auto before = open();  // a program from before the home got its second key
  before->shutdown();
  const crypto::SigningKey key = crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr)
                                     .with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  ApplianceLog::open(files_, folder_ / "log", key, "theatre-1")->state_keys();
  EXPECT_THAT([&] { before->shutdown(); }, testing::ThrowsMessage<Error>(HasSubstr("device-ml-dsa.key")));
  EXPECT_THAT([&] { open(); }, testing::ThrowsMessage<Error>(HasSubstr("states in its entry 2")));
  EXPECT_THAT(types(), ElementsAre("boot", "shutdown", "device-ml-dsa-added"));
}

TEST_F(ApplianceLogTest, ChecksTheCaseIdentifier) {
  const auto log = open();
  EXPECT_THROW(log->case_opened("../../etc", digest_of_abc()), UsageError);
  EXPECT_EQ(log->size(), 0U);
}

TEST_F(ApplianceLogTest, TwoProcessesAddToOneLog) {
  const auto recording = open();
  const auto exporting = ApplianceLog::open(real_file_system(), folder_ / "log", key_, "theatre-1");
  recording->boot("b1");
  exporting->boot("b1");
  recording->case_opened(kApplianceCase, digest_of_abc());
  exporting->access(kApplianceCase, "export", "somebody");
  recording->case_checkpoint(kApplianceCase, 5, digest_of_abc());
  EXPECT_THAT(types(), ElementsAre("boot", "case-opened", "access", "case-checkpoint"));
  EXPECT_EQ(exporting->head().size, 4U);
  EXPECT_EQ(exporting->root(), recording->root());
  EXPECT_EQ(note(4)->root, root_of_first(4));
}

TEST_F(ApplianceLogTest, ThreadsAndOpeningsAtOnceLoseNoEntry) {
  constexpr int kEach = 20;
  const auto first = open(real_file_system());
  const auto second = open(real_file_system());
  const auto add = [&](ApplianceLog& log) {
    for (int i = 0; i < kEach; ++i) {
      log.access(kApplianceCase, "what", "who");
    }
  };
  std::thread a([&] { add(*first); });
  std::thread b([&] { add(*first); });
  std::thread c([&] { add(*second); });
  a.join();
  b.join();
  c.join();
  const std::vector<LogLine> lines = read_log(folder_ / "log");
  ASSERT_EQ(lines.size(), 1U + 3 * kEach);
  for (std::uint64_t seq = 0; seq < lines.size(); ++seq) {
    EXPECT_EQ(lines[seq].seq, seq);
  }
  EXPECT_EQ(first->head().root, second->head().root);
}

TEST_F(ApplianceLogTest, StatesATornLastLine) {
  open()->boot("b1");
  std::ofstream(folder_ / "log" / "ledger.jsonl", std::ios::app) << "{\"type\":\"acc";
  EXPECT_EQ(read_log(folder_ / "log").size(), 1U) << "a torn line is no entry";
  const auto log = open();
  log->boot("b2");
  log->shutdown();
  EXPECT_THAT(types(), ElementsAre("boot", "boot", "recovered", "shutdown"));
  const auto recovered = parse_log_entry(read_log(folder_ / "log")[2].json);
  EXPECT_EQ(std::get<LogRecoveredEntry>(recovered.entry->body).truncated, 12U);
}

TEST_F(ApplianceLogTest, EntersNothingWhileItsDiskFails) {
  const auto log = open();
  log->boot("b1");
  files_.fail("sync log/ledger.jsonl", EIO);
  EXPECT_THROW(log->shutdown(), SyncError);
  EXPECT_THROW(log->shutdown(), Error);
  EXPECT_EQ(log->size(), 1U);
}

// Two rooms share the log: the disk failed once, as one of them began a case.
TEST_F(ApplianceLogTest, OneFailedFlushKeepsNoRoomFromItsNextCase) {
  constexpr const char* kSecond = "20260805T101502Z-3f9c21ac";
  const auto log = open();
  log->case_opened(kApplianceCase, digest_of_abc());
  const std::uint64_t before = log->size();
  files_.fail("sync log/ledger.jsonl", EIO, 0, 1);
  EXPECT_THROW(log->case_opened(kSecond, digest_of_abc()), SyncError);
  EXPECT_EQ(log->case_state(kSecond), ApplianceLog::CaseState::kUnknown);
  log->case_checkpoint(kApplianceCase, 3, digest_of_abc());
  log->case_opened(kSecond, digest_of_abc());
  EXPECT_EQ(log->case_state(kApplianceCase), ApplianceLog::CaseState::kOpened);
  log->case_closed(kSecond, 9, digest_of_abc(), {});
  log->case_closed(kApplianceCase, 9, digest_of_abc(), {});
  EXPECT_THAT(types(), ElementsAre("boot", "case-opened", "case-checkpoint", "case-opened", "case-closed",
                                   "case-closed"));
  for (std::uint64_t size = before; size <= log->size(); ++size) {
    const auto signed_note = note(size);
    ASSERT_TRUE(signed_note) << size;
    EXPECT_EQ(signed_note->root, root_of_first(size));
  }
}

TEST_F(ApplianceLogTest, ALineWhoseCheckpointFindsNoRoomIsTakenBack) {
  const auto log = open();
  log->case_opened(kApplianceCase, digest_of_abc());
  const auto second = open();
  const ApplianceLog::Head before = log->head();
  files_.fail("create log/checkpoints", ENOSPC);
  for (int tries = 0; tries < 5; ++tries) {
    EXPECT_THROW(log->case_closed(kApplianceCase, 9, digest_of_abc(), {}), IoError);
  }
  EXPECT_EQ(log->head().root, before.root);
  EXPECT_EQ(second->head().root, before.root);
  EXPECT_EQ(log->case_state(kApplianceCase), ApplianceLog::CaseState::kOpened);
  EXPECT_FALSE(fs::exists(folder_ / "log" / note_path(3)));
  files_.heal();
  log->case_closed(kApplianceCase, 9, digest_of_abc(), {});
  second->shutdown();
  EXPECT_THAT(types(), ElementsAre("boot", "case-opened", "case-closed", "shutdown"));
  EXPECT_EQ(note(4)->root, root_of_first(4));
}

TEST_F(ApplianceLogTest, TheLineOfAWriterThatDiedBeforeItsCheckpointIsTakenBackAndStated) {
  open()->case_opened(kApplianceCase, digest_of_abc());
  const auto living = open();
  const ApplianceLog::Head before = living->head();
  files_.kill_at(6);  // behind the line, in the checkpoint
  std::size_t lines = read_log(folder_ / "log").size();
  try {
    open()->access(kApplianceCase, "export", "Dr. Sato");
    FAIL() << "not killed";
  } catch (const test::Killed&) {
  }
  files_.heal();
  ASSERT_EQ(read_log(folder_ / "log").size(), lines + 1) << "killed elsewhere";
  const std::uint64_t bytes = read_log(folder_ / "log").back().json.size() + 1;
  // A case that is opened now states this head: what is not signed is not in it.
  EXPECT_EQ(living->head().root, before.root);
  EXPECT_EQ(read_log(folder_ / "log").size(), lines);
  living->access(kApplianceCase, "export", "Dr. Mori");
  const std::vector<LogLine> all = read_log(folder_ / "log");
  ASSERT_EQ(all.size(), lines + 2);
  EXPECT_EQ(std::get<LogRecoveredEntry>(parse_log_entry(all[lines].json).entry->body).truncated, bytes);
  EXPECT_EQ(note(lines + 2)->root, root_of_first(lines + 2));
}

TEST_F(ApplianceLogTest, WhatTheDeviceStandsOnIsNotTakenBack) {
  const auto log = open();
  log->case_opened(kApplianceCase, digest_of_abc());
  fs::remove(folder_ / "log" / note_path(2));
  open()->shutdown();
  log->shutdown();
  EXPECT_THAT(types(), ElementsAre("boot", "case-opened", "shutdown", "shutdown"));
}

TEST_F(ApplianceLogTest, ReadingNamesTheLineThatIsDamaged) {
  open()->boot("b1");
  std::ofstream(folder_ / "log" / "ledger.jsonl", std::ios::app) << "nonsense\n";
  try {
    read_log(folder_ / "log");
    FAIL() << "read";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("cannot read line 2 of"));
  }
  EXPECT_THROW(read_log(folder_ / "nowhere"), UsageError);
}

// Whoever can write to the disk can add a line, and say in it that it is the first.
TEST_F(ApplianceLogTest, ALineThatSomebodyAddedIsCountedAndNotSigned) {
  open()->plan_sealed(digest_of_abc());
  std::ofstream(folder_ / "log" / "ledger.jsonl", std::ios::app)
      << to_line(
             LogEntry{0, {parse_utc("2026-08-05T07:00:00Z").value(), 1}, PlanSealedEntry{crypto::sha256({})}})
      << "\n";
  const std::vector<LogLine> lines = read_log(folder_ / "log");
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[2].seq, 2U);
  const crypto::VerifierKey device("theatre-1", key_.public_key());
  const auto is_signed = [&](std::uint64_t seq) {
    return is_signed_entry(folder_ / "log", device, seq, root_of_first(seq + 1));
  };
  EXPECT_TRUE(is_signed(1));
  EXPECT_FALSE(is_signed(2));
  // The next start signs what follows it.
  open()->shutdown();
  EXPECT_TRUE(is_signed(3));
  EXPECT_FALSE(is_signed(2));
  const crypto::VerifierKey other("theatre-1", crypto::SigningKey::generate().public_key());
  EXPECT_FALSE(is_signed_entry(folder_ / "log", other, 1, root_of_first(2)));
  EXPECT_FALSE(is_signed_entry(folder_ / "log", device, 1, root_of_first(1)));
}

TEST_F(ApplianceLogTest, NoStatementThatSomebodyAddedIsSignedByItself) {
  open()->plan_sealed(digest_of_abc());
  const Moment then = parse_log_entry(read_log(folder_ / "log").back().json).entry->at;
  // Of two no crash can tell, so none is taken back.
  for (const std::uint64_t seq : {2U, 3U}) {
    std::ofstream(folder_ / "log" / "ledger.jsonl", std::ios::app)
        << to_line(LogEntry{seq, then, PlanSealedEntry{crypto::sha256({})}}) << "\n";
  }
  EXPECT_THAT([&] { open()->checkpoint(); },
              ::testing::ThrowsMessage<Error>(HasSubstr("was not signed by whoever wrote it")));
  EXPECT_FALSE(note(4));
  open()->shutdown();
  open()->checkpoint();
  EXPECT_FALSE(note(4)) << "behind another entry it stays unsigned";
  EXPECT_TRUE(note(5));
}

TEST_F(ApplianceLogTest, WhereverItIsKilledNoNoteCoversWhatIsNotThere) {
  for (const bool power : {false, true}) {
    for (std::size_t at = 0;; ++at) {
      const TemporaryFolder folder(test::quick_parent());
      FaultFileSystem files(folder.path());
      files.kill_at(at);
      bool whole = false;
      try {
        const auto log = ApplianceLog::open(files, folder / "log", key_, "theatre-1");
        log->boot("b1");
        log->case_opened(kApplianceCase, digest_of_abc());
        log->case_closed(kApplianceCase, 9, digest_of_abc(), {});
        whole = true;
      } catch (const test::Killed&) {
      }
      if (power) {
        files.lose_power();
      }
      std::uint64_t lines = 0;
      if (fs::exists(folder / "log" / "ledger.jsonl")) {
        lines = read_log(folder / "log").size();
      }
      if (fs::exists(folder / "log" / "checkpoints")) {
        for (const fs::directory_entry& file : fs::directory_iterator(folder / "log" / "checkpoints")) {
          if (const auto size = size_of_note_name(file.path().filename().string())) {
            EXPECT_LE(*size, lines) << "kill at call " << at;
          }
        }
      }
      if (whole) {
        EXPECT_EQ(lines, 3U);
        break;
      }
      files.heal();
      const auto again = ApplianceLog::open(files, folder / "log", key_, "theatre-1");
      again->shutdown();
      EXPECT_EQ(read_log(folder / "log").back().type, "shutdown") << "kill at call " << at;
    }
  }
}

/// Puts `to` for the last `from` in the log's file, of the same length: what a disk, or whoever can write to
/// it, does.
void change_log(const fs::path& file, const std::string& from, const std::string& to) {
  std::ifstream input(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(input), {}};
  const std::size_t at = text.rfind(from);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, from.size(), to);
  std::ofstream(file, std::ios::binary) << text;
}

// Whoever signs over it would make the newest checkpoint fit, and nobody would look at the one before.
TEST_F(ApplianceLogTest, ThatWasChangedSaysSoBeforeAnythingIsSignedOverIt) {
  open()->case_held(kApplianceCase, "court order", "anna");
  const std::optional<crypto::Checkpoint> signed_then = note(2);
  change_log(folder_ / "log" / kLedgerFile, "3f9c21ab", "3f9c21aa");
  const auto log = open();
  EXPECT_THAT(log->damage(), HasSubstr("other lines than those over which its checkpoint of 2 entries"));
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(types(), ElementsAre("boot", "case-held", "damage-found", "access"));
  const auto stated =
      std::get<LogDamageEntry>(parse_log_entry(read_log(folder_ / "log")[2].json).entry->body);
  EXPECT_EQ(stated.size, 2U);
  EXPECT_EQ(stated.stated_root, signed_then->root);
  EXPECT_EQ(stated.root, root_of_first(2));
  EXPECT_EQ(note(4)->root, root_of_first(4));
  log->access("*", "unlocked", "sato");
  EXPECT_EQ(types().size(), 5U) << "once";
  EXPECT_EQ(open()->damage(), "") << "the newest checkpoint fits";
}

// Whoever changes what was signed adds lines, so that the checkpoint that shows it is far from the end.
TEST_F(ApplianceLogTest, ThatWasChangedSaysSoHoweverManyLinesStandBehind) {
  open()->case_held(kApplianceCase, "court order", "anna");
  change_log(folder_ / "log" / kLedgerFile, "3f9c21ab", "3f9c21aa");
  for (std::uint64_t seq = 2; seq < 40; ++seq) {
    std::ofstream(folder_ / "log" / kLedgerFile, std::ios::app)
        << to_line(
               LogEntry{seq, {parse_utc("2026-08-05T07:00:00Z").value(), 1}, BootEntry{"b1", "theatre-1"}})
        << "\n";
  }
  EXPECT_THAT(open()->damage(), HasSubstr("other lines than those over which its checkpoint of 2 entries"));
}

// A file in the place of its checkpoint signs no statement that somebody made up, nor does the device then.
TEST_F(ApplianceLogTest, AFileInTheCheckpointsPlaceKeepsNoLineThatSomebodyAdded) {
  const std::uint64_t hold = open()->case_held(kApplianceCase, "court order", "anna");
  std::ofstream(folder_ / "log" / kLedgerFile, std::ios::app)
      << to_line(LogEntry{2, parse_log_entry(read_log(folder_ / "log").back().json).entry->at,
                          CaseReleasedEntry{kApplianceCase, hold, "over", "sato"}})
      << "\n";
  std::ofstream(folder_ / "log" / note_path(3)) << "x";
  open()->checkpoint();
  EXPECT_THAT(types(), ElementsAre("boot", "case-held"));
  EXPECT_FALSE(note(3));
}

TEST_F(ApplianceLogTest, ThatWasChangedBehindAStartSaysSo) {
  open()->access("*", "unlocked", "sato");
  open()->boot("b2");  // has no checkpoint of its own
  change_log(folder_ / "log" / kLedgerFile, "unlocked", "unlockeD");
  EXPECT_THAT(open()->damage(), HasSubstr("of 2 entries"));
}

TEST_F(ApplianceLogTest, WhoseEndWasCutOffSaysSo) {
  open()->access("*", "unlocked", "sato");
  const auto size = fs::file_size(folder_ / "log" / kLedgerFile);
  open()->case_held(kApplianceCase, "court order", "anna");
  fs::resize_file(folder_ / "log" / kLedgerFile, size);
  const auto log = open();
  EXPECT_THAT(log->damage(), HasSubstr("has fewer lines than the 3"));
  log->access("*", "unlocked", "sato");
  const auto stated =
      std::get<LogDamageEntry>(parse_log_entry(read_log(folder_ / "log")[2].json).entry->body);
  EXPECT_EQ(stated.size, 3U);
  EXPECT_FALSE(stated.root);
}

TEST_F(ApplianceLogTest, IsSignedWhereAnotherFileLiesInTheCheckpointsPlace) {
  open()->access("*", "unlocked", "sato");
  fs::copy_file(folder_ / "log" / note_path(2), folder_ / "log" / note_path(3));
  const auto log = open();
  EXPECT_EQ(log->damage(), "");
  log->case_held(kApplianceCase, "court order", "anna");
  ASSERT_TRUE(note(3));
  EXPECT_EQ(note(3)->root, root_of_first(3));
}

// Files that look like later checkpoints must not hide the one that shows it, nor must the entry come again
// and again.
TEST_F(ApplianceLogTest, WhoseEndWasCutOffSaysSoOnceWhateverLiesBesideTheCheckpoints) {
  open()->access("*", "unlocked", "sato");
  const auto size = fs::file_size(folder_ / "log" / kLedgerFile);
  for (int i = 0; i < 20; ++i) open()->access("*", "unlocked", "sato");
  fs::resize_file(folder_ / "log" / kLedgerFile, size);
  std::ofstream(folder_ / "log" / note_path(99'999'999)) << "nothing";
  for (int i = 0; i < 3; ++i) {
    const auto log = open();
    EXPECT_THAT(log->damage(), HasSubstr("has fewer lines than the 22"));
    log->access("*", "unlocked", "sato");
  }
  EXPECT_THAT(types(), ElementsAre("boot", "access", "damage-found", "access", "access", "access"));
}

TEST_F(ApplianceLogTest, TakesNoStatementThatCannotBeSigned) {
  open()->access("*", "unlocked", "sato");
  fs::create_directory(folder_ / "log" / note_path(3));
  const auto log = open();
  EXPECT_THAT([&] { log->case_held(kApplianceCase, "court order", "anna"); },
              testing::ThrowsMessage<Error>(HasSubstr("cannot be signed")));
  EXPECT_THAT(types(), ElementsAre("boot", "access"));
  log->case_opened(kApplianceCase, digest_of_abc());
  EXPECT_THAT(types(), ElementsAre("boot", "access", "case-opened")) << "recording goes on";
  EXPECT_EQ(log->case_held(kApplianceCase, "court order", "anna"), 3U);
}

TEST_F(ApplianceLogTest, KnowsWhetherItGoesOnFromWhatWasKept) {
  const auto log = open();
  log->access("*", "unlocked", "sato");
  const crypto::Checkpoint kept = *note(2);
  log->access("*", "unlocked", "sato");
  const auto lacks = [&](const crypto::Checkpoint& expected) {
    return ApplianceLog::open(files_, folder_ / "log", key_, "theatre-1", expected)->lacks();
  };
  EXPECT_EQ(open()->lacks(), "");
  EXPECT_EQ(lacks(kept), "");
  EXPECT_EQ(lacks(*note(3)), "");
  EXPECT_EQ(lacks({kept.origin, 2, digest_of_abc()}), "its entries are others");
  EXPECT_EQ(lacks({kept.origin, 4, digest_of_abc()}), "it has 3 entries");
}

TEST_F(ApplianceLogTest, GivesItsNewestCheckpointsToWhoeverKeepsThem) {
  open()->access("*", "unlocked", "sato");
  std::vector<std::uint64_t> kept;
  const auto log = open();
  log->keep_notes([&](std::string_view text) {
    const auto opened = crypto::open_note(text, {crypto::VerifierKey("theatre-1", key_.public_key())});
    kept.push_back(crypto::Checkpoint::parse(opened.text).value().size);
  });
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(kept, ElementsAre(2U, 3U));
}

}  // namespace
}  // namespace kiroku::archive
