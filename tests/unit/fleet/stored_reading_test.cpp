#include "fleet/stored_reading.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_folder.h"
#include "base/error.h"
#include "tests/support/scripted_server.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

/// A folder with a segment whose bytes are in a store, and a file whose bytes are here.
class StoredReadingTest : public ::testing::Test {
 protected:
  static constexpr const char* kSegment = "segments/endoscope/00000000.ts.age";

  StoredReadingTest() {
    fs::create_directories((folder_ / kSegment).parent_path());
    std::ofstream(folder_ / kSegment).flush();
    fs::resize_file(folder_ / kSegment, kBytes);
    std::ofstream(folder_ / "ledger.jsonl") << "{}";
  }
  StoredReading reading() {
    ListedVersion version;
    version.key = std::string("or-1/x/") + kSegment;
    version.version = "v1";
    version.bytes = kBytes;
    return {connections_, folder_.path(), {{kSegment, version}}};
  }

  static constexpr std::size_t kBytes = 6000;
  const test::TemporaryFolder folder_;
  test::ScriptedServer server_{
      test::http_answer("206 Partial Content", "application/octet-stream", std::string(kBytes, 'x'))};
  StoreConnections connections_{[this] {
    return ObjectStore({"http://127.0.0.1:" + std::to_string(server_.port()), "recordings", "us-east-1", {}},
                       {"key", crypto::Secret::copy_of("secret")});
  }};
};

TEST_F(StoredReadingTest, HasBytesOfTheStoreWhereTheFileHasNone) {
  const StoredReading stored = reading();
  const archive::CaseFolder folder = archive::CaseFolder::open(folder_.path(), stored);
  const archive::FileOpening segment = folder.open_file(kSegment);
  ASSERT_TRUE(segment.file.has_value());
  EXPECT_EQ(segment.file->size(), kBytes);
  Bytes bytes(kBytes + 10);
  EXPECT_EQ(segment.file->read_at(0, bytes), kBytes);
  bytes.resize(kBytes);
  EXPECT_EQ(text_of(bytes), std::string(kBytes, 'x'));
  Bytes end(10);
  EXPECT_EQ(segment.file->read_at(kBytes - 3, end), 3U);
  EXPECT_EQ(server_.requests(), 1U) << "it was fetched again";
  EXPECT_FALSE(segment.file->first_hole().has_value()) << "the store's bytes have no hole";
  EXPECT_EQ(folder.read_if_there("ledger.jsonl", 100), "{}");
  EXPECT_NO_THROW(stored.require_all_given());
}

TEST_F(StoredReadingTest, SaysThatTheStoreGaveNotAllAndAsksItNoMore) {
  server_.answer_with(test::http_answer("500 Internal Server Error", "text/plain", ""));
  const StoredReading stored = reading();
  const archive::CaseFolder folder = archive::CaseFolder::open(folder_.path(), stored);
  const archive::FileOpening segment = folder.open_file(kSegment);
  Bytes bytes(10);
  EXPECT_THROW((void)segment.file->read_at(0, bytes), IoError);
  EXPECT_THROW((void)segment.file->read_at(20, bytes), IoError);
  EXPECT_EQ(server_.requests(), 1U);
  EXPECT_THROW(stored.require_all_given(), StoreError);
  EXPECT_EQ(folder.read_if_there("ledger.jsonl", 100), "{}");
}

}  // namespace
}  // namespace kiroku::fleet
