#include "archive/reading/replica.h"

#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/upkeep/retention.h"
#include "tests/support/flipped_byte.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::SampleArchive;
using test::SampleCase;
using testing::HasSubstr;
using testing::Optional;

class ReplicaTest : public testing::Test {
 protected:
  ReplicaTest() {
    fs::create_directories(copy_.parent_path());
    fs::copy(folder_, copy_, fs::copy_options::recursive);
  }
  [[nodiscard]] std::optional<std::string> why_not() const {
    return why_not_replicated(folder_, "endoscope", copy_);
  }

  SampleArchive archive_;
  fs::path folder_ = SampleCase::write(archive_);
  fs::path copy_ = archive_.folder().parent_path() / "elsewhere" / folder_.filename();
};

TEST_F(ReplicaTest, AFaithfulCopyCounts) {
  EXPECT_EQ(why_not(), std::nullopt);
  // Entries that the case got after it was copied do not matter, other streams neither.
  std::ifstream in(copy_ / "ledger.jsonl");
  std::string all((std::istreambuf_iterator<char>(in)), {});
  all.resize(all.rfind('\n', all.size() - 2) + 1);
  std::ofstream(copy_ / "ledger.jsonl", std::ios::trunc) << all;
  fs::remove_all(copy_ / "segments/vitals");
  EXPECT_EQ(why_not(), std::nullopt);
}

TEST_F(ReplicaTest, EveryDoubtIsAReason) {
  const fs::path segment = copy_ / "segments/endoscope/00000001.ts.age";
  fs::resize_file(segment, fs::file_size(segment) - 1);
  EXPECT_THAT(why_not(), Optional(HasSubstr("00000001.ts.age is not the one that was recorded")));
  fs::remove(segment);
  EXPECT_THAT(why_not(), Optional(HasSubstr("00000001.ts.age is not there")));
  fs::create_symlink(folder_ / "segments/endoscope/00000001.ts.age", segment);
  EXPECT_THAT(why_not(), Optional(HasSubstr("00000001.ts.age is a symbolic link")));
  EXPECT_THAT(why_not_replicated(folder_, "endoscope", copy_ / "nowhere"), Optional(HasSubstr("no copy")));
}

TEST_F(ReplicaTest, AHoleOfTebibytesIsNotRead) {
  fs::resize_file(copy_ / "segments/endoscope/00000001.ts.age", std::uintmax_t{8} << 40U);
  EXPECT_THAT(why_not(), Optional(HasSubstr("it has 8796093022208 bytes")));
}

TEST_F(ReplicaTest, ItsLedgerMustBeThisOne) {
  const fs::path ledger = copy_ / "ledger.jsonl";
  test::flip_byte(ledger, 40);
  EXPECT_THAT(why_not(), Optional(HasSubstr("another one")));
  fs::remove(ledger);
  EXPECT_THAT(why_not(), Optional(HasSubstr("ledger is not there")));
}

TEST_F(ReplicaTest, ACopyFromBeforeTheCaseWasClosedDoesNotCount) {
  std::ifstream in(folder_ / "ledger.jsonl");
  std::ofstream out(copy_ / "ledger.jsonl", std::ios::trunc);
  for (std::string line; std::getline(in, line) && line.find("\"close\"") == std::string::npos;) {
    out << line << '\n';
  }
  out.close();
  EXPECT_THAT(why_not(), Optional(HasSubstr("not closed yet")));
}

}  // namespace
}  // namespace kiroku::archive
