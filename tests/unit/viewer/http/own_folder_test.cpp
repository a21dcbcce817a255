#include "viewer/http/own_folder.h"

#include <fstream>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

struct OwnFolderTest : testing::Test {
  test::TemporaryFolder temporary;
  fs::path parent = temporary / "copies";
};

TEST_F(OwnFolderTest, IsItsOwnersAloneAndGoesWithItsObject) {
  {
    const OwnFolder own(parent);
    EXPECT_EQ(fs::status(parent).permissions(), fs::perms::owner_all);
    EXPECT_EQ(fs::status(own.path()).permissions(), fs::perms::owner_all);
    std::ofstream(own.path() / "piece") << "sealed";
  }
  EXPECT_TRUE(fs::is_empty(parent));
}

TEST_F(OwnFolderTest, LeavesThoseOfOtherServersAlone) {
  const OwnFolder first(parent);
  std::ofstream(first.path() / "piece") << "sealed";
  const OwnFolder second(parent);
  EXPECT_NE(first.path(), second.path());
  EXPECT_TRUE(fs::exists(first.path() / "piece"));
}

TEST_F(OwnFolderTest, RemovesWhatADeadServerLeft) {
  fs::create_directories(parent / "dead");
  std::ofstream(parent / "dead" / "export.mkv") << "plaintext";
  std::ofstream(parent / "stray") << "plaintext";
  std::ofstream(temporary / "elsewhere") << "somebody's";
  fs::create_symlink(temporary / "elsewhere", parent / "link");
  const OwnFolder own(parent);
  const std::vector<fs::path> left(fs::directory_iterator(parent), fs::directory_iterator{});
  EXPECT_THAT(left, testing::ElementsAre(own.path()));
  EXPECT_TRUE(fs::exists(temporary / "elsewhere"));
}

TEST_F(OwnFolderTest, SaysWhereItCannotBeMade) {
  std::ofstream(temporary / "file") << "";
  EXPECT_THROW(OwnFolder(temporary / "file"), IoError);
}

}  // namespace
}  // namespace kiroku::viewer
