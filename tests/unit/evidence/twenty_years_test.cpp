// Twenty years of one record, played with authorities whose certificates end: SHA-256, then SHA-512, then
// SHA3-512. No clock is read: every time is stated.
#include <gtest/gtest.h>

#include "base/error.h"
#include "evidence/renewal.h"
#include "tests/support/evidence_kit.h"

namespace kiroku::evidence {
namespace {

using crypto::HashAlgorithm;
using test::codes_of;
using test::day;
using test::hash_of;
using test::object_of;
using test::PlayedAuthority;

class TwentyYears : public ::testing::Test {
 protected:
  static constexpr const char* kData = "ledger of 2026";
  static constexpr const char* kMore = "a segment of it";
  static constexpr const char* kOther = "another case";

  TwentyYears() {
    for (const PlayedAuthority* authority : {&first_, &second_, &third_}) {
      trust_.add_trusted(bytes_of(authority->root_pem()), "root");
    }
    records_ = begin_records(HashAlgorithm::kSha256, groups(HashAlgorithm::kSha256), first_.at("2026-11-01"));
    records_ = renew_time_stamps(std::move(records_), second_.at("2031-11-01"));
    records_ = renew_hash_trees(std::move(records_), HashAlgorithm::kSha512, groups(HashAlgorithm::kSha512),
                                second_.at("2034-06-01"));
    records_ = renew_time_stamps(std::move(records_), third_.at("2039-03-01"));
    records_ = renew_hash_trees(std::move(records_), HashAlgorithm::kSha3_512,
                                groups(HashAlgorithm::kSha3_512), third_.at("2044-05-01"));
  }
  static std::vector<HashList> groups(HashAlgorithm algorithm) {
    return {{hash_of(algorithm, kData), hash_of(algorithm, kMore)}, {hash_of(algorithm, kOther)}};
  }
  static Policy policy(const std::string& ends) {
    std::string text;
    for (const char* name : {"sha384", "sha3-256", "sha3-384", "sha3-512", "ecdsa"}) {
      text += std::string("[[algorithm]]\nname=\"") + name + "\"\n";
    }
    for (const char* name : {"sha256", "sha512"}) {
      if (ends.find(std::string("\"") + name) == std::string::npos) {
        text += std::string("[[algorithm]]\nname=\"") + name + "\"\n";
      }
    }
    return Policy::parse(text + ends, "policy.toml");
  }
  RecordJudgement judge(const EvidenceRecord& record, const Policy& policy,
                        const std::string& today = "2046-11-01") const {
    return judge_record(record, {object_of(kData), object_of(kMore)},
                        {.trust = &trust_, .policy = &policy, .now = day(today)});
  }
  RecordJudgement judge(const EvidenceRecord& record) const { return judge(record, Policy::without_ends()); }
  std::string first_problem(const EvidenceRecord& record) const {
    const RecordJudgement judgement = judge(record);
    return judgement.problems.empty() ? "" : judgement.problems.front().text;
  }

  PlayedAuthority first_{"First", "2026-01-01", "2032-01-01"};
  PlayedAuthority second_{"Second", "2030-01-01", "2040-01-01"};
  PlayedAuthority third_{"Third", "2038-01-01", "2050-01-01"};
  timestamp::TrustStore trust_;
  std::vector<EvidenceRecord> records_;
};

TEST_F(TwentyYears, AfterTwoAuthoritiesHaveExpiredItHolds) {
  const RecordJudgement judgement = judge(records_[0]);
  EXPECT_EQ(codes_of(judgement), "");
  EXPECT_EQ(judgement.standing(), Standing::kHolds);
  EXPECT_EQ(judgement.since(), day("2026-11-01"));
  EXPECT_EQ(judgement.newest(), day("2044-05-01"));
  EXPECT_TRUE(judgement.outside());
  EXPECT_EQ(judgement.time_stamps.size(), 5U);
  EXPECT_EQ(judgement.end->time, day("2050-01-01"));
  EXPECT_EQ(judgement.covered_from, (std::vector<std::optional<std::size_t>>{0, 0}));
  for (const TimeStampJudgement& each : judgement.time_stamps) {
    EXPECT_EQ(each.other_values, each.index == 0 ? 0U : each.other_values);
    EXPECT_TRUE(each.imprint_fits);
  }
  // The other case's record holds for the other case, and for it alone.
  const Policy none = Policy::without_ends();
  const JudgingRules rules{.trust = &trust_, .policy = &none, .now = day("2046-11-01")};
  EXPECT_EQ(codes_of(judge_record(records_[1], {object_of(kOther)}, rules)), "");
  EXPECT_EQ(codes_of(judge(records_[1])),
            "record-data-not-covered record-data-not-covered record-data-not-covered");
}

TEST_F(TwentyYears, ItSurvivesBeingWrittenAndReadEachTime) {
  const RecordParse parse = parse_record(encode_record(records_[0]));
  ASSERT_TRUE(parse.record) << parse.explanation;
  EXPECT_EQ(codes_of(judge(*parse.record)), "");
}

// A stranger's key may be as slow as they like, and a record may have hundreds of their tokens.
TEST_F(TwentyYears, OfStrangersTokensSomeAreJudgedWholly) {
  const PlayedAuthority stranger("Stranger", "2026-01-01", "2050-01-01");
  EvidenceRecord record =
      begin_records(HashAlgorithm::kSha256, groups(HashAlgorithm::kSha256), stranger.at("2026-11-01"))[0];
  record.chains[0].resize(kMostJudgedStrangers + 20, record.chains[0][0]);
  std::size_t strangers = 0, not_looked_at = 0;
  for (const Problem& each : judge(record).problems) {
    strangers += each.code == "token-issuer-unknown" ? 1U : 0U;
    not_looked_at += each.text.ends_with("whether its signature holds was not looked at") ? 1U : 0U;
  }
  EXPECT_EQ(strangers, kMostJudgedStrangers + 20);
  EXPECT_EQ(not_looked_at, 20U);
}

TEST_F(TwentyYears, AnAlgorithmThatEndedAfterItsRenewalBreaksNothing) {
  const Policy after = policy(
      "[[algorithm]]\nname=\"sha256\"\nuntil=2099-12-31\n"
      "[[algorithm]]\nname=\"sha512\"\nuntil=2044-05-31\n");
  EXPECT_EQ(codes_of(judge(records_[0], after)), "");
}

TEST_F(TwentyYears, AnAlgorithmThatEndedBeforeItsRenewalBreaksTheChain) {
  const Policy before = policy(
      "[[algorithm]]\nname=\"sha256\"\nuntil=2099-12-31\n"
      "[[algorithm]]\nname=\"sha512\"\nuntil=2044-04-29\n");
  const RecordJudgement judgement = judge(records_[0], before);
  EXPECT_EQ(codes_of(judgement), "record-renewed-too-late");
  EXPECT_EQ(judgement.standing(), Standing::kRefused);
  EXPECT_EQ(
      judgement.problems[0].text,
      "archiveTimeStampSequence[1][0] rests on sha512, which ended at 2044-04-30T00:00:00.000000Z, and the "
      "next time-stamp came at 2044-05-01T00:00:00.000000Z, after that");
}

// The tokens themselves are signed over SHA-256, whatever they stamp.
TEST_F(TwentyYears, AnAlgorithmOfSignaturesCountsLikewise) {
  const Policy ended = policy("[[algorithm]]\nname=\"sha256\"\nuntil=2034-12-31\n");
  const RecordJudgement judgement = judge(records_[0], ended);
  EXPECT_EQ(judgement.standing(), Standing::kRefused);
  EXPECT_EQ(judgement.problems[0].place, "archiveTimeStampSequence[1][0]");
  EXPECT_NE(judgement.problems[0].text.find("ecdsa with 256 bits over sha256"), std::string::npos);
}

TEST_F(TwentyYears, WhatThePolicyDoesNotListCountsNever) {
  const Policy unlisted =
      Policy::parse("[[algorithm]]\nname=\"sha256\"\n[[algorithm]]\nname=\"ecdsa\"\n", "p");
  EXPECT_EQ(codes_of(judge(records_[0], unlisted)),
            "record-algorithm-not-listed record-algorithm-not-listed");
}

TEST_F(TwentyYears, ALinkThatCameTooLateIsRefused) {
  const std::string kLate = "2032-02-01";
  std::vector<EvidenceRecord> late =
      begin_records(HashAlgorithm::kSha256, groups(HashAlgorithm::kSha256), first_.at("2026-11-01"));
  late = renew_time_stamps(std::move(late), second_.at(kLate));
  const RecordJudgement judgement = judge(late[0], Policy::without_ends(), "2033-01-01");
  EXPECT_EQ(codes_of(judgement), "record-renewed-too-late");
  EXPECT_EQ(
      judgement.problems[0].text,
      "archiveTimeStampSequence[0][0] rests on a certificate of CN=First,O=Test, which ended at "
      "2032-01-01T00:00:00.000000Z, and the next time-stamp came at 2032-02-01T00:00:00.000000Z, after that");
}

TEST_F(TwentyYears, ARecordThatNobodyRenewedLapses) {
  const RecordJudgement judgement = judge(records_[0], Policy::without_ends(), "2050-01-01");
  EXPECT_EQ(codes_of(judgement), "record-lapsed");
  EXPECT_EQ(judgement.standing(), Standing::kCouldNotCheck);
}

TEST_F(TwentyYears, EveryLinkThatIsCutOutIsMissed) {
  for (std::size_t chain = 0; chain < records_[0].chains.size(); ++chain) {
    for (std::size_t index = 0; index < records_[0].chains[chain].size(); ++index) {
      EvidenceRecord cut = records_[0];
      cut.chains[chain].erase(cut.chains[chain].begin() + std::ptrdiff_t(index));
      if (cut.chains[chain].empty()) cut.chains.erase(cut.chains.begin() + std::ptrdiff_t(chain));
      // Without the newest link the record is what it was before that came, and lasts no longer.
      const bool newest = chain == 2;
      EXPECT_EQ(judge(cut).standing(), newest ? Standing::kHolds : Standing::kRefused)
          << place_of(chain, index) << ": " << first_problem(cut);
      if (newest) {
        EXPECT_EQ(judge(cut).newest(), day("2039-03-01"));
      }
    }
  }
}

TEST_F(TwentyYears, EveryTwoLinksThatChangePlacesAreRefused) {
  std::vector<std::pair<std::size_t, std::size_t>> places;
  for (std::size_t chain = 0; chain < records_[0].chains.size(); ++chain) {
    for (std::size_t index = 0; index < records_[0].chains[chain].size(); ++index) {
      places.emplace_back(chain, index);
    }
  }
  for (std::size_t a = 0; a < places.size(); ++a) {
    for (std::size_t b = a + 1; b < places.size(); ++b) {
      EvidenceRecord swapped = records_[0];
      std::swap(swapped.chains[places[a].first][places[a].second],
                swapped.chains[places[b].first][places[b].second]);
      EXPECT_EQ(judge(swapped).standing(), Standing::kRefused) << a << " and " << b;
    }
  }
}

TEST_F(TwentyYears, EveryLinkOfAnotherRecordIsRefused) {
  for (std::size_t chain = 0; chain < records_[0].chains.size(); ++chain) {
    for (std::size_t index = 0; index < records_[0].chains[chain].size(); ++index) {
      EvidenceRecord foreign = records_[0];
      foreign.chains[chain][index] = records_[1].chains[chain][index];
      // Two records that were renewed with one token share that link where its tree covers one value.
      if (foreign.chains[chain][index].reduced_tree == records_[0].chains[chain][index].reduced_tree)
        continue;
      EXPECT_EQ(judge(foreign).standing(), Standing::kRefused) << place_of(chain, index);
    }
  }
}

TEST_F(TwentyYears, OtherBytesAreRefusedInEachChain) {
  const Policy none = Policy::without_ends();
  const RecordJudgement judgement =
      judge_record(records_[0], {object_of(kData), object_of("a changed segment")},
                   {.trust = &trust_, .policy = &none, .now = day("2046-11-01")});
  EXPECT_EQ(codes_of(judgement), "record-data-not-covered record-data-not-covered record-data-not-covered");
  EXPECT_EQ(
      judgement.problems[0].text,
      "archiveTimeStampSequence[0][0] does not cover a changed segment: it is of other data, or these bytes "
      "are not those that were time-stamped");
}

// Once SHA-256 is broken, somebody finds other bytes with the old hash. The chain of 2034 knows better.
TEST_F(TwentyYears, BytesThatOnlyTheBrokenHashTakesForTheOldOnesAreRefused) {
  const DataObject forged{
      "forged", [](HashAlgorithm algorithm) {
        return std::optional(hash_of(algorithm, algorithm == HashAlgorithm::kSha256 ? kMore : "forged"));
      }};
  const Policy none = Policy::without_ends();
  const RecordJudgement judgement = judge_record(
      records_[0], {object_of(kData), forged}, {.trust = &trust_, .policy = &none, .now = day("2046-11-01")});
  EXPECT_EQ(codes_of(judgement), "record-data-not-covered record-data-not-covered");
  EXPECT_EQ(judgement.problems[0].place, "archiveTimeStampSequence[1][0]");
}

TEST_F(TwentyYears, WithoutItsRootALinkCouldNotBeChecked) {
  timestamp::TrustStore two;
  two.add_trusted(bytes_of(first_.root_pem()), "root");
  two.add_trusted(bytes_of(third_.root_pem()), "root");
  const RecordJudgement judgement =
      judge_record(records_[0], {object_of(kData)}, {.trust = &two, .now = day("2046-11-01")});
  EXPECT_EQ(codes_of(judgement), "token-issuer-unknown token-issuer-unknown");
  EXPECT_EQ(judgement.standing(), Standing::kCouldNotCheck);
}

TEST_F(TwentyYears, OneLinkOfTheRecordersOwnAuthorityMakesAllOfItSelfIssued) {
  timestamp::TrustStore own;
  own.add_trusted(bytes_of(first_.root_pem()), "root");
  own.add_trusted(bytes_of(third_.root_pem()), "root");
  own.add_own_authority(bytes_of(second_.root_pem()), "root");
  const RecordJudgement judgement =
      judge_record(records_[0], {object_of(kData)}, {.trust = &own, .now = day("2046-11-01")});
  EXPECT_EQ(codes_of(judgement), "");
  EXPECT_FALSE(judgement.outside());
}

TEST_F(TwentyYears, WhatCameLaterMayBeCoveredFromALaterChainOn) {
  const std::string kLater = "a token that came later";
  std::vector<EvidenceRecord> grown =
      begin_records(HashAlgorithm::kSha256, {groups(HashAlgorithm::kSha256)[0]}, first_.at("2026-11-01"));
  HashList group = groups(HashAlgorithm::kSha512)[0];
  group.push_back(hash_of(HashAlgorithm::kSha512, kLater));
  grown = renew_hash_trees(std::move(grown), HashAlgorithm::kSha512, {group}, second_.at("2031-06-01"));
  JudgingRules rules{.trust = &trust_, .now = day("2033-01-01")};
  const std::vector<DataObject> objects{object_of(kData), object_of(kLater)};
  EXPECT_EQ(codes_of(judge_record(grown[0], objects, rules)), "record-data-not-covered");
  rules.objects_may_join = true;
  const RecordJudgement judgement = judge_record(grown[0], objects, rules);
  EXPECT_EQ(codes_of(judgement), "");
  EXPECT_EQ(judgement.covered_from, (std::vector<std::optional<std::size_t>>{0, 1}));
  EXPECT_EQ(judgement.time_stamps[1].other_values, 1U);  // the segment that was not given
  // What was there once and is gone from a later chain did not join: it was left out.
  const EvidenceRecord left_out =
      renew_hash_trees({grown[0]}, HashAlgorithm::kSha3_512, {{hash_of(HashAlgorithm::kSha3_512, kLater)}},
                       second_.at("2032-06-01"))[0];
  EXPECT_EQ(codes_of(judge_record(left_out, objects, rules)), "record-data-not-covered");
}

TEST_F(TwentyYears, DataThatCannotBeReadLeavesTheAnswerOpen) {
  const DataObject gone{"gone", [](HashAlgorithm) { return std::nullopt; }};
  const RecordJudgement judgement =
      judge_record(records_[0], {object_of(kData), gone}, {.trust = &trust_, .now = day("2046-11-01")});
  EXPECT_EQ(codes_of(judgement), "record-data-not-read record-data-not-read record-data-not-read");
  EXPECT_EQ(judgement.standing(), Standing::kCouldNotCheck);
}

TEST_F(TwentyYears, ATimeStampOfTheFutureIsNotBelieved) {
  const RecordJudgement judgement = judge(records_[0], Policy::without_ends(), "2044-04-30");
  EXPECT_EQ(codes_of(judgement), "record-from-the-future");
  EXPECT_EQ(judgement.standing(), Standing::kCouldNotCheck);
}

TEST_F(TwentyYears, AnotherHashThanTheTokensOwnIsRefused) {
  EvidenceRecord record = records_[0];
  record.chains[1][0].digest_algorithm = named_hash(HashAlgorithm::kSha3_512);  // of the same length
  EXPECT_EQ(judge(record).standing(), Standing::kRefused);
  EXPECT_NE(codes_of(judge(record)).find("record-imprint-differs"), std::string::npos);
  record = records_[0];
  record.chains[0][1].digest_algorithm = named_hash(HashAlgorithm::kSha3_256);
  EXPECT_NE(codes_of(judge(record)).find("record-algorithm-differs"), std::string::npos);
  record = records_[0];
  record.chains[0][0].digest_algorithm->algorithm.reset();
  record.chains[0][0].digest_algorithm->name = "md5";
  EXPECT_NE(codes_of(judge(record)).find("record-algorithm-unknown"), std::string::npos);
}

// What `kiroku renew` goes by.
TEST_F(TwentyYears, IsDueWhenSomethingEndsSoon) {
  const Policy ends = policy("[[algorithm]]\nname=\"sha256\"\nuntil=2031-12-30\n");
  const std::vector<EvidenceRecord> begun =
      begin_records(HashAlgorithm::kSha256, groups(HashAlgorithm::kSha256), third_.at("2039-03-01"));
  const auto due = [&](const EvidenceRecord& record, const Policy& by, const std::string& today) {
    return what_is_due(judge(record, by, today), by, day(today));
  };
  const Policy none = Policy::without_ends();
  EXPECT_EQ(due(begun[0], none, "2045-01-01").what, Due::What::kNothing);
  EXPECT_EQ(due(begun[0], none, "2045-01-01").before, day("2050-01-01"));
  const Due soon = due(begun[0], none, "2049-08-01");
  EXPECT_EQ(soon.what, Due::What::kTimeStampRenewal);
  EXPECT_EQ(soon.reason, "a certificate of CN=Third,O=Test ends at 2050-01-01T00:00:00.000000Z");
  EXPECT_EQ(due(begun[0], none, "2050-01-01").what, Due::What::kTooLate);

  const std::vector<EvidenceRecord> early =
      begin_records(HashAlgorithm::kSha256, groups(HashAlgorithm::kSha256), second_.at("2031-03-01"));
  const Due rehash = due(early[0], ends, "2031-08-01");
  EXPECT_EQ(rehash.what, Due::What::kHashTreeRenewal);
  EXPECT_EQ(rehash.reason, "sha256 ends at 2031-12-31T00:00:00.000000Z");
  EXPECT_EQ(due(early[0], ends, "2031-04-01").what, Due::What::kNothing);
}

TEST_F(TwentyYears, AnAuthorityThatDoesNotAnswerChangesNothing) {
  const std::vector<EvidenceRecord> before = records_;
  const Stamp away = [](HashAlgorithm, ByteView) -> Bytes { throw Error("nobody answers"); };
  EXPECT_THROW(renew_time_stamps(records_, away), Error);
  EXPECT_EQ(encode_record(records_[0]), encode_record(before[0]));
}

}  // namespace
}  // namespace kiroku::evidence
