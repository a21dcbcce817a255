#include "fleet/stored_case.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/scripted_server.h"

namespace kiroku::fleet {
namespace {

constexpr const char* kCase = "20260805T091502Z-3f9c21ab";

std::string version(const std::string& key, const std::string& id, bool newest, const std::string& put) {
  return "<Version><Key>" + key + "</Key><VersionId>" + id + "</VersionId><IsLatest>" +
         (newest ? "true" : "false") + "</IsLatest><Size>1</Size><LastModified>" + put +
         "</LastModified></Version>";
}

std::string versions_listed(const std::string& inside) {
  return test::http_answer(
      "200 OK", "application/xml",
      "<ListVersionsResult><IsTruncated>false</IsTruncated>" + inside + "</ListVersionsResult>");
}

class StoredCases : public ::testing::Test {
 protected:
  test::ScriptedServer server_{versions_listed("")};
  ObjectStore store_{{"http://127.0.0.1:" + std::to_string(server_.port()), "recordings", "us-east-1", {}},
                     {"or-1-key", crypto::Secret::copy_of("not to be told")}};
};

TEST_F(StoredCases, KnowWhatLiesUnderALockThatCounts) {
  StoredCase of;
  const std::string parts = std::string("or-1/growing/") + kCase + "/";
  of.newest = {{parts + "000000000000", "v1"},
               {parts + "000000004096", "v2"},
               {"or-1/growing/log/000", "v3"},
               {std::string("or-1/") + kCase + "/device.pub", "v4"}};
  of.newest_key = std::string("or-1/") + kCase + "/checkpoints/00000042.note";
  EXPECT_THAT(of.telling_keys("or-1", kCase),
              ::testing::ElementsAre(std::string("or-1/") + kCase + "/ledger.jsonl", parts + "000000004096",
                                     of.newest_key));
  EXPECT_THAT(StoredCase().telling_keys("or-1", kCase),
              ::testing::ElementsAre(std::string("or-1/") + kCase + "/ledger.jsonl"));
}

TEST_F(StoredCases, TellWhenTheAppliancesLogCameLast) {
  EXPECT_FALSE(log_came_last(store_, "or-1"));
  server_.answer_with(
      versions_listed(version("or-1/growing/log/000000000000", "v1", true, "2026-11-29T16:45:00Z") +
                      version("or-1/growing/log/000000000099", "v1", true, "2026-11-29T16:46:00Z") +
                      version("or-1/growing/log/000000000100", "v1", true, "2026-11-29T16:44:00Z")));
  EXPECT_EQ(log_came_last(store_, "or-1"), parse_utc("2026-11-29T16:46:00Z"));
  EXPECT_THAT(server_.last_request(), ::testing::HasSubstr("prefix=or-1%2Fgrowing%2Flog%2F"));
}

TEST_F(StoredCases, StatementsLieBesideTheirCase) {
  EXPECT_EQ(store_statements_prefix("or-1", kCase), std::string("or-1/store-statements/") + kCase + "/");
}

}  // namespace
}  // namespace kiroku::fleet
