#include "evidence/record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "evidence/hash_tree.h"
#include "tests/support/evidence_kit.h"
#include "timestamp/der.h"

namespace kiroku::evidence {
namespace {

using crypto::HashAlgorithm;
using test::hash_of;
using test::PlayedAuthority;
using timestamp::der_value;

constexpr auto kHashOfRecord = HashAlgorithm::kSha256;

class EvidenceRecordTest : public ::testing::Test {
 protected:
  EvidenceRecordTest() {
    std::vector<EvidenceRecord> records = begin_records(
        kHashOfRecord,
        {{hash_of(kHashOfRecord, "a"), hash_of(kHashOfRecord, "b")}, {hash_of(kHashOfRecord, "c")}},
        authority_.at("2026-02-01"));
    records = renew_time_stamps(std::move(records), authority_.at("2027-02-01"));
    records =
        renew_hash_trees(std::move(records), HashAlgorithm::kSha3_512,
                         {{hash_of(HashAlgorithm::kSha3_512, "a"), hash_of(HashAlgorithm::kSha3_512, "b")},
                          {hash_of(HashAlgorithm::kSha3_512, "c")}},
                         authority_.at("2028-02-01"));
    record_ = records.front();
  }
  static std::string refusal_of(ByteView der) {
    const RecordParse parse = parse_record(der);
    EXPECT_NE(parse.record.has_value(), !parse.explanation.empty());
    return parse.explanation;
  }
  std::string refusal_of_changed() const {
    try {
      encode_record(record_);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  PlayedAuthority authority_{"First", "2026-01-01", "2046-01-01"};
  EvidenceRecord record_;
};

TEST_F(EvidenceRecordTest, GoesIntoDerAndComesBack) {
  const Bytes der = encode_record(record_);
  const RecordParse parse = parse_record(der);
  ASSERT_TRUE(parse.record) << parse.explanation;
  EXPECT_EQ(encode_record(*parse.record), der);
  EXPECT_EQ(parse.record->digest_algorithms.size(), 2U);
  EXPECT_EQ(parse.record->digest_algorithms[1].name, "sha3-512");
  ASSERT_EQ(parse.record->chains.size(), 2U);
  ASSERT_EQ(parse.record->chains[0].size(), 2U);
  EXPECT_EQ(parse.record->chains[0][1].token, record_.chains[0][1].token);
  EXPECT_EQ(parse.record->chains[0][0].reduced_tree, record_.chains[0][0].reduced_tree);
  EXPECT_EQ(parse.record->chains[1][0].digest_algorithm->algorithm, HashAlgorithm::kSha3_512);
}

TEST_F(EvidenceRecordTest, KeepsWhatItDoesNotUnderstand) {
  // One attribute: type 1.2.3, a set of one INTEGER.
  const Bytes attribute = der_value(0x30, {der_value(0x06, {Bytes{std::byte{0x2a}, std::byte{3}}}),
                                           der_value(0x31, {der_value(0x02, {Bytes{std::byte{5}}})})});
  record_.crypto_infos = der_value(0xa0, {attribute});
  record_.encryption_info = der_value(0xa1, {der_value(0x06, {Bytes{std::byte{0x2a}, std::byte{3}}}),
                                             der_value(0x04, {Bytes{std::byte{1}}})});
  record_.chains[0][0].attributes = der_value(0xa1, {attribute});
  const RecordParse parse = parse_record(encode_record(record_));
  ASSERT_TRUE(parse.record) << parse.explanation;
  EXPECT_EQ(parse.record->crypto_infos, record_.crypto_infos);
  EXPECT_EQ(parse.record->encryption_info, record_.encryption_info);
  EXPECT_EQ(parse.record->chains[0][0].attributes, record_.chains[0][0].attributes);
}

TEST_F(EvidenceRecordTest, OpenSslReadsTheSame) {
  // The DER of chains that a hash-tree renewal covers stands in the record as it is.
  const Bytes der = encode_record(record_);
  const Bytes chain = encode_chain(record_.chains[0]);
  EXPECT_NE(std::search(der.begin(), der.end(), chain.begin(), chain.end()), der.end());
}

TEST_F(EvidenceRecordTest, EveryShorterPieceIsRefused) {
  const Bytes der = encode_record(record_);
  for (std::size_t size = 0; size < der.size(); size += 7) {
    EXPECT_NE(refusal_of(ByteView(der).first(size)), "") << size;
  }
}

TEST_F(EvidenceRecordTest, TrailingBytesAreRefused) {
  Bytes der = encode_record(record_);
  der.push_back(std::byte{0});
  EXPECT_EQ(refusal_of(der), "the file is no DER value, or holds more than one");
}

TEST_F(EvidenceRecordTest, RefusalsNameThePlace) {
  const EvidenceRecord sound = record_;
  record_.chains[1][0].reduced_tree[0][1] = Bytes(19, std::byte{1});
  EXPECT_EQ(refusal_of_changed(),
            "cannot write an evidence record: "
            "archiveTimeStampSequence[1][0].reducedHashtree[0][1] is no hash value");
  record_ = sound;
  record_.chains[0][1].token = der_value(0x30, {});
  EXPECT_EQ(refusal_of_changed(), "") << "an empty token is one for the token's judge";
  record_ = sound;
  record_.chains.push_back({});
  EXPECT_EQ(refusal_of_changed(),
            "cannot write an evidence record: archiveTimeStampSequence[2] is an empty chain");
  record_ = sound;
  record_.chains.clear();
  EXPECT_EQ(refusal_of_changed(), "cannot write an evidence record: archiveTimeStampSequence is empty");
  record_ = sound;
  record_.chains[0][0].reduced_tree = {{}};
  EXPECT_EQ(refusal_of_changed(),
            "cannot write an evidence record: "
            "archiveTimeStampSequence[0][0].reducedHashtree[0] is an empty list");
}

TEST_F(EvidenceRecordTest, MoreThanMayBeIsRefusedBeforeItIsRead) {
  const EvidenceRecord sound = record_;
  record_.chains[0][0].reduced_tree.assign(kMostHashLists + 1, {Bytes(32, std::byte{1})});
  EXPECT_EQ(refusal_of_changed(),
            "cannot write an evidence record: archiveTimeStampSequence[0][0]."
            "reducedHashtree[64] is one list more than the 64 that may be");
  record_ = sound;
  record_.chains.assign(kMostChains + 1, sound.chains[1]);
  EXPECT_EQ(refusal_of_changed(),
            "cannot write an evidence record: archiveTimeStampSequence[64] is one chain "
            "more than the 64 that may be");
  record_ = sound;
  record_.chains[1].assign(kMostTimeStamps + 1, sound.chains[0][0]);
  EXPECT_EQ(refusal_of_changed(),
            "cannot write an evidence record: archiveTimeStampSequence[1][510] is one "
            "time-stamp more than the 512 that may be");
  record_ = sound;
  record_.chains[0][0].token = der_value(0x30, {der_value(0x04, {Bytes(kMaximumPartBytes)})});
  EXPECT_EQ(refusal_of_changed(),
            "cannot write an evidence record: archiveTimeStampSequence[0][0].timeStamp has more than 1 MiB");
  EXPECT_EQ(refusal_of(Bytes(kMaximumRecordBytes + 1)), "the file has more than 32 MiB");
}

// Each renewal covers all chains before it: judged by themselves, 64 large ones would take 32 times as long
// as their bytes.
TEST_F(EvidenceRecordTest, AsManyRenewalsOfLargeChainsAreReadAsTakeTimeInProportionToTheirBytes) {
  ArchiveTimeStampChain large = record_.chains[1];
  large[0].reduced_tree = {HashList(8'000, Bytes(64, std::byte{1}))};
  const std::size_t bytes = encode_chain(large).size();
  const auto fits = [&](std::size_t chains) {
    return bytes * chains * (chains - 1) / 2 <= kMostTimesHashedAgain * bytes * chains + kAlwaysHashedAgain;
  };
  std::size_t most = 1;
  while (fits(most + 1)) ++most;
  ASSERT_GT(most, 17U);
  ASSERT_LT(most, kMostChains);
  record_.chains.assign(most, large);
  EXPECT_EQ(refusal_of_changed(), "");
  record_.chains.assign(most + 1, large);
  EXPECT_THAT(refusal_of_changed(),
              ::testing::StartsWith("cannot write an evidence record: archiveTimeStampSequence[" +
                                    std::to_string(most) + "] is one renewal too many: "));
  // Small ones may be as many as there may be chains.
  record_.chains.assign(kMostChains, {{std::nullopt, {}, {}, der_value(0x30, {})}});
  EXPECT_EQ(refusal_of_changed(), "");
}

TEST_F(EvidenceRecordTest, OtherThingsAreRefused) {
  EXPECT_EQ(refusal_of(bytes_of("<EvidenceRecord/>")), "the file is no DER value, or holds more than one");
  EXPECT_EQ(refusal_of(record_.chains[0][0].token), "version is missing: this is no evidence record");
  Bytes der = encode_record(record_);
  const Bytes one{std::byte{2}, std::byte{1}, std::byte{1}};
  *(std::search(der.begin(), der.end(), one.begin(), one.end()) + 2) = std::byte{2};
  EXPECT_EQ(refusal_of(der), "version is not 1, the only one of RFC 4998");
}

// Other octets of the same values would have another hash than the one that a renewal covers.
TEST_F(EvidenceRecordTest, WhatIsNoDerIsRefused) {
  const Bytes der = encode_record(record_);
  const auto whole = timestamp::sole_element(der, 0x30);
  ASSERT_TRUE(whole);
  Bytes longer{std::byte{0x30}, std::byte{0x84}};  // the length in four octets, where two do
  for (int shift = 24; shift >= 0; shift -= 8)
    longer.push_back(std::byte(whole->content.size() >> unsigned(shift)));
  append(longer, whole->content);
  EXPECT_EQ(refusal_of(longer), "the file is no DER value, or holds more than one");
  // A set whose members are not in order.
  const auto attribute = [](std::byte last) {
    return der_value(0x30, {der_value(0x06, {Bytes{std::byte{0x2a}, last}}),
                            der_value(0x31, {der_value(0x02, {Bytes{std::byte{5}}})})});
  };
  const Bytes first = attribute(std::byte{3});
  const Bytes second = attribute(std::byte{4});
  record_.chains[0][0].attributes = der_value(0xa1, {first, second});
  Bytes other = encode_record(record_);
  EXPECT_EQ(refusal_of(other), "");
  const auto at = std::search(other.begin(), other.end(), first.begin(), first.end());
  std::copy(second.begin(), second.end(), at);
  std::copy(first.begin(), first.end(), at + std::ssize(first));
  EXPECT_EQ(refusal_of(other), "the record is not in DER");
}

}  // namespace
}  // namespace kiroku::evidence
