#include "crypto/hardware_key.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/device_identity.h"
#include "crypto/encoding.h"
#include "crypto/signed_note.h"
#include "tests/support/software_hardware_key.h"

namespace kiroku::crypto {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::string_view kNoteText = "kiroku/or3/log\n1\nAAAA\n";

Bytes of_hex(std::string_view hex) { return from_hex(hex).value(); }

// RFC 6979, A.2.5: the key, and the signature of "sample" with SHA-256.
const Bytes kX = of_hex("60fed4ba255a9d31c961eb74c6356d68c049b8923b61fa6ce669622e60f29fb6");
const Bytes kY = of_hex("7903fe1008b8bc99a41ae9e95628bc64f2f1b20c2d7e9f5177a3c294d4462299");
const Bytes kR = of_hex("efd48b2aacb6a8fd1140dd9cd45e81d69d2c877b56aaf991c34d0ea84eaf3716");
const Bytes kS = of_hex("f7cb1c942d657c41d436c7a1b6e29f65f3e900dbb9aff4064dc4ab2f843acda8");

TEST(EcdsaP256, ChecksThePublishedSignature) {
  const P256PublicKey key = p256_public_key(kX, kY);
  EXPECT_EQ(key.size(), 91U);
  const Bytes signature = ecdsa_signature(kR, kS);
  EXPECT_TRUE(verify_ecdsa_p256(key, bytes_of("sample"), signature));
  EXPECT_FALSE(verify_ecdsa_p256(key, bytes_of("simple"), signature));
  EXPECT_FALSE(verify_ecdsa_p256(key, bytes_of("sample"), ecdsa_signature(kS, kR)));
  EXPECT_FALSE(verify_ecdsa_p256(key, bytes_of("sample"), {}));
  for (std::size_t at = 0; at < signature.size(); ++at) {
    Bytes flipped = signature;
    flipped[at] ^= std::byte{1};
    EXPECT_FALSE(verify_ecdsa_p256(key, bytes_of("sample"), flipped)) << at;
  }
}

TEST(EcdsaP256, TakesNoOtherFormOfAKey) {
  const P256PublicKey key = p256_public_key(kX, kY);
  EXPECT_TRUE(is_p256_public_key(key));
  for (std::size_t at = 0; at < key.size(); ++at) {
    Bytes flipped = key;
    flipped[at] ^= std::byte{1};
    EXPECT_FALSE(is_p256_public_key(flipped)) << at << ": another form, curve or no point of it";
  }
  Bytes longer = key;
  longer.push_back(std::byte{0});
  EXPECT_FALSE(is_p256_public_key(longer));
  EXPECT_FALSE(is_p256_public_key({}));
  EXPECT_THROW(p256_public_key(kY, kX), Error);
  EXPECT_THROW(p256_public_key(longer, kY), Error);
}

class KeyInHardware : public testing::Test {
 protected:
  static std::string without_line(const std::string& note, std::string_view beginning) {
    const std::size_t at = note.find(beginning);
    return note.substr(0, at) + note.substr(note.find('\n', at) + 1);
  }
  [[nodiscard]] SigningKey copied() const {
    return SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr);
  }
  [[nodiscard]] SigningKey with_all() const {
    return copied()
        .with_ml_dsa({MlDsaSet::k65, Bytes(kMlDsaSeedSize, std::byte{1})})
        .with_hardware(hardware_);
  }

  std::shared_ptr<test::SoftwareHardwareKey> hardware_ = std::make_shared<test::SoftwareHardwareKey>();
  SigningKey key_ = SigningKey::generate().with_hardware(hardware_);
  VerifierKey all_ = verifier_key_of("or3", key_);
  std::string note_ = sign_note(kNoteText, "or3", key_);
};

TEST_F(KeyInHardware, SignsBehindTheOthers) {
  const SigningKey three = with_all();
  const OpenedNote opened = open_note(sign_note(kNoteText, "or3", three), {verifier_key_of("or3", three)});
  EXPECT_FALSE(opened.failure) << opened.explanation;
  EXPECT_TRUE(opened.by_ml_dsa && opened.by_hardware);
  EXPECT_THAT(opened.signers, ElementsAre("or3", "or3/ml-dsa-65", "or3/ecdsa-p256"));
}

TEST_F(KeyInHardware, IsAskedForByWhoeverKnowsIt) {
  EXPECT_EQ(open_note(sign_note(kNoteText, "or3", copied()), {all_}).failure, NoteFailure::kLacksHardware);
  const VerifierKey one("or3", key_.public_key());
  EXPECT_THAT(open_note(note_, {one}).unchecked, ElementsAre(testing::StartsWith("or3/ecdsa-p256+")));
  EXPECT_EQ(open_note(sign_note(kNoteText, "or3", copied()), {one, all_}).failure,
            NoteFailure::kLacksHardware);
  EXPECT_EQ(open_note(without_line(note_, "\u2014 or3 "), {all_}).failure, NoteFailure::kUnknownKey)
      << "it does not stand for Ed25519";
}

TEST_F(KeyInHardware, WhatIsMissingOfOneSaysNothingOfTheOther) {
  const SigningKey three = with_all();
  const VerifierKey device = verifier_key_of("or3", three);
  const std::string note = sign_note(kNoteText, "or3", three);
  const OpenedNote silent = open_note(without_line(note, "\u2014 or3/ecdsa-p256 "), {device});
  EXPECT_EQ(silent.failure, NoteFailure::kLacksHardware);
  EXPECT_TRUE(silent.by_ml_dsa);
  const OpenedNote from_before = open_note(without_line(note, "\u2014 or3/ml-dsa-65 "), {device});
  EXPECT_EQ(from_before.failure, NoteFailure::kLacksMlDsa);
  EXPECT_TRUE(from_before.by_hardware);
}

TEST_F(KeyInHardware, ALineThatDoesNotHoldIsRefused) {
  const std::string elsewhere = sign_note("kiroku/or3/log\n2\nAAAA\n", "or3", key_);
  const std::string line = elsewhere.substr(elsewhere.find("\u2014 or3/ecdsa-p256 "));
  EXPECT_EQ(open_note(without_line(note_, "\u2014 or3/ecdsa-p256 ") + line, {all_}).failure,
            NoteFailure::kBadSignature);
  const SigningKey foreign = copied().with_hardware(std::make_shared<test::SoftwareHardwareKey>());
  const OpenedNote opened = open_note(sign_note(kNoteText, "or3", foreign), {all_});
  EXPECT_EQ(opened.failure, NoteFailure::kBadSignature);
  EXPECT_FALSE(opened.by_hardware);
}

TEST_F(KeyInHardware, IsStatedByTheIdentityThatAllKeysSign) {
  const Sha256Digest root = sha256(bytes_of("the log's first seven entries"));
  const VerifierKey alone = parse_device_identity(write_device_identity("or3", key_, {0, 7, root}));
  EXPECT_EQ(alone.log_root_before_hardware(), root);
  EXPECT_THROW(write_device_identity("or3", key_, {0, 7, std::nullopt}), UsageError);
  EXPECT_THROW(write_device_identity("or3", key_, {0, 0, root}), UsageError);
  EXPECT_FALSE(parse_device_identity(write_device_identity("or3", key_, {})).log_root_before_hardware());
  EXPECT_EQ(alone.hardware(), all_.hardware());
  EXPECT_EQ(alone.hardware_since(), 7U);
  EXPECT_FALSE(alone.ml_dsa());

  const SigningKey three = with_all();
  const std::string identity = write_device_identity("or3", three, {4, 7, root});
  const VerifierKey read = parse_device_identity(identity);
  EXPECT_EQ(read.ml_dsa_since(), 4U);
  EXPECT_EQ(read.hardware_since(), 7U);
  const auto refused = [](const std::string& text, const char* why) {
    EXPECT_THAT([&] { parse_device_identity(text); }, ThrowsMessage<UsageError>(HasSubstr(why))) << text;
  };
  for (const char* line : {"\u2014 or3 ", "\u2014 or3/ml-dsa-65 ", "\u2014 or3/ecdsa-p256 "})
    refused(without_line(identity, line), "did not all sign");
  std::string later = identity;
  later.replace(later.find("\n7 "), 3, "\n9 ");
  refused(later, "did not all sign");
  std::string other_log = identity;
  const std::string other_root = to_base64(sha256(bytes_of("another log")), Base64Padding::kPadded);
  other_log.replace(other_log.find("\n7 ") + 3, other_root.size(), other_root);
  refused(other_log, "did not all sign");
  std::string without_root = identity;
  without_root.erase(without_root.find("\n7 ") + 2, 1 + other_root.size());
  refused(without_root, "lacks its root");
  // Whoever has the files and takes the hardware out of the identity makes another identity, which says less.
  EXPECT_FALSE(parse_device_identity(
                   write_device_identity(
                       "or3", copied().with_ml_dsa({MlDsaSet::k65, Bytes(kMlDsaSeedSize, std::byte{1})}), {}))
                   .hardware());
}

TEST_F(KeyInHardware, IsReadAsItIsWritten) {
  const HardwareVerifierKey key = *all_.hardware();
  EXPECT_EQ(HardwareVerifierKey::parse(key.to_string()), key);
  EXPECT_THROW(HardwareVerifierKey::parse(all_.to_string()), UsageError);
  EXPECT_THROW(VerifierKey::parse(key.to_string()), UsageError);
  EXPECT_THROW(HardwareVerifierKey("or3", Bytes(91)), UsageError);
  EXPECT_THROW(VerifierKey("or4", key_.public_key()).with_hardware(key, 0), UsageError);
  std::string other_id = key.to_string();
  const std::size_t at = other_id.find('+') + 1;
  other_id[at] = other_id[at] == '0' ? '1' : '0';
  EXPECT_THAT([&] { HardwareVerifierKey::parse(other_id); }, ThrowsMessage<UsageError>(HasSubstr("its id")));
}

}  // namespace
}  // namespace kiroku::crypto
