#include "base/near_miss.h"

#include <gtest/gtest.h>

namespace kiroku {
namespace {

const std::vector<std::string> kWords{"record",  "recover", "report", "export",
                                      "excerpt", "case",    "cases",  "log"};

TEST(NearMiss, FindsWhatWasMeant) {
  EXPECT_EQ(nearest_word("recrod", kWords), "record");
  EXPECT_EQ(nearest_word("exprot", kWords), "export");
  EXPECT_EQ(nearest_word("exerpt", kWords), "excerpt");
  EXPECT_EQ(nearest_word("caes", kWords), "case");
  EXPECT_EQ(nearest_word("CASES", kWords), "cases");
  EXPECT_EQ(nearest_word("rec", kWords), "record");
  EXPECT_EQ(nearest_word("lg", kWords), "log");
  EXPECT_EQ(nearest_word("--endoscpe", {"--room", "--endoscope"}), "--endoscope");
}

TEST(NearMiss, IsSilentWhereNothingIsNear) {
  for (const char* typed : {"", "x", "-", "frobnicate", "zzz", "recipients"}) {
    EXPECT_EQ(nearest_word(typed, kWords), std::nullopt) << typed;
  }
  EXPECT_EQ(nearest_word("record", {}), std::nullopt);
  EXPECT_EQ(nearest_word(std::string(1'000'000, 'r'), kWords), std::nullopt);
}

TEST(NearMiss, AsksInHalfASentence) {
  EXPECT_EQ(did_you_mean("repotr", kWords), " (did you mean 'report'?)");
  EXPECT_EQ(did_you_mean("frobnicate", kWords), "");
}

}  // namespace
}  // namespace kiroku
