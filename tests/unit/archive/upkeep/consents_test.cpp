#include "archive/upkeep/consents.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/consent_layout.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/log_reading.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::SampleArchive;
using test::SampleCase;
using testing::HasSubstr;
using testing::IsEmpty;

/// A log that states consents of a case, and somebody who can write to its disk and has no key.
class ConsentsTest : public testing::Test {
 protected:
  std::unique_ptr<ApplianceLog> open_log() {
    return ApplianceLog::open(real_file_system(), archive_.log_folder(), archive_.key(),
                              SampleArchive::kDeviceName);
  }
  crypto::Sha256Digest keep(const std::string& text) {
    return keep_sealed(real_file_system(), archive_.log_folder(), bytes_of(text), archive_.recipients());
  }
  [[nodiscard]] ConsentStatement teaching() const {
    return {case_id_, {"teaching"}, crypto::sha256(bytes_of("a statement")), std::nullopt, "anna"};
  }
  void give() { open_log()->consent_given(teaching()); }
  std::uint64_t withdraw() { return open_log()->consent_withdrawn(teaching()); }
  /// A line that nobody signs, and another, for which the recorder takes neither back.
  void forge(const LogEntryBody& body) {
    for (const LogEntryBody& each : {body, LogEntryBody(ShutdownEntry{})}) {
      const std::vector<LogLine> all = read_log(archive_.log_folder());
      LogEntry entry = parse_log_entry(all.back().json).entry.value();
      entry.seq = all.size();
      entry.body = each;
      std::ofstream(archive_.log_folder() / kLedgerFile, std::ios::app) << to_line(entry) << "\n";
    }
  }
  /// A start of the machine that names another key, and a line with a checkpoint by that key.
  void forge_signed(const LogEntryBody& body) {
    const crypto::SigningKey key = crypto::SigningKey::generate();
    const std::string name = "stranger";
    const BootEntry boot{"another boot", crypto::verifier_key_of(name, key).to_string()};
    for (const LogEntryBody& each : {LogEntryBody(boot), body}) {
      const std::vector<LogLine> all = read_log(archive_.log_folder());
      LogEntry entry = parse_log_entry(all.back().json).entry.value();
      entry.seq = all.size();
      entry.body = each;
      std::ofstream(archive_.log_folder() / kLedgerFile, std::ios::app) << to_line(entry) << "\n";
    }
    const std::uint64_t size = read_log(archive_.log_folder()).size();
    const crypto::Checkpoint text{log_origin(name), size, root_of_log(archive_.log_folder(), size)};
    std::ofstream(archive_.log_folder() / note_path(size)) << crypto::sign_note(text.to_text(), name, key);
  }
  [[nodiscard]] Consents read() const { return read_consents(archive_.log_folder(), archive_.device()); }
  [[nodiscard]] std::optional<std::uint64_t> erases() const {
    return signed_withdrawal(read(), case_id_, "teaching");
  }
  [[nodiscard]] std::string why_not() const { return why_not_consented(read(), case_id_, "teaching"); }
  [[nodiscard]] bool may_withdraw() const {
    return may_be_withdrawn(read().at(case_id_).purposes.at("teaching"));
  }

  SampleArchive archive_;
  std::string case_id_ = SampleCase::write(archive_).filename().string();
};

TEST_F(ConsentsTest, ASignedWithdrawalForbidsAndErases) {
  give();
  EXPECT_THAT(why_not(), IsEmpty());
  EXPECT_EQ(erases(), std::nullopt);
  const std::uint64_t entry = withdraw();
  EXPECT_THAT(why_not(), HasSubstr("was withdrawn"));
  EXPECT_EQ(erases(), entry);
  EXPECT_FALSE(may_withdraw());
}

TEST_F(ConsentsTest, AWithdrawalThatNobodySignedForbidsAndErasesNothing) {
  give();
  forge(ConsentWithdrawnEntry{teaching()});
  EXPECT_THAT(why_not(), HasSubstr("nobody signed that entry in time"));
  EXPECT_EQ(erases(), std::nullopt);
  // The next entry's checkpoint covers it, and is not its own.
  open_log()->access(case_id_, "exported vitals", "anna");
  EXPECT_THAT(why_not(), HasSubstr("nobody signed that entry in time"));
  EXPECT_EQ(erases(), std::nullopt);
  EXPECT_TRUE(may_withdraw());
  const std::uint64_t entry = withdraw();
  EXPECT_EQ(erases(), entry);
}

TEST_F(ConsentsTest, AWithdrawalThatNobodySignedTakesNothingBackFromASignedOne) {
  give();
  const std::uint64_t entry = withdraw();
  forge(ConsentWithdrawnEntry{teaching()});
  EXPECT_EQ(erases(), entry);
}

TEST_F(ConsentsTest, OfAConsentThatWasGivenAgainTheOldWithdrawalErasesNothing) {
  give();
  withdraw();
  give();
  EXPECT_EQ(erases(), std::nullopt);
  forge(ConsentWithdrawnEntry{teaching()});
  EXPECT_THAT(why_not(), HasSubstr("nobody signed that entry in time"));
  EXPECT_EQ(erases(), std::nullopt);
}

TEST_F(ConsentsTest, WhoseCheckpointIsGoneErasesNothingAndPermitsNothing) {
  give();
  withdraw();
  ASSERT_NE(erases(), std::nullopt);
  give();
  const std::uint64_t size = read_log(archive_.log_folder()).size();
  open_log()->plan_sealed(crypto::sha256({}));
  fs::remove(archive_.log_folder() / note_path(size));
  EXPECT_THAT(why_not(), HasSubstr("was withdrawn"));
  EXPECT_EQ(erases(), std::nullopt);
  withdraw();
  EXPECT_NE(erases(), std::nullopt) << "a later withdrawal that is signed counts";
}

// Whoever can write to the disk has a key of their own, and lets the log name it before the recorder's next
// start.
TEST_F(ConsentsTest, AKeyThatNobodyHandedOverToSignsNothing) {
  give();
  forge_signed(ConsentWithdrawnEntry{teaching()});
  open_log()->boot("the next start");
  open_log()->access(case_id_, "exported vitals", "anna");
  EXPECT_EQ(erases(), std::nullopt);
}

TEST_F(ConsentsTest, WhatWasSealedForNoEntryIsRemovedAndNothingElse) {
  const crypto::Sha256Digest entered = keep("entered"), not_entered = keep("not entered"),
                             of_another = keep("of another");
  ConsentStatement says = teaching();
  says.statement = entered;
  open_log()->consent_given(says);
  remove_unless_entered(real_file_system(), archive_.log_folder(), {entered, not_entered});
  EXPECT_TRUE(fs::exists(archive_.log_folder() / consent_path(entered)));
  EXPECT_FALSE(fs::exists(archive_.log_folder() / consent_path(not_entered)));
  EXPECT_TRUE(fs::exists(archive_.log_folder() / consent_path(of_another)));
}

TEST_F(ConsentsTest, WhereTheLogCannotBeReadWhatWasSealedStays) {
  const crypto::Sha256Digest kept = keep("kept");
  std::ofstream(archive_.log_folder() / kLedgerFile, std::ios::app) << "no entry\n";
  remove_unless_entered(real_file_system(), archive_.log_folder(), {kept});
  EXPECT_TRUE(fs::exists(archive_.log_folder() / consent_path(kept)));
}

}  // namespace
}  // namespace kiroku::archive
