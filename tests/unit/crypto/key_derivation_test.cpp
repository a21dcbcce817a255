#include "crypto/key_derivation.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/x25519.h"

namespace kiroku::crypto {
namespace {

// RFC 5869 appendix A.1 and A.3, cut to the 32 bytes that are used here.
TEST(KeyDerivation, GivesThePublishedHkdfKeys) {
  const Bytes input_key(22, std::byte{0x0b});
  const Bytes info = *from_hex("f0f1f2f3f4f5f6f7f8f9");
  EXPECT_EQ(to_hex(hkdf_sha256(input_key, *from_hex("000102030405060708090a0b0c"), text_of(info)).bytes()),
            "3cb25f25faacd57a90434f64d0362f2a2d2d0a90cf1a5a4c5db02d56ecc4c5bf");
  EXPECT_EQ(to_hex(hkdf_sha256(input_key, {}, "").bytes()),
            "8da4e775a563c18f715f802a063c5a31b8a11f5c5ee1879ec3454e5f3c738d2d");
}

// RFC 4231 test case 2.
TEST(KeyDerivation, GivesThePublishedHmac) {
  EXPECT_EQ(to_hex(hmac_sha256(bytes_of("Jefe"), bytes_of("what do ya want for nothing?"))),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
}

// RFC 7914 section 12, N = 16384, the first 32 of its 64 bytes.
TEST(KeyDerivation, GivesThePublishedScryptKey) {
  EXPECT_EQ(to_hex(scrypt(bytes_of("pleaseletmein"), bytes_of("SodiumChloride"), 14).bytes()),
            "7023bdcb3afd7348461c06cd81fd38ebfda8fbba904f8e3ea9b543f6545da1f2");
}

TEST(KeyDerivation, RefusesImpossibleWorkFactors) {
  EXPECT_THROW(scrypt(bytes_of("p"), bytes_of("s"), 0), UsageError);
  EXPECT_THROW(scrypt(bytes_of("p"), bytes_of("s"), 64), UsageError);
}

// RFC 7748 section 6.1.
TEST(X25519, GivesThePublishedSharedSecret) {
  const Bytes alice = *from_hex("77076d0a7318a57d3c16c17251b26645df4c2f87ebc0992ab177fba51db92c2a");
  const Bytes bob = *from_hex("5dab087e624a8a4b79e17f8b83800ee66f3bb1292618b6fd1c2f8b27ff88e0eb");
  const std::string secret = "4a5d9d5ba4ce2de1728e3bf480350f25e07e21c947d19e3376f09b3c1e161742";
  EXPECT_EQ(to_hex(x25519_public_key(bob)),
            "de9edb7d7b7dc1b4d35b61c2ece435373f8343c85b78674dadfc7e146f882b4f");
  EXPECT_EQ(to_hex(x25519(alice, x25519_public_key(bob))->bytes()), secret);
  EXPECT_EQ(to_hex(x25519(bob, x25519_public_key(alice))->bytes()), secret);
}

TEST(X25519, RefusesEveryPointOfLowOrder) {
  // The points whose order divides 8, and their encodings that are not reduced (Curve25519's own page).
  const std::string_view points[] = {"0000000000000000000000000000000000000000000000000000000000000000",
                                     "0100000000000000000000000000000000000000000000000000000000000000",
                                     "e0eb7a7c3b41b8ae1656e3faf19fc46ada098deb9c32b1fd866205165f49b800",
                                     "5f9c95bca3508c24b1d0b1559c83ef5b04445cc4581c8e86d8224eddd09f1157",
                                     "ecffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f",
                                     "edffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f",
                                     "eeffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f"};
  const Secret key = Secret::random(kX25519KeySize);
  for (const auto point : points) {
    X25519PublicKey share;
    std::ranges::copy(*from_hex(point), share.begin());
    EXPECT_FALSE(x25519(key.bytes(), share)) << point;
  }
}

}  // namespace
}  // namespace kiroku::crypto
