#include "archive/verify/record_choice.h"

#include <algorithm>
#include <optional>

#include <gtest/gtest.h>

#include "archive/upkeep/evidence_renewal.h"
#include "base/error.h"
#include "evidence/renewal.h"
#include "tests/support/case_kit.h"
#include "tests/support/evidence_kit.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using crypto::HashAlgorithm;
using test::day;
using test::PlayedAuthority;

class RecordChoices : public ::testing::Test {
 protected:
  RecordChoices() {
    trust_.add_trusted(bytes_of(first_.root_pem()), "first");
    trust_.add_trusted(bytes_of(second_.root_pem()), "second");
    trust_.add_own_authority(bytes_of(own_.root_pem()), "own");
  }

  /// A record of the case that is begun at this time.
  [[nodiscard]] Bytes begun(const std::string& today, const PlayedAuthority& authority) const {
    fs::remove_all(record_file().parent_path());
    return renewed(today, authority);
  }
  /// The record that lies beside the case, renewed where that is due.
  [[nodiscard]] Bytes renewed(const std::string& today, const PlayedAuthority& authority,
                              const std::string& policy = "") const {
    EvidenceRenewalOptions options;
    options.trust = &trust_;
    options.now = [today] { return day(today); };
    options.stamp = authority.at(today);
    if (!policy.empty()) options.policy = evidence::Policy::parse(policy, "policy.toml");
    const EvidenceRenewal done = renew_evidence(real_file_system(), {case_}, options).front();
    EXPECT_NE(done.what, EvidenceRenewal::What::kRefused) << done.text;
    return to_bytes(test::contents(record_file()));
  }
  [[nodiscard]] RecordChoice choose(const std::vector<Bytes>& records, const std::string& today,
                                    std::optional<Bytes> known = {}) const {
    const CaseFolder folder = CaseFolder::open(case_);
    return choose_record(
        folder, records, {.trust = &trust_, .policy = nullptr, .now = day(today)},
        [&](const crypto::Sha256Digest& each) { return known && crypto::sha256(*known) == each; });
  }
  /// A hash-tree renewal over data that is not the case's, by an authority that is trusted.
  [[nodiscard]] Bytes over_other_data(const Bytes& record, const std::string& today) const {
    evidence::HashList others;
    for (char c = 'a'; c <= 'z'; ++c) others.push_back(test::hash_of(HashAlgorithm::kSha512, {c}));
    return evidence::encode_record(evidence::renew_hash_trees({*evidence::parse_record(record).record},
                                                              HashAlgorithm::kSha512, {others},
                                                              second_.at(today))
                                       .front());
  }
  [[nodiscard]] fs::path record_file() const { return evidence_file(case_, case_.filename().string()); }

  test::SampleArchive archive_;
  const fs::path case_ = test::SampleCase::write(archive_);
  PlayedAuthority first_{"First", "2026-01-01", "2034-01-01"};
  PlayedAuthority second_{"Second", "2026-01-01", "2050-01-01"};
  PlayedAuthority own_{"Own", "2020-01-01", "2050-01-01"};
  timestamp::TrustStore trust_;
};

TEST_F(RecordChoices, TheEarliestProofIsTakenAndOfItTheNewestRenewal) {
  const Bytes later = begun("2028-01-01", second_);
  const Bytes early = begun("2027-01-01", first_);
  const Bytes longer = renewed("2033-10-01", second_);
  ASSERT_NE(longer, early);
  std::vector<Bytes> all{later, early, longer};
  std::ranges::sort(all);
  do {
    const RecordChoice choice = choose(all, "2033-11-01");
    EXPECT_EQ(all[choice.index], longer);
    EXPECT_TRUE(choice.holds);
  } while (std::next_permutation(all.begin(), all.end()));
}

TEST_F(RecordChoices, OneThatLapsedIsNotTakenForItsAge) {
  const Bytes early = begun("2027-01-01", first_);
  const Bytes later = begun("2028-01-01", second_);
  EXPECT_EQ(choose({early, later}, "2033-12-01").index, 0U);
  EXPECT_EQ(choose({early, later}, "2034-06-01").index, 1U);
}

TEST_F(RecordChoices, TheRecordersOwnWordIsNoEarlierTime) {
  const Bytes outside = begun("2028-01-01", second_);
  const Bytes own = begun("2021-01-01", own_);
  const RecordChoice choice = choose({own, outside}, "2029-01-01");
  EXPECT_EQ(choice.index, 1U);
  EXPECT_TRUE(choice.holds);
}

TEST_F(RecordChoices, ARenewalOverOtherDataTakesNobodysPlace) {
  const Bytes early = begun("2027-01-01", first_);
  const Bytes forged = over_other_data(early, "2033-10-01");
  const RecordChoice choice = choose({forged, early}, "2033-11-01");
  EXPECT_EQ(choice.index, 1U);
  EXPECT_TRUE(choice.holds);
  // What was compared before is not compared again.
  EXPECT_EQ(choose({forged, early}, "2033-11-01", forged).index, 0U);
}

TEST_F(RecordChoices, AHashTreeRenewalIsTakenWhereItCoversWhatIsThere) {
  const std::string policy =
      "new_hash = \"sha512\"\n[[algorithm]]\nname = \"sha256\"\nuntil = 2039-12-31\n"
      "[[algorithm]]\nname = \"sha512\"\n[[algorithm]]\nname = \"ecdsa\"\n[[algorithm]]\nname = "
      "\"ed25519\"\n";
  const Bytes early = begun("2027-01-01", second_);
  const Bytes hashed = renewed("2039-10-01", second_, policy);
  EXPECT_EQ(choose({early, hashed}, "2039-11-01").index, 1U);
  // A segment that cannot be read any more is under no new hash: the older record still says SHA-256 of it.
  const fs::path segment = case_ / "segments/endoscope/00000000.ts.age";
  fs::resize_file(segment, fs::file_size(segment) - 1);
  const RecordChoice choice = choose({early, hashed}, "2039-11-01");
  EXPECT_EQ(choice.index, 0U);
  EXPECT_TRUE(choice.holds);
}

TEST_F(RecordChoices, WhereNoneHoldsTheLikeliestIsTold) {
  const fs::path other = test::SampleCase::write(archive_);
  const Bytes early = begun("2027-01-01", first_);
  const Bytes nonsense = to_bytes("no record");
  const RecordChoice choice = choose({nonsense, early}, "2040-01-01");
  EXPECT_EQ(choice.index, 1U);
  EXPECT_FALSE(choice.holds);
  EXPECT_FALSE(choose({nonsense}, "2040-01-01").holds);
}

}  // namespace
}  // namespace kiroku::archive
