#include "crypto/ml_dsa.h"

#include <gtest/gtest.h>
#include <openssl/crypto.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/keccak.h"
#include "crypto/ml_dsa_polynomial.h"
#include "crypto/openssl_handles.h"
#include "tests/support/ml_dsa_cases.h"
#include "tests/support/patterned_bytes.h"

namespace kiroku::crypto {
namespace {

INSTANTIATE_TEST_SUITE_P(, MlDsa, testing::ValuesIn(test::ml_dsa_cases()), test::ml_dsa_case_name);

TEST(MlDsaProviders, OpenSslComputesFromItsVersion35On) {
  constexpr unsigned long kFirst = 0x30500000;
  EXPECT_EQ(ml_dsa_provider() == MlDsaProvider::kOpenSsl, OpenSSL_version_num() >= kFirst)
      << OpenSSL_version(OPENSSL_VERSION);
}

// The accumulated vectors of C2SP/CCTV: seeds are drawn from one SHAKE128 stream, public keys and
// deterministic signatures of an empty message go into another.
TEST_P(MlDsa, GivesThePublishedAccumulatedVectors) {
  constexpr std::size_t kRounds = 100;
  Bytes seeds(kRounds * kMlDsaSeedSize);
  keccak(Keccak::kShake128, {}, seeds);
  Bytes computed;
  for (std::size_t round = 0; round < kRounds; ++round) {
    const auto key = key_of(ByteView(seeds).subspan(round * kMlDsaSeedSize, kMlDsaSeedSize));
    append(computed, key.public_key());
    const Bytes signature = key.sign_deterministically({});
    append(computed, signature);
    EXPECT_TRUE(verify(key.public_key(), {}, signature, {}));
  }
  Bytes accumulated(32);
  keccak(Keccak::kShake128, {computed}, accumulated);
  EXPECT_EQ(to_hex(accumulated), set() == MlDsaSet::k44
                                     ? "d51148e1f9f4fa1a723a6cf42e25f2a99eb5c1b378b3d2dbbd561b1203beeae4"
                                     : "8358a1843220194417cadbc2651295cd8fc65125b5a5c1a239a16dc8b57ca199");
}

// CCTV's vector of the field's operations, for every element r of Z_q: its signed form and absolute value,
// Power2Round, and with both values of gamma2 UseHint(0, r), UseHint(1, r), LowBits(r) and its absolute
// value.
TEST(MlDsaPolynomialTest, RoundsEveryElementAsPublished) {
  const FetchedDigest shake(EVP_MD_fetch(nullptr, "SHAKE-128", nullptr));
  const DigestContext context(EVP_MD_CTX_new());
  ASSERT_EQ(EVP_DigestInit_ex2(context.get(), shake.get(), nullptr), 1);
  std::string lines;
  const auto put = [&](std::int64_t value) { lines += std::to_string(value) + "\n"; };
  const auto with_sign = [](std::uint32_t value) {
    return value > kMlDsaQ / 2 ? std::int64_t{value} - kMlDsaQ : std::int64_t{value};
  };
  for (std::uint32_t r = 0; r < kMlDsaQ; ++r) {
    put(with_sign(r));
    put(std::abs(with_sign(r)));
    const MlDsaRounded rounded = power_of_two_round(r);
    put(rounded.high);
    put(rounded.low);
    for (const std::uint32_t gamma2 : {(kMlDsaQ - 1) / 88, (kMlDsaQ - 1) / 32}) {
      const MlDsaRounded parts = decompose(r, gamma2);
      ASSERT_EQ(use_hint(false, r, gamma2), parts.high);
      put(parts.high);
      put(use_hint(true, r, gamma2));
      put(with_sign(parts.low));
      put(std::abs(with_sign(parts.low)));
    }
    ASSERT_EQ(EVP_DigestUpdate(context.get(), lines.data(), lines.size()), 1);
    lines.clear();
  }
  Bytes accumulated(32);
  ASSERT_EQ(
      EVP_DigestFinalXOF(context.get(), openssl_bytes(std::span<std::byte>(accumulated)), accumulated.size()),
      1);
  EXPECT_EQ(to_hex(accumulated), "f930663417278156ab05d940294a77210a809c924d8ab63ec72f4526247602c7");
}

TEST(MlDsaPolynomialTest, TellsWhetherANormReachesABound) {
  constexpr std::uint32_t kBound = 1000;
  for (const auto& [value, reaches] :
       {std::pair{0U, false}, std::pair{kBound - 1, false}, std::pair{kBound, true},
        std::pair{kMlDsaQ / 2, true}, std::pair{kMlDsaQ - kBound, true},
        std::pair{kMlDsaQ - kBound + 1, false}, std::pair{kMlDsaQ - 1, false}}) {
    MlDsaPolynomial polynomial;
    polynomial.coefficients[255] = value;
    EXPECT_EQ(polynomial.mask_if_norm_reaches(kBound), reaches ? 0xffffffffU : 0U) << value;
  }
}

TEST_P(MlDsa, EveryProviderVerifiesWhatAnySigned) {
  const Secret seed = Secret::random(kMlDsaSeedSize);
  const Bytes message = test::patterned_bytes(1000);
  for (const MlDsaProvider signer : test::ml_dsa_providers()) {
    const MlDsaPrivateKey key(set(), seed.bytes(), signer);
    EXPECT_EQ(key.public_key(), key_of(seed.bytes()).public_key());
    EXPECT_EQ(key.sign_deterministically(message), key_of(seed.bytes()).sign_deterministically(message));
    EXPECT_TRUE(verify(key.public_key(), message, key.sign(message), {}));
  }
}

TEST_P(MlDsa, HedgedSignaturesDifferAndDeterministicOnesDoNot) {
  const auto key = key_of(test::patterned_bytes(kMlDsaSeedSize));
  const Bytes message = test::patterned_bytes(100);
  const Bytes first = key.sign(message);
  const Bytes second = key.sign(message);
  EXPECT_NE(first, second);
  EXPECT_TRUE(verify(key.public_key(), message, first, {}));
  EXPECT_TRUE(verify(key.public_key(), message, second, {}));
  EXPECT_EQ(key.sign_deterministically(message), key.sign_deterministically(message));
  EXPECT_EQ(key.sign_deterministically(message), key.sign_with(Bytes(kMlDsaRandomnessSize), message));
}

TEST_P(MlDsa, NothingElseVerifies) {
  const auto key = key_of(test::patterned_bytes(kMlDsaSeedSize));
  const Bytes message = test::patterned_bytes(100);
  const Bytes context = test::patterned_bytes(kMlDsaLongestContext);
  const Bytes signature = key.sign(message, context);
  EXPECT_TRUE(verify(key.public_key(), message, signature, context));
  EXPECT_FALSE(verify(key.public_key(), message, signature, {}));
  EXPECT_FALSE(verify(key.public_key(), message, signature, ByteView(context).first(254)));
  EXPECT_FALSE(verify(key.public_key(), ByteView(message).first(99), signature, context));
  EXPECT_FALSE(verify(MlDsaPrivateKey::generate(set()).public_key(), message, signature, context));
  const auto with_a_flipped_bit = [](const Bytes& bytes, std::size_t bit) {
    Bytes changed = bytes;
    changed[bit / 8] ^= static_cast<std::byte>(1 << bit % 8);
    return changed;
  };
  // A prime number of bits apart: every bit of a byte is met.
  for (std::size_t bit = 0; bit < 8 * signature.size(); bit += 251)
    EXPECT_FALSE(verify(key.public_key(), message, with_a_flipped_bit(signature, bit), context)) << bit;
  for (std::size_t bit = 0; bit < 8 * key.public_key().size(); bit += 251)
    EXPECT_FALSE(verify(with_a_flipped_bit(key.public_key(), bit), message, signature, context)) << bit;
}

TEST_P(MlDsa, RefusesWrongSizes) {
  const auto key = key_of(test::patterned_bytes(kMlDsaSeedSize));
  EXPECT_EQ(key.public_key().size(), ml_dsa_public_key_size(set()));
  const Bytes signature = key.sign({});
  EXPECT_EQ(signature.size(), ml_dsa_signature_size(set()));
  EXPECT_THROW(key_of(Bytes(31)), UsageError);
  EXPECT_THROW(static_cast<void>(key.sign({}, Bytes(256))), UsageError);
  EXPECT_THROW(static_cast<void>(key.sign_with(Bytes(31), {})), UsageError);
  Bytes longer = signature;
  longer.emplace_back();
  EXPECT_FALSE(verify(key.public_key(), {}, longer, {}));
  EXPECT_FALSE(verify(key.public_key(), {}, ByteView(signature).first(signature.size() - 1), {}));
  EXPECT_FALSE(verify(ByteView(key.public_key()).first(32), {}, signature, {}));
  EXPECT_FALSE(verify(key.public_key(), {}, signature, Bytes(256)));
}

}  // namespace
}  // namespace kiroku::crypto
