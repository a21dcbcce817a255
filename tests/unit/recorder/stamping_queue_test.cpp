#include "recorder/stamping_queue.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

UtcTime minute(int number) { return *parse_utc("2026-08-05T09:00:00Z") + std::chrono::minutes(number); }

class StampingQueueTest : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<StampingQueue> open() const {
    return StampingQueue::open(folder_ / "stamping.sqlite");
  }
  static std::vector<std::string> names(const StampingQueue& queue) {
    std::vector<std::string> names;
    for (const WantedToken& wanted : queue.list()) {
      names.push_back(wanted.case_id + " " + wanted.authority + " " + std::to_string(wanted.checkpoint));
    }
    return names;
  }
  test::TemporaryFolder folder_{test::quick_parent()};
};

TEST_F(StampingQueueTest, OneCheckpointOfACaseAndAuthorityIsWantedTheNewest) {
  const auto queue = open();
  queue->want("b", "swiss", 4, minute(1));
  queue->want("a", "swiss", 2, minute(2));
  queue->want("b", "free", 4, minute(3));
  queue->want("b", "swiss", 9, minute(4));
  queue->want("b", "swiss", 7, minute(5));
  EXPECT_THAT(names(*queue), ElementsAre("b swiss 9", "a swiss 2", "b free 4"));
  EXPECT_EQ(queue->list()[0].since, minute(1));
}

TEST_F(StampingQueueTest, ATokenOverAnOlderCheckpointDoesNotEndTheWishForANewerOne) {
  const auto queue = open();
  queue->want("a", "swiss", 9, minute(1));
  queue->done("a", "swiss", 8);
  EXPECT_THAT(names(*queue), ElementsAre("a swiss 9"));
  queue->done("a", "free", 9);
  EXPECT_THAT(names(*queue), ElementsAre("a swiss 9"));
  queue->done("a", "swiss", 10);
  EXPECT_THAT(names(*queue), IsEmpty());
}

TEST_F(StampingQueueTest, SurvivesTheProgram) {
  AuthorityRecord record;
  record.failures = 3;
  record.written = minute(5);
  record.limit = minute(6);
  record.next = minute(7);
  record.path = "over wwan0";
  record.last_error = "größer \"x\"";
  record.last_token = minute(1);
  {
    const auto queue = open();
    queue->want("a", "swiss", 9, minute(1));
    queue->failed("a", "swiss", "no answer");
    queue->failed("a", "swiss", "still none");
    queue->remember("swiss", record);
    record.last_token.reset();
    queue->remember("swiss", record);
  }
  const auto queue = open();
  ASSERT_EQ(queue->list().size(), 1U);
  EXPECT_EQ(queue->list()[0].attempts, 2U);
  EXPECT_EQ(queue->list()[0].last_error, "still none");
  const auto read = queue->authority("swiss");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->failures, 3U);
  EXPECT_EQ(read->written, minute(5));
  EXPECT_EQ(read->limit, minute(6));
  EXPECT_EQ(read->next, minute(7));
  EXPECT_EQ(read->path, "over wwan0");
  EXPECT_EQ(read->last_error, "größer \"x\"");
  EXPECT_EQ(read->last_token, minute(1)) << "a failure does not make the last token forgotten";
  EXPECT_FALSE(queue->authority("free"));
  queue->drop("a", "swiss");
  EXPECT_THAT(queue->list(), IsEmpty());
}

TEST_F(StampingQueueTest, IsSharedByProcesses) {
  const auto one = open();
  const auto other = open();
  one->want("a", "swiss", 9, minute(1));
  other->want("b", "swiss", 1, minute(2));
  EXPECT_THAT(names(*one), ElementsAre("a swiss 9", "b swiss 1"));
}

TEST_F(StampingQueueTest, SetsADamagedFileAside) {
  std::ofstream(folder_ / "stamping.sqlite") << std::string(5000, 'x');
  const auto queue = open();
  queue->want("a", "swiss", 9, minute(1));
  EXPECT_THAT(names(*queue), ElementsAre("a swiss 9"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "stamping.sqlite.damaged"));
}

TEST_F(StampingQueueTest, RefusesAFileOfANewerVersionAndAFolder) {
  open().reset();
  sqlite3* raw = nullptr;
  sqlite3_open((folder_ / "stamping.sqlite").c_str(), &raw);
  sqlite3_exec(raw, "PRAGMA user_version = 99", nullptr, nullptr, nullptr);
  sqlite3_close(raw);
  try {
    open().reset();
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("the stamping queue"));
    EXPECT_THAT(error.what(), HasSubstr("made by a newer version"));
  }
  EXPECT_THROW(StampingQueue::open(folder_.path()), Error);
}

}  // namespace
}  // namespace kiroku::recorder
