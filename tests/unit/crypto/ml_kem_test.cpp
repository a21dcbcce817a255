#include "crypto/ml_kem.h"

#include <gtest/gtest.h>
#include <openssl/crypto.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/keccak.h"
#include "tests/support/patterned_bytes.h"

namespace kiroku::crypto {
namespace {

// FIPS 202's examples of the empty message.
TEST(Keccak, GivesThePublishedDigests) {
  Bytes out(32);
  keccak(Keccak::kSha3With256Bits, {}, out);
  EXPECT_EQ(to_hex(out), "a7ffc6f8bf1ed76651c14756a061d662f580ff4de43b49fa82d80a4b80f8434a");
  keccak(Keccak::kShake128, {}, out);
  EXPECT_EQ(to_hex(out), "7f9c2ba4e88f827d616045507605853ed73b8093f6efbc88eb1a6eacfa66ef26");
  keccak(Keccak::kShake256, {}, out);
  EXPECT_EQ(to_hex(out), "46b9dd2b0ba88d13233b3feb743eeb243fcd52ea62b81b82b50c27646ed5762f");
}

std::vector<MlKemProvider> providers() {
  if (ml_kem_provider() == MlKemProvider::kOwn) return {MlKemProvider::kOwn};
  return {MlKemProvider::kOwn, MlKemProvider::kOpenSsl};
}

// The same tests, whoever computes.
class MlKem : public testing::TestWithParam<MlKemProvider> {
 protected:
  static MlKemPrivateKey key_of(ByteView seed) { return MlKemPrivateKey(seed, GetParam()); }
  static MlKemEncapsulation encapsulate(ByteView public_key, const Secret& message) {
    return ml_kem_encapsulate(public_key, message, GetParam());
  }
};

INSTANTIATE_TEST_SUITE_P(, MlKem, testing::ValuesIn(providers()), [](const auto& provider) {
  return provider.param == MlKemProvider::kOwn ? "Own" : "OpenSsl";
});

TEST(MlKemProviders, OpenSslComputesFromItsVersion35On) {
  constexpr unsigned long kFirst = 0x30500000;
  EXPECT_EQ(ml_kem_provider() == MlKemProvider::kOpenSsl, OpenSSL_version_num() >= kFirst)
      << OpenSSL_version(OPENSSL_VERSION);
}

TEST_P(MlKem, OpensWhatAnyProviderSealed) {
  const Secret seed = Secret::random(kMlKemSeedSize);
  const MlKemPrivateKey key = key_of(seed.bytes());
  for (const MlKemProvider sealer : providers()) {
    EXPECT_EQ(key.public_key(), MlKemPrivateKey(seed.bytes(), sealer).public_key());
    const auto sealed = ml_kem_encapsulate(key.public_key(), Secret::random(kMlKemMessageSize), sealer);
    EXPECT_TRUE(
        equal_constant_time(key.decapsulate(sealed.ciphertext).bytes(), sealed.shared_secret.bytes()));
  }
}

// The accumulated vectors of C2SP/CCTV for ML-KEM-768: keys, messages and random ciphertexts are drawn from
// one SHAKE128 stream, everything computed goes into another.
TEST_P(MlKem, GivesThePublishedAccumulatedVectors) {
  constexpr std::size_t kRounds = 100;
  constexpr std::size_t kDrawn = kMlKemSeedSize + kMlKemMessageSize + kMlKemCiphertextSize;
  Bytes drawn(kRounds * kDrawn);
  keccak(Keccak::kShake128, {}, drawn);
  Bytes computed;
  for (std::size_t round = 0; round < kRounds; ++round) {
    ByteView input = ByteView(drawn).subspan(round * kDrawn, kDrawn);
    const MlKemPrivateKey key = key_of(input.first(kMlKemSeedSize));
    append(computed, key.public_key());
    const auto encapsulation =
        encapsulate(key.public_key(), Secret::copy_of(input.subspan(kMlKemSeedSize, kMlKemMessageSize)));
    append(computed, encapsulation.ciphertext);
    append(computed, encapsulation.shared_secret.bytes());
    EXPECT_TRUE(equal_constant_time(key.decapsulate(encapsulation.ciphertext).bytes(),
                                    encapsulation.shared_secret.bytes()));
    append(computed, key.decapsulate(input.last(kMlKemCiphertextSize)).bytes());
  }
  Bytes accumulated(32);
  keccak(Keccak::kShake128, {computed}, accumulated);
  EXPECT_EQ(to_hex(accumulated), "1114b1b6699ed191734fa339376afa7e285c9e6acf6ff0177d346696ce564415");
}

TEST_P(MlKem, EveryChangedCiphertextGivesAnotherSecretAndAlwaysTheSame) {
  const MlKemPrivateKey key = key_of(test::patterned_bytes(kMlKemSeedSize));
  auto encapsulation = encapsulate(key.public_key(), Secret(kMlKemMessageSize));
  for (std::size_t i = 0; i < kMlKemCiphertextSize; i += 41) {
    encapsulation.ciphertext[i] ^= std::byte{1};
    const Secret rejected = key.decapsulate(encapsulation.ciphertext);
    EXPECT_FALSE(equal_constant_time(rejected.bytes(), encapsulation.shared_secret.bytes())) << i;
    EXPECT_TRUE(equal_constant_time(rejected.bytes(), key.decapsulate(encapsulation.ciphertext).bytes()))
        << i;
    encapsulation.ciphertext[i] ^= std::byte{1};
  }
}

TEST_P(MlKem, RefusesKeysThatAreNotReducedAndWrongSizes) {
  const MlKemPrivateKey key = key_of(test::patterned_bytes(kMlKemSeedSize));
  EXPECT_TRUE(is_ml_kem_public_key(key.public_key()));
  Bytes unreduced = key.public_key();
  unreduced[0] = std::byte{0x01};  // the first coefficient becomes 0xd01 = 3329 = q
  unreduced[1] = (unreduced[1] & std::byte{0xf0}) | std::byte{0x0d};
  EXPECT_FALSE(is_ml_kem_public_key(unreduced));
  EXPECT_THROW(encapsulate(unreduced, Secret(kMlKemMessageSize)), UsageError);
  EXPECT_FALSE(is_ml_kem_public_key(ByteView(key.public_key()).first(1183)));
  EXPECT_THROW(key_of(Bytes(63)), UsageError);
  EXPECT_THROW(static_cast<void>(key.decapsulate(Bytes(1087))), UsageError);
  EXPECT_THROW(encapsulate(key.public_key(), Secret(31)), UsageError);
}

}  // namespace
}  // namespace kiroku::crypto
