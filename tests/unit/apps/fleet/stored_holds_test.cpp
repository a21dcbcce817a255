#include "apps/fleet/stored_holds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/fleet/verified_cases.h"

namespace kiroku::apps {
namespace {

using testing::HasSubstr;

const std::string kCase = "20260805T091502Z-3f9c21ab";

archive::Holds held() { return {{kCase, {{12, UtcTime{}, "court order", "anna"}}}}; }

fleet::HoldsSeen seen(std::uint64_t under_hold, std::uint64_t free) {
  fleet::HoldsSeen seen{under_hold, free, {}, {}, true};
  if (under_hold > 0) seen.first_held = {"or-1/a", "v1"};
  if (free > 0) seen.first_free = {"or-1/b", "v2"};
  return seen;
}

TEST(StoredHolds, WhereStoreAndLogAgreeNothingIsTold) {
  EXPECT_EQ(compare_holds(held(), kCase, seen(3, 0)).text, "");
  EXPECT_EQ(compare_holds({}, kCase, seen(0, 3)).text, "");
  // Released.
  EXPECT_EQ(compare_holds({{kCase, {}}}, kCase, seen(0, 3)).text, "");
}

TEST(StoredHolds, WhatSomebodyLiftedIsAFindingAndNoVerdict) {
  const HoldDifference differs = compare_holds(held(), kCase, seen(2, 1));
  EXPECT_TRUE(differs.lifted);
  EXPECT_EQ(differs.of.key, "or-1/b");
  EXPECT_THAT(differs.text, HasSubstr("the store does not hold 1 of 3 objects, as or-1/b"));
  EXPECT_THAT(differs.text, HasSubstr("entry 12 of the appliance log, by anna): court order"));
  EXPECT_THAT(compare_holds(held(), kCase, seen(0, 3)).text, HasSubstr("or this access key may not look"));

  archive::VerificationReport report;
  report.verdict = archive::Verdict::kIntact;
  const fleet::Verification found = verification_of(report, {}, differs);
  EXPECT_EQ(found.verdict, "intact");
  EXPECT_FALSE(found.alarm);
  EXPECT_EQ(found.findings, 1U);
  EXPECT_EQ(found.detail, differs.text);
  VerifiedCases cases;
  cases.add(found);
  EXPECT_EQ(cases.status(), 0);
  cases.add_lifted();
  EXPECT_EQ(cases.status(), 3);
  EXPECT_EQ(cases.summary(), "1 case verified; of 1 case under legal hold the store does not hold all");
}

TEST(StoredHolds, AKeyThatSeesNoLocksSaysNothingOfThem) {
  fleet::HoldsSeen blind = seen(0, 3);
  blind.are_locks_told = false;
  const HoldDifference differs = compare_holds(held(), kCase, blind);
  EXPECT_FALSE(differs.lifted);
  EXPECT_THAT(differs.text, HasSubstr("it may lack the rights to look at them"));
}

TEST(StoredHolds, WhatTheStoreHoldsWithoutTheLogIsTold) {
  const HoldDifference differs = compare_holds({}, kCase, seen(1, 2));
  EXPECT_FALSE(differs.lifted);
  EXPECT_EQ(differs.of.key, "or-1/a");
  EXPECT_THAT(differs.text, HasSubstr("the store has 1 of 3 objects under legal hold, as or-1/a"));
}

}  // namespace
}  // namespace kiroku::apps
