#include "evidence/policy.h"

#include <string>
#include <utility>

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
  EXPECT_EQ(refusal_of("name = "),
            "policy.toml:1:8: has no value; write a text in quotation marks, a whole number, or a day as "
            "2040-12-31");
  EXPECT_EQ(refusal_of("until = 3\n"),
            "policy.toml:1:1: unknown key 'until'; known are name, publisher, issued, renew_before_days, "
            "new_hash");
  EXPECT_EQ(refusal_of("[[algorithm]]\nname = \"md5\"\n"),
            "policy.toml:1:1: 'md5' is no algorithm known here; known are sha256, sha384, sha512, sha3-256, "
            "sha3-384, sha3-512, rsa, dsa, ecdsa, ed25519, ed448 and ml-dsa-44");
  EXPECT_EQ(refusal_of("[[algorithm]]\nname = \"sha256\"\nuntil = 2023-02-30\n"),
            "policy.toml:3:9: '2023-02-30' is no day from 1970 on; write one as 2040-12-31");
  EXPECT_EQ(refusal_of("[[algorithm]]\nname = \"sha256\"\nuntil = \"2023-02-03\"\n"),
            "policy.toml:3:9: 'until' must be a day from 1970 on, as 2040-12-31");
  EXPECT_EQ(refusal_of("[[algorithm]]\nname = \"sha256\"\nminimum_bits = 256\n"),
            "policy.toml:1:1: a hash has no 'minimum_bits'; leave it out");
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

TEST(EvidencePolicy, ReadsItsFormsOfToml) {
  const Policy policy = Policy::parse(
      "# a policy\r\n\"name\" = \"\\u0050olicy \\\"1\\\"\\t\\U0001F600\"  # its name\r\n"
      "publisher = 'C:\\x'\nrenew_before_days = +1_0\n  [[ algorithm ]]  # one\n\tname=\"sha256\"#\n"
      "'until' = 2040-02-29\n[[\"algorithm\"]]\nname = \"rsa\"\nminimum_bits = 0",
      "policy.toml");
  EXPECT_EQ(policy.name(), "Policy \"1\"\t\xF0\x9F\x98\x80");
  EXPECT_EQ(policy.renew_before(), std::chrono::days(10));
  EXPECT_EQ(policy.hash("sha256").end, day("2040-03-01"));
  EXPECT_TRUE(policy.signature({"rsa", 1, ""}).listed);
}

TEST(EvidencePolicy, RefusesEachOtherFormByItsPlaceAndSaysWhatToDo) {
  const std::pair<const char*, const char*> kRefused[] = {
      {"name = \"a\"\nname = \"b\"\n", "2:1: 'name' stands in line 1 already; leave one of them out"},
      {"[[algorithm]]\nname = \"rsa\"\n\"name\" = 'rsa'\n", "3:1: 'name' stands in line 2 already"},
      {"name = \"a\nb\"\n", "1:10: the text does not end on its line"},
      {"name = \"\"\"a\"\"\"\n", "1:8: begins a text of several lines; write it on one"},
      {"name = '''a'''\n", "1:8: begins a text of several lines"},
      {"name = \"\\x41\"\n", "1:9: '\\' begins what TOML does not know"},
      {"name = \"\\ud800\"\n", "1:9: '\\' begins what TOML does not know"},
      {"name = \"\\u12\"\n", "1:9: '\\' begins what TOML does not know"},
      {"name = \"\\U00110000\"\n", "1:9: '\\' begins what TOML does not know"},
      {"name = \"\\", "1:9: '\\' begins what TOML does not know"},
      {"name = \"a\" b\n", "1:12: stands behind what the line says"},
      {"name \"a\"\n", "1:6: no '=' stands behind the key"},
      {"a.b = 1\n", "1:2: no '=' stands behind the key"},
      {"= 1\n", "1:1: is no key; write a line as: key = value"},
      {"[[ @lgorithm]]\n", "1:4: is no key"},
      {"[", "1:2: is no key"},
      {"[[algorithm]\n", "1:12: the bracket that begins the line is not closed; write [[algorithm]]"},
      {"[algorithm]\n", "1:1: a policy has no table 'algorithm' in such brackets; write [[algorithm]]"},
      {"[[hash]]\n", "1:1: a policy has no table 'hash' in such brackets"},
      {"algorithm = 1\n", "1:1: write each algorithm as a table, [[algorithm]] with its name"},
      {"algorithm = [{name = \"sha256\"}]\n", "1:13: '[{name' is no value of a policy"},
      {"renew_before_days = 0x10\n", "1:21: '0x10' is no value of a policy"},
      {"renew_before_days = 010\n", "1:21: '010' is no value of a policy"},
      {"renew_before_days = 1__0\n", "1:21: '1__0' is no value of a policy"},
      {"renew_before_days = 99999999999999999999\n", "1:21: '99999999999999999999' is no value"},
      {"renew_before_days = 1.0\n", "1:21: '1.0' is no value of a policy"},
      {"renew_before_days = \"1\"\n", "1:21: 'renew_before_days' must be a whole number"},
      {"issued = 2026-11-24T00:00:00Z\n", "1:10: '2026-11-24T00:00:00Z' is no value of a policy"},
      {"issued = 1969-12-31\n", "1:10: '1969-12-31' is no day from 1970 on"},
      {"issued = 2026-13-01\n", "1:10: '2026-13-01' is no day from 1970 on"},
      {"name = true\n", "1:8: 'true' is no value of a policy"},
      {"name = 2026-11-24\n", "1:8: 'name' must be a text in quotation marks"},
      {"\xEF\xBB\xBFname = 'a'\n", "1:1: holds a control character, or one that is not ASCII"},
      {"name = 'a'\rpublisher = 'b'\n", "1:11: holds a control character"},
      {"[[algorithm]]\nuntil = 2040-12-31\n", "1:1: an [[algorithm]] has no 'name'; write one"},
  };
  for (const auto& [text, why] : kRefused)
    EXPECT_TRUE(refusal_of(text).starts_with(std::string("policy.toml:") + why))
        << text << " is refused as " << refusal_of(text);
  std::string many, wide;
  for (int i = 0; i < 1'001; ++i) many += "[[algorithm]]\nname = \"rsa\"\n";
  EXPECT_TRUE(refusal_of(many).starts_with("policy.toml:2001:1: more than 1,000 algorithms"));
  for (int i = 0; i < 101; ++i) wide += "k" + std::to_string(i) + " = 1\n";
  EXPECT_TRUE(refusal_of(wide).starts_with("policy.toml:101:1: a table with more than 100 keys"));
}

}  // namespace
}  // namespace kiroku::evidence
