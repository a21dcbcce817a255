#include "crypto/file_hash.h"

#include <filesystem>
#include <fstream>
#include <sys/stat.h>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::crypto {
namespace {

TEST(FileHash, IsThatOfAllPieces) {
  const test::TemporaryFolder folder;
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{3}, std::size_t{1} << 20, (std::size_t{1} << 20) + 1}) {
    const std::string text(size, 'k');
    std::ofstream(folder.path() / "file", std::ios::binary) << text;
    const FileHash found = hash_file(folder.path() / "file");
    EXPECT_EQ(found.bytes, size);
    EXPECT_EQ(found.sha256, sha256(bytes_of(text)));
  }
}

// A pipe that nobody writes to would be waited for without end.
TEST(FileHash, OfWhatIsNoFileIsRefused) {
  const test::TemporaryFolder folder;
  const std::filesystem::path pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THROW(hash_file(pipe), Error);
  EXPECT_THROW(hash_file(folder.path()), IoError);
  EXPECT_THROW(hash_file(folder.path() / "nowhere"), IoError);
}

}  // namespace
}  // namespace kiroku::crypto
