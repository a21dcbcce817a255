#include "crypto/cosignature.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/cosigning_key.h"
#include "crypto/encoding.h"
#include "crypto/note_format.h"

namespace kiroku::crypto {
namespace {

using testing::HasSubstr;
using State = CosignatureCheck::State;

// The example of C2SP tlog-cosignature.md. Its keys are not stated there, so that only its form can be read.
constexpr const char* kExample =
    "example.com/behind-the-sofa\n20852163\nCsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=\n\n"
    "\u2014 example.com/behind-the-sofa "
    "Az3grlgtzPICa5OS8npVmf1Myq/5IZniMp+ZJurmRDeOoRDe4URYN7u5/Zhcyv2q1gGzGku9nTo+zyWE+xeMcTOAYQ8=\n"
    "\u2014 witness.example.com/w1 "
    "jWbPPwAAAABkGFDLEZMHwSRaJNiIDoe9DYn/"
    "zXcrtPHeolMI5OWXEhZCB9dlrDJsX3b2oyin1nPZqhf5nNo0xUe+mbIUBkBIfZ+qnA==\n";
constexpr std::uint64_t kExampleTime = 1679315147;  // as the document says

const std::string kText = "log.example\n7\nCsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=\n";

class Cosignature : public testing::Test {
 protected:
  [[nodiscard]] std::string note_with(const std::string& line) const {
    return sign_note(kText, "log.example", log_key) + line;
  }

  const SigningKey log_key = SigningKey::generate(), key = SigningKey::generate();
  const CosignerKey cosigner{"w.example/1", key.public_key()};
};

TEST_F(Cosignature, IsTheSignatureOfTheDocumentedMessage) {
  const std::string line = cosign(kText, "w.example/1", key, kExampleTime);
  const std::string note = note_with(line);
  const CosignatureCheck check = check_cosignature(note, cosigner);
  EXPECT_EQ(check.state, State::kValid);
  EXPECT_EQ(check.time_s, kExampleTime);
  const NoteParts parts = parse_note(note);
  ASSERT_EQ(parts.lines.size(), 2U);
  EXPECT_EQ(to_hex(ByteView(parts.lines[1].signature).first(8)), "00000000641850cb");
  EXPECT_TRUE(verify_ed25519(key.public_key(), bytes_of("cosignature/v1\ntime 1679315147\n" + kText),
                             ByteView(parts.lines[1].signature).subspan(8)));
}

TEST_F(Cosignature, OfTheSpecificationHasItsForm) {
  const NoteParts parts = parse_note(kExample);
  ASSERT_EQ(parts.lines.size(), 2U);
  EXPECT_EQ(parts.lines[1].name, "witness.example.com/w1");
  ASSERT_EQ(parts.lines[1].signature.size(), 8U + 64);
  EXPECT_EQ(to_hex(ByteView(parts.lines[1].signature).first(8)), "00000000641850cb");
}

TEST_F(Cosignature, OfAnotherTextTimeNameOrKeyIsNone) {
  const std::string line = cosign(kText, "w.example/1", key, kExampleTime);
  const std::string other_text = "log.example\n8\nCsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=\n";
  EXPECT_EQ(check_cosignature(sign_note(other_text, "log.example", log_key) + line, cosigner).state,
            State::kInvalid);
  EXPECT_EQ(check_cosignature(note_with(line), CosignerKey("w.example/2", key.public_key())).state,
            State::kAbsent);
  EXPECT_EQ(check_cosignature(note_with(line), CosignerKey("w.example/1", log_key.public_key())).state,
            State::kAbsent);
  EXPECT_EQ(check_cosignature(note_with(""), cosigner).state, State::kAbsent);
  EXPECT_EQ(check_cosignature("no note", cosigner).state, State::kAbsent);
  // Its time is signed, too.
  Bytes changed = parse_note(note_with(line)).lines[1].signature;
  changed[7] ^= std::byte{1};
  EXPECT_EQ(
      check_cosignature(note_with(signature_line("w.example/1", cosigner.key_id(), changed)), cosigner).state,
      State::kInvalid);
  changed.pop_back();
  EXPECT_EQ(
      check_cosignature(note_with(signature_line("w.example/1", cosigner.key_id(), changed)), cosigner).state,
      State::kInvalid);
  // A plain signature of the note by the witness's key is no cosignature.
  const std::string plain = signature_line("w.example/1", cosigner.key_id(), key.sign(bytes_of(kText)));
  EXPECT_EQ(check_cosignature(note_with(plain), cosigner).state, State::kInvalid);
}

TEST_F(Cosignature, StatesATime) {
  EXPECT_THROW(cosign(kText, "w", key, 0), UsageError);
  EXPECT_THROW(cosign(kText, "w", key, 1ULL << 63), UsageError);
  // A line of the time 0, signed rightly, is of a subtree and none of a checkpoint.
  Bytes zero(8, std::byte{0});
  append(zero, key.sign(bytes_of("cosignature/v1\ntime 0\n" + kText)));
  EXPECT_EQ(
      check_cosignature(note_with(signature_line("w.example/1", cosigner.key_id(), zero)), cosigner).state,
      State::kInvalid);
}

TEST_F(Cosignature, KeysAreTextsOfTheirOwnKind) {
  const CosignerKey read = CosignerKey::parse(cosigner.to_string());
  EXPECT_EQ(read.name(), "w.example/1");
  EXPECT_EQ(read, cosigner);
  const auto refusal = [](const std::string& text) -> std::string {
    try {
      CosignerKey::parse(text);
    } catch (const UsageError& error) {
      return error.what();
    }
    return "nothing was refused";
  };
  EXPECT_THAT(refusal(VerifierKey("w.example/1", key.public_key()).to_string()),
              HasSubstr("it is the key of a log"));
  EXPECT_THAT(refusal("w+00000000+" + to_base64(Bytes(1313, std::byte{6}), Base64Padding::kPadded)),
              HasSubstr("its id does not belong"));
  EXPECT_THAT(refusal(KeyText{"w", std::byte{0x06}, Bytes(1311)}.to_string()), HasSubstr("1312 bytes"));
  EXPECT_THAT(refusal(KeyText{"w", std::byte{0x05}, Bytes(32)}.to_string()), HasSubstr("is unknown"));
  EXPECT_THAT(refusal(KeyText{std::string(256, 'w'), std::byte{0x06}, Bytes(1312)}.to_string()),
              HasSubstr("at most 255 bytes"));
  EXPECT_THAT(refusal(KeyText{"w", std::byte{0x04}, Bytes(31)}.to_string()), HasSubstr("32 bytes"));
  EXPECT_THAT(refusal("w+00000000+" + to_base64(Bytes(33, std::byte{4}), Base64Padding::kPadded)),
              HasSubstr("its id does not belong"));
  // The verifier of logs refuses a witness's key in turn.
  EXPECT_THROW(VerifierKey::parse(cosigner.to_string()), UsageError);
}

class MlDsaCosignature : public Cosignature {
 protected:
  static constexpr const char* kName = "w.example/1";
  const MlDsaPrivateKey ml_dsa = MlDsaPrivateKey::generate(MlDsaSet::k44);
  const CosignerKey by_ml_dsa = CosignerKey::of_ml_dsa_44(kName, ml_dsa.public_key());

  [[nodiscard]] State state_of(const std::string& text, const std::string& line) const {
    return check_cosignature(sign_note(text, "log.example", log_key) + line, by_ml_dsa).state;
  }
};

TEST_F(MlDsaCosignature, IsTheSignatureOfTheDocumentedStructure) {
  const std::string note = note_with(cosign(kText, kName, ml_dsa, kExampleTime));
  const CosignatureCheck check = check_cosignature(note, by_ml_dsa);
  EXPECT_EQ(check.state, State::kValid);
  EXPECT_EQ(check.time_s, kExampleTime);
  const SignatureLine line = parse_note(note).lines.at(1);
  ASSERT_EQ(line.signature.size(), 8U + 2420);
  // struct cosigned_message of tlog-cosignature.md, field by field.
  const std::string message = to_hex(bytes_of("subtree/v1\n")) + "00" +  // label
                              "0b" + to_hex(bytes_of(kName)) +           // cosigner_name
                              "00000000641850cb" +                       // timestamp
                              "0b" + to_hex(bytes_of("log.example")) +   // log_origin
                              "0000000000000000"
                              "0000000000000007" +  // start, end
                              "0ac5186a91863e8e1d90c808014aa89bf5da8e3ee1d9f07630f0378f68f1ab62";  // hash
  EXPECT_TRUE(verify_ml_dsa(MlDsaSet::k44, ml_dsa.public_key(), from_hex(message).value(),
                            ByteView(line.signature).subspan(8)));
}

TEST_F(MlDsaCosignature, SignsNameTimeAndWhatACheckpointSays) {
  const std::string line = cosign(kText, kName, ml_dsa, kExampleTime);
  EXPECT_EQ(state_of(kText, line), State::kValid);
  EXPECT_EQ(state_of(kText + "more\n", line), State::kValid) << "extension lines are not signed";
  EXPECT_EQ(state_of("log.example\n8\nCsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=\n", line),
            State::kInvalid);
  EXPECT_EQ(state_of("log.axample\n7\nCsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=\n", line),
            State::kInvalid);
  EXPECT_EQ(state_of("log.example\n7\nDsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=\n", line),
            State::kInvalid);
  EXPECT_EQ(state_of("no checkpoint\n", line), State::kInvalid);
  // A line of another witness by the same key: its name is signed, too.
  const SignatureLine other =
      parse_note(note_with(cosign(kText, "w.example/2", ml_dsa, kExampleTime))).lines.at(1);
  EXPECT_EQ(state_of(kText, signature_line(kName, by_ml_dsa.key_id(), other.signature)), State::kInvalid);
  Bytes changed = parse_note(note_with(line)).lines.at(1).signature;
  changed[7] ^= std::byte{1};  // the time
  EXPECT_EQ(state_of(kText, signature_line(kName, by_ml_dsa.key_id(), changed)), State::kInvalid);
  changed[7] ^= std::byte{1};
  changed.pop_back();
  EXPECT_EQ(state_of(kText, signature_line(kName, by_ml_dsa.key_id(), changed)), State::kInvalid);
  // By the key of the other algorithm under the same name, it is nobody's line.
  EXPECT_EQ(check_cosignature(note_with(line), cosigner).state, State::kAbsent);
  EXPECT_EQ(state_of(kText, cosign(kText, kName, key, kExampleTime)), State::kAbsent);
}

TEST_F(MlDsaCosignature, IsRefusedWhereItCannotBeStated) {
  EXPECT_THROW(cosign(kText, kName, ml_dsa, 0), UsageError);
  EXPECT_THROW(cosign("no checkpoint\n", kName, ml_dsa, 1), UsageError);
  const auto with_origin = [](std::size_t size) {
    return Checkpoint{std::string(size, 'o'), 7, {}}.to_text();
  };
  EXPECT_EQ(state_of(with_origin(255), cosign(with_origin(255), kName, ml_dsa, 1)), State::kValid);
  EXPECT_FALSE(can_cosign_by_ml_dsa(with_origin(256)));
  EXPECT_THROW(cosign(with_origin(256), kName, ml_dsa, 1), UsageError);
  EXPECT_EQ(state_of(with_origin(256), cosign(with_origin(255), kName, ml_dsa, 1)), State::kInvalid);
  EXPECT_THROW(cosign(kText, std::string(256, 'w'), ml_dsa, 1), UsageError);
  EXPECT_THROW(cosign(kText, kName, MlDsaPrivateKey::generate(MlDsaSet::k65), 1), UsageError);
}

TEST_F(MlDsaCosignature, KeysAreKeptAsSeedsInPkcs8) {
  // What RFC 9881 has for this seed; the same bytes stand in Wycheproof's vectors.
  const MlDsaPrivateKey known(MlDsaSet::k44, Bytes(32, std::byte{0x2a}));
  const Bytes der =
      from_hex(
          "3034020100300b0609608648016503040311042280202a2a2a2a2a2a2a2a2a2a2a2a2a2a2a2a2a2a2a2a2a2a2a2a"
          "2a2a2a2a2a2a2a2a")
          .value();
  const std::string pem = "-----BEGIN PRIVATE KEY-----\n" +
                          to_base64(der, Base64Padding::kPadded).substr(0, 64) + "\n" +
                          to_base64(der, Base64Padding::kPadded).substr(64) + "\n-----END PRIVATE KEY-----\n";
  const CosigningKey read = CosigningKey::from_pem(pem);
  EXPECT_EQ(read.public_key("w"), CosignerKey::of_ml_dsa_44("w", known.public_key()));
  EXPECT_EQ(read.to_pem().text(), pem);
  for (const auto algorithm : {CosignatureAlgorithm::kEd25519, CosignatureAlgorithm::kMlDsa44}) {
    const CosigningKey made = CosigningKey::generate(algorithm);
    const CosignerKey its_key = made.public_key(kName);
    EXPECT_EQ(its_key.algorithm(), algorithm);
    EXPECT_EQ(CosignerKey::parse(its_key.to_string()), its_key);
    const CosigningKey again = CosigningKey::from_pem(made.to_pem().text());
    EXPECT_EQ(again.public_key(kName), its_key);
    EXPECT_EQ(check_cosignature(note_with(again.cosign(kText, kName, 5)), its_key).state, State::kValid);
  }
  Bytes changed = der;
  ASSERT_EQ(changed[20], std::byte{0x80});
  changed[20] ^= std::byte{0x84};  // RFC 9881's tag of an expanded key, in the place of the seed's
  const std::string other = "-----BEGIN PRIVATE KEY-----\n" + to_base64(changed, Base64Padding::kPadded) +
                            "\n-----END PRIVATE KEY-----\n";
  EXPECT_THROW(CosigningKey::from_pem(other), Error);
  EXPECT_THROW(CosigningKey::from_pem("no key"), Error);
  EXPECT_THROW(CosigningKey(MlDsaPrivateKey::generate(MlDsaSet::k65)), UsageError);
}

TEST(ExtendedCheckpoint, MayHaveLinesBehind) {
  const auto plain = parse_extended_checkpoint(kText);
  ASSERT_TRUE(plain);
  EXPECT_EQ(plain->size, 7U);
  EXPECT_EQ(parse_extended_checkpoint(kText + "more\nand more\n"), plain);
  EXPECT_FALSE(Checkpoint::parse(kText + "more\n"));
  EXPECT_FALSE(parse_extended_checkpoint(kText + "\n"));
  EXPECT_FALSE(parse_extended_checkpoint(kText + "torn"));
  EXPECT_FALSE(parse_extended_checkpoint("log.example\n7\n"));
}

}  // namespace
}  // namespace kiroku::crypto
