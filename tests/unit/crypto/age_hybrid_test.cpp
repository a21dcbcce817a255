#include "crypto/age_hybrid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/age_file.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "crypto/hpke.h"
#include "crypto/x_wing.h"
#include "tests/support/patterned_bytes.h"

namespace kiroku::crypto {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

// The vector of draft-ietf-hpke-pq for MLKEM768-X25519, HKDF-SHA256, ChaCha20Poly1305; its long values are
// compared by their SHA-256.
constexpr std::string_view kSeed = "b3f98b03126a431ccecc62ae0f68e102c2d8e1cc7b21ba85d821d8e31761e0f8";
constexpr std::string_view kRandomness =
    "a3a869097e0241158eca5dc6c9e695f9e0d2ee5db51c09c435aab69d56509a43d94ff76d7d47cf79ecf75394261236cec024bd84"
    "9cc782e1"
    "4f7f0738af83daed";
constexpr std::string_view kSharedSecret = "b90cf181d95351d1091569487caaf6c3434eeb181a2c4c04631980ce139afa67";

TEST(XWing, GivesThePublishedKeysAndSecrets) {
  const XWingPrivateKey key(*from_hex(kSeed));
  EXPECT_EQ(to_hex(sha256(key.public_key())),
            "120b60e0ae3c00c1c9def1c61aeb12de710bfa49646ae6f99a7e564b25ace493");
  const auto encapsulation = x_wing_encapsulate(key.public_key(), Secret::copy_of(*from_hex(kRandomness)));
  EXPECT_EQ(to_hex(sha256(encapsulation.ciphertext)),
            "3a7ef30fb815e75b7f0f16f5bab5c36250882d94ea0f776cc2241cdd3b36b480");
  EXPECT_EQ(to_hex(encapsulation.shared_secret.bytes()), kSharedSecret);
  EXPECT_EQ(to_hex(key.decapsulate(encapsulation.ciphertext)->bytes()), kSharedSecret);
}

TEST(XWing, RefusesSharesOfLowOrderAndWrongSizes) {
  const XWingPrivateKey key(*from_hex(kSeed));
  Bytes ciphertext = x_wing_encapsulate(key.public_key(), Secret::random(64)).ciphertext;
  std::fill(ciphertext.end() - 32, ciphertext.end(), std::byte{0});
  EXPECT_FALSE(key.decapsulate(ciphertext));
  Bytes weak_key = key.public_key();
  std::fill(weak_key.end() - 32, weak_key.end(), std::byte{0});
  EXPECT_THROW(x_wing_encapsulate(weak_key, Secret::random(64)), UsageError);
  EXPECT_THROW(x_wing_encapsulate(key.public_key(), Secret::random(63)), UsageError);
  EXPECT_THROW(static_cast<void>(key.decapsulate(ByteView(ciphertext).first(1119))), UsageError);
  EXPECT_THROW(XWingPrivateKey(Bytes(31)), UsageError);
}

TEST(Hpke, GivesThePublishedKeys) {
  const auto keys = hpke_base_keys(
      0x647a, Secret::copy_of(*from_hex(kSharedSecret)),
      text_of(*from_hex("34663634363532303666366532303631323034373732363536333639363136653230353537323665")));
  EXPECT_EQ(to_hex(keys.key.bytes()), "4a4c042267e8ec360c83b2baf0d5e3dcca73a86531cdf67ec41d95bccfe12387");
  EXPECT_EQ(to_hex(keys.nonce.bytes()), "5ddfaaee10a4dfd0d8e1b49f");
}

TEST(AgeHybrid, SealsToItsRecipientsOnly) {
  const AgeKeyPair first = generate_hybrid_age_key();
  const AgeKeyPair second = generate_hybrid_age_key();
  const AgeKeyPair stranger = generate_hybrid_age_key();
  EXPECT_TRUE(first.recipient.starts_with("age1pq1"));
  EXPECT_TRUE(first.identity_text.text().starts_with("AGE-SECRET-KEY-PQ-1"));
  EXPECT_EQ(recipient_of(first.identity_text.text()), first.recipient);
  EXPECT_EQ(parse_recipient(first.recipient)->to_string(), first.recipient);

  const Bytes plaintext = test::patterned_bytes(70000);
  const Bytes sealed =
      seal_bytes(plaintext, {parse_recipient(first.recipient), parse_recipient(second.recipient)});
  for (const auto* pair : {&first, &second})
    EXPECT_EQ(unseal_bytes(sealed, {parse_identity(pair->identity_text.text())}), plaintext);
  EXPECT_THAT([&] { unseal_bytes(sealed, {parse_identity(stranger.identity_text.text())}); },
              ThrowsMessage<AgeError>(HasSubstr("none of the identities")));
}

TEST(AgeHybrid, IsNotMixedWithRecipientsThatWouldUndoIt) {
  const auto hybrid = parse_recipient(generate_hybrid_age_key().recipient);
  const auto classic = parse_recipient(generate_age_key().recipient);
  for (const auto& recipients : {AgeRecipients{hybrid, classic}, AgeRecipients{classic, hybrid}})
    EXPECT_THAT([&] { seal_bytes({}, recipients); },
                ThrowsMessage<UsageError>(HasSubstr("recipients of one kind")));
}

TEST(AgeHybrid, RefusesDamagedTexts) {
  const AgeKeyPair pair = generate_hybrid_age_key();
  std::string recipient = pair.recipient;
  recipient[100] = recipient[100] == 'q' ? 'p' : 'q';
  EXPECT_THAT([&] { parse_recipient(recipient); },
              ThrowsMessage<UsageError>(HasSubstr("no post-quantum age recipient")));
  std::string identity(pair.identity_text.text());
  identity[30] = identity[30] == 'Q' ? 'P' : 'Q';
  EXPECT_THAT([&] { parse_identity(identity); },
              ThrowsMessage<UsageError>(
                  testing::AllOf(HasSubstr("no age identity"), testing::Not(HasSubstr(identity)))));
  EXPECT_THROW(parse_recipient(to_bech32("age1pq", Bytes(kXWingPublicKeySize, std::byte{0xff}))), UsageError);
}

}  // namespace
}  // namespace kiroku::crypto
