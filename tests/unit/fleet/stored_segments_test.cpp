#include "fleet/stored_segments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/scripted_server.h"

namespace kiroku::fleet {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// A store that answers every question alike.
class OneAnswer {
 public:
  explicit OneAnswer(const std::string& answer)
      : server_(answer), connections_([this] {
          return ObjectStore(
              {"http://127.0.0.1:" + std::to_string(server_.port()), "recordings", "us-east-1", {}},
              {"key", crypto::Secret::copy_of("secret")});
        }) {}
  [[nodiscard]] test::ScriptedServer& server() { return server_; }
  [[nodiscard]] StoreConnections& connections() { return connections_; }

 private:
  test::ScriptedServer server_;
  StoreConnections connections_;
};

std::string partial(const std::string& bytes) {
  return test::http_answer("206 Partial Content", "application/octet-stream", bytes);
}

TEST(RangeCache, AsksOnceForARange) {
  OneAnswer store(partial("sealed"));
  RangeCache cache;
  const auto first = cache.get(store.connections(), "a", "v1", 6, 0);
  EXPECT_EQ(*first, to_bytes("sealed"));
  EXPECT_EQ(cache.get(store.connections(), "a", "v1", 6, 0), first);
  EXPECT_EQ(store.server().requests(), 1U);
  EXPECT_NE(cache.get(store.connections(), "a", "v2", 6, 0), first) << "another version is another thing";
  EXPECT_EQ(store.server().requests(), 2U);
  EXPECT_EQ(cache.fetched_bytes(), 12U);
}

TEST(RangeCache, ForgetsWhatWasUsedLongestAgo) {
  OneAnswer store(partial("sealed"));
  RangeCache cache(12);
  for (const char* key : {"a", "b"}) (void)cache.get(store.connections(), key, "v", 6, 0);
  (void)cache.get(store.connections(), "a", "v", 6, 0);
  (void)cache.get(store.connections(), "c", "v", 6, 0);
  EXPECT_EQ(store.server().requests(), 3U);
  (void)cache.get(store.connections(), "a", "v", 6, 0);
  EXPECT_EQ(store.server().requests(), 3U) << "it was used since";
  (void)cache.get(store.connections(), "b", "v", 6, 0);
  EXPECT_EQ(store.server().requests(), 4U);
}

TEST(RangeCache, KeepsNothingOfWhatFailed) {
  OneAnswer store(partial("short"));
  RangeCache cache;
  const auto get = [&] { return cache.get(store.connections(), "a", "v", 6, 0); };
  EXPECT_THAT([&] { (void)get(); },
              ThrowsMessage<Error>(HasSubstr("sent 5 bytes where it has 6 from byte 0 on")));
  store.server().answer_with(partial("sealed"));
  EXPECT_EQ(*get(), to_bytes("sealed"));
}

TEST(StoredSegments, NamesWhatTheStoreLacks) {
  const std::string listing =
      "<ListVersionsResult><IsTruncated>false</IsTruncated><Version><Key>or-1/x/segments/a</Key>"
      "<VersionId>v1</VersionId><IsLatest>true</IsLatest><Size>7</Size></Version></ListVersionsResult>";
  OneAnswer store(test::http_answer("200 OK", "application/xml", listing));
  RangeCache cache;
  const StoredSegments segments(store.connections(), cache, "or-1/x/");
  EXPECT_EQ(segments.open(archive::FileReference{"segments/a", 7, {}})->size(), 7U);
  EXPECT_THAT(
      [&] {
        (void)segments.open(archive::FileReference{"segments/a", 8, crypto::sha256({})});
      },
      ThrowsMessage<Error>(HasSubstr("no version of or-1/x/segments/a with the 8 bytes")));
  EXPECT_THAT(
      [&] {
        (void)segments.open(archive::FileReference{"segments/b c", 7, {}});
      },
      ThrowsMessage<Error>(HasSubstr("which no store has of Kiroku")));
}

// Whoever has an appliance's keys can put as many versions as they like: not all of them are fetched.
TEST(StoredSegments, FetchesSoManyVersionsAndNoMore) {
  std::string listing = "<ListVersionsResult><IsTruncated>false</IsTruncated>";
  for (int i = 0; i < 300; ++i) {
    listing += "<Version><Key>or-1/x/segments/a</Key><VersionId>v" + std::to_string(i) +
               "</VersionId><IsLatest>" + (i == 0 ? "true" : "false") + "</IsLatest><Size>6</Size></Version>";
  }
  OneAnswer store(test::http_answer("200 OK", "application/xml", listing + "</ListVersionsResult>"));
  store.server().answer_ranges_with(partial("forged"));
  RangeCache cache;
  const StoredSegments segments(store.connections(), cache, "or-1/x/");
  (void)segments.open(archive::FileReference{"segments/a", 6, crypto::sha256(to_bytes("sealed"))});
  EXPECT_EQ(store.server().requests(), 1 + kMostVersionsTried);
}

}  // namespace
}  // namespace kiroku::fleet
