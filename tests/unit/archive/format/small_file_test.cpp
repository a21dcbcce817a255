#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "archive/format/case_folder.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;

class SmallFile : public testing::Test {
 protected:
  [[nodiscard]] std::optional<std::string> read(std::size_t limit) const {
    return read_small(real_reading().open_to_read(file_), limit);
  }
  void write(const std::string& text) const { std::ofstream(file_, std::ios::binary) << text; }

  test::TemporaryFolder folder_;
  fs::path file_ = folder_ / "file";
};

TEST_F(SmallFile, IsReadUpToItsLimit) {
  const std::string text(100'000, 'x');
  write(text);
  EXPECT_EQ(read(100'000), text);
  EXPECT_EQ(read(99'999), std::nullopt);
}

// One that takes no room on the disk costs whoever makes a thousand of them nothing.
TEST_F(SmallFile, ThatIsAHoleIsNotRead) {
  write("x");
  fs::resize_file(file_, 1U << 20U);
  if (!real_reading().open_to_read(file_).first_hole()) GTEST_SKIP() << "the file system tells of no holes";
  EXPECT_EQ(read(1U << 20U), std::nullopt);
  // A block is read: what a power cut left of a note is judged as what it is.
  fs::resize_file(file_, 0);
  fs::resize_file(file_, 4096);
  EXPECT_EQ(read(4096), std::string(4096, '\0'));
}

TEST_F(SmallFile, WhoseZerosWereWrittenHasNoHole) {
  const std::string text = std::string(10'000, '\0') + "x";
  write(text);
  EXPECT_EQ(read(20'000), text);
}

}  // namespace
}  // namespace kiroku::archive
