#include "archive/storage/space_reserve.h"

#include <cerrno>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/fault_file_system.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::FaultFileSystem;
using test::TemporaryFolder;

std::uint64_t allocated_bytes(const fs::path& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 ? static_cast<std::uint64_t>(status.st_blocks) * 512 : 0;
}

TEST(SpaceReserve, HoldsRealBlocks) {
  const TemporaryFolder folder;
  SpaceReserve reserve(real_file_system(), reserve_file(folder.path()));
  reserve.fill();
  EXPECT_EQ(fs::file_size(folder / ".reserve"), SpaceReserve::kBytes);
  EXPECT_GE(allocated_bytes(folder / ".reserve"), SpaceReserve::kBytes);
}

TEST(SpaceReserve, IsNotGivenUpBecauseItCannotBeExamined) {
  const TemporaryFolder folder;
  FaultFileSystem files(folder.path());
  SpaceReserve reserve(files, reserve_file(folder.path()));
  reserve.fill();
  files.fail_reading("examine .reserve", FaultFileSystem::ReadFault::kFails, 0, 1);
  files.fail("reserve", ENOSPC);
  EXPECT_THROW(reserve.fill(), IoError);
  EXPECT_EQ(fs::file_size(folder / ".reserve"), SpaceReserve::kBytes);
}

TEST(SpaceReserve, GivesBlocksBackStepByStepAndFillsUpAgain) {
  const TemporaryFolder folder;
  SpaceReserve reserve(real_file_system(), reserve_file(folder.path()));
  reserve.fill();
  EXPECT_TRUE(reserve.release_step());
  EXPECT_EQ(fs::file_size(folder / ".reserve"), SpaceReserve::kBytes - SpaceReserve::kStep);
  EXPECT_LT(allocated_bytes(folder / ".reserve"), SpaceReserve::kBytes);
  reserve.fill();
  EXPECT_GE(allocated_bytes(folder / ".reserve"), SpaceReserve::kBytes);
}

TEST(SpaceReserve, EndsAfterItsLastStep) {
  const TemporaryFolder folder;
  SpaceReserve reserve(real_file_system(), reserve_file(folder.path()));
  EXPECT_FALSE(reserve.release_step()) << "there is no file yet";
  reserve.fill();
  for (std::uint64_t i = 0; i < SpaceReserve::kBytes / SpaceReserve::kStep; ++i) {
    EXPECT_TRUE(reserve.release_step());
  }
  EXPECT_FALSE(reserve.release_step());
}

TEST(SpaceReserve, PromisesNothingWhereTheDiskIsFull) {
  const TemporaryFolder folder;
  FaultFileSystem files(folder.path());
  files.fail("reserve", ENOSPC);
  SpaceReserve reserve(files, reserve_file(folder.path()));
  EXPECT_THROW(reserve.fill(), IoError);
  EXPECT_EQ(fs::file_size(folder / ".reserve"), 0U);
}

TEST(SpaceReserve, SupportsAWriteUntilItSucceeds) {
  const TemporaryFolder folder;
  SpaceReserve reserve(real_file_system(), reserve_file(folder.path()));
  reserve.fill();
  int attempts = 0;
  reserve.support([&] {
    if (++attempts < 3) {
      throw IoError("write", "x", ENOSPC);
    }
  });
  EXPECT_EQ(attempts, 3);
  EXPECT_EQ(fs::file_size(folder / ".reserve"), SpaceReserve::kBytes - 2 * SpaceReserve::kStep);
}

TEST(SpaceReserve, GivesUpNothingForOtherErrorsNorForAFailedFlush) {
  const TemporaryFolder folder;
  SpaceReserve reserve(real_file_system(), reserve_file(folder.path()));
  reserve.fill();
  EXPECT_THROW(reserve.support([] { throw IoError("write", "x", EIO); }), IoError);
  EXPECT_THROW(reserve.support([] { throw SyncError("flush", "x", ENOSPC); }), SyncError);
  EXPECT_EQ(fs::file_size(folder / ".reserve"), SpaceReserve::kBytes);
}

TEST(SpaceReserve, TellsTheErrorWhenNothingIsLeftToGive) {
  const TemporaryFolder folder;
  SpaceReserve reserve(real_file_system(), reserve_file(folder.path()));
  reserve.fill();
  EXPECT_THROW(reserve.support([] { throw IoError("write", "x", ENOSPC); }), IoError);
  EXPECT_EQ(fs::file_size(folder / ".reserve"), 0U);
}

}  // namespace
}  // namespace kiroku::archive
