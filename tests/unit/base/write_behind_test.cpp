#include "base/write_behind.h"

#include <array>
#include <fcntl.h>
#include <linux/magic.h>
#include <sys/mman.h>
#include <sys/vfs.h>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace kiroku {
namespace {

constexpr std::size_t kMebibyte = 1U << 20U;

/// How many of a file's pages are in memory.
std::size_t resident_pages(int descriptor, std::size_t bytes) {
  void* const mapped = ::mmap(nullptr, bytes, PROT_READ, MAP_SHARED, descriptor, 0);
  EXPECT_NE(mapped, MAP_FAILED);
  std::vector<unsigned char> pages(bytes / static_cast<std::size_t>(::getpagesize()));
  EXPECT_EQ(::mincore(mapped, bytes, pages.data()), 0);
  ::munmap(mapped, bytes);
  std::size_t resident = 0;
  for (const unsigned char page : pages) resident += page & 1U;
  return resident;
}

TEST(WriteBehind, GivesUpPagesOfWhatWasWrittenBefore) {
  const test::TemporaryFolder folder;
  struct statfs file_system {};
  ASSERT_EQ(::statfs(folder.path().c_str(), &file_system), 0);
  if (file_system.f_type == TMPFS_MAGIC)
    GTEST_SKIP() << "a file system in memory has no other place for its pages";
  const int descriptor = ::open((folder / "film").c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  ASSERT_GE(descriptor, 0);
  WriteBehind behind(descriptor);
  const std::vector<char> block(kMebibyte, 'k');
  constexpr std::size_t kBlocks = 64;
  for (std::size_t i = 1; i <= kBlocks; ++i) {
    ASSERT_EQ(::write(descriptor, block.data(), block.size()), static_cast<ssize_t>(block.size()));
    if (i == kBlocks) {
      ASSERT_EQ(::fdatasync(descriptor), 0);  // pages that are not on the disk yet stay
    }
    behind.wrote_until(i * kMebibyte);
  }
  const std::size_t pages = kBlocks * kMebibyte / static_cast<std::size_t>(::getpagesize());
  EXPECT_LE(resident_pages(descriptor, kBlocks * kMebibyte), pages / 2);
  std::vector<char> read(kMebibyte);
  ASSERT_EQ(::pread(descriptor, read.data(), read.size(), 3 * kMebibyte), static_cast<ssize_t>(read.size()));
  EXPECT_EQ(read, block);
  ::close(descriptor);
}

TEST(WriteBehind, SaysNothingOfWhatCannotBeHinted) {
  std::array<int, 2> pipe{};
  ASSERT_EQ(::pipe(pipe.data()), 0);
  WriteBehind behind(pipe[1]);
  EXPECT_NO_THROW(behind.wrote_until(100 * kMebibyte));
  ::close(pipe[0]);
  ::close(pipe[1]);
}

}  // namespace
}  // namespace kiroku
