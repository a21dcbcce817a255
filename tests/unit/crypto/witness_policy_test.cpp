#include "crypto/witness_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::crypto {
namespace {

using testing::HasSubstr;
using State = CosignatureCheck::State;

class WitnessPolicyTest : public testing::Test {
 protected:
  [[nodiscard]] std::string witness(std::size_t i, const std::string& more = "") const {
    return "witness W" + std::to_string(i) + " " + CosignerKey(name(i), keys[i].public_key()).to_string() +
           more + "\n";
  }
  [[nodiscard]] std::string witnesses(std::size_t count) const {
    std::string text;
    for (std::size_t i = 0; i < count; ++i) text += witness(i);
    return text;
  }
  static std::string name(std::size_t i) { return "w" + std::to_string(i) + ".example"; }
  [[nodiscard]] static std::string refusal(const std::string& text) {
    try {
      WitnessPolicy::parse(text, "policy.txt");
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was refused";
  }

  std::vector<SigningKey> keys = [] {
    std::vector<SigningKey> made;
    for (int i = 0; i < 6; ++i) made.push_back(SigningKey::generate());
    return made;
  }();
};

// A file that is no policy may have one word of megabytes.
TEST_F(WitnessPolicyTest, QuotesTheBeginningOfWhatIsNone) {
  const std::string word(1U << 20U, 'w');
  for (const std::string& text :
       {word + "\n", "witness a " + word + "\n", "log " + word + "\n", "quorum " + word + "\n",
        witness(0) + "group g " + word + " W0\n", "log a+00000000+" + word + "\n"}) {
    EXPECT_LT(refusal(text).size(), 1'000U) << text.substr(0, 20);
    EXPECT_THAT(refusal(text), HasSubstr("\u2026")) << text.substr(0, 20);
  }
}

TEST_F(WitnessPolicyTest, CountsAsItsGroupsSay) {
  // The example of tlog-policy.md: two of three, and one of three others.
  const WitnessPolicy policy = WitnessPolicy::parse(
      "# two houses\n\n" + witnesses(6) +
          " group X 2 W0 W1 W2\n\tgroup Y any W3 W4 W5  \ngroup both all X Y\nquorum both\n",
      "policy.txt");
  EXPECT_EQ(policy.witnesses().size(), 6U);
  EXPECT_FALSE(policy.asks_for_none());
  for (unsigned set = 0; set < 64; ++set) {
    std::vector<bool> has(6);
    int x = 0, y = 0;
    for (unsigned i = 0; i < 6; ++i) {
      has[i] = (set >> i & 1U) != 0;
      (i < 3 ? x : y) += has[i] ? 1 : 0;
    }
    EXPECT_EQ(policy.is_met(has), x >= 2 && y >= 1) << set;
  }
}

TEST_F(WitnessPolicyTest, MayAskForOneOrNone) {
  const WitnessPolicy one = WitnessPolicy::parse(witnesses(2) + "quorum W1\n", "p");
  EXPECT_TRUE(one.is_met({false, true}));
  EXPECT_FALSE(one.is_met({true, false}));
  const WitnessPolicy none = WitnessPolicy::parse("quorum none\n", "p");
  EXPECT_TRUE(none.asks_for_none());
  EXPECT_TRUE(none.is_met({}));
}

TEST_F(WitnessPolicyTest, KeepsAddressesAndLogs) {
  const VerifierKey log("log.example", keys[0].public_key());
  const WitnessPolicy policy = WitnessPolicy::parse("log " + log.to_string() + " https://log.example/\n" +
                                                        witness(1, " http://w1.example/") + "quorum W1\n",
                                                    "p");
  EXPECT_EQ(policy.logs().at(0).key, log);
  EXPECT_EQ(policy.logs().at(0).url, "https://log.example/");
  EXPECT_EQ(policy.witnesses().at(0).url, "http://w1.example/");
}

TEST_F(WitnessPolicyTest, RefusesWithTheLine) {
  EXPECT_THAT(refusal(""), HasSubstr("it has no line 'quorum NAME'"));
  EXPECT_THAT(refusal(witness(0) + "quorum W0"),
              HasSubstr("line 2: the last line does not end with a newline"));
  EXPECT_THAT(refusal(witness(0) + "quorum W1\n"), HasSubstr("line 2: 'W1' is not defined on a line before"));
  EXPECT_THAT(refusal("quorum W0\n" + witness(0)), HasSubstr("line 1: 'W0' is not defined"));
  EXPECT_THAT(refusal(witness(0) + witness(0) + "quorum W0\n"),
              HasSubstr("line 2: the same key stands as a witness"));
  EXPECT_THAT(refusal("witness none " + CosignerKey("a", keys[0].public_key()).to_string() + "\n"),
              HasSubstr("'none' is no name"));
  EXPECT_THAT(refusal(witnesses(2) + "group G 3 W0 W1\nquorum G\n"), HasSubstr("from 1 to 2"));
  EXPECT_THAT(refusal(witnesses(2) + "group G 0 W0 W1\nquorum G\n"), HasSubstr("from 1 to 2"));
  EXPECT_THAT(refusal(witnesses(2) + "group G all\nquorum G\n"), HasSubstr("a group is"));
  EXPECT_THAT(refusal(witnesses(2) + "group G all W0 W0\nquorum G\n"),
              HasSubstr("'W0' is in a group already"));
  EXPECT_THAT(refusal(witnesses(2) + "group G any W0\ngroup H any W0 W1\nquorum H\n"),
              HasSubstr("line 4: 'W0' is in a group already"));
  EXPECT_THAT(refusal(witnesses(1) + "quorum W0\nquorum W0\n"), HasSubstr("there is a quorum already"));
  EXPECT_THAT(refusal("witnes W0 x\n"), HasSubstr("'witnes' is none of log, witness, group, quorum"));
  EXPECT_THAT(refusal("witness W0 nonsense\n"), HasSubstr("line 1: \"nonsense\" is no verifier key"));
  EXPECT_THAT(refusal("log " + CosignerKey("a", keys[0].public_key()).to_string() + "\n"),
              HasSubstr("its algorithm is not Ed25519"));
  EXPECT_THAT(refusal("witness W0 \x01\n"), HasSubstr("control character"));
}

TEST_F(WitnessPolicyTest, JudgesTheLinesOfANote) {
  const std::string text = "log.example\n7\nCsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=\n";
  const SigningKey log = SigningKey::generate();
  const WitnessPolicy policy = WitnessPolicy::parse(witnesses(3) + "group G 2 W0 W1 W2\nquorum G\n", "p");
  constexpr std::uint64_t kNow = 1'800'000'000;
  const auto cosigned = [&](std::size_t i, std::uint64_t time_s) {
    return cosign(text, name(i), keys[i], time_s);
  };
  std::string note =
      sign_note(text, "log.example", log) + cosigned(0, kNow - 5) + cosign(text, "stranger", log, kNow);
  WitnessedNote judged = judge_witnesses(policy, note, kNow);
  EXPECT_FALSE(judged.quorum);
  EXPECT_EQ(judged.cosigners.at(0).check.state, State::kValid);
  EXPECT_EQ(judged.cosigners.at(0).check.time_s, kNow - 5);
  EXPECT_EQ(judged.cosigners.at(0).name, "w0.example");
  EXPECT_EQ(judged.cosigners.at(1).check.state, State::kAbsent);
  // One of the far future does not count, one of a clock that is some minutes ahead does.
  EXPECT_FALSE(judge_witnesses(policy, note + cosigned(1, kNow + 1'000'000), kNow).quorum);
  EXPECT_TRUE(judge_witnesses(policy, note + cosigned(1, kNow + 600), kNow).quorum);
  // Another witness's cosignature under one's own name does not count.
  EXPECT_FALSE(judge_witnesses(policy, note + cosign(text, name(1), keys[0], kNow), kNow).quorum);
}

TEST_F(WitnessPolicyTest, CountsBothAlgorithmsAndEachOnlyWhileItHolds) {
  const MlDsaPrivateKey ml_dsa = MlDsaPrivateKey::generate(MlDsaSet::k44);
  const CosignerKey by_ml_dsa = CosignerKey::of_ml_dsa_44("post.example", ml_dsa.public_key());
  const std::string list = witness(0) + "witness P " + by_ml_dsa.to_string() + "\n";
  const auto both = WitnessPolicy::parse(list + "group both all W0 P\nquorum both\n", "policy.txt");
  const auto any = WitnessPolicy::parse(list + "group any any W0 P\nquorum any\n", "policy.txt");
  const std::string text = Checkpoint{"log", 7, {}}.to_text();
  const std::string plain = sign_note(text, "log", keys[5]) + cosign(text, name(0), keys[0], 5);
  const std::string note = plain + cosign(text, "post.example", ml_dsa, 5);
  EXPECT_FALSE(judge_witnesses(both, plain, 5).quorum);
  EXPECT_TRUE(judge_witnesses(both, note, 5).quorum);
  EXPECT_FALSE(judge_witnesses(both, note, 5, {.ed25519 = false}).quorum);
  EXPECT_FALSE(judge_witnesses(both, note, 5, {.ml_dsa_44 = false}).quorum);
  EXPECT_TRUE(judge_witnesses(any, note, 5, {.ed25519 = false}).quorum);
  EXPECT_TRUE(judge_witnesses(any, note, 5, {.ml_dsa_44 = false}).quorum);
  EXPECT_FALSE(judge_witnesses(any, note, 5, {.ed25519 = false, .ml_dsa_44 = false}).quorum);
  EXPECT_FALSE(judge_witnesses(any, plain, 5, {.ed25519 = false}).quorum);
  EXPECT_EQ(judge_witnesses(any, note, 5, {.ml_dsa_44 = false}).cosigners[1].check.state, State::kValid);
  EXPECT_THAT(refusal(list + "witness Q " + by_ml_dsa.to_string() + "\nquorum none\n"),
              HasSubstr("would count twice"));
}

}  // namespace
}  // namespace kiroku::crypto
