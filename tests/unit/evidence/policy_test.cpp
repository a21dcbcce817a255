#include "evidence/policy.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/evidence_kit.h"

namespace kiroku::evidence {
namespace {

using test::day;

constexpr const char* kPolicy = R"(
name = "Example"
publisher = "Somebody"
issued = 2026-11-24
renew_before_days = 90
new_hash = "sha512"

[[algorithm]]
name = "sha256"
until = 2034-12-31
[[algorithm]]
name = "sha512"
[[algorithm]]
name = "rsa"
minimum_bits = 2048
until = 2030-12-31
[[algorithm]]
name = "rsa"
minimum_bits = 3000
until = 2036-12-31
)";

std::string refusal_of(const std::string& text) {
  try {
    Policy::parse(text, "policy.toml");
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

TEST(EvidencePolicy, CountsUntilTheEndOfTheDayThatIsNamed) {
  const Policy policy = Policy::parse(kPolicy, "policy.toml");
  EXPECT_EQ(policy.name(), "Example");
  EXPECT_EQ(policy.renew_before(), std::chrono::days(90));
  EXPECT_EQ(policy.new_hash(), crypto::HashAlgorithm::kSha512);
  EXPECT_TRUE(policy.hash("sha256").holds_at(day("2035-01-01") - std::chrono::microseconds(1)));
  EXPECT_FALSE(policy.hash("sha256").holds_at(day("2035-01-01")));
  EXPECT_TRUE(policy.hash("sha512").holds_at(day("2999-01-01")));
}

TEST(EvidencePolicy, WhatItDoesNotListCountsNever) {
  const Policy policy = Policy::parse(kPolicy, "policy.toml");
  EXPECT_FALSE(policy.hash("sha3-256").holds_at(day("2026-01-01")));
  EXPECT_FALSE(policy.signature({"ecdsa", 256, "sha256"}).holds_at(day("2026-01-01")));
  EXPECT_FALSE(policy.signature({"rsa", 1024, "sha256"}).holds_at(day("2026-01-01")));
  EXPECT_FALSE(policy.signature({"rsa", 2048, "sha1"}).holds_at(day("2026-01-01")));
}

TEST(EvidencePolicy, ASignatureEndsWithTheEarlierOfKeyAndHash) {
  const Policy policy = Policy::parse(kPolicy, "policy.toml");
  EXPECT_EQ(policy.signature({"rsa", 2048, "sha256"}).end, day("2031-01-01"));
  EXPECT_EQ(policy.signature({"rsa", 4096, "sha256"}).end, day("2035-01-01"));  // the hash
  EXPECT_EQ(policy.signature({"rsa", 4096, "sha512"}).end, day("2037-01-01"));
}

TEST(EvidencePolicy, OfSeveralEntriesThatFitTheLatestEndCounts) {
  const Policy policy = Policy::parse(
      "[[algorithm]]\nname=\"sha256\"\n[[algorithm]]\nname=\"rsa\"\nminimum_bits=4000\n[[algorithm]]\n"
      "name=\"rsa\"\nuntil=2030-12-31\n",
      "p");
  EXPECT_FALSE(policy.signature({"rsa", 4096, "sha256"}).end);
  EXPECT_EQ(policy.signature({"rsa", 2048, "sha256"}).end, day("2031-01-01"));
  EXPECT_EQ(policy.new_hash(), crypto::HashAlgorithm::kSha256);
}

TEST(EvidencePolicy, WithoutOneNothingEnds) {
  const Policy policy = Policy::without_ends();
  EXPECT_FALSE(policy.was_given());
  EXPECT_TRUE(policy.hash("sha3-512").holds_at(day("2999-01-01")));
  EXPECT_TRUE(policy.signature({"ecdsa", 256, "sha256"}).holds_at(day("2999-01-01")));
  EXPECT_FALSE(policy.hash("md5").holds_at(day("2026-01-01")));
}

TEST(EvidencePolicy, RefusesWhatIsNoPolicyByItsPlace) {
  EXPECT_TRUE(refusal_of("x = ").starts_with("policy.toml:1:5: is not TOML: "));
  // What toml++ would not survive.
  EXPECT_EQ(refusal_of("name = \"a\"\n [[ @lgorithm]]\n"),
            "policy.toml:2: no name stands behind the bracket that begins the line");
  EXPECT_EQ(refusal_of("name = \"a\"\n["),
            "policy.toml:2: no name stands behind the bracket that begins the line");
  EXPECT_EQ(refusal_of("\xD0\x9An"),
            "policy.toml:1: holds a control character, or one that is not ASCII; write it as \\u and four "
            "hexadecimal digits");
  EXPECT_EQ(refusal_of("until = 3\n"),
            "policy.toml:1:1: unknown key 'until'; known are name, publisher, issued, renew_before_days, "
            "new_hash, algorithm");
  EXPECT_EQ(refusal_of("[[algorithm]]\nname = \"md5\"\n"),
            "policy.toml:1:1: 'md5' is no algorithm known here; known are sha256, sha384, sha512, sha3-256, "
            "sha3-384, sha3-512, rsa, dsa, ecdsa, ed25519, ed448 and ml-dsa-44");
  EXPECT_TRUE(refusal_of("[[algorithm]]\nname = \"sha256\"\nuntil = 2023-02-30\n")
                  .starts_with("policy.toml:3:19: is not TOML: "));
  EXPECT_EQ(refusal_of("[[algorithm]]\nname = \"sha256\"\nuntil = \"2023-02-03\"\n"),
            "policy.toml:3:9: 'until' must be a day from 1970 on, as 2040-12-31");
  EXPECT_EQ(refusal_of("[[algorithm]]\nname = \"sha256\"\nminimum_bits = 256\n"),
            "policy.toml:1:1: a hash has no 'minimum_bits'");
  EXPECT_EQ(refusal_of("new_hash = \"sha512\"\n[[algorithm]]\nname = \"sha256\"\n"),
            "policy.toml:1:12: 'new_hash' must be one of the hashes that the policy lists");
  EXPECT_EQ(refusal_of("renew_before_days = -1\n[[algorithm]]\nname = \"sha256\"\n"),
            "policy.toml:1:21: 'renew_before_days' must be a whole number from 0 to 3650");
  EXPECT_EQ(refusal_of("name = \"empty\"\n"),
            "policy.toml is no policy of algorithms: write each one as a table, [[algorithm]] with its name");
  EXPECT_EQ(refusal_of("[[algorithm]]\nname = \"rsa\"\n"),
            "policy.toml is no policy of algorithms: it lists no hash");
  EXPECT_EQ(refusal_of(std::string(kMaximumPolicyBytes + 1, ' ')),
            "policy.toml is no policy of algorithms: it has more than 1 MiB");
}

}  // namespace
}  // namespace kiroku::evidence
