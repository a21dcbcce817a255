#include "viewer/report/case_facts.h"

#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/reading/excerpt.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "tests/support/sample_case.h"

namespace kiroku::report {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

class CaseFactsTest : public testing::Test {
 protected:
  static std::string read(const fs::path& file) {
    std::ifstream input(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(input), {}};
  }
  static void write(const fs::path& file, const std::string& text) {
    std::ofstream(file, std::ios::binary | std::ios::trunc) << text;
  }
  /// One digit of the year in the second line.
  static std::string with_another_time(std::string lines) {
    lines[lines.find("utc", lines.find('\n')) + 8] = '9';
    return lines;
  }

  test::SampleArchive archive_;
  fs::path folder_ = test::SampleCase::write(archive_);
};

TEST_F(CaseFactsTest, AreOfTheLinesThatWereVerified) {
  const archive::VerificationReport report = archive::verify_case(folder_, archive_.options());
  const CaseFacts facts = read_case_facts(folder_, report);
  EXPECT_EQ(facts.entries, report.entries);
  EXPECT_EQ(facts.root, report.lines_root);
  EXPECT_EQ(facts.ledger.sha256, crypto::sha256(bytes_of(read(folder_ / "ledger.jsonl"))));
}

TEST_F(CaseFactsTest, OfALedgerExchangedSinceThereAreNone) {
  const archive::VerificationReport report = archive::verify_case(folder_, archive_.options());
  const fs::path ledger = folder_ / "ledger.jsonl";
  const std::string honest = read(ledger);
  for (const std::string& other : {with_another_time(honest), honest.substr(0, honest.find('\n') + 1)}) {
    write(ledger, other);
    EXPECT_THAT([&] { (void)read_case_facts(folder_, report); },
                ThrowsMessage<Error>(HasSubstr("its ledger changed after it was verified")));
  }
}

TEST_F(CaseFactsTest, LinesWrittenSinceAreNotAmongThem) {
  const archive::VerificationReport report = archive::verify_case(folder_, archive_.options());
  const std::string honest = read(folder_ / "ledger.jsonl");
  const std::string last = honest.substr(honest.rfind('\n', honest.size() - 2) + 1);
  write(folder_ / "ledger.jsonl", honest + last);
  const CaseFacts facts = read_case_facts(folder_, report);
  EXPECT_EQ(facts.entries, report.entries);
  EXPECT_EQ(facts.root, report.lines_root);
}

/// What anybody can write: no key is needed for a note's form.
std::string forged_note(const std::string& case_id, std::uint64_t size) {
  const auto base64 = [](std::size_t bytes) {
    return crypto::to_base64(Bytes(bytes, std::byte{7}), crypto::Base64Padding::kPadded);
  };
  return "kiroku/or3/" + case_id + "\n" + std::to_string(size) + "\n" + base64(32) + "\n\n\u2014 or3 " +
         base64(68) + "\n";
}

// Hashing a case takes minutes in which whoever can write to its folder may put anything there.
TEST_F(CaseFactsTest, ACheckpointPutThereSinceIsNotAmongThem) {
  const archive::VerificationReport report = archive::verify_case(folder_, archive_.options());
  ASSERT_EQ(report.verdict, archive::Verdict::kIntact);
  const CaseFacts before = read_case_facts(folder_, report);
  ASSERT_TRUE(before.last_checkpoint);
  EXPECT_EQ(before.last_checkpoint->size, report.entries);
  EXPECT_EQ(before.last_checkpoint->root, *report.lines_root);
  const std::string case_id = folder_.filename().string();
  for (const std::uint64_t size : {std::uint64_t{2}, std::uint64_t{9999}}) {
    const std::string name = std::to_string(size);
    write(folder_ / "checkpoints" / (std::string(8 - name.size(), '0') + name + ".note"),
          forged_note(case_id, size));
    const CaseFacts facts = read_case_facts(folder_, report);
    ASSERT_TRUE(facts.last_checkpoint);
    EXPECT_EQ(facts.last_checkpoint->text, before.last_checkpoint->text);
    EXPECT_EQ(facts.last_checkpoint->root, before.last_checkpoint->root);
  }
}

TEST_F(CaseFactsTest, OfACheckpointExchangedOrRemovedSinceThereAreNone) {
  const archive::VerificationReport report = archive::verify_case(folder_, archive_.options());
  const fs::path note = folder_ / read_case_facts(folder_, report).last_checkpoint->file;
  write(note, forged_note(folder_.filename().string(), report.entries));
  EXPECT_THAT([&] { (void)read_case_facts(folder_, report); },
              ThrowsMessage<Error>(HasSubstr("changed after it was verified")));
  fs::remove(note);
  EXPECT_THAT([&] { (void)read_case_facts(folder_, report); },
              ThrowsMessage<Error>(HasSubstr("changed after it was verified")));
}

TEST_F(CaseFactsTest, NobodyJudgedTheCheckpointsOfACaseThatWasNotVerified) {
  EXPECT_FALSE(read_case_facts(folder_).last_checkpoint);
}

TEST_F(CaseFactsTest, OfAnExcerptAreThoseOfItsLinesAndItsOpening) {
  const fs::path excerpt = archive_.folder() / "excerpt";
  archive::ExcerptOptions options;
  options.from_ns = 2'000'000'001;
  options.to_ns = 4'000'000'000;
  options.streams = {"endoscope"};
  archive::make_excerpt(folder_, options, excerpt);
  const archive::VerificationReport report = archive::verify_case(excerpt, archive_.options());
  EXPECT_EQ(read_case_facts(excerpt, report).entries, report.entries);
  ASSERT_TRUE(report.excerpt && read_case_facts(excerpt, report).last_checkpoint);
  EXPECT_EQ(read_case_facts(excerpt, report).last_checkpoint->size, report.excerpt->size);
  for (const char* file : {"ledger-part.jsonl", "ledger-open.jsonl"}) {
    const std::string honest = read(excerpt / file);
    std::string other = honest;
    other[other.find("utc") + 8] = '9';
    write(excerpt / file, other);
    EXPECT_THROW((void)read_case_facts(excerpt, report), Error) << file;
    write(excerpt / file, honest);
  }
}

}  // namespace
}  // namespace kiroku::report
