#include "crypto/signing_key.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/pem.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "tests/support/ed25519_seed.h"

namespace kiroku::crypto {
namespace {

using test::key_from_seed;
using testing::HasSubstr;
using testing::ThrowsMessage;

struct Vector {
  std::string_view seed, public_key, message, signature;
};

// RFC 8032 section 7.1, TEST 1 to 3.
constexpr Vector kVectors[] = {{"9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60",
                                "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a", "",
                                "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555fb8821590a3"
                                "3bacc61e39701cf9b46bd25bf5f0595b"
                                "be24655141438e7a100b"},
                               {"4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb",
                                "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c", "72",
                                "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da085ac1e43e15"
                                "996e458f3613d0f11d8c387b2eaeb430"
                                "2aeeb00d291612bb0c00"},
                               {"c5aa8df43f9f837bedb7442f31dcb7b166d38535076f094b85ce3a2e0b4458f7",
                                "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025", "af82",
                                "6291d657deec24024827e69c3abe01a30ce548a284743a445e3680d7db5ac3ac18ff9b538d16"
                                "f290ae67f760984dc6594a7c15e9716e"
                                "d28dc027beceea1ec40a"}};

TEST(SigningKey, GivesThePublishedSignatures) {
  for (const auto& vector : kVectors) {
    const SigningKey key = key_from_seed(*from_hex(vector.seed));
    const Bytes message = *from_hex(vector.message);
    EXPECT_EQ(to_hex(key.public_key()), vector.public_key);
    EXPECT_EQ(to_hex(key.sign(message)), vector.signature);
    EXPECT_TRUE(verify_ed25519(key.public_key(), message, *from_hex(vector.signature)));
  }
}

TEST(SigningKey, VerificationFindsEachFlippedBit) {
  const SigningKey key = SigningKey::generate();
  Bytes message = to_bytes("the tree of the first 42 entries");
  Ed25519Signature signature = key.sign(message);
  EXPECT_TRUE(verify_ed25519(key.public_key(), message, signature));
  for (std::size_t bit = 0; bit < 8 * signature.size(); ++bit) {
    signature[bit / 8] ^= std::byte(1U << bit % 8);
    EXPECT_FALSE(verify_ed25519(key.public_key(), message, signature)) << bit;
    signature[bit / 8] ^= std::byte(1U << bit % 8);
  }
  message[0] ^= std::byte{1};
  EXPECT_FALSE(verify_ed25519(key.public_key(), message, signature));
  message[0] ^= std::byte{1};
  EXPECT_FALSE(verify_ed25519(key.public_key(), message, ByteView(signature).first(63)));
  EXPECT_FALSE(verify_ed25519(SigningKey::generate().public_key(), message, signature));
}

TEST(SigningKey, ComesBackFromPlainPem) {
  const SigningKey key = SigningKey::generate();
  const Secret pem = key.to_pem(nullptr);
  EXPECT_TRUE(pem.text().starts_with("-----BEGIN PRIVATE KEY-----\n"));
  EXPECT_FALSE(SigningKey::pem_is_encrypted(pem.text()));
  EXPECT_EQ(SigningKey::from_pem(pem.text(), nullptr).public_key(), key.public_key());
}

TEST(SigningKey, ComesBackFromEncryptedPemWithItsPassphraseOnly) {
  const SigningKey key = SigningKey::generate();
  const Secret passphrase = Secret::copy_of("correct horse");
  const Secret wrong = Secret::copy_of("battery staple");
  const Secret pem = key.to_pem(&passphrase);
  EXPECT_TRUE(SigningKey::pem_is_encrypted(pem.text()));
  EXPECT_EQ(SigningKey::from_pem(pem.text(), &passphrase).public_key(), key.public_key());
  EXPECT_THAT([&] { SigningKey::from_pem(pem.text(), &wrong); },
              ThrowsMessage<Error>(HasSubstr("the passphrase does not open the signing key")));
  EXPECT_THAT([&] { SigningKey::from_pem(pem.text(), nullptr); },
              ThrowsMessage<Error>(HasSubstr("protected by a passphrase and none was given")));
}

TEST(SigningKey, RefusesKeysOfOtherAlgorithmsAndOtherFiles) {
  const PrivateKey p256(EVP_PKEY_Q_keygen(nullptr, nullptr, "EC", "P-256"));
  const BufferIo io(BIO_new(BIO_s_mem()));
  ASSERT_EQ(PEM_write_bio_PrivateKey(io.get(), p256.get(), nullptr, nullptr, 0, nullptr, nullptr), 1);
  const char* text = nullptr;
  const auto size = static_cast<std::size_t>(BIO_get_mem_data(io.get(), &text));
  EXPECT_THAT(
      [&] {
        SigningKey::from_pem({text, size}, nullptr);
      },
      ThrowsMessage<Error>(HasSubstr("it must be Ed25519")));
  EXPECT_THAT([] { SigningKey::from_pem("not a key", nullptr); },
              ThrowsMessage<Error>(HasSubstr("no PKCS#8 PEM private key")));
}

}  // namespace
}  // namespace kiroku::crypto
