#include "crypto/device_identity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/ml_dsa.h"
#include "crypto/note_format.h"
#include "crypto/pkcs8.h"

namespace kiroku::crypto {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::string_view kCheckpointText = "kiroku/or3/log\n1\nAAAA\n";

MlDsaPrivateKey ml_dsa_of(unsigned char seed) {
  return {MlDsaSet::k65, Bytes(kMlDsaSeedSize, std::byte{seed})};
}

/// A device with both keys, and what others know of it.
class TwoKeys : public testing::Test {
 protected:
  static SigningKey make_key(unsigned char seed) {
    return SigningKey::generate().with_ml_dsa(ml_dsa_of(seed));
  }
  /// The same Ed25519 key without the other: an older program's, or of somebody who can forge it.
  [[nodiscard]] SigningKey ed25519_alone() const {
    return SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr);
  }
  [[nodiscard]] static std::string without_line(const std::string& note, std::string_view beginning) {
    const std::size_t at = note.find(beginning);
    return note.substr(0, at) + note.substr(note.find('\n', at) + 1);
  }

  SigningKey key_ = make_key(1);
  VerifierKey both_ = verifier_key_of("or3", key_);
  VerifierKey known_before_{"or3", key_.public_key()};
  std::string note_ = sign_note(kCheckpointText, "or3", key_);
};

TEST_F(TwoKeys, SignANoteWithOneLineEach) {
  const OpenedNote opened = open_note(note_, {both_});
  EXPECT_FALSE(opened.failure) << opened.explanation;
  EXPECT_TRUE(opened.by_ml_dsa);
  EXPECT_THAT(opened.signers, ElementsAre("or3", "or3/ml-dsa-65"));
  EXPECT_THAT(opened.unchecked, ElementsAre());
}

TEST_F(TwoKeys, AreOneKeyForWhoeverKnowsOne) {
  const OpenedNote opened = open_note(note_, {known_before_});
  EXPECT_FALSE(opened.failure) << opened.explanation;
  EXPECT_FALSE(opened.by_ml_dsa);
  EXPECT_THAT(opened.unchecked, ElementsAre(testing::StartsWith("or3/ml-dsa-65+")));
}

TEST_F(TwoKeys, ANoteWithoutTheMlDsaSignatureIsRefused) {
  EXPECT_EQ(open_note(sign_note(kCheckpointText, "or3", ed25519_alone()), {both_}).failure,
            NoteFailure::kLacksMlDsa);
  EXPECT_EQ(open_note(without_line(note_, "\u2014 or3/ml-dsa-65 "), {both_}).failure,
            NoteFailure::kLacksMlDsa);
  // Whoever gave the same key without its other half made nothing weaker.
  EXPECT_EQ(open_note(sign_note(kCheckpointText, "or3", ed25519_alone()), {known_before_, both_}).failure,
            NoteFailure::kLacksMlDsa);
}

TEST_F(TwoKeys, ANoteWithoutTheEd25519SignatureIsRefused) {
  EXPECT_EQ(open_note(without_line(note_, "\u2014 or3 "), {both_}).failure, NoteFailure::kUnknownKey);
}

TEST_F(TwoKeys, AnotherDevicesMlDsaSignatureIsRefused) {
  const SigningKey mixed = ed25519_alone().with_ml_dsa(ml_dsa_of(2));
  const OpenedNote opened = open_note(sign_note(kCheckpointText, "or3", mixed), {both_});
  EXPECT_EQ(opened.failure, NoteFailure::kBadSignature);
  EXPECT_FALSE(opened.by_ml_dsa);
  // Under another name it is a stranger's line, and the device's own is not there.
  const std::string other = sign_note(kCheckpointText, "or4", make_key(3));
  const std::string line = other.substr(other.find("\u2014 or4/ml-dsa-65 "));
  EXPECT_EQ(open_note(without_line(note_, "\u2014 or3/ml-dsa-65 ") + line, {both_}).failure,
            NoteFailure::kLacksMlDsa);
}

TEST_F(TwoKeys, AMlDsaSignatureOfAnotherTextIsRefused) {
  const std::string other = sign_note("kiroku/or3/log\n2\nAAAA\n", "or3", key_);
  const std::string line = other.substr(other.find("\u2014 or3/ml-dsa-65 "));
  const OpenedNote opened = open_note(without_line(note_, "\u2014 or3/ml-dsa-65 ") + line, {both_});
  EXPECT_EQ(opened.failure, NoteFailure::kBadSignature);
  EXPECT_THAT(opened.explanation, HasSubstr("or3/ml-dsa-65"));
}

TEST_F(TwoKeys, EveryBitOfTheMlDsaLineCounts) {
  const std::size_t begin = note_.find("\u2014 or3/ml-dsa-65 ");
  for (std::size_t at = begin; at < note_.size(); at += 97) {
    std::string flipped = note_;
    flipped[at] = static_cast<char>(flipped[at] ^ 1);
    EXPECT_TRUE(open_note(flipped, {both_}).failure) << at;
  }
}

TEST_F(TwoKeys, ANoteFromBeforeIsTakenOfALogThatWasNoLonger) {
  const VerifierKey since_seven = known_before_.with_ml_dsa(*both_.ml_dsa(), 7);
  const OpenedNote alone = open_note(sign_note(kCheckpointText, "or3", ed25519_alone()), {since_seven});
  EXPECT_TRUE(is_signed_for_log(alone, since_seven, 7));
  EXPECT_FALSE(is_signed_for_log(alone, since_seven, 8));
  EXPECT_FALSE(is_signed_for_log(alone, both_, 1));
}

TEST_F(TwoKeys, TheIdentityStatesBothAndSinceWhen) {
  const std::string identity = write_device_identity("or3", key_, {.ml_dsa = 42});
  EXPECT_TRUE(looks_like_device_identity(identity));
  EXPECT_FALSE(looks_like_device_identity(both_.to_string()));
  const VerifierKey read = parse_device_identity(identity);
  EXPECT_EQ(read, known_before_);
  EXPECT_EQ(read.ml_dsa(), both_.ml_dsa());
  EXPECT_EQ(read.ml_dsa_since(), 42U);
  EXPECT_THROW(write_device_identity("or3", ed25519_alone(), {}), UsageError);
}

TEST_F(TwoKeys, AnIdentityThatDoesNotHoldIsRefused) {
  const std::string identity = write_device_identity("or3", key_, {});
  const auto refused = [](const std::string& text, const char* why) {
    EXPECT_THAT([&] { parse_device_identity(text); }, ThrowsMessage<UsageError>(HasSubstr(why))) << text;
  };
  refused("", "no blank line");
  refused(without_line(identity, "\u2014 or3 "), "did not all sign");
  refused(without_line(identity, "\u2014 or3/ml-dsa-65 "), "did not all sign");
  std::string later = identity;
  later.replace(later.find("\n0\n"), 3, "\n9\n");  // a downgrade: checkpoints of before would be taken
  refused(later, "did not all sign");
  std::string named = identity;
  named.replace(0, std::string("kiroku/or3").size(), "kiroku/or4");
  refused(named, "not that of or3");
  // The keys of two devices, signed by whoever has one of each.
  const SigningKey mixed = ed25519_alone().with_ml_dsa(ml_dsa_of(2));
  std::string exchanged = write_device_identity("or3", mixed, {});
  exchanged.replace(exchanged.find(verifier_key_of("or3", mixed).ml_dsa()->to_string()),
                    both_.ml_dsa()->to_string().size(), both_.ml_dsa()->to_string());
  refused(exchanged, "did not all sign");
}

TEST_F(TwoKeys, AKeyIsReadAsItIsWritten) {
  const MlDsaVerifierKey key = *both_.ml_dsa();
  EXPECT_EQ(MlDsaVerifierKey::parse(key.to_string()), key);
  EXPECT_THROW(MlDsaVerifierKey::parse(both_.to_string()), UsageError);
  EXPECT_THROW(VerifierKey::parse(key.to_string()), UsageError)
      << "an older verifier takes it for no Ed25519 key";
  EXPECT_THROW(known_before_.with_ml_dsa(MlDsaVerifierKey("or4", key.key()), 0), UsageError);
  EXPECT_THROW(SigningKey::generate().with_ml_dsa(MlDsaPrivateKey::generate(MlDsaSet::k44)), UsageError);
}

TEST(MlDsaPem, IsReadBackPlainAndEncrypted) {
  const MlDsaPrivateKey key = ml_dsa_of(5);
  const Secret passphrase = Secret::copy_of(std::string_view("correct horse"));
  const Secret other = Secret::copy_of(std::string_view("wrong"));
  const Secret plain = ml_dsa_pem(key, nullptr);
  const Secret encrypted = ml_dsa_pem(key, &passphrase);
  EXPECT_EQ(ml_dsa_of_pem(MlDsaSet::k65, plain.text(), nullptr)->public_key(), key.public_key());
  EXPECT_EQ(ml_dsa_of_pem(MlDsaSet::k65, encrypted.text(), &passphrase)->public_key(), key.public_key());
  EXPECT_FALSE(ml_dsa_of_pem(MlDsaSet::k65, encrypted.text(), &other));
  EXPECT_FALSE(ml_dsa_of_pem(MlDsaSet::k44, plain.text(), nullptr));
  EXPECT_FALSE(ml_dsa_of_pem(MlDsaSet::k65, SigningKey::generate().to_pem(nullptr).text(), nullptr));
}

}  // namespace
}  // namespace kiroku::crypto
