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

}  // namespace
}  // namespace kiroku::apps
