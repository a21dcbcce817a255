#include "base/ascii.h"

#include <gtest/gtest.h>

namespace kiroku {
namespace {

TEST(Ascii, LowersItsOwnLettersAlone) {
  EXPECT_EQ(lower_case("Kiroku 3D [@`{] \xc3\x84"), "kiroku 3d [@`{] \xc3\x84");
  EXPECT_EQ(ascii_upper('z'), 'Z');
  EXPECT_EQ(ascii_upper('{'), '{');
}

TEST(Ascii, ComparesButForCase) {
  EXPECT_TRUE(same_but_for_case("Content-LENGTH", "content-length"));
  EXPECT_FALSE(same_but_for_case("content-length", "content-length "));
  EXPECT_FALSE(same_but_for_case("@", "`"));
}

}  // namespace
}  // namespace kiroku
