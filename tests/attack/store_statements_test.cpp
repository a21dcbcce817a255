// What another device states of a case that a store had without its end, and what becomes of the verdict: it
// is never better than without.
#include "archive/verify/store_statements.h"

#include <algorithm>

#include <gmock/gmock.h>

#include "archive/storage/file_stamps.h"
#include "tests/attack/attacked_case.h"
#include "tests/support/evidence_kit.h"
#include "tests/support/report_text.h"
#include "tests/support/sample_case.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::StoreStatement;
using archive::Verdict;
using archive::VerificationReport;
using ::testing::HasSubstr;
using ::testing::Not;

class StoreStatements : public ::testing::Test {
 protected:
  StoreStatements() {
    trust_.add_own_authority(bytes_of(archive_.authority().root_pem()), "own");
    trust_.add_trusted(bytes_of(outside_.root_pem()), "outside");
  }

  static fs::path written(SampleArchive& archive) {
    SampleCase sample(archive);
    sample.record();
    return sample.folder();
  }

  [[nodiscard]] StoreStatement described() const {
    const VerificationReport report = verify();
    StoreStatement statement = archive::describe_for_statement(archive::CaseFolder::open(folder_),
                                                               report.entries, report.signed_entries);
    statement.maker = "or-2";
    statement.case_id = report.case_id;
    statement.device = report.device;
    statement.store = "https://store.hospital.example/recordings/or3";
    statement.looked = *parse_utc("2026-08-05T17:00:00Z");
    return statement;
  }
  [[nodiscard]] fs::path place() const {
    const fs::path beside = archive::store_statements_folder(folder_, folder_.filename().string());
    fs::create_directories(beside);
    return beside / archive::store_statement_name(*parse_utc("2026-08-05T17:00:00Z"), device().key_id());
  }
  void state(const StoreStatement& statement) const { state(statement, key_); }
  void state(const StoreStatement& statement, const crypto::SigningKey& key) const {
    write_file(place(), crypto::sign_note(statement.to_text(), statement.maker, key));
  }
  [[nodiscard]] crypto::VerifierKey device() const { return crypto::verifier_key_of("or-2", key_); }
  [[nodiscard]] VerificationReport verify() const { return verify({archive_.device(), device()}); }
  [[nodiscard]] VerificationReport verify(const std::vector<crypto::VerifierKey>& devices) const {
    archive::VerifyOptions options = archive_.options();
    options.log.reset();
    options.trust = &trust_;
    options.devices = devices;
    return archive::verify_case(folder_, options);
  }
  static std::string told(const VerificationReport& report, const std::string& code) {
    const auto found = std::ranges::find(report.findings, code, &archive::Finding::code);
    return found == report.findings.end() ? "" : found->text;
  }
  static std::string codes(const VerificationReport& report) {
    std::string all(archive::verdict_name(report.verdict));
    for (const archive::Finding& each : report.findings) {
      if (each.code.starts_with("store-statement")) all += " " + each.code.substr(16);
    }
    return all;
  }

  SampleArchive archive_;
  fs::path folder_ = written(archive_);
  crypto::SigningKey key_ =
      crypto::SigningKey::generate().with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  PlayedAuthority outside_{"outside", "2026-01-01", "2036-01-01"};
  timestamp::TrustStore trust_;
};

TEST_F(StoreStatements, HoldAndLeaveTheVerdictAsItIs) {
  EXPECT_EQ(codes(verify()), "incomplete");
  state(described());
  const VerificationReport report = verify();
  EXPECT_EQ(codes(report), "incomplete holds") << details(report);
  const std::string text = told(report, "store-statement-holds");
  EXPECT_THAT(text, HasSubstr("device \"or-2\", and not the case's own"));
  EXPECT_THAT(text, HasSubstr(std::to_string(report.entries) + " entries"));
  EXPECT_THAT(text, HasSubstr("no time-stamp that holds"));
}

TEST_F(StoreStatements, TellByWhenTheyWereMade) {
  state(described());
  const crypto::Sha256Digest hash = crypto::sha256(bytes_of(read_file(place())));
  const Bytes response = outside_.at("2026-08-06")(crypto::HashAlgorithm::kSha256, hash);
  write_file(archive::token_beside(place(), "outside"), std::string(text_of(response)));
  EXPECT_THAT(told(verify(), "store-statement-holds"),
              HasSubstr("stated this by 2026-08-06T00:00:00.000000Z, as "));
  // A token over something else says nothing.
  state(described());
  write_file(place(), read_file(place()) + "— another AAAAAAAA\n");
  EXPECT_THAT(told(verify(), "store-statement-holds"), HasSubstr("no time-stamp that holds"));
}

TEST_F(StoreStatements, CountForNothingByAStranger) {
  state(described());
  EXPECT_EQ(codes(verify({archive_.device()})), "incomplete untrusted");
  const crypto::SigningKey other = crypto::SigningKey::generate();
  state(described(), other);
  EXPECT_EQ(codes(verify()), "incomplete untrusted") << "another key of the same name";
}

// A hundred of them, of a megabyte each, would take memory to the end of the verification.
TEST_F(StoreStatements, OfAStrangerAreNotKeptWhole) {
  StoreStatement statement = described();
  statement.files.push_back({"checkpoints/99999999.note", {}});
  statement.missing.push_back("segments/room/00000000.ts.age");
  state(statement);
  const auto judged = [&](const std::vector<crypto::VerifierKey>& devices) {
    archive::VerifyOptions options;
    options.devices = devices;
    options.trust = &trust_;
    const auto all = archive::judge_store_statements(
        archive::CaseFolder::open(folder_),
        {statement.case_id, crypto::VerifierKey::parse(statement.device), statement.entries.size}, options);
    return all.at(0);
  };
  const archive::JudgedStatement stranger = judged({archive_.device()});
  ASSERT_TRUE(stranger.statement);
  EXPECT_FALSE(stranger.is_trusted);
  EXPECT_EQ(stranger.statement->maker, "or-2");
  EXPECT_TRUE(stranger.statement->files.empty());
  EXPECT_TRUE(stranger.statement->missing.empty());
  const archive::JudgedStatement trusted = judged({archive_.device(), device()});
  EXPECT_TRUE(trusted.is_trusted);
  EXPECT_FALSE(trusted.statement->files.empty());
}

TEST_F(StoreStatements, AreRefusedOfTheCasesOwnDevice) {
  StoreStatement statement = described();
  statement.maker = SampleArchive::kDeviceName;
  state(statement, archive_.key());
  EXPECT_EQ(codes(verify()), "incomplete refused");
}

TEST_F(StoreStatements, NeedEachKeyOfTheirMaker) {
  const StoreStatement statement = described();
  const std::string note = crypto::sign_note(statement.to_text(), "or-2", key_);
  const std::size_t second = note.find("— or-2/ml-dsa-65");
  ASSERT_NE(second, std::string::npos);
  write_file(place(), note.substr(0, second));
  EXPECT_EQ(codes(verify()), "incomplete refused");
}

TEST_F(StoreStatements, OfAnotherCaseAreRefused) {
  StoreStatement statement = described();
  statement.case_id = "20260805T091502Z-00000000";
  state(statement);
  EXPECT_EQ(codes(verify()), "incomplete refused");
  statement = described();
  statement.device = device().to_string();
  state(statement);
  EXPECT_EQ(codes(verify()), "incomplete refused");
}

TEST_F(StoreStatements, TellOfWhatIsGoneSince) {
  state(described());
  const std::string ledger = read_file(folder_ / "ledger.jsonl");
  const std::size_t last = ledger.rfind('\n', ledger.size() - 2);
  write_file(folder_ / "ledger.jsonl", ledger.substr(0, last + 1));
  EXPECT_THAT(codes(verify()), HasSubstr(" differs"));
  EXPECT_THAT(told(verify(), "store-statement-differs"), HasSubstr("and here are "));
  write_file(folder_ / "ledger.jsonl", ledger);
  ASSERT_EQ(codes(verify()), "incomplete holds");
  const fs::path note = archive::note_path(verify().signed_entries);
  const std::string signed_note = read_file(folder_ / note);
  fs::remove(folder_ / note);
  EXPECT_THAT(told(verify(), "store-statement-differs"), HasSubstr("is missing here"));
  write_file(folder_ / note, signed_note + "— another AAAAAAAA\n");
  EXPECT_THAT(told(verify(), "store-statement-differs"), HasSubstr("is not the file that was there then"));
}

TEST_F(StoreStatements, NeverMakeACaseReadAsTamperedWith) {
  StoreStatement lying = described();
  lying.entries.root = crypto::sha256(bytes_of("another"));
  state(lying);
  EXPECT_EQ(codes(verify()), "incomplete differs");
  lying = described();
  lying.files.push_back({"tokens/00000042.zzz.tsr", crypto::sha256(bytes_of("made up"))});
  state(lying);
  EXPECT_EQ(codes(verify()), "incomplete differs");
}

TEST_F(StoreStatements, TellOfWhatCameSince) {
  StoreStatement early = described();
  const VerificationReport before = verify();
  archive::CaseFolder folder = archive::CaseFolder::open(folder_);
  const StoreStatement first = archive::describe_for_statement(folder, before.entries - 1, 1);
  early.entries = first.entries;
  early.signed_entries = first.signed_entries;
  state(early);
  const VerificationReport report = verify();
  EXPECT_EQ(codes(report), "incomplete outgrown holds") << details(report) << "by their entries";
  EXPECT_THAT(told(report, "store-statement-outgrown"), HasSubstr("1 entry and "));
  state(described());
  ASSERT_EQ(codes(verify()), "incomplete holds");
  write_file(folder_ / "segments/endoscope/00000003.ts.age", "x");
  EXPECT_EQ(codes(verify()), "incomplete holds outgrown");
  EXPECT_THAT(told(verify(), "store-statement-outgrown"), HasSubstr("0 entries and 1 file "));
}

TEST_F(StoreStatements, StateWhatIsMissing) {
  const fs::path segment = folder_ / "segments/endoscope/00000001.ts.age";
  const std::string film = read_file(segment);
  fs::remove(segment);
  const StoreStatement statement = described();
  EXPECT_THAT(statement.missing, ::testing::ElementsAre("segments/endoscope/00000001.ts.age"));
  write_file(segment, film);
  state(statement);
  EXPECT_EQ(codes(verify()), "incomplete holds outgrown") << "it came since";
}

TEST_F(StoreStatements, AreFilesAndNoLinks) {
  state(described());
  const fs::path elsewhere = folder_.parent_path() / "elsewhere";
  fs::rename(place(), elsewhere);
  fs::create_symlink(elsewhere, place());
  EXPECT_EQ(codes(verify()), "incomplete refused");
  const fs::path beside = place().parent_path();
  fs::remove_all(beside);
  fs::create_directory_symlink(folder_.parent_path(), beside);
  EXPECT_EQ(codes(verify()), "incomplete");
}

}  // namespace
}  // namespace kiroku::test
