#include "archive/catalogue/catalogue.h"

#include <fstream>
#include <functional>
#include <future>
#include <latch>
#include <map>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/ledger_entry.h"
#include "base/error.h"
#include "crypto/hash.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr const char* kFirst = "20260805T091502Z-3f9c21ab";
constexpr const char* kSecond = "20260806T091502Z-00000001";

/// Writes ledgers as a recording leaves them; nothing else of a case is looked at by the catalogue.
class CatalogueTest : public testing::Test {
 protected:
  void add(const std::string& case_id, const CaseEntryBody& body, std::int64_t mono_ns) {
    fs::create_directories(archive_ / case_id);
    const std::string day = case_id.substr(6, 2);
    const CaseEntry entry{seq_[case_id]++, {*parse_utc("2026-08-" + day + "T09:15:02Z"), mono_ns}, body};
    std::ofstream(archive_ / case_id / "ledger.jsonl", std::ios::app) << to_line(entry) << "\n";
  }
  void add_open(const std::string& case_id) {
    OpenEntry open;
    open.case_id = case_id;
    open.device = "d";
    open.boot_id = "b";
    for (const char* name : {"endoscope", "room"}) {
      StreamInfo stream;
      stream.name = name;
      stream.kind = "video";
      stream.media = "video/mp2t";
      stream.source = R"(odd","type":"close","bytes":9)";
      open.streams.push_back(stream);
    }
    add(case_id, open, 0);
  }
  void add_segment(const std::string& case_id, std::uint64_t index, std::uint64_t bytes) {
    SegmentEntry segment;
    segment.stream = "room";
    segment.index = index;
    segment.file = {"segments/room/x", bytes, {}};
    segment.time_base = "1/90000";
    add(case_id, segment, 1);
  }
  void add_token(const std::string& case_id) {
    TokenEntry token;
    token.authority = "swiss";
    token.serial = "0a";
    add(case_id, token, 2);
  }
  void add_whole_case(const std::string& case_id) {
    add_open(case_id);
    add_segment(case_id, 0, 1000);
    add_segment(case_id, 1, 234);
    add_token(case_id);
    add(case_id, TokenMissedEntry{1, "swiss", "no answer"}, 3);
    add(case_id, CloseEntry{"operator", {}}, 7'000'000'000);
    add_token(case_id);
  }
  std::unique_ptr<Catalogue> open() const { return Catalogue::open(file_); }
  static std::vector<std::string> ids(const std::vector<CatalogueRow>& rows) {
    std::vector<std::string> ids;
    ids.reserve(rows.size());
    for (const CatalogueRow& row : rows) {
      ids.push_back(row.case_id);
    }
    return ids;
  }

  /// The file system's clock goes on by ticks: what is written next has another time than all before.
  void pass_a_tick() const {
    const fs::path probe = folder_ / "probe";
    std::ofstream(probe) << "x";
    for (const auto before = fs::last_write_time(probe); fs::last_write_time(probe) == before;) {
      std::ofstream(probe) << "x";
    }
  }

  TemporaryFolder folder_{test::quick_parent()};
  fs::path archive_ = folder_ / "archive";
  fs::path file_ = folder_ / "catalogue.sqlite";
  std::map<std::string, std::uint64_t> seq_;

  void SetUp() override { fs::create_directory(archive_); }
};

TEST_F(CatalogueTest, CountsWhatIsLeftAfterAnErasure) {
  add_whole_case(kFirst);
  add(kFirst, ErasedEntry{"room", 0, 0, "30 days"}, 7'000'000'000);
  const auto rows = open()->list(archive_);
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].segments, 1U);
  EXPECT_EQ(rows[0].bytes, 234U);
  EXPECT_EQ(rows[0].state, "closed");
}

TEST_F(CatalogueTest, ARecoveredCaseLastedUntilItWasCutOff) {
  add_open(kFirst);
  add_segment(kFirst, 0, 10);
  add(kFirst, RecoveredEntry{"b", "crash", ""}, 900'000'000'000);
  add(kFirst, CloseEntry{"recovered", {}}, 900'000'000'001);
  const auto rows = open()->list(archive_);
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].duration_ns, 1);
}

TEST_F(CatalogueTest, ListsWhatAClosedCaseHolds) {
  add_whole_case(kFirst);
  const auto rows = open()->list(archive_);
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].case_id, kFirst);
  EXPECT_EQ(rows[0].opened, *parse_utc("2026-08-05T09:15:02Z"));
  EXPECT_EQ(rows[0].duration_ns, 7'000'000'000);
  EXPECT_EQ(rows[0].state, "closed");
  EXPECT_THAT(rows[0].streams, ElementsAre("endoscope", "room"));
  EXPECT_EQ(rows[0].segments, 2U);
  EXPECT_EQ(rows[0].bytes, 1234U);
  EXPECT_EQ(rows[0].tokens, 2U);
  EXPECT_EQ(rows[0].last_verdict, std::nullopt);
}

TEST_F(CatalogueTest, AGrowingCaseIsBroughtUpToDate) {
  add_open(kFirst);
  const auto catalogue = open();
  auto rows = catalogue->list(archive_);
  EXPECT_EQ(rows[0].state, "open");
  EXPECT_EQ(rows[0].duration_ns, std::nullopt);
  add_segment(kFirst, 0, 10);
  std::ofstream(archive_ / kFirst / "ledger.jsonl", std::ios::app) << R"({"type":"segm)";
  rows = catalogue->list(archive_);
  EXPECT_EQ(rows[0].segments, 1U) << "a torn line is no entry yet";
  EXPECT_EQ(rows[0].bytes, 10U);
}

TEST_F(CatalogueTest, ListsNewestFirstAndFollowsFoldersThatComeAndGo) {
  add_whole_case(kFirst);
  const auto catalogue = open();
  EXPECT_THAT(ids(catalogue->list(archive_)), ElementsAre(kFirst));
  add_whole_case(kSecond);
  EXPECT_THAT(ids(catalogue->list(archive_)), ElementsAre(kSecond, kFirst));
  fs::remove_all(archive_ / kFirst);
  EXPECT_THAT(ids(catalogue->list(archive_)), ElementsAre(kSecond));
}

TEST_F(CatalogueTest, LeavesOutTheLogAndHiddenFolders) {
  fs::create_directory(archive_ / "log");
  fs::create_directory(archive_ / ".new-20260805T091502Z-3f9c21ab");
  std::ofstream(archive_ / ".reserve") << "x";
  std::ofstream(archive_ / "stray file") << "x";
  EXPECT_THAT(open()->list(archive_), IsEmpty());
}

TEST_F(CatalogueTest, ListsWhatCannotBeReadAsUnreadable) {
  fs::create_directory(archive_ / kFirst);     // no ledger
  fs::create_directories(archive_ / kSecond);  // a ledger that begins otherwise
  std::ofstream(archive_ / kSecond / "ledger.jsonl") << "{}\n";
  fs::create_directories(archive_ / "somebody's folder");
  const std::string damaged = "20260807T091502Z-00000002";
  add_whole_case(damaged);
  std::ofstream(archive_ / damaged / "ledger.jsonl", std::ios::app) << std::string("\0\0\n", 3);
  const std::string endless = "20260808T091502Z-00000003";
  add_open(endless);
  std::ofstream(archive_ / endless / "ledger.jsonl", std::ios::app) << std::string(3 << 20, ' ') << "\n";
  const auto rows = open()->list(archive_);
  EXPECT_THAT(ids(rows), ElementsAre(endless, damaged, kSecond, kFirst, "somebody's folder"));
  for (const CatalogueRow& row : rows) {
    EXPECT_EQ(row.state, "unreadable") << row.case_id;
  }
  EXPECT_EQ(rows[3].opened, *parse_utc("2026-08-05T09:15:02Z")) << "by its name";
}

TEST_F(CatalogueTest, ListsNoExcerptAsACase) {
  add_whole_case(kFirst);
  for (const std::string name : {kSecond, "for-the-court"}) {
    fs::create_directory(archive_ / name);
    std::ofstream(archive_ / name / "excerpt.json") << "{}\n";
  }
  EXPECT_THAT(ids(open()->list(archive_)), ElementsAre(kFirst));
  EXPECT_EQ(open()->rebuild(archive_), 1U);
}

TEST_F(CatalogueTest, CountsLinesThatAreWrittenOtherwiseToo) {
  add_open(kFirst);
  std::ofstream(archive_ / kFirst / "ledger.jsonl", std::ios::app)
      << R"({ "seq":1, "type":"mark", "utc":"2026-08-05T09:15:02.000000Z", "mono_ns":1, "commitment":")"
      << std::string(64, 'a') << "\" }\n";
  add_segment(kFirst, 0, 5);
  EXPECT_EQ(open()->list(archive_)[0].segments, 1U);
}

TEST_F(CatalogueTest, KeepsAVerdictWhileTheCaseDoesNotChange) {
  add_whole_case(kFirst);
  const UtcTime when = *parse_utc("2026-08-06T00:00:00Z");
  {
    const auto catalogue = open();
    catalogue->list(archive_);
    catalogue->set_verdict(kFirst, "intact", when);
    catalogue->set_verdict("20260101T000000Z-00000000", "intact", when);
  }
  const auto catalogue = open();
  EXPECT_EQ(catalogue->rebuild(archive_), 1U);
  catalogue->refresh(archive_ / kFirst / "");
  auto rows = catalogue->list(archive_);
  EXPECT_EQ(rows[0].last_verdict, "intact");
  EXPECT_EQ(rows[0].verified, when);
  add_token(kFirst);
  rows = catalogue->list(archive_);
  EXPECT_EQ(rows[0].last_verdict, std::nullopt);
  EXPECT_EQ(rows[0].verified, std::nullopt);
}

// A list that went on saying "intact" would say it of what nobody verified.
TEST_F(CatalogueTest, ForgetsAVerdictWhereFilesAreTakenAwayOrTheLedgersTimeIsSetBack) {
  add_whole_case(kFirst);
  const fs::path ledger = archive_ / kFirst / "ledger.jsonl";
  const fs::path segment = archive_ / kFirst / "segments" / "room" / "00000000.ts.age";
  fs::create_directories(segment.parent_path());
  std::ofstream(segment) << "film";
  const auto catalogue = open();
  const auto is_kept_after = [&](const std::function<void()>& change) {
    catalogue->list(archive_);
    catalogue->set_verdict(kFirst, "intact", *parse_utc("2026-08-06T00:00:00Z"));
    EXPECT_EQ(catalogue->list(archive_)[0].last_verdict, "intact");
    pass_a_tick();
    change();
    return catalogue->list(archive_)[0].last_verdict.has_value();
  };
  EXPECT_TRUE(is_kept_after([] {}));
  EXPECT_FALSE(is_kept_after([&] { fs::rename(segment, segment.string() + ".gone"); }));
  EXPECT_FALSE(is_kept_after([&] { fs::remove(segment.string() + ".gone"); }));
  EXPECT_FALSE(is_kept_after([&] { fs::create_directory(archive_ / kFirst / "segments" / "more"); }));
  EXPECT_FALSE(is_kept_after([&] {
    const auto time = fs::last_write_time(ledger);
    std::fstream(ledger, std::ios::in | std::ios::out) << '{';
    fs::last_write_time(ledger, time);
  }));
}

TEST_F(CatalogueTest, IsMadeAnewFromTheFolders) {
  add_whole_case(kFirst);
  add_whole_case(kSecond);
  open()->list(archive_);
  fs::remove(file_);
  const auto catalogue = open();
  EXPECT_EQ(catalogue->rebuild(archive_), 2U);
  EXPECT_THAT(ids(catalogue->list(archive_)), ElementsAre(kSecond, kFirst));
}

TEST_F(CatalogueTest, SetsADamagedFileAside) {
  std::ofstream(file_) << std::string(5000, 'x');
  add_whole_case(kFirst);
  EXPECT_EQ(open()->list(archive_).size(), 1U);
  EXPECT_TRUE(fs::exists(folder_ / "catalogue.sqlite.damaged"));
}

TEST_F(CatalogueTest, SetsAFileAsideThatIsDamagedInside) {
  for (int i = 0; i < 50; ++i) {
    add_open("20260805T091502Z-000000" + std::to_string(10 + i));
  }
  open()->list(archive_);
  {
    std::fstream damaged(file_, std::ios::in | std::ios::out | std::ios::binary);
    damaged.seekp(4096);
    damaged << std::string(4096, '\xff');
  }
  EXPECT_EQ(open()->list(archive_).size(), 50U);
  EXPECT_TRUE(fs::exists(folder_ / "catalogue.sqlite.damaged"));
}

TEST_F(CatalogueTest, TwoProcessesUseOneFile) {
  add_whole_case(kFirst);
  const auto first = open();
  const auto second = open();
  EXPECT_EQ(first->list(archive_).size(), 1U);
  second->set_verdict(kFirst, "intact", *parse_utc("2026-08-06T00:00:00Z"));
  EXPECT_EQ(first->list(archive_)[0].last_verdict, "intact");
}

TEST_F(CatalogueTest, SeveralMakeOneFileAtOnce) {
  constexpr int kTimes = 20, kPrograms = 6;
  for (int time = 0; time < kTimes; ++time) {
    const fs::path file = archive_ / ("catalogue-" + std::to_string(time) + ".sqlite");
    std::latch all_there(kPrograms);
    std::vector<std::future<void>> programs;
    for (int i = 0; i < kPrograms; ++i) {
      programs.push_back(std::async(std::launch::async, [&] {
        all_there.arrive_and_wait();
        static_cast<void>(Catalogue::open(file));
      }));
    }
    for (std::future<void>& program : programs) EXPECT_NO_THROW(program.get());
  }
}

TEST_F(CatalogueTest, NamesTheArchiveThatIsNotThere) {
  try {
    open()->list(folder_ / "nowhere");
    FAIL() << "listed";
  } catch (const IoError& error) {
    EXPECT_THAT(error.what(), HasSubstr("nowhere"));
  }
  EXPECT_THROW(Catalogue::open(folder_ / "no" / "catalogue.sqlite"), Error);
}

}  // namespace
}  // namespace kiroku::archive
