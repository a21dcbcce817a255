#include "crypto/cosignature.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
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
  EXPECT_EQ(read.key(), key.public_key());
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
  EXPECT_THAT(refusal(KeyText{"w", std::byte{0x06}, Bytes(1312)}.to_string()), HasSubstr("ML-DSA-44"));
  EXPECT_THAT(refusal(KeyText{"w", std::byte{0x04}, Bytes(31)}.to_string()), HasSubstr("32 bytes"));
  EXPECT_THAT(refusal("w+00000000+" + to_base64(Bytes(33, std::byte{4}), Base64Padding::kPadded)),
              HasSubstr("its id does not belong"));
  // The verifier of logs refuses a witness's key in turn.
  EXPECT_THROW(VerifierKey::parse(cosigner.to_string()), UsageError);
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
