// The case clock against the clocks of outside authorities: one of them may have been set right, and whoever
// holds the device key may have made the case clock up.
#include <array>
#include <chrono>
#include <ctime>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/reading/excerpt.h"
#include "tests/attack/attacked_case.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/report_text.h"
#include "tests/support/token_maker.h"

namespace kiroku::test {
namespace {

using namespace std::chrono_literals;

/// A case of a minute that two outside authorities stamp at both ends.
class OutsideClocks : public ::testing::Test {
 protected:
  using Exchange = archive::TokenEntry::Exchange;
  OutsideClocks() {
    trust_.add_own_authority(bytes_of(archive_.authority().root_pem()), "the recorder's own authority");
    for (const TestAuthority& authority : authorities_) {
      trust_.add_trusted(bytes_of(authority.root_pem()), "an outside authority");
    }
  }

  /// An authority's clock is that of the case, and `set` more.
  void stamp(SampleCase& sample, std::size_t authority, std::chrono::seconds set,
             const std::string& name = "", std::optional<Exchange> stated = {}) {
    stamp_over(sample, sample.writer().checkpoint(archive_.now(), true), authority, set, name, stated);
  }
  void stamp_over(SampleCase& sample, const archive::StoredCheckpoint& checkpoint, std::size_t authority,
                  std::chrono::seconds set, const std::string& name = "",
                  std::optional<Exchange> stated = {}) {
    const crypto::Sha256Digest imprint = crypto::sha256(bytes_of(checkpoint.note));
    const std::time_t says = std::chrono::system_clock::to_time_t(archive_.now().utc + set);
    std::tm parts{};
    gmtime_r(&says, &parts);
    std::array<char, 32> text{};
    std::strftime(text.data(), text.size(), "%Y%m%d%H%M%SZ", &parts);
    TokenRecipe recipe;
    recipe.imprint = Bytes(imprint.begin(), imprint.end());
    recipe.gen_time = text.data();
    recipe.policy = "1.2.3.4";
    recipe.signer = &authorities_.at(authority).signer;
    recipe.enclosed = {recipe.signer->certificate.get()};
    const Bytes response = make_response(make_token(recipe));
    const std::string usual = authority == 0 ? "first" : "second";
    archive::TokenEntry facts = SampleArchive::facts_of(response);
    facts.exchange = stated;
    sample.writer().add_token(checkpoint, name.empty() ? usual : name, response, facts, archive_.now());
  }

  archive::VerificationReport verify(SampleCase& sample) {
    archive::VerifyOptions options = archive_.options();
    options.trust = &trust_;
    return archive::verify_case(sample.folder(), options);
  }

  archive::VerificationReport verify(std::size_t count, std::array<std::chrono::seconds, 2> set,
                                     std::chrono::seconds ahead = 0s) {
    SampleCase sample(archive_);
    archive_.now_ns = 6 * kSecond;
    for (std::size_t each = 0; each < count; ++each) stamp(sample, each, ahead);
    archive_.now_ns = 66 * kSecond;
    sample.record_at_once();
    for (std::size_t each = 0; each < count; ++each) stamp(sample, each, ahead + set.at(each));
    sample.close();
    return verify(sample);
  }

  /// A case that is stamped 20 times, after `step` each, while the authorities' clocks gain `gained`.
  archive::VerificationReport asked_often(std::size_t count, std::chrono::milliseconds step,
                                          std::chrono::seconds gained) {
    archive_.clear();
    archive_.now_ns = 0;
    SampleCase sample(archive_);
    for (int i = 0; i < 20; ++i) {
      archive_.now_ns += std::chrono::nanoseconds(step).count();
      for (std::size_t each = 0; each < count; ++each) stamp(sample, each, i * gained);
    }
    sample.record_at_once();
    sample.writer().close("operator", archive_.now());
    for (std::size_t each = 0; each < count; ++each) stamp(sample, each, 20 * gained);
    sample.writer().finish(archive_.now());
    return verify(sample);
  }

  archive::VerificationReport closed(SampleCase& sample) {
    sample.record_at_once();
    sample.writer().close("operator", archive_.now());
    sample.writer().checkpoint(archive_.now(), true);
    sample.writer().finish(archive_.now());
    return verify(sample);
  }

  archive::VerificationReport stamped_to_its_end(SampleCase& sample) {
    sample.record_at_once();
    sample.close();
    return verify(sample);
  }

  SampleArchive archive_;
  std::array<TestAuthority, 2> authorities_{make_test_authority(), make_test_authority()};
  timestamp::TrustStore trust_;
};

TEST_F(OutsideClocks, ThatAgreeSayNothing) {
  const archive::VerificationReport report = verify(2, {0s, 0s});
  EXPECT_EQ(summary(report), "intact") << details(report);
}

TEST_F(OutsideClocks, OfWholeSecondsThatAreAskedOftenAgree) {
  const archive::VerificationReport report = asked_often(2, 700ms, 0s);
  EXPECT_EQ(report.verdict, archive::Verdict::kIntact) << details(report);
}

// Two seconds are allowed to each comparison: who asks for a token each second would leave out half of all.
TEST_F(OutsideClocks, WhoAsksOftenLeavesNothingOut) {
  const archive::VerificationReport of_one = asked_often(1, 500ms, 1s);
  EXPECT_EQ(of_one.verdict, archive::Verdict::kUnproven) << details(of_one);
  EXPECT_THAT(summary(of_one), testing::HasSubstr("authority-clock-differs tokens/"));
  const archive::VerificationReport of_two = asked_often(2, 500ms, 1s);
  EXPECT_EQ(of_two.verdict, archive::Verdict::kTampered) << details(of_two);
  EXPECT_THAT(summary(of_two), testing::HasSubstr("clock-contradicted tokens/"));
}

// The ledger's name for an authority is chosen by whoever writes the ledger.
TEST_F(OutsideClocks, OneAuthorityUnderManyNamesIsOne) {
  SampleCase sample(archive_);
  for (int i = 0; i < 10; ++i) {
    archive_.now_ns += kSecond / 2;
    stamp(sample, 0, i * 2s, "name-" + std::to_string(i));
  }
  const archive::VerificationReport report = closed(sample);
  EXPECT_EQ(report.verdict, archive::Verdict::kUnproven) << details(report);
  EXPECT_THAT(summary(report), testing::HasSubstr("authority-clock-differs tokens/"));
}

TEST_F(OutsideClocks, TheReportTellsOfAuthoritiesByTheirCertificates) {
  SampleCase sample(archive_);
  for (const char* name : {"swiss", "german"}) stamp(sample, 0, 0s, name);
  stamp(sample, 1, 0s, "swiss");
  const archive::VerificationReport report = closed(sample);
  ASSERT_THAT(report.authorities, testing::SizeIs(2)) << details(report);
  EXPECT_EQ(report.authorities[0].subject, "CN=Test root,O=Test");
  EXPECT_EQ(report.authorities[0].tokens, 2U);
  EXPECT_THAT(report.authorities[0].names, testing::ElementsAre("swiss", "german"));
  EXPECT_EQ(report.authorities[1].tokens, 1U);
  EXPECT_THAT(report.authorities[1].names, testing::ElementsAre("swiss"));
}

TEST_F(OutsideClocks, OneAuthorityUnderTwoNamesThatIsSetShowsNoClockThatWasMadeUp) {
  SampleCase sample(archive_);
  for (const char* name : {"a", "b"}) stamp(sample, 0, 0s, name);
  archive_.now_ns += 60 * kSecond;
  for (const char* name : {"a", "b"}) stamp(sample, 0, 10s, name);
  const archive::VerificationReport report = closed(sample);
  EXPECT_EQ(report.verdict, archive::Verdict::kUnproven) << details(report);
}

TEST_F(OutsideClocks, OfTwoThatAreAskedOnceEachTheTimeBetweenIsComparedToo) {
  SampleCase sample(archive_);
  stamp(sample, 0, 0s);
  archive_.now_ns += kSecond;
  stamp(sample, 1, 20s);
  const archive::VerificationReport report = closed(sample);
  EXPECT_EQ(report.verdict, archive::Verdict::kUnproven) << details(report);
  EXPECT_THAT(summary(report), testing::HasSubstr("authorities-disagree tokens/"));
}

// Sixteen of twenty seconds are left out, and nobody is asked for the time in between. Whoever holds the
// device key writes when the token over the end was asked for, answered and entered.
TEST_F(OutsideClocks, TheTokenOverTheEndIsComparedToo) {
  struct Statement {
    std::optional<Exchange> exchange;
    std::int64_t entered_ns = 4 * kSecond;
    std::string says;
  };
  const std::vector<Statement> statements{
      {Exchange{4 * kSecond, 4 * kSecond}, 4 * kSecond, "unproven\nauthority-clock-differs tokens/"},
      {{}, 4 * kSecond, "intact\nend-stamped-late tokens/"},
      {{}, 20 * kSecond, "intact\nend-stamped-late tokens/"},
      {Exchange{4 * kSecond, 20 * kSecond}, 20 * kSecond, "intact\nend-stamped-late tokens/"},
      {Exchange{20 * kSecond, 20 * kSecond}, 20 * kSecond, "intact\nend-stamped-late tokens/"}};
  for (const Statement& stated : statements) {
    archive_.clear();
    archive_.now_ns = 0;
    SampleCase sample(archive_);
    stamp(sample, 0, 0s);
    archive_.now_ns += 4 * kSecond;
    sample.record_at_once();
    sample.writer().close("operator", archive_.now());
    archive_.now_ns = stated.entered_ns;
    stamp(sample, 0, std::chrono::seconds(20 - stated.entered_ns / kSecond), "first", stated.exchange);
    sample.writer().finish(archive_.now());
    const archive::VerificationReport report = verify(sample);
    EXPECT_THAT(summary(report), testing::HasSubstr(stated.says)) << details(report);
  }
}

// The second authority's only token before the end is stated to have taken sixteen seconds.
TEST_F(OutsideClocks, AnotherAuthorityThatIsStatedToBeSlowHidesNoLateEnd) {
  SampleCase sample(archive_);
  const archive::StoredCheckpoint begin = sample.writer().checkpoint(archive_.now(), true);
  stamp_over(sample, begin, 0, 0s);
  archive_.now_ns += 4 * kSecond;
  sample.record_at_once();
  sample.writer().close("operator", archive_.now());
  archive_.now_ns += 16 * kSecond;
  stamp_over(sample, begin, 1, 0s, "second", Exchange{0, archive_.now_ns});
  stamp(sample, 1, 0s, "second", Exchange{4 * kSecond, archive_.now_ns});
  sample.writer().finish(archive_.now());
  const archive::VerificationReport report = verify(sample);
  EXPECT_THAT(summary(report), testing::HasSubstr("end-stamped-late tokens/")) << details(report);
}

TEST_F(OutsideClocks, ATokenOverTheEndThatComesInTimeSaysNothing) {
  SampleCase sample(archive_);
  stamp(sample, 0, 0s);
  archive_.now_ns += 4 * kSecond;
  sample.record_at_once();
  sample.writer().close("operator", archive_.now());
  archive_.now_ns += 2 * kSecond;
  stamp(sample, 0, 0s, "first", Exchange{4 * kSecond, archive_.now_ns});
  archive_.now_ns += 3'600 * kSecond;
  stamp(sample, 1, 0s, "second");  // another one comes an hour later: the first is enough
  sample.writer().finish(archive_.now());
  const archive::VerificationReport report = verify(sample);
  EXPECT_EQ(report.verdict, archive::Verdict::kIntact) << details(report);
  EXPECT_THAT(summary(report), testing::Not(testing::HasSubstr("end-stamped-late"))) << details(report);
}

// The operation was a year ago or is a year old, by the recorder's word: nobody outside was asked meanwhile.
TEST_F(OutsideClocks, ACaseThatIsStampedAfterItsEndAloneSaysSo) {
  SampleCase sample(archive_);
  archive_.now_ns += 4 * kSecond;
  sample.record_at_once();
  sample.writer().close("operator", archive_.now());
  stamp(sample, 0, 365 * 24h);
  sample.writer().finish(archive_.now());
  const archive::VerificationReport report = verify(sample);
  EXPECT_THAT(summary(report), testing::HasSubstr("intact\nstamped-after-close tokens/")) << details(report);
  EXPECT_THAT(details(report), testing::HasSubstr("31536000 s after it"));
}

// Film of last year, and one time-stamp just before the end: nothing outside bounds how old it is.
TEST_F(OutsideClocks, WhatWasRecordedLongBeforeTheFirstTimeStampIsSaid) {
  for (const std::int64_t seconds : {119, 121}) {
    archive_.clear();
    SampleCase sample(archive_);
    archive_.now_ns = seconds * kSecond;
    sample.record_at_once();
    stamp(sample, 0, 0s);
    sample.writer().close("operator", archive_.now());
    stamp(sample, 0, 0s);
    sample.writer().finish(archive_.now());
    const archive::VerificationReport report = verify(sample);
    EXPECT_EQ(report.verdict, archive::Verdict::kIntact) << details(report);
    if (seconds == 119) {
      EXPECT_THAT(summary(report), testing::Not(testing::HasSubstr("first-stamped-late"))) << details(report);
      EXPECT_FALSE(report.age_at_first_stamp_ns);
    } else {
      EXPECT_THAT(summary(report), testing::HasSubstr("first-stamped-late tokens/")) << details(report);
      EXPECT_EQ(report.age_at_first_stamp_ns, 121 * kSecond);
    }
  }
}

// The token stands in front of the film's entries, and proves no more than that these are younger.
TEST_F(OutsideClocks, FilmThatIsEnteredLongAfterItsEndBehindATimeStampIsSaid) {
  for (const bool also_at_the_beginning : {false, true}) {
    for (const std::int64_t seconds : {119, 131}) {
      archive_.clear();
      archive_.now_ns = 0;
      SampleCase sample(archive_);
      if (also_at_the_beginning) stamp(sample, 0, 0s);
      archive_.now_ns = seconds * kSecond;
      stamp(sample, 0, 0s);
      sample.record_at_once();
      sample.writer().close("operator", archive_.now());
      stamp(sample, 0, 0s);
      sample.writer().finish(archive_.now());
      const archive::VerificationReport report = verify(sample);
      const bool is_late = seconds == 131;
      const auto says = [&](const char* code, bool said) {
        return said ? testing::Matcher<std::string>(testing::HasSubstr(code))
                    : testing::Matcher<std::string>(testing::Not(testing::HasSubstr(code)));
      };
      EXPECT_EQ(report.verdict, archive::Verdict::kIntact) << details(report);
      EXPECT_THAT(summary(report), says("segments-entered-late ledger.jsonl", is_late)) << details(report);
      EXPECT_THAT(summary(report), says("first-stamped-late tokens/", is_late && !also_at_the_beginning))
          << details(report);
      EXPECT_EQ(report.entered_late_ns.has_value(), is_late);
    }
  }
}

TEST_F(OutsideClocks, AnExcerptOfWhichNobodyOutsideStampedASegmentIsNotProvedInPart) {
  SampleCase sample(archive_);
  stamp(sample, 0, 0s);
  for (std::uint64_t i = 0; i < 3; ++i) {
    const std::int64_t begin_ns = archive_.now_ns;
    archive_.now_ns += 2 * kSecond;
    sample.writer().append({sample.segment(0, i, {begin_ns, archive_.now_ns})}, archive_.now());
    sample.stamp();
  }
  sample.close();
  EXPECT_EQ(verify(sample).time, archive::TimeProof::kExternalInPart);
  archive::ExcerptOptions options;
  options.from_ns = 2 * kSecond + 1;
  options.to_ns = 3 * kSecond;
  options.streams = {"endoscope"};
  archive::make_excerpt(sample.folder(), options, archive_.folder() / "excerpt");
  archive::VerifyOptions verifying = archive_.options();
  verifying.trust = &trust_;
  const archive::VerificationReport report = archive::verify_case(archive_.folder() / "excerpt", verifying);
  EXPECT_EQ(report.verdict, archive::Verdict::kIntactExcerpt) << details(report);
  EXPECT_GT(report.outside_tokens, 0U);
  EXPECT_EQ(report.time, archive::TimeProof::kSelfIssued);
}

TEST_F(OutsideClocks, AWallClockThatIsAYearBehindIsSaidAlsoWhereNoExchangeIsStated) {
  const archive::VerificationReport report = verify(2, {0s, 0s}, 365 * 24h);
  EXPECT_THAT(summary(report), testing::HasSubstr("intact\nclock-differs ledger.jsonl 0")) << details(report);
}

// No machine's clock runs faster than its kernel lets it.
TEST_F(OutsideClocks, ASlewThatNoKernelMakesExcusesNothing) {
  SampleCase sample(archive_);
  stamp(sample, 0, 0s);
  archive_.now_ns += kSecond;
  sample.writer().append({archive::ClockEntry{true, 0, 0, 0, -6'000'000'000'000}}, archive_.now());
  archive_.now_ns += 3 * kSecond;
  stamp(sample, 0, 20s);
  const archive::VerificationReport report = closed(sample);
  EXPECT_EQ(report.verdict, archive::Verdict::kUnproven) << details(report);
}

// chrony slews by 83,333 ppm. Recorders stated no more of that than its beginning until a minute was over.
TEST_F(OutsideClocks, ASlewOfWhichOnlyTheBeginningIsStatedMakesNoSoundCaseTampered) {
  for (const std::size_t count : {1U, 2U}) {
    archive_.clear();
    archive_.now_ns = 0;
    SampleCase sample(archive_);
    for (std::size_t each = 0; each < count; ++each) stamp(sample, each, 0s);
    archive_.now_ns += 2 * kSecond;
    sample.writer().append({archive::ClockEntry{true, 0, 0, 0, 2'727'683}}, archive_.now());
    archive_.now_ns += 52 * kSecond;
    for (std::size_t each = 0; each < count; ++each) stamp(sample, each, -4s);
    const archive::VerificationReport report = stamped_to_its_end(sample);
    EXPECT_EQ(report.verdict, archive::Verdict::kIntact) << details(report);
    EXPECT_EQ(summary(report), "intact\nclock-slewed ledger.jsonl " + std::to_string(1 + count) +
                                   "\nclock-slews-allowed-for - -")
        << details(report);
  }
}

// Who holds the device key may state slews that were none. That is bounded, and the report says how far.
TEST_F(OutsideClocks, WhatStatedSlewsMayExcuseIsSaid) {
  for (const auto set : {5s, 20s}) {
    archive_.clear();
    archive_.now_ns = 0;
    SampleCase sample(archive_);
    for (const std::size_t each : {0U, 1U}) stamp(sample, each, 0s);
    for (int entry = 0; entry < 2; ++entry) {
      archive_.now_ns += 30 * kSecond;
      sample.writer().append({archive::ClockEntry{true, 0, 0, 0, -100'500'000}}, archive_.now());
    }
    for (const std::size_t each : {0U, 1U}) stamp(sample, each, set);
    const archive::VerificationReport report = stamped_to_its_end(sample);
    EXPECT_EQ(report.verdict, set == 5s ? archive::Verdict::kIntact : archive::Verdict::kTampered)
        << details(report);
    EXPECT_THAT(details(report), testing::HasSubstr("by up to 6.040 s in all"));
  }
}

// As a virtual machine sees it: wall clock and authorities go on, and CLOCK_BOOTTIME stands.
TEST_F(OutsideClocks, AMachineThatWasPausedFromOutsideMakesNoSoundCaseTampered) {
  SampleCase sample(archive_);
  for (const std::size_t each : {0U, 1U}) stamp(sample, each, 0s);
  archive_.now_ns += 5 * kSecond;
  sample.writer().append({archive::ClockEntry{true, 0, 0, 60 * kSecond, {}}}, archive_.now());
  for (const std::size_t each : {0U, 1U}) stamp(sample, each, 60s);
  const archive::VerificationReport report = closed(sample);
  EXPECT_EQ(report.verdict, archive::Verdict::kUnproven) << details(report);
  EXPECT_THAT(details(report), testing::HasSubstr("a virtual machine that was paused"));
}

TEST_F(OutsideClocks, OneThatIsSetMakesNoSoundCaseTampered) {
  for (const auto set : {10s, -10s}) {
    const archive::VerificationReport report = verify(1, {set, 0s});
    EXPECT_EQ(report.verdict, archive::Verdict::kUnproven) << details(report);
    EXPECT_THAT(summary(report), testing::HasSubstr("unproven\nauthority-clock-differs tokens/"));
  }
}

TEST_F(OutsideClocks, AnotherOneThatAgreesWithTheCaseSaysWhichWasSet) {
  const archive::VerificationReport report = verify(2, {10s, 0s});
  EXPECT_EQ(report.verdict, archive::Verdict::kIntact) << details(report);
  EXPECT_THAT(summary(report), testing::HasSubstr("authority-clock-set tokens/"));
}

TEST_F(OutsideClocks, TwoThatAreSetDifferentWaysProveNoTime) {
  const archive::VerificationReport report = verify(2, {10s, -10s});
  EXPECT_EQ(report.verdict, archive::Verdict::kUnproven) << details(report);
}

// A minute of film that was made in five, or five minutes of which four are missing.
TEST_F(OutsideClocks, TwoThatSayTheSameShowACaseClockThatWasMadeUp) {
  for (const auto set : {240s, -50s}) {
    const archive::VerificationReport report = verify(2, {set, set});
    EXPECT_EQ(report.verdict, archive::Verdict::kTampered) << details(report);
    EXPECT_THAT(summary(report), testing::HasSubstr("clock-contradicted tokens/"));
  }
}

}  // namespace
}  // namespace kiroku::test
