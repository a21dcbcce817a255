#include "archive/upkeep/standby_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/storage/file_system.h"
#include "crypto/age_file.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

class StandbyFolderTest : public testing::Test {
 protected:
  StandbyFolderTest() {
    streams_[0].name = "endoscope";
    streams_[0].media = "video/mp2t";
    streams_[1].name = "vitals";
    streams_[1].media = "application/jsonl";
  }
  [[nodiscard]] std::unique_ptr<StandbyFolder> make() const {
    const crypto::AgeRecipients recipients =
        crypto::parse_recipients(crypto::generate_age_key().recipient, "test");
    return std::make_unique<StandbyFolder>(real_file_system(), archive_.path(), streams_,
                                           std::vector<crypto::AgeRecipients>{recipients, recipients});
  }
  static FileReference record(StandbyFolder& folder, std::size_t stream, std::uint64_t index) {
    const auto segment = folder.begin_segment(stream, index);
    segment->write(bytes_of("pictures"));
    segment->seal();
    return segment->commit();
  }
  [[nodiscard]] std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(archive_.path()), {}));
  }

  test::TemporaryFolder archive_;
  std::vector<StreamInfo> streams_{2};
};

TEST_F(StandbyFolderTest, HoldsSegmentsUntilTheyAreDiscarded) {
  const auto folder = make();
  const FileReference first = record(*folder, 0, 0);
  const FileReference second = record(*folder, 1, 0);
  EXPECT_EQ(first.file, "segments/endoscope/00000000.ts.age");
  EXPECT_EQ(std::filesystem::file_size(folder->path_of(first)), first.bytes);
  folder->discard(first);
  EXPECT_FALSE(std::filesystem::exists(folder->path_of(first)));
  EXPECT_TRUE(std::filesystem::exists(folder->path_of(second)));
}

TEST_F(StandbyFolderTest, LeavesNothingBehind) {
  {
    const auto folder = make();
    record(*folder, 0, 0);
    EXPECT_EQ(entries(), 1U);
  }
  EXPECT_EQ(entries(), 0U);
}

TEST_F(StandbyFolderTest, WhatADeadRecorderLeftIsCountedAndRemovedAndNothingElse) {
  const auto dead = make();
  record(*dead, 0, 0);
  record(*dead, 0, 1);
  std::filesystem::create_directory(archive_ / "20260805T091502Z-3f9c21ab");
  EXPECT_EQ(remove_abandoned_standby(real_file_system(), archive_.path()).segments, 2U);
  EXPECT_EQ(entries(), 1U);
  EXPECT_EQ(remove_abandoned_standby(real_file_system(), archive_.path()).segments, 0U);
}

TEST_F(StandbyFolderTest, AFolderThatCannotBeListedKeepsNoOther) {
  const auto dead = make();
  record(*dead, 0, 0);
  std::filesystem::create_directory(archive_ / ".standby-00000000");
  test::FaultFileSystem faults(archive_.path());
  faults.fail_reading("list .standby-00000000", test::FaultFileSystem::ReadFault::kFails);
  const AbandonedStandby found = remove_abandoned_standby(faults, archive_.path());
  EXPECT_EQ(found.segments, 1U);
  ASSERT_EQ(found.left.size(), 1U);
  EXPECT_EQ(found.left[0].folder, archive_ / ".standby-00000000");
  EXPECT_THAT(found.left[0].problem, testing::HasSubstr(".standby-00000000"));
  EXPECT_EQ(entries(), 1U);
}

}  // namespace
}  // namespace kiroku::archive
