#include "archive/verify/case_clock_rules.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "tests/support/nanoseconds.h"

namespace kiroku::archive {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::int64_t kChronyPpb = 83'333'000;

class CaseClock : public testing::Test {
 protected:
  /// A token that is asked for and answered at once; by default of the first outside authority.
  void stamp(std::int64_t mono_ns, std::chrono::microseconds says, const std::string& root = "first",
             std::int64_t asked_before_ns = 0, std::int64_t accuracy_ns = 0) {
    TimedToken token;
    token.stamped.accuracy_ns = accuracy_ns;
    token.stamped.entry = ++entry_;
    token.stamped.checkpoint = entry_;
    token.stamped.gen_time = UtcTime(1'785'920'400s) + says;
    token.stamped.authority = token.stamped.root = root;
    token.file = token_path(entry_, root);
    token.written_ns = token.latest_ns = mono_ns;
    token.earliest_ns = mono_ns - asked_before_ns;
    token.external = true;
    rules_.take(std::move(token));
  }
  /// What the crystal says when the case clock runs faster since `since_ns`.
  static std::chrono::microseconds slowed(std::int64_t mono_ns, std::int64_t since_ns) {
    const double fast = static_cast<double>(std::max<std::int64_t>(mono_ns - since_ns, 0));
    const double true_ns = static_cast<double>(mono_ns) - fast + fast / (1 + kChronyPpb / 1e9);
    return std::chrono::microseconds(static_cast<std::int64_t>(true_ns / 1e3));
  }
  std::vector<std::string> codes(bool from_open = true) {
    set_ = rules_.finish(from_open);
    std::vector<std::string> codes;
    for (const Finding& each : findings_.take()) {
      codes.emplace_back(each.code);
      texts_ += each.text + "\n";
    }
    return codes;
  }

  FindingList findings_;
  CaseClockRules rules_{findings_};
  std::uint64_t entry_ = 0;
  std::set<std::string> set_;
  std::string texts_;
};

TEST_F(CaseClock, AgreesWithAuthoritiesThatGoAsItDoes) {
  for (int i = 0; i < 10; ++i) {
    stamp(i * 60 * kSecond, i * 60s);
    stamp(i * 60 * kSecond + kSecond, i * 60s + 1s, "second");
  }
  EXPECT_THAT(codes(), IsEmpty());
}

// An entry says what was before it, and a token between two of them is not judged by the first alone.
TEST_F(CaseClock, WhatALaterEntryStatesOfASlewCountsForTheTokensBeforeIt) {
  rules_.take_rate(0, 0);
  for (const char* root : {"first", "second"}) stamp(kSecond, 1s, root);
  rules_.take_rate(2'727'683, 3 * kSecond);
  for (const char* root : {"first", "second"}) {
    stamp(55 * kSecond, slowed(55 * kSecond, 2 * kSecond), root);
  }
  rules_.take_rate(kChronyPpb, 63 * kSecond);
  EXPECT_THAT(codes(), ElementsAre("clock-slews-allowed-for"));
  EXPECT_THAT(texts_, HasSubstr("by up to 5.00"));
}

TEST_F(CaseClock, ASlewThatNobodyStatedIsContradicted) {
  for (const char* root : {"first", "second"}) stamp(kSecond, 1s, root);
  for (const char* root : {"first", "second"}) {
    stamp(55 * kSecond, slowed(55 * kSecond, 2 * kSecond), root);
  }
  EXPECT_THAT(codes(), ElementsAre("clock-contradicted", "clock-contradicted"));
}

TEST_F(CaseClock, ASlewThatIsOverExcusesNothingAfterwards) {
  rules_.take_rate(0, 0);
  rules_.take_rate(kChronyPpb, kSecond);
  rules_.take_rate(kChronyPpb, 10 * kSecond);
  rules_.take_rate(0, 11 * kSecond);
  for (const char* root : {"first", "second"}) stamp(12 * kSecond, 12s, root);
  for (const char* root : {"first", "second"}) stamp(60 * kSecond, 57s, root);
  rules_.take_rate(0, 71 * kSecond);
  EXPECT_THAT(codes(), ElementsAre("clock-contradicted", "clock-contradicted"));
}

TEST_F(CaseClock, AnAuthorityThatIsSetIsNamed) {
  for (const char* root : {"first", "second"}) stamp(kSecond, 1s, root);
  stamp(60 * kSecond, 70s);
  stamp(60 * kSecond, 60s, "second");
  EXPECT_THAT(codes(), ElementsAre("authority-clock-set"));
  EXPECT_THAT(set_, ElementsAre("first"));
}

// Ninety seconds are missing by the first authority, and by the second one, of which that cannot be seen.
TEST_F(CaseClock, AnAuthorityWhoseTimeFitsBothClocksClearsNone) {
  for (int i = 0; i <= 2; ++i) {
    stamp(i * 60 * kSecond, i * 60s);
    stamp(i * 60 * kSecond, i * 60s, "second", 0, 60 * kSecond);
  }
  stamp(180 * kSecond, 270s);
  stamp(180 * kSecond, 270s, "second", 0, 60 * kSecond);
  EXPECT_THAT(codes(), ElementsAre("authority-clock-differs"));
  EXPECT_THAT(set_, IsEmpty());
}

TEST_F(CaseClock, AnAuthorityThatIsStatedToBeSlowClearsNone) {
  for (const char* root : {"first", "second"}) stamp(0, 0s, root);
  for (int i = 1; i <= 2; ++i) stamp(i * 60 * kSecond, i * 60s);
  stamp(180 * kSecond, 270s);
  stamp(180 * kSecond, 180s, "second", 120 * kSecond);
  stamp(240 * kSecond, 330s);
  stamp(300 * kSecond, 390s);
  stamp(300 * kSecond, 300s, "second", 120 * kSecond);
  EXPECT_THAT(codes(), ElementsAre("authority-clock-differs"));
}

TEST_F(CaseClock, AnAuthorityThatIsSetItselfClearsNoOther) {
  for (const char* root : {"second", "first"}) stamp(0, 0s, root);
  stamp(60 * kSecond, 120s, "second");
  stamp(60 * kSecond, 60s);
  for (const char* root : {"second", "first"}) stamp(120 * kSecond, 180s, root);
  EXPECT_THAT(codes(), ElementsAre("authority-clock-differs", "authority-clock-differs"));
  EXPECT_THAT(set_, IsEmpty());
}

TEST_F(CaseClock, AnAuthorityThatIsSetByLittleIsNamedByAnExactOne) {
  for (const auto set : {2'500'000us, -2'500'000us}) {
    rules_ = CaseClockRules(findings_);
    for (int i = 0; i <= 10; ++i) {
      stamp(i * 60 * kSecond, i * 60s + (i > 5 ? set : 0us));
      stamp(i * 60 * kSecond, i * 60s, "second");
    }
    EXPECT_THAT(codes(), ElementsAre("authority-clock-set"));
  }
}

// What states a slew may lie in front of the lines. No slew explains more than a kernel makes.
TEST_F(CaseClock, ASlewMayBeStatedInFrontOfAnExcerptsLines) {
  for (const auto says : {55s, 45s}) {
    rules_ = CaseClockRules(findings_);
    for (const char* root : {"first", "second"}) stamp(0, 0s, root);
    for (const char* root : {"first", "second"}) stamp(60 * kSecond, says, root);
    EXPECT_THAT(codes(false), testing::Each(says == 55s ? "authority-clock-differs" : "clock-contradicted"));
  }
}

TEST_F(CaseClock, NothingIsComparedAcrossACrash) {
  for (const char* root : {"first", "second"}) stamp(kSecond, 1s, root);
  rules_.take_recovered();
  for (const char* root : {"first", "second"}) stamp(10 * kSecond, 3'600s, root);
  EXPECT_THAT(codes(), IsEmpty());
}

// Which other differences lie over the same time is not asked of each of them: here it would take minutes.
TEST_F(CaseClock, ThousandsOfDifferencesAreComparedWithoutAskingEachOfEach) {
  constexpr int kDifferences = 60'000;
  for (int i = 0; i < kDifferences; ++i) {
    stamp(i * kSecond, i * 10s);
    stamp(i * kSecond, i * -10s, "second");
  }
  EXPECT_THAT(codes(), testing::SizeIs(testing::Ge(1'000U)));
}

TEST_F(CaseClock, OnlyDifferencesOverTheSameTimeAndTheSameWayShowACaseClockThatWasMadeUp) {
  stamp(0, 0s);
  stamp(0, 0s, "third");
  stamp(60 * kSecond, 70s);  // alone until here
  stamp(70 * kSecond, 70s, "second");
  stamp(120 * kSecond, 140s);
  stamp(125 * kSecond, 100s, "third");  // the other way
  stamp(130 * kSecond, 140s, "second");
  stamp(140 * kSecond, 160s);
  stamp(200 * kSecond, 230s);  // alone again
  EXPECT_THAT(codes(), ElementsAre("authority-clock-differs", "clock-contradicted", "authority-clock-differs",
                                   "clock-contradicted", "authority-clock-differs"));
}

// The second authority's is under way all the while: also for the last of many of the first.
TEST_F(CaseClock, ADifferenceThatTakesLongIsSharedByAllThatLieInIt) {
  stamp(0, 0s, "second");
  for (int i = 0; i <= 4; ++i) stamp(i * 60 * kSecond, i * 70s);
  stamp(250 * kSecond, 300s, "second");
  EXPECT_THAT(codes(), testing::AllOf(testing::SizeIs(5), testing::Each("clock-contradicted")));
}

}  // namespace
}  // namespace kiroku::archive
