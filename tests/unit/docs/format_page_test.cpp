// The format page is what an expert reads in twenty years: it must know every finding there is.
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "archive/finding_codes.h"
#include "tests/support/build_paths.h"

namespace kiroku::archive {
namespace {

TEST(FormatPage, ExplainsEveryFindingCode) {
  std::ifstream in(test::source_folder() / "docs/format.md");
  ASSERT_TRUE(in);
  std::stringstream page;
  page << in.rdbuf();
  for (const FindingCode& code : kFindingCodes) {
    EXPECT_NE(page.str().find("| `" + std::string(code.name) + "` |"), std::string::npos) << code.name;
  }
}

}  // namespace
}  // namespace kiroku::archive
