#include "archive/storage/file_system.h"

#include <cerrno>
#include <fstream>
#include <iterator>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/fault_file_system.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::FaultFileSystem;
using test::TemporaryFolder;
using testing::ElementsAre;

std::string text_in(const fs::path& file) {
  std::ifstream input(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(input), {}};
}

TEST(FileSystem, WritesAppendAndReopeningGoesOnAtTheEnd) {
  const TemporaryFolder folder;
  real_file_system().create(folder / "a")->write(bytes_of("one"));
  real_file_system().append_to(folder / "a")->write(bytes_of("two"));
  EXPECT_EQ(text_in(folder / "a"), "onetwo");
}

TEST(FileSystem, RefusesToMakeAFileThatIsThere) {
  const TemporaryFolder folder;
  real_file_system().create(folder / "a");
  try {
    real_file_system().create(folder / "a");
    FAIL() << "made twice";
  } catch (const IoError& error) {
    EXPECT_EQ(error.error_number(), EEXIST);
    EXPECT_EQ(std::string(error.what()), "cannot make " + (folder / "a").string() + ": File exists");
  }
}

TEST(FileSystem, DoesNotFollowASymbolicLinkOutOfTheArchive) {
  const TemporaryFolder folder;
  real_file_system().create(folder / "outside");
  fs::create_symlink(folder / "outside", folder / "link");
  EXPECT_THROW(real_file_system().append_to(folder / "link"), IoError);
}

TEST(FileSystem, ReserveKeepsTheSizeAndTakesBlocks) {
  const TemporaryFolder folder;
  const auto file = real_file_system().create(folder / "a");
  file->write(bytes_of("abc"));
  file->reserve(1 << 20);
  EXPECT_EQ(fs::file_size(folder / "a"), 3U);
  file->write(bytes_of("def"));
  EXPECT_EQ(text_in(folder / "a"), "abcdef");
}

TEST(FileSystem, TruncateGoesOnAtTheNewEnd) {
  const TemporaryFolder folder;
  const auto file = real_file_system().create(folder / "a");
  file->write(bytes_of("abcdef"));
  file->truncate(2);
  file->write(bytes_of("X"));
  EXPECT_EQ(text_in(folder / "a"), "abX");
}

TEST(FileSystem, ASecondOpeningDoesNotGetTheLock) {
  const TemporaryFolder folder;
  const auto first = real_file_system().create(folder / "a");
  const auto second = real_file_system().append_to(folder / "a");
  EXPECT_TRUE(first->try_lock());
  EXPECT_FALSE(second->try_lock());
  first->unlock();
  EXPECT_TRUE(second->try_lock());
}

TEST(FileSystem, SyncsWhileAnotherThreadWrites) {
  const TemporaryFolder folder;
  const auto file = real_file_system().create(folder / "a");
  std::thread syncing([&] {
    for (int i = 0; i < 5; ++i) {
      file->sync();
    }
  });
  for (int i = 0; i < 100; ++i) {
    file->write(bytes_of("0123456789"));
    file->write_behind();
  }
  syncing.join();
  EXPECT_EQ(fs::file_size(folder / "a"), 1000U);
}

TEST(WriteDurably, MakesTheCallsOfADurableWriteInOrder) {
  const TemporaryFolder folder;
  FaultFileSystem files(folder.path());
  files.write_durably(folder / "note", bytes_of("text\n"));
  EXPECT_THAT(files.calls(), ElementsAre("create note.part", "write note.part 5", "sync_all note.part",
                                         "rename note.part note", "sync_folder ."));
  EXPECT_EQ(text_in(folder / "note"), "text\n");
}

TEST(WriteDurably, ReplacesAPartThatACrashLeft) {
  const TemporaryFolder folder;
  std::ofstream(folder / "note.part") << "half";
  real_file_system().write_durably(folder / "note", bytes_of("text\n"));
  EXPECT_EQ(text_in(folder / "note"), "text\n");
  EXPECT_FALSE(fs::exists(folder / "note.part"));
}

TEST(WriteDurably, LeavesNothingBehindWhenAStepBeforeTheNameFails) {
  for (const char* step : {"create", "write", "sync_all", "rename"}) {
    const TemporaryFolder folder;
    FaultFileSystem files(folder.path());
    files.fail(step, EIO);
    EXPECT_THROW(files.write_durably(folder / "note", bytes_of("text\n")), IoError) << step;
    EXPECT_TRUE(fs::is_empty(folder.path())) << step;
  }
}

TEST(WriteDurably, TellsAFailedFlushFromOtherErrors) {
  for (const char* step : {"sync_all", "sync_folder"}) {
    const TemporaryFolder folder;
    FaultFileSystem files(folder.path());
    files.fail(step, ENOSPC);
    EXPECT_THROW(files.write_durably(folder / "note", bytes_of("text\n")), SyncError) << step;
  }
}

TEST(WriteDurably, IsWhollyThereOrNotAtAllWhereverItIsKilled) {
  for (const bool power : {false, true}) {
    for (std::size_t at = 0; at < 5; ++at) {
      const TemporaryFolder folder;
      FaultFileSystem files(folder.path());
      files.kill_at(at);
      EXPECT_THROW(files.write_durably(folder / "note", bytes_of("text\n")), test::Killed);
      if (power) {
        files.lose_power();
      }
      EXPECT_EQ(fs::exists(folder / "note"), !power && at == 4) << at;
      if (fs::exists(folder / "note")) {
        EXPECT_EQ(text_in(folder / "note"), "text\n");
      }
    }
  }
}

}  // namespace
}  // namespace kiroku::archive
