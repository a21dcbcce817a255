#include "apps/verify/report_text.h"

#include <chrono>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::apps {
namespace {

using testing::HasSubstr;
using testing::Not;
using namespace std::chrono_literals;

constexpr std::int64_t kSecond = 1'000'000'000;

/// A case of which outside authorities stamped what follows entry 82 alone, and its end.
archive::VerificationReport stamped_late() {
  const UtcTime begin = *parse_utc("2026-08-05T09:15:02.000000Z");
  archive::VerificationReport report;
  report.verdict = archive::Verdict::kIntact;
  report.time = archive::TimeProof::kExternal;
  report.brackets = {{0, 81, {}, begin, "", "outside", archive::TimeProof::kExternal},
                     {82, 85, begin, begin + 2s, "outside", "outside", archive::TimeProof::kExternal},
                     {86, 86, begin + 2s, {}, "outside", "", archive::TimeProof::kExternal}};
  return report;
}

std::string told(const archive::VerificationReport& report) {
  return report_text(report, "case", true, no_log_words());
}

// A bracket with one limit is wider than any with two, however short those are.
TEST(ReportText, SaysWhichBracketsHaveOneLimitAlone) {
  EXPECT_THAT(told(stamped_late()),
              HasSubstr("3 brackets, the widest of those with two limits 0:02; entries 0 to 81 without an "
                        "earlier limit; entry 86 without a later limit\n"));
  archive::VerificationReport after = stamped_late();
  after.brackets.erase(after.brackets.begin() + 1);
  EXPECT_THAT(told(after), HasSubstr("2 brackets, none with two limits; entries 0 to 81 without an earlier"));
}

TEST(ReportText, SaysHowManyFilesLieThereThatNobodyRecorded) {
  archive::VerificationReport report = stamped_late();
  EXPECT_THAT(told(report), Not(HasSubstr("nobody recorded")));
  report.left_by_systems = 1;
  EXPECT_THAT(told(report), HasSubstr("             beside these lies 1 file that nobody recorded\n"));
  report.left_by_systems = 2;
  EXPECT_THAT(told(report), HasSubstr("             beside these lie 2 files that nobody recorded\n"));
}

TEST(ReportText, SaysBesideTheTimeWhatItIsNotWorth) {
  const auto with = [](std::string_view code) {
    archive::VerificationReport report = stamped_late();
    report.age_at_first_stamp_ns = report.entered_late_ns = 200 * kSecond;
    report.findings.push_back({std::string(code), archive::Severity::kNote, {}, {}, {}, "why"});
    return told(report);
  };
  const char* const proved = "  time       proved by an outside time-stamping authority\n";
  EXPECT_THAT(told(stamped_late()), HasSubstr(proved));
  EXPECT_THAT(with("frames-dropped"), HasSubstr(proved));
  EXPECT_THAT(with("stamped-after-close"),
              testing::AllOf(HasSubstr("there by then, not when it was recorded\n"),
                             HasSubstr("             when it was recorded, and for how long, rests on the "
                                       "recorder's word\n")));
  EXPECT_THAT(
      with("first-stamped-late"),
      testing::AllOf(HasSubstr("how old its beginning is, is not\n"),
                     HasSubstr("             by the case clock it began 3:20 before the first outside "
                               "time-stamp: that it began no earlier rests on the recorder's word\n"),
                     Not(HasSubstr(proved))));
  EXPECT_THAT(with("segments-entered-late"),
              testing::AllOf(
                  HasSubstr("how old some of it is, is not\n"),
                  HasSubstr("             by the case clock some of it ended 3:20 before the outside "
                            "time-stamp in front of its entry: that it is no older rests on the recorder's "
                            "word\n"),
                  Not(HasSubstr(proved))));
  EXPECT_THAT(with("end-stamped-late"),
              HasSubstr("             that it ended when it says rests on the recorder's word"));
  EXPECT_THAT(with("clock-differs"), HasSubstr("             the recorder's clock was wrong"));
  EXPECT_THAT(with("close-utc-differs"),
              HasSubstr("             from opening to closing the recorder's clock"));
}

TEST(ReportText, OfARenewedCaseDoesNotSayThatNothingProvesItsTime) {
  archive::VerificationReport report = stamped_late();
  report.time = archive::TimeProof::kNone;
  EXPECT_THAT(told(report), HasSubstr("not proved: no time-stamp that could be checked"));
  archive::EvidenceReport& evidence = report.evidence.emplace();
  evidence.holds = evidence.outside = true;
  evidence.time_stamps = 1;
  evidence.since = evidence.newest = parse_utc("2027-01-01T00:00:00Z");
  EXPECT_THAT(told(report), testing::AllOf(HasSubstr("its evidence record proves since when it existed"),
                                           Not(HasSubstr("not proved"))));
}

TEST(ReportText, SaysOfTheDeviceWhatWasAsked) {
  archive::VerificationReport report = stamped_late();
  report.device = "or3+0b4cfd37+key";
  report.signed_entries = 1;
  const auto said = [&](bool trusted) { return report_text(report, "case", trusted, no_log_words()); };
  EXPECT_THAT(said(true), HasSubstr("or3+0b4cfd37+key (trusted)\n"));
  EXPECT_THAT(said(false), HasSubstr("or3+0b4cfd37+key (not among the trusted keys)\n"));
  report.findings.push_back({"no-trusted-device", archive::Severity::kUnproven, {}, {}, {}, "why"});
  EXPECT_THAT(said(false), HasSubstr("or3+0b4cfd37+key (no trusted key was given)\n"));
  report.device.clear();
  EXPECT_THAT(said(false),
              testing::AllOf(HasSubstr("  device     not known"), Not(HasSubstr("trusted keys"))));
}

}  // namespace
}  // namespace kiroku::apps
