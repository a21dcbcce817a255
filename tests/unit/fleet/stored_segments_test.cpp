#include "fleet/stored_segments.h"

#include <atomic>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/eventually.h"
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
  FetchingAhead ahead;
  const StoredSegments segments(store.connections(), cache, ahead, "or-1/x/");
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
  FetchingAhead ahead;
  const StoredSegments segments(store.connections(), cache, ahead, "or-1/x/");
  (void)segments.open(archive::FileReference{"segments/a", 6, crypto::sha256(to_bytes("sealed"))});
  EXPECT_EQ(store.server().requests(), 1 + kMostVersionsTried);
}

archive::SegmentEntry entry_of(const std::string& sealed) {
  archive::SegmentEntry entry;
  entry.file = {"segments/a", sealed.size(), crypto::sha256(to_bytes(sealed))};
  return entry;
}

std::string listing_of(const std::string& sealed) {
  return test::http_answer(
      "200 OK", "application/xml",
      "<ListVersionsResult><IsTruncated>false</IsTruncated><Version><Key>or-1/x/segments/a</Key>"
      "<VersionId>v1</VersionId><IsLatest>true</IsLatest><Size>" +
          std::to_string(sealed.size()) + "</Size></Version></ListVersionsResult>");
}

TEST(StoredSegments, HasWhatIsExpectedBeforeItIsOpened) {
  OneAnswer store(listing_of("sealed"));
  store.server().answer_ranges_with(partial("sealed"));
  RangeCache cache;
  FetchingAhead ahead;
  const auto segments = std::make_shared<StoredSegments>(store.connections(), cache, ahead, "or-1/x/");
  segments->expect(entry_of("sealed"));
  ASSERT_TRUE(test::eventually([&] { return cache.fetched_bytes() == 6; }));
  ASSERT_EQ(store.server().requests(), 2U) << "a list, and the one range";
  segments->expect(entry_of("sealed"));
  Bytes bytes(6);
  EXPECT_EQ(segments->open(entry_of("sealed"))->read_at(0, bytes), 6U);
  EXPECT_EQ(bytes, to_bytes("sealed"));
  EXPECT_EQ(store.server().requests(), 2U) << "it was asked for again";
}

TEST(StoredSegments, AsksForAllRangesOfWhatIsOpenedFirst) {
  const std::string sealed(RangeCache::kRangeBytes * 2, 'x');
  OneAnswer store(listing_of(sealed));
  store.server().answer_ranges_with(partial(sealed.substr(0, RangeCache::kRangeBytes)));
  RangeCache cache;
  FetchingAhead ahead;
  const StoredSegments segments(store.connections(), cache, ahead, "or-1/x/");
  const auto source = segments.open(entry_of(sealed));
  ASSERT_TRUE(test::eventually([&] { return cache.fetched_bytes() == RangeCache::kRangeBytes; }));
  EXPECT_EQ(cache.fetched_bytes(), RangeCache::kRangeBytes) << "nobody reads yet";
  (void)segments.open(entry_of(sealed));
  Bytes bytes(sealed.size());
  EXPECT_EQ(source->read_at(0, bytes), sealed.size());
  EXPECT_EQ(store.server().requests(), 3U) << "a list, and two ranges";
}

TEST(StoredSegments, SaysOfWhatWasExpectedInVainOnlyWhenItIsOpened) {
  OneAnswer store(test::http_answer("500 Internal Server Error", "text/plain", ""));
  RangeCache cache;
  FetchingAhead ahead;
  const auto segments = std::make_shared<StoredSegments>(store.connections(), cache, ahead, "or-1/x/");
  segments->expect(entry_of("sealed"));
  ASSERT_TRUE(test::eventually([&] { return store.server().requests() > 0; }));
  EXPECT_THROW((void)segments->open(entry_of("sealed")), StoreError);
  store.server().answer_with(listing_of("sealed"));
  EXPECT_EQ(segments->open(entry_of("sealed"))->size(), 6U);
}

TEST(FetchingAhead, DoesSeveralThingsAtOnceAndForgetsTheOldestOfTooMany) {
  std::atomic<std::size_t> running{0}, done{0};
  std::atomic<bool> may_end{false};
  {
    FetchingAhead ahead;
    for (std::size_t i = 0; i < FetchingAhead::kThreads; ++i) {
      ahead.add([&] {
        ++running;
        (void)test::eventually([&] { return may_end.load(); });
        throw Error("nobody asked");
      });
    }
    EXPECT_TRUE(test::eventually([&] { return running == FetchingAhead::kThreads; }));
    ahead.add([&] { done += 1000; });
    for (std::size_t i = 0; i < FetchingAhead::kMostWaiting; ++i) ahead.add([&] { ++done; });
    may_end = true;
    EXPECT_TRUE(test::eventually([&] { return done >= FetchingAhead::kMostWaiting; }));
  }
  EXPECT_EQ(done, FetchingAhead::kMostWaiting) << "the oldest that waited is forgotten";
}

}  // namespace
}  // namespace kiroku::fleet
