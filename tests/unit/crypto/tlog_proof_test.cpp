#include "crypto/tlog_proof.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "crypto/cosignature.h"
#include "crypto/merkle_tree.h"
#include "crypto/witness_policy.h"

namespace kiroku::crypto {
namespace {

using testing::HasSubstr;

// Another implementation's proof of an entry in a log of four, cosigned by one witness: tr/c2sp/testdata/
// test.tlog-proof, its entry and keys, of github.com/project-oak/oak at commit 578b95116bac (Apache-2.0).
constexpr std::string_view kOakProof =
    "c2sp.org/tlog-proof@v1\n"
    "index 3\n"
    "JBLYbBgEHNZMP9yBly3cVyFLQPqn+z0YdjoHdksDJeY=\n"
    "R71E/0J8A2l+L5ZFDuy/fy59xnJFGYNDRo6pKoqoihc=\n"
    "\n"
    "fake.log.origin/log\n"
    "4\n"
    "CPv9hH0ShT6k/WU9QZeh1bV7bYeUOkrnBuCLCQG9GgE=\n"
    "\n"
    "\u2014 fake.log.origin/log "
    "Un6ruNthJe4tf267eyOp8N1FYcK5AoY5b6v53qa6uDg33Xn5PqIaP35NSw87oCw+krzzJliWc5C7KqPV0oPyNxQ2awA=\n"
    "\u2014 test-witness "
    "JjSe8AAAAABpmI8+HVh4f06FDH/kr4CtoQ63zVC31E8aT7JHzJMkLcOEIAGPiBG/"
    "IatdHdPk1mKe23SDzKi04+Tmzub1qcwuVG78DQ==\n";
constexpr std::string_view kOakOrigin = "fake.log.origin/log";
constexpr std::string_view kOakEntry = "test entry data";
const VerifierKey kOakLog =
    VerifierKey::parse("fake.log.origin/log+527eabb8+AddT9PtBhhNAsDYZ0V0euiRbXuvrLsw4L6vKARfipnmz");
constexpr const char* kOakWitness = "test-witness+26349ef0+BIQDFTUlktisMqJzWn8qhteWrRr4dLcQ9R37T+8LQyQF";

TlogProof oak() { return *parse_tlog_proof(kOakProof).proof; }

TEST(TlogProof, AnotherImplementationsProofHoldsAndIsWrittenAgain) {
  const ParsedTlogProof parsed = parse_tlog_proof(kOakProof);
  ASSERT_TRUE(parsed.proof) << parsed.why;
  EXPECT_EQ(parsed.proof->index, 3U);
  EXPECT_EQ(parsed.proof->path.size(), 2U);
  EXPECT_EQ(parsed.proof->to_text(), kOakProof);
  const VerifiedTlogProof verified =
      verify_tlog_proof(*parsed.proof, bytes_of(kOakEntry), {kOakLog}, kOakOrigin);
  ASSERT_TRUE(verified.checkpoint) << verified.why;
  EXPECT_EQ(verified.checkpoint->size, 4U);
  EXPECT_THAT(verified.signers, testing::ElementsAre(kOakLog));
  const auto policy = WitnessPolicy::parse("witness w1 " + std::string(kOakWitness) + "\nquorum w1\n", "p");
  const WitnessedNote judged = judge_witnesses(policy, parsed.proof->note, 1'800'000'000);
  EXPECT_TRUE(judged.quorum);
  EXPECT_EQ(judged.cosigners[0].check.time_s, 0x69988f3eU);
}

// An entry of a real log of 76,959 entries, by the same source: tr/c2sp, TEST_REAL_PROOF_HASHES.
TEST(TlogProof, AnEntryOfARealLogLeadsToItsRoot) {
  const std::string text =
      "c2sp.org/tlog-proof@v1\nindex 76958\n"
      "fGRlLyuz+L9Jb8+uTSut/2aVc4z7fKFW+clvsb6xjEM=\nF6LautOHD5eppkWC0xn/lz00X5g2yLlZAkl2jCI/wdE=\n"
      "qH7OJxFNup+TDvJuohd2HphKVngfMeMzUK8QChEDcas=\n+Y3g758yXtPCRh/eqhLTA3bdcx+cCV1Uah0JdgB0YEs=\n"
      "vq8cJSjj8dPVmFBRUqDLlaMqW6aAYR2GKugVhgudXLs=\nJ0z3X5qTb9WFC1gABhVFx0bW1rVZRL+DAoBL2e2h4G4=\n"
      "NmSbYg25xNFzTRerIsF3HbEMyTIDqW87AQd9ekzopE8=\nL8BZipjURnkctkjJtGJs+YyTXMssvNKA7+a8nV2JT/s=\n"
      "pva4RFzCejMkVMVmYc93As2lbk7WAyrw58TvrzEOjNc=\n\n";
  const SigningKey key = SigningKey::generate();
  const std::string note =
      sign_note("tesseroak\n76959\nQYfrD7XAd4qUHbRBs4dDyDZwpZN4M/cccXr2G56pxkY=\n", "tesseroak", key);
  const ParsedTlogProof parsed = parse_tlog_proof(text + note);
  ASSERT_TRUE(parsed.proof) << parsed.why;
  const std::vector<VerifierKey> keys{VerifierKey("tesseroak", key.public_key())};
  EXPECT_TRUE(verify_tlog_proof(*parsed.proof, bytes_of("hello tesseroak\n"), keys, "tesseroak").checkpoint);
  EXPECT_FALSE(verify_tlog_proof(*parsed.proof, bytes_of("hello tesseroak"), keys, "tesseroak").checkpoint);
}

TEST(TlogProof, TellsWhichOfSeveralKeysOfOneNameSignedIt) {
  const SigningKey one = SigningKey::generate(), other = SigningKey::generate(),
                   third = SigningKey::generate();
  const std::vector<VerifierKey> keys{VerifierKey("or-1", one.public_key()),
                                      VerifierKey("or-1", other.public_key()),
                                      VerifierKey("or-1", third.public_key())};
  const Sha256Digest root = merkle_leaf_hash(bytes_of("entry"));
  const std::string text = Checkpoint{"kiroku/or-1/log", 1, root}.to_text();
  const auto signers_of = [&](const std::string& note) {
    TlogProof proof;
    proof.note = note;
    const VerifiedTlogProof verified = verify_tlog_proof(proof, bytes_of("entry"), keys, "kiroku/or-1/log");
    EXPECT_TRUE(verified.checkpoint) << verified.why;
    return verified.signers;
  };
  const std::string by_other = sign_note(text, "or-1", other);
  EXPECT_THAT(signers_of(by_other), testing::ElementsAre(keys[1]));
  const std::string by_third = sign_note(text, "or-1", third);
  EXPECT_THAT(signers_of(by_other + by_third.substr(by_third.rfind("\u2014"))),
              testing::ElementsAre(keys[1], keys[2]));
}

TEST(TlogProof, ShowsNothingWhereAnythingIsAnother) {
  const auto why = [](const TlogProof& proof, std::string_view entry = kOakEntry,
                      const std::vector<VerifierKey>& keys = {kOakLog},
                      std::string_view origin = kOakOrigin) {
    const VerifiedTlogProof verified = verify_tlog_proof(proof, bytes_of(entry), keys, origin);
    EXPECT_FALSE(verified.checkpoint);
    return verified.why;
  };
  EXPECT_THAT(why(oak(), "test entry dat"), HasSubstr("do not lead from the entry"));
  TlogProof changed = oak();
  changed.index = 2;
  EXPECT_THAT(why(changed), HasSubstr("do not lead from the entry"));
  changed.index = 4;
  EXPECT_THAT(why(changed), HasSubstr("do not lead from the entry"));
  changed = oak();
  changed.path.pop_back();
  EXPECT_THAT(why(changed), HasSubstr("do not lead from the entry"));
  changed = oak();
  changed.path.push_back(changed.path[0]);
  EXPECT_THAT(why(changed), HasSubstr("do not lead from the entry"));
  changed = oak();
  std::swap(changed.path[0], changed.path[1]);
  EXPECT_THAT(why(changed), HasSubstr("do not lead from the entry"));
  EXPECT_THAT(why(oak(), kOakEntry, {kOakLog}, "another"),
              HasSubstr("of another log, \"fake.log.origin/log\""));
  EXPECT_THAT(why(oak(), kOakEntry, {}), HasSubstr("no key that was given"));
  const VerifierKey other("fake.log.origin/log", SigningKey::generate().public_key());
  EXPECT_THAT(why(oak(), kOakEntry, {other}), HasSubstr("no key that was given"));
  changed = oak();
  changed.note.replace(changed.note.find("Un6ruNth"), 8, "Un6ruNtA");
  EXPECT_THAT(why(changed), HasSubstr("its checkpoint does not hold"));
  changed.note = "no checkpoint\n";
  EXPECT_THAT(why(changed), HasSubstr("its checkpoint is none"));
}

TEST(TlogProof, ExtraDataIsKeptAndProvesNothing) {
  TlogProof proof = oak();
  proof.extra = to_bytes(bytes_of("anything"));
  const ParsedTlogProof again = parse_tlog_proof(proof.to_text());
  ASSERT_TRUE(again.proof) << again.why;
  EXPECT_EQ(again.proof->extra, proof.extra);
  EXPECT_TRUE(verify_tlog_proof(*again.proof, bytes_of(kOakEntry), {kOakLog}, kOakOrigin).checkpoint);
}

TEST(TlogProof, RefusesWhatIsNoneByLineAndReason) {
  const std::string hash = "JBLYbBgEHNZMP9yBly3cVyFLQPqn+z0YdjoHdksDJeY=\n";
  const std::string first = "c2sp.org/tlog-proof@v1\n";
  const auto why = [](const std::string& text) { return parse_tlog_proof(text).why; };
  EXPECT_EQ(why(""), "line 1 is not 'c2sp.org/tlog-proof@v1'");
  EXPECT_EQ(why("c2sp.org/tlog-proof@v2\nindex 0\n\nx\n"), "line 1 is not 'c2sp.org/tlog-proof@v1'");
  EXPECT_EQ(why("c2sp.org/tlog-proof@v1\r\nindex 0\n\nx\n"), "line 1 is not 'c2sp.org/tlog-proof@v1'");
  EXPECT_EQ(why(first), "line 2 is not 'index NUMBER'");
  EXPECT_EQ(why(first + "extra !!\nindex 0\n\nx\n"), "line 2 has no base64 behind 'extra'");
  EXPECT_EQ(why(first + "extra dGVzdA\nindex 0\n\nx\n"), "line 2 has no base64 behind 'extra'");
  EXPECT_EQ(why(first + "extra dGVzdA==\nextra dGVzdA==\nindex 0\n\nx\n"), "line 3 is not 'index NUMBER'");
  for (const char* index : {"", "-5", "+5", "05", "5 ", "0x5", "18446744073709551616"})
    EXPECT_EQ(why(first + "index " + index + "\n\nx\n"), "line 2 has no number behind 'index'") << index;
  EXPECT_TRUE(parse_tlog_proof(first + "index 18446744073709551615\n\nx\n").proof);
  EXPECT_EQ(why(first + "index 0\n" + hash),
            "line 4 is not there: an empty line and a checkpoint follow the hashes");
  EXPECT_EQ(why(first + "index 0\nAAAA\n\nx\n"), "line 3 is no SHA-256 hash in base64");
  EXPECT_EQ(why(first + "index 0\n" + hash.substr(0, 43) + "\n\nx\n"), "line 3 is no SHA-256 hash in base64");
  EXPECT_EQ(why(first + "index 0\n\n"), "line 4 is not there: a checkpoint follows the empty line");
  std::string high = first + "index 0\n";
  for (std::size_t i = 0; i < TlogProof::kMostHashes; ++i) high += hash;
  EXPECT_TRUE(parse_tlog_proof(high + "\nx\n").proof);
  EXPECT_EQ(why(high + hash + "\nx\n"), "line 66 is one hash more than any tree's proof has");
  EXPECT_EQ(why(first + std::string(TlogProof::kMostBytes, 'a')), "it has more than 2 MiB");
}

// As a checkpoint of somebody else's log may have.
TEST(TlogProof, ExtensionLinesOfTheCheckpointAreAllowed) {
  const SigningKey key = SigningKey::generate();
  const Sha256Digest leaf = merkle_leaf_hash(bytes_of("entry"));
  Checkpoint checkpoint{"log", 1, leaf};
  TlogProof proof;
  proof.note = sign_note(checkpoint.to_text() + "an extension\n", "log", key);
  const std::vector<VerifierKey> keys{VerifierKey("log", key.public_key())};
  const VerifiedTlogProof verified = verify_tlog_proof(proof, bytes_of("entry"), keys, "log");
  ASSERT_TRUE(verified.checkpoint) << verified.why;
  EXPECT_EQ(*verified.checkpoint, checkpoint);
}

}  // namespace
}  // namespace kiroku::crypto
