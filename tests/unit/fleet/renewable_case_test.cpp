#include "fleet/renewable_case.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_folder.h"
#include "tests/support/scripted_server.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kSegment = "segments/endoscope/00000000.ts.age";
constexpr const char* kRenewed = "20260805T091502Z-3f9c21ab";

std::string object(const std::string& body) { return test::http_answer("200 OK", "binary", body); }
std::string refused(const std::string& status, const std::string& code) {
  return test::http_answer(status, "application/xml", "<Error><Code>" + code + "</Code></Error>");
}

class StreamedSegments : public ::testing::Test {
 protected:
  StreamedSegments() {
    fs::create_directories(fetched_.folder / "segments/endoscope");
    std::ofstream(fetched_.folder / kSegment).close();
    std::ofstream(fetched_.folder / "ledger.jsonl") << "a line\n";
    fetched_.segments_left[kSegment].versions = {{"or-1/c/" + std::string(kSegment), "v1", 5, true}};
  }
  ObjectStore connect() const {
    return {{"http://127.0.0.1:" + std::to_string(server_.port()), "recordings", "us-east-1", {}},
            {"or-1-key", crypto::Secret::copy_of("not to be told")}};
  }
  static std::string text_of_file(const archive::CaseFolder& folder, const std::string& file) {
    return folder.read_if_there(file, 100).value_or("not there");
  }

  static FetchedCase in(const std::filesystem::path& folder) {
    FetchedCase fetched;
    fetched.folder = folder;
    return fetched;
  }

  test::ScriptedServer server_{object("first")};
  test::TemporaryFolder folder_;
  StoreConnections store_{[this] { return connect(); }};
  FetchedCase fetched_ = in(folder_.path() / "case");
  StreamedFiles files_{store_, folder_.path()};
};

TEST_F(StreamedSegments, ComeWhenTheyAreReadAndLeaveNothing) {
  files_.show(fetched_);
  const archive::CaseFolder folder = archive::CaseFolder::open(fetched_.folder, files_);
  std::uint64_t bytes = 0;
  for (const archive::ListedFile& each : folder.list()) bytes += each.path == kSegment ? each.bytes : 0;
  EXPECT_EQ(bytes, 5U) << "as the store lists it";
  EXPECT_EQ(server_.requests(), 0U) << "nothing was read yet";
  EXPECT_EQ(text_of_file(folder, "ledger.jsonl"), "a line\n");
  EXPECT_EQ(text_of_file(folder, kSegment), "first");
  EXPECT_THAT(server_.last_request(), HasSubstr("versionId=v1"));
  EXPECT_EQ(files_.bytes(), 5U);
  EXPECT_EQ(fs::file_size(fetched_.folder / kSegment), 0U);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), {}), 1) << "the case's folder alone";
  EXPECT_THAT(files_.away(), IsEmpty());
}

TEST_F(StreamedSegments, OfSeveralVersionsTheLedgersIsRead) {
  SegmentInStore& segment = fetched_.segments_left[kSegment];
  segment.versions.push_back({segment.versions.front().key, "v0", 5, false});
  segment.sha256 = crypto::sha256(bytes_of("first"));
  files_.show(fetched_);
  const archive::CaseFolder folder = archive::CaseFolder::open(fetched_.folder, files_);
  EXPECT_EQ(text_of_file(folder, kSegment), "first");
  EXPECT_EQ(server_.requests(), 1U) << "the newest fits";
  server_.answer_with(object("other"));
  EXPECT_EQ(text_of_file(folder, kSegment), "other") << "the verifier says that it is not the recorded one";
  EXPECT_EQ(server_.requests(), 3U) << "both were tried";
}

TEST_F(StreamedSegments, WhatTheStoreDoesNotGiveIsUnreadableOrSaysNothing) {
  files_.show(fetched_);
  const archive::CaseFolder folder = archive::CaseFolder::open(fetched_.folder, files_);
  server_.answer_with(refused("404 Not Found", "NoSuchKey"));
  EXPECT_EQ(folder.open_file(kSegment).problem, archive::FileProblem::kUnreadable);
  EXPECT_THAT(files_.away(), IsEmpty()) << "the store answers: this one object is lost";
  server_.answer_with(refused("503 Service Unavailable", "SlowDown"));
  EXPECT_EQ(folder.open_file(kSegment).problem, archive::FileProblem::kUnreadable);
  EXPECT_NE(files_.away(), "") << "nothing is known of the object";
}

// Whoever may put makes one: it says nothing of the store.
TEST_F(StreamedSegments, WhatNobodyElseCanReadKeepsNoOtherCaseWaiting) {
  server_.answer_with(refused("400 Bad Request", "InvalidRequest"));
  files_.show(fetched_);
  const archive::CaseFolder folder = archive::CaseFolder::open(fetched_.folder, files_);
  EXPECT_EQ(folder.open_file(kSegment).problem, archive::FileProblem::kUnreadable);
  EXPECT_THAT(files_.away(), IsEmpty());
}

TEST_F(StreamedSegments, NoneIsReadThatIsLongerThanAnySegment) {
  fetched_.segments_left[kSegment].versions.front().bytes = std::uint64_t{5} << 30;
  files_.show(fetched_);
  const archive::CaseFolder folder = archive::CaseFolder::open(fetched_.folder, files_);
  EXPECT_EQ(folder.open_file(kSegment).problem, archive::FileProblem::kUnreadable);
  EXPECT_THAT(files_.away(), IsEmpty());
  EXPECT_EQ(files_.bytes(), 0U);
}

TEST_F(StreamedSegments, OfSeveralVersionsThoseOfTheLedgersSizeAreRead) {
  SegmentInStore& segment = fetched_.segments_left[kSegment];
  segment.versions.insert(segment.versions.begin(), {segment.versions.front().key, "v2", 5'000'000, true});
  segment.sha256 = crypto::sha256(bytes_of("first"));
  segment.bytes = 5;
  files_.show(fetched_);
  const archive::CaseFolder folder = archive::CaseFolder::open(fetched_.folder, files_);
  EXPECT_EQ(text_of_file(folder, kSegment), "first");
  EXPECT_EQ(files_.bytes(), 5U);
}

TEST_F(StreamedSegments, AStoreThatIsAwayIsWaitedForByAllOfABatch) {
  server_.answer_with(refused("503 Service Unavailable", "SlowDown"));
  RenewalBatch batch{store_, folder_.path() / "scratch", {}};
  StoredRenewableCase first(batch, "or-1", kRenewed, {}), second(batch, "or-2", kRenewed, {});
  EXPECT_THROW(first.folder(), archive::RenewalWaits);
  const std::size_t asked = server_.requests();
  EXPECT_THROW(second.folder(), archive::RenewalWaits);
  EXPECT_EQ(server_.requests(), asked) << "it was not asked again";
  RenewalBatch ended{store_, folder_.path() / "scratch", [] { return true; }};
  StoredRenewableCase third(ended, "or-1", kRenewed, {});
  EXPECT_THROW(third.folder(), archive::RenewalWaits);
  EXPECT_EQ(server_.requests(), asked) << "it was told to end";
}

}  // namespace
}  // namespace kiroku::fleet
