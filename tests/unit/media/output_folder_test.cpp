#include "media/output_folder.h"

#include <fstream>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::media {
namespace {

namespace fs = std::filesystem;

class OutputFolderTest : public testing::Test {
 protected:
  void write(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }
  static std::string yes(const fs::path&) { return ""; }
  static std::string no(const fs::path&) { return "it is needed"; }
  test::TemporaryFolder folder_;
  fs::path out_ = folder_ / "out", part_ = folder_ / "out.part";
};

TEST_F(OutputFolderTest, AppearsWhole) {
  {
    OutputFolder made(out_, false, yes);
    write(made.path() / "a", "1");
    EXPECT_FALSE(fs::exists(out_));
    made.commit();
  }
  EXPECT_TRUE(fs::exists(out_ / "a"));
  EXPECT_FALSE(fs::exists(part_));
}

TEST_F(OutputFolderTest, LeavesNothingBehind) {
  { const OutputFolder made(out_, false, yes); }
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

TEST_F(OutputFolderTest, ReplacesOnlyWhatItMay) {
  fs::create_directory(out_);
  write(out_ / "old", "1");
  EXPECT_THROW(OutputFolder(out_, false, yes), UsageError);
  EXPECT_THROW(OutputFolder(out_, true, no), UsageError);
  EXPECT_TRUE(fs::exists(out_ / "old"));
  EXPECT_FALSE(fs::exists(part_));
  OutputFolder made(out_, true, yes);
  write(made.path() / "new", "1");
  EXPECT_TRUE(fs::exists(out_ / "old")) << "until the new one is whole";
  made.commit();
  EXPECT_TRUE(fs::exists(out_ / "new"));
  EXPECT_FALSE(fs::exists(out_ / "old"));
  EXPECT_FALSE(fs::exists(part_));
}

TEST_F(OutputFolderTest, RefusesWhatAnotherIsWriting) {
  const OutputFolder made(out_, false, yes);
  EXPECT_THROW(OutputFolder(out_, false, yes), UsageError);
  EXPECT_TRUE(fs::exists(part_));
}

}  // namespace
}  // namespace kiroku::media
