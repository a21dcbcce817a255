#include "crypto/aead.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/encoding.h"
#include "tests/support/shared_data.h"

namespace kiroku::crypto {
namespace {

TEST(ChaCha20Poly1305, SealsAndOpensAllWycheproofCases) {
  KIROKU_NEEDS_SHARED_DATA("timestamp/wycheproof/chacha20_poly1305_test.json");
  const auto suite = nlohmann::json::parse(
      text_of(test::read_whole(test::shared_data("timestamp/wycheproof/chacha20_poly1305_test.json"))));
  std::size_t cases = 0;
  std::size_t refused_nonces = 0;
  for (const auto& group : suite["testGroups"]) {
    for (const auto& test : group["tests"]) {
      SCOPED_TRACE("case " + test["tcId"].dump() + " " + test["comment"].dump());
      ++cases;
      const auto bytes = [&](const char* name) { return *from_hex(test[name].get<std::string>()); };
      const Bytes nonce = bytes("iv");
      const Bytes message = bytes("msg");
      const Bytes associated_data = bytes("aad");
      Bytes sealed = bytes("ct");
      append(sealed, bytes("tag"));
      Bytes opened(message.size());
      Bytes resealed(sealed.size());
      ChaCha20Poly1305 cipher(bytes("key"));
      if (group["ivSize"] != 8 * kAeadNonceSize) {
        ++refused_nonces;
        EXPECT_EQ(test["result"], "invalid");
        EXPECT_THROW(static_cast<void>(cipher.open(nonce, sealed, opened, associated_data)), UsageError);
        EXPECT_THROW(cipher.seal(nonce, message, resealed, associated_data), UsageError);
        continue;
      }
      const bool valid = test["result"] == "valid";
      EXPECT_EQ(cipher.open(nonce, sealed, opened, associated_data), valid);
      EXPECT_EQ(opened, valid ? message : Bytes(message.size()));
      cipher.seal(nonce, message, resealed, associated_data);
      EXPECT_EQ(resealed == sealed, valid);
    }
  }
  EXPECT_EQ(cases, 325U);
  EXPECT_EQ(refused_nonces, 9U);
}

// RFC 8439 section 2.8.2.
TEST(ChaCha20Poly1305, GivesTheCiphertextOfItsRfc) {
  const Bytes key = *from_hex("808182838485868788898a8b8c8d8e8f909192939495969798999a9b9c9d9e9f");
  const Bytes nonce = *from_hex("070000004041424344454647");
  const Bytes associated_data = *from_hex("50515253c0c1c2c3c4c5c6c7");
  const std::string_view plaintext =
      "Ladies and Gentlemen of the class of '99: If I could offer you only one tip for the future, sunscreen "
      "would "
      "be it.";
  Bytes sealed(plaintext.size() + kAeadTagSize);
  ChaCha20Poly1305(key).seal(nonce, bytes_of(plaintext), sealed, associated_data);
  EXPECT_EQ(to_hex(sealed),
            "d31a8d34648e60db7b86afbc53ef7ec2a4aded51296e08fea9e2b5a736ee62d63dbea45e8ca9671282fafb69da92728b"
            "1a71de0a9e06"
            "0b2905d6a5b67ecd3b3692ddbd7f2d778b8c9803aee328091b58fab324e4fad675945585808b4831d7bc3ff4def08e4b"
            "7a9de576d265"
            "86cec64b61161ae10b594f09e26a7e902ecbd0600691");
}

TEST(ChaCha20Poly1305, OneObjectHandlesManyMessagesBothWays) {
  ChaCha20Poly1305 cipher(Bytes(kAeadKeySize, std::byte{7}));
  Bytes nonce(kAeadNonceSize);
  for (std::size_t size = 0; size < 300; size += 7) {
    nonce[0] = static_cast<std::byte>(size & 0xff);
    nonce[1] = static_cast<std::byte>(size >> 8);
    const Bytes message(size, std::byte{0x42});
    Bytes sealed(size + kAeadTagSize);
    cipher.seal(nonce, message, sealed);
    Bytes opened(size);
    ASSERT_TRUE(cipher.open(nonce, sealed, opened));
    ASSERT_EQ(opened, message);
    sealed.back() ^= std::byte{1};
    ASSERT_FALSE(cipher.open(nonce, sealed, opened));  // and the failure does not spoil the next message
    ASSERT_EQ(opened, Bytes(size));
  }
}

TEST(ChaCha20Poly1305, WorksInPlace) {
  ChaCha20Poly1305 cipher(Bytes(kAeadKeySize, std::byte{7}));
  const Bytes nonce(kAeadNonceSize);
  const Bytes message(1000, std::byte{0x42});
  Bytes buffer = message;
  buffer.resize(message.size() + kAeadTagSize);
  cipher.seal(nonce, ByteView(buffer).first(message.size()), buffer);
  EXPECT_NE(Bytes(buffer.begin(), buffer.begin() + 1000), message);
  ASSERT_TRUE(cipher.open(nonce, buffer, std::span(buffer).first(message.size())));
  EXPECT_EQ(Bytes(buffer.begin(), buffer.begin() + 1000), message);
}

TEST(ChaCha20Poly1305, RefusesWrongSizes) {
  EXPECT_THROW(ChaCha20Poly1305(Bytes(31)), UsageError);
  ChaCha20Poly1305 cipher{Bytes(kAeadKeySize)};
  const Bytes nonce(kAeadNonceSize);
  Bytes room(10);
  EXPECT_THROW(cipher.seal(nonce, Bytes(10), room), UsageError);
  EXPECT_FALSE(cipher.open(nonce, Bytes(15), room));
  EXPECT_THROW(static_cast<void>(cipher.open(nonce, Bytes(20), room)), UsageError);
}

}  // namespace
}  // namespace kiroku::crypto
