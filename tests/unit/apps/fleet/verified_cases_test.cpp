#include "apps/fleet/verified_cases.h"

#include <gtest/gtest.h>

namespace kiroku::apps {
namespace {

using archive::Severity;
using archive::Verdict;

archive::VerificationReport report_of(Verdict verdict, Severity worst, const std::string& text = "") {
  archive::VerificationReport report;
  report.verdict = verdict;
  report.findings.push_back({"note", Severity::kNote, {}, {}, {}, "a note"});
  if (worst != Severity::kNote) report.findings.push_back({"worst", worst, {}, {}, {}, text});
  return report;
}

VerifiedCases cases_of(std::initializer_list<Verdict> verdicts) {
  VerifiedCases cases;
  for (const Verdict verdict : verdicts) cases.add(verification_of(report_of(verdict, Severity::kNote)));
  return cases;
}

TEST(VerifiedCases, AnAlarmSaysThatACaseIsNotIntact) {
  const fleet::Verification tampered =
      verification_of(report_of(Verdict::kTampered, Severity::kTampered, "segment 3 is not there"));
  EXPECT_EQ(tampered.verdict, "tampered");
  EXPECT_TRUE(tampered.alarm);
  EXPECT_EQ(tampered.findings, 1U);
  EXPECT_EQ(tampered.detail, "segment 3 is not there");
  // What lies in a case's place must be the case.
  EXPECT_TRUE(verification_of(report_of(Verdict::kIntactExcerpt, Severity::kNote)).alarm);
  for (const Verdict verdict :
       {Verdict::kIntact, Verdict::kIntactWithGaps, Verdict::kUnproven, Verdict::kIncomplete})
    EXPECT_FALSE(verification_of(report_of(verdict, Severity::kNote)).alarm)
        << archive::verdict_name(verdict);
}

TEST(VerifiedCases, ALogThatEndsBeforeTheCaseIsTold) {
  archive::VerificationReport report = report_of(Verdict::kIntact, Severity::kNote);
  report.close_entry = 9;
  EXPECT_EQ(verification_of(report).detail, "");  // no log was compared
  report.in_log = {.opening = true, .end = true, .entries = 10};
  EXPECT_EQ(verification_of(report).detail, "");
  report.in_log = {.opening = true, .end = false, .entries = 4};
  EXPECT_EQ(verification_of(report).detail, "the appliance log knows no end of the case yet");
  EXPECT_FALSE(verification_of(report).alarm);
  // An end of another history is none of this one.
  report.in_log = {.opening = true, .end = true, .entries = 9};
  EXPECT_EQ(verification_of(report).detail, "the appliance log knows no end of the case yet");
  report.findings.push_back({"worst", Severity::kTampered, {}, {}, {}, "segment 3 is not there"});
  EXPECT_EQ(verification_of(report).detail,
            "segment 3 is not there; the appliance log knows no end of the case yet");
  // Whoever left no end in the case waits for none in the log.
  report.close_entry.reset();
  EXPECT_EQ(verification_of(report).detail, "segment 3 is not there");
}

TEST(VerifiedCases, WhatCouldNotBeProvenIsAnAnswerOfItsOwn) {
  const VerifiedCases whole = cases_of({Verdict::kIntact, Verdict::kIntactWithGaps});
  EXPECT_EQ(whole.status(), 0);
  EXPECT_EQ(whole.summary(), "2 cases verified");
  // A root that was forgotten makes no case of a hospital one that is not intact.
  const VerifiedCases unproven = cases_of({Verdict::kUnproven, Verdict::kUnproven});
  EXPECT_EQ(unproven.status(), 3);
  EXPECT_EQ(unproven.summary(), "2 cases verified, 2 unproven");
  const VerifiedCases cut_off = cases_of({Verdict::kIncomplete});
  EXPECT_EQ(cut_off.status(), 3);
  EXPECT_EQ(cut_off.summary(), "1 case verified, 1 incomplete");
  VerifiedCases unchecked = cases_of({Verdict::kIntact});
  unchecked.add_unchecked();
  EXPECT_EQ(unchecked.status(), 3);
  EXPECT_EQ(unchecked.summary(), "1 case verified, 1 could not be checked");
  VerifiedCases all = cases_of({Verdict::kUnproven, Verdict::kTampered, Verdict::kIncomplete});
  all.add_unchecked();
  EXPECT_EQ(all.status(), 1);
  EXPECT_EQ(all.summary(),
            "3 cases verified, 1 NOT INTACT, 1 incomplete, 1 unproven, 1 could not be checked");
}

// "kiroku-fleet verify --all && …" goes on only where every case of the catalogue was looked at and holds.
TEST(VerifiedCases, WhoAsksForAllIsToldWhatThisRunDidNotLookAt) {
  const auto compared = [](const fleet::FleetTotals& totals) {
    VerifiedCases cases = cases_of({Verdict::kIntact, Verdict::kIntact});
    cases.compare(totals);
    return cases;
  };
  EXPECT_EQ(compared({.cases = 2}).status(), 0);
  EXPECT_EQ(compared({.cases = 2}).summary(), "2 cases verified");
  // Another worker took it while this one verified the others.
  const VerifiedCases other = compared({.cases = 3, .alarms = 1});
  EXPECT_EQ(other.status(), 1);
  EXPECT_EQ(other.summary(), "2 cases verified; in the catalogue 1 NOT INTACT that this run did not verify");
  EXPECT_EQ(compared({.cases = 3, .unproven = 1}).status(), 3);
  const VerifiedCases gone = compared({.cases = 3, .missing = 1});
  EXPECT_EQ(gone.status(), 1);
  EXPECT_EQ(gone.summary(), "2 cases verified; not looked at: 1 missing from the store");
  EXPECT_EQ(compared({.cases = 3, .unverified_unreadable = 1}).status(), 1);
  const VerifiedCases changed = compared({.cases = 3, .unverified_closed = 1});
  EXPECT_EQ(changed.status(), 3);
  EXPECT_EQ(changed.summary(), "2 cases verified; not looked at: 1 that changed just now");
  // What this run found itself is told once.
  VerifiedCases own = cases_of({Verdict::kTampered, Verdict::kUnproven});
  own.compare({.cases = 2, .alarms = 1, .unproven = 1});
  EXPECT_EQ(own.status(), 1);
  EXPECT_EQ(own.summary(), "2 cases verified, 1 NOT INTACT, 1 unproven");
}

TEST(VerifiedCases, ARunThatWasToldToEndDidNotLookAtAll) {
  VerifiedCases cases = cases_of({Verdict::kIntact});
  cases.end_early();
  EXPECT_EQ(cases.status(), 3);
  EXPECT_EQ(cases.summary(), "1 case verified; ended before every case was looked at");
}

TEST(VerifiedCases, WhatWasMendedIsToldAndWhatCouldNotBeNeedsAPerson) {
  VerifiedCases cases = cases_of({Verdict::kIntact});
  cases.add_mended(2, 0);
  EXPECT_EQ(cases.status(), 0);
  EXPECT_EQ(cases.summary(), "1 case verified; 2 objects mended in the store");
  cases.add_mended(0, 1);
  EXPECT_EQ(cases.status(), 3);
  EXPECT_EQ(cases.summary(), "1 case verified; 2 objects mended in the store; 1 object could not be mended");
  archive::VerificationReport report;
  report.verdict = Verdict::kIntact;
  fleet::Mending mending{{{"tokens/00000002.own.tsr", {}, "an older version", "v2"}},
                         {{"segments/room/00000000.ts.age", "no copy has the bytes"}}};
  EXPECT_EQ(verification_of(report, mending).detail,
            "1 object mended in the store; 1 object could not be mended");
  EXPECT_FALSE(verification_of(report, mending).alarm);
  fleet::Mending without;
  without.erased = {"segments/room/00000000.ts.age"};
  EXPECT_EQ(verification_of(report, without).detail,
            "1 object erased by the appliance and lost or damaged in the store, not put again");
  mending.more_left = 1'000;
  EXPECT_EQ(verification_of(report, mending).detail,
            "1 object mended in the store; 1001 objects could not be mended");
}

}  // namespace
}  // namespace kiroku::apps
