#include "archive/verify/verifier.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/forger.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/report_text.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

std::string listing(const VerificationReport& report) {
  std::string text = std::string(verdict_name(report.verdict)) + "\n";
  for (const Finding& finding : report.findings) {
    text += finding.code + " | " + finding.file + " | " +
            (finding.entry ? std::to_string(*finding.entry) : "-") + " | " +
            (finding.offset ? std::to_string(*finding.offset) : "-") + " | " + finding.text + "\n";
  }
  return text;
}

TEST(Verifier, FindsTheUntouchedCaseIntact) {
  test::SampleArchive archive;
  const auto folder = test::SampleCase::write(archive);
  const VerificationReport report = verify_case(folder, archive.options());
  EXPECT_EQ(listing(report), "intact\n");
}

constexpr std::int64_t kMillisecond = 1'000'000;
using Exchange = TokenEntry::Exchange;

/// Checkpoint and token, with the exchange in the entry: 20 ms to the authority and 20 ms back.
void stamp(test::SampleArchive& archive, test::SampleCase& sample,
           std::optional<Exchange> stated = std::nullopt) {
  const StoredCheckpoint checkpoint = sample.writer().checkpoint(archive.now(), true);
  const std::int64_t asked_ns = archive.now_ns;
  archive.now_ns += 20 * kMillisecond;
  const Bytes response = archive.stamp(checkpoint.note);
  archive.now_ns += 20 * kMillisecond;
  TokenEntry facts = test::SampleArchive::facts_of(response);
  facts.exchange = stated.value_or(Exchange{asked_ns, archive.now_ns});
  sample.writer().add_token(checkpoint, test::SampleArchive::kAuthorityName, response, facts, archive.now());
}

TEST(Verifier, ComparesAnAuthoritysClockWithTheCaseClock) {
  test::SampleArchive archive;
  // 300 ms ahead, and 100 ppm faster.
  archive.authority_time = [](std::int64_t mono_ns) {
    return test::SampleArchive::opened_at() +
           std::chrono::microseconds((300 * kMillisecond + mono_ns + mono_ns / 10'000) / 1'000);
  };
  test::SampleCase sample(archive);
  stamp(archive, sample);
  for (int i = 0; i < 10; ++i) {
    archive.now_ns += 60 * kSecond;
    sample.writer().append({ClockEntry{true, 0, 0, 0, 0}}, archive.now());
    stamp(archive, sample);
  }
  sample.record_at_once();
  sample.close();  // its token states no exchange, like those of older cases
  const VerificationReport report = verify_case(sample.folder(), archive.options());
  EXPECT_EQ(listing(report), "intact\n");
  ASSERT_EQ(report.clocks.size(), 1U);
  const AuthorityClock& clock = report.clocks[0];
  EXPECT_EQ(clock.authority, "embedded");
  EXPECT_EQ(clock.comparisons, 11U);
  EXPECT_EQ(clock.first.case_ns, 20 * kMillisecond);
  EXPECT_NEAR(static_cast<double>(offset_ns(clock.first, *report.opened)), 300e6, 2e3);
  EXPECT_GE(clock.first.half_width_ns, 20 * kMillisecond);
  EXPECT_NEAR(static_cast<double>(clock.drift_ns()), 600.4e9 / 10'000, 2e3);
  EXPECT_EQ(clock.drift_half_width_ns(), clock.first.half_width_ns + clock.last.half_width_ns);
}

TEST(Verifier, AllowsAWholeSecondWhereAnAuthorityHasNoFractions) {
  test::SampleArchive archive;
  archive.authority_time = [](std::int64_t mono_ns) {
    return std::chrono::floor<std::chrono::seconds>(test::SampleArchive::opened_at() +
                                                    std::chrono::microseconds(mono_ns / 1'000));
  };
  test::SampleCase sample(archive);
  stamp(archive, sample);
  sample.record_at_once();
  sample.close();
  const VerificationReport report = verify_case(sample.folder(), archive.options());
  ASSERT_EQ(report.clocks.size(), 1U);
  EXPECT_GE(report.clocks[0].first.half_width_ns, kSecond + 20 * kMillisecond);
}

TEST(Verifier, RefusesAnExchangeThatIsNotBetweenCheckpointAndEntry) {
  for (const Exchange& stated :
       {Exchange{kSecond, 5'040 * kMillisecond}, Exchange{5 * kSecond, 9 * kSecond}}) {
    test::SampleArchive archive;
    test::SampleCase sample(archive);
    archive.now_ns = 5 * kSecond;
    sample.writer().append({ClockEntry{true, 0, 0, 0, {}}}, archive.now());
    stamp(archive, sample, stated);
    archive.now_ns = 6 * kSecond;
    sample.record_at_once();
    sample.close();
    const VerificationReport report = verify_case(sample.folder(), archive.options());
    EXPECT_EQ(report.verdict, Verdict::kTampered);
    ASSERT_EQ(report.findings.size(), 1U) << listing(report);
    EXPECT_EQ(report.findings[0].code, "token-exchange-impossible");
    EXPECT_EQ(report.findings[0].entry, 2U);
  }
}

/// Ten minutes in which the machine's clocks run 8 % fast, as an NTP program may make them.
VerificationReport slewed(bool stated) {
  test::SampleArchive archive;
  archive.authority_time = [](std::int64_t mono_ns) {
    const std::int64_t fast_ns = std::max<std::int64_t>(mono_ns - 10 * kSecond, 0);
    return test::SampleArchive::opened_at() +
           std::chrono::microseconds((mono_ns - fast_ns + fast_ns * 100 / 108) / 1'000);
  };
  const auto clock = [&](std::int64_t rate_ppb) {
    return ClockEntry{true, 0, 0, 0, stated ? std::optional(rate_ppb) : std::nullopt};
  };
  test::SampleCase sample(archive);
  stamp(archive, sample);
  archive.now_ns = 11 * kSecond;
  sample.writer().append({clock(80'000'000)}, archive.now());
  archive.now_ns = 610 * kSecond;
  stamp(archive, sample);  // while it goes on
  sample.writer().append({clock(80'000'000)}, archive.now());
  stamp(archive, sample);
  sample.record_at_once();
  sample.close();
  return verify_case(sample.folder(), archive.options());
}

TEST(Verifier, AllowsForAStatedSlew) {
  const VerificationReport report = slewed(true);
  EXPECT_EQ(report.verdict, Verdict::kIntact);
  ASSERT_EQ(report.findings.size(), 2U) << listing(report);
  EXPECT_EQ(report.findings[1].code, "clock-slews-allowed-for");
  EXPECT_EQ(report.findings[0].code, "clock-slewed");
  EXPECT_EQ(
      report.findings[0].text,
      "the machine's clocks, the case clock among them, were made to run 80000 ppm faster than its crystal");
}

/// The machine's wall clock, which the embedded authority follows, is set an hour ahead at 30 s.
VerificationReport stepped(bool stated) {
  test::SampleArchive archive;
  archive.authority_time = [](std::int64_t mono_ns) {
    return test::SampleArchive::opened_at() + std::chrono::microseconds(mono_ns / 1'000) +
           std::chrono::hours(mono_ns > 30 * kSecond ? 1 : 0);
  };
  test::SampleCase sample(archive);
  stamp(archive, sample);
  archive.now_ns = 30 * kSecond + kSecond / 2;
  stamp(archive, sample);  // before the step is stated
  archive.now_ns = 31 * kSecond;
  if (stated) sample.writer().append({ClockEntry{true, 0, 0, 3600 * kSecond, {}}}, archive.now());
  archive.now_ns = 90 * kSecond;
  stamp(archive, sample);
  sample.record_at_once();
  sample.close();
  return verify_case(sample.folder(), archive.options());
}

TEST(Verifier, AStatedStepExplainsAClockThatFollowedIt) {
  const VerificationReport report = stepped(true);
  EXPECT_EQ(report.verdict, Verdict::kIntact) << listing(report);
  // The entries' own UTC, which the sample takes from the case clock, does not follow the step.
  ASSERT_EQ(report.findings.size(), 2U) << listing(report);
  EXPECT_EQ(report.findings[0].code, "clock-stepped");
  EXPECT_EQ(report.findings[1].code, "close-utc-differs");
}

TEST(Verifier, AStepThatNobodyStatedExplainsNothing) {
  const VerificationReport report = stepped(false);
  EXPECT_EQ(report.verdict, Verdict::kUnproven);
  ASSERT_EQ(report.findings.size(), 1U) << listing(report);
  EXPECT_EQ(report.findings[0].code, "clock-disagreement");
}

TEST(Verifier, TellsASlewThatNobodyStated) {
  const VerificationReport report = slewed(false);
  EXPECT_EQ(report.verdict, Verdict::kUnproven);
  ASSERT_EQ(report.findings.size(), 1U) << listing(report);
  EXPECT_EQ(report.findings[0].code, "clock-disagreement");
}

/// A case with one segment that is sealed to somebody whom `open` does not name.
std::filesystem::path sealed_to_another(test::SampleArchive& archive) {
  test::SampleCase sample(archive);
  stamp(archive, sample);
  archive.now_ns = 7 * kSecond;
  SegmentEntry entry = sample.segment(0, 0, {0, 7 * kSecond});
  const crypto::AgeRecipients another{crypto::parse_recipient(crypto::generate_age_key().recipient)};
  const std::string sealed = test::sealed_anew(to_bytes("a film"), another);
  test::write_into(sample.folder() / entry.file.file, sealed);
  entry.file.bytes = sealed.size();
  entry.file.sha256 = crypto::sha256(bytes_of(sealed));
  sample.writer().append({entry, sample.segment(1, 0, {0, 7 * kSecond})}, archive.now());
  sample.close();
  return sample.folder();
}

TEST(Verifier, FindsASegmentThatANamedRecipientCannotOpen) {
  test::SampleArchive archive;
  const auto folder = sealed_to_another(archive);
  VerifyOptions options = archive.options();
  EXPECT_EQ(listing(verify_case(folder, options)), "intact\n") << "without a key nobody can tell";
  options.identities = &archive.identities();
  const VerificationReport report = verify_case(folder, options);
  EXPECT_EQ(test::summary(report), "tampered\nsegment-not-for-recipient segments/endoscope/00000000.ts.age 2")
      << test::details(report);
  ASSERT_TRUE(report.contents);
  EXPECT_EQ(report.contents->segments, 2U);
  EXPECT_EQ(report.contents->opened, 1U);
}

TEST(Verifier, SaysHowManySegmentsWereLookedInto) {
  test::SampleArchive archive;
  const auto folder = test::SampleCase::write(archive);
  VerifyOptions options = archive.options();
  EXPECT_FALSE(verify_case(folder, options).contents);

  const crypto::AgeIdentities stranger{
      crypto::parse_identity(crypto::generate_age_key().identity_text.text())};
  options.identities = &stranger;
  VerificationReport report = verify_case(folder, options);
  EXPECT_EQ(report.verdict, Verdict::kIntact) << test::details(report);
  EXPECT_EQ(report.contents->segments, 4U);
  EXPECT_EQ(report.contents->opened, 0U);

  options.identities = &archive.identities();
  report = verify_case(folder, options);
  EXPECT_EQ(report.contents->opened, 4U);
  EXPECT_EQ(report.contents->decoded, 0U) << "no decoders were given";

  options.inspect = [](const StreamInfo& stream, const SegmentEntry&, const crypto::ByteSource&,
                       const crypto::AgeIdentities&) {
    return stream.name == "vitals" ? std::optional(InspectionProblem{"it is noise"}) : std::nullopt;
  };
  report = verify_case(folder, options);
  EXPECT_EQ(report.contents->opened, 4U);
  EXPECT_EQ(report.contents->decoded, 3U);
}

}  // namespace
}  // namespace kiroku::archive
