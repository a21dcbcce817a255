#include "crypto/ml_kem_own.h"

#include <array>
#include <cstring>

#include "crypto/keccak.h"
#include "crypto/ml_kem_polynomial.h"
#include "crypto/published.h"

namespace kiroku::crypto {
namespace {

// ML-KEM-768 of FIPS 203 table 2; both η are 2.
constexpr std::size_t kRank = 3;
constexpr unsigned kUncompressedBits = 12;
constexpr unsigned kVectorBits = 10;  // d_u
constexpr unsigned kScalarBits = 4;   // d_v
constexpr std::size_t kEncodedSize = 32 * kUncompressedBits;
constexpr std::size_t kVectorPartSize = 32 * kVectorBits;
constexpr std::size_t kSeedSize = 32;
static_assert(kMlKemPublicKeySize == kRank * kEncodedSize + kSeedSize);
static_assert(kMlKemCiphertextSize == kRank * kVectorPartSize + 32 * kScalarBits);

using Vector = std::array<MlKemPolynomial, kRank>;

// Entry (row, column) of the matrix Â; its transpose has the indices exchanged.
MlKemPolynomial matrix_entry(ByteView matrix_seed, std::size_t row, std::size_t column) {
  return sample_uniform_polynomial(matrix_seed, static_cast<std::uint8_t>(column),
                                   static_cast<std::uint8_t>(row));
}

Vector sample_small_vector(ByteView seed, std::uint8_t first_nonce) {
  Vector vector;
  for (std::uint8_t i = 0; i < kRank; ++i)
    vector[i] = sample_small_polynomial(seed, static_cast<std::uint8_t>(first_nonce + i));
  return vector;
}

struct KeyPair {
  Vector secret;  // ŝ, transformed
  Bytes public_key;
};

// K-PKE.KeyGen (Algorithm 13).
KeyPair generate(ByteView d) {
  const std::byte rank{kRank};
  Secret seeds(2 * kSeedSize);
  keccak(Keccak::kSha3With512Bits, {d, {&rank, 1}}, seeds.bytes());
  const auto matrix_seed = seeds.bytes().first(kSeedSize);
  const auto noise_seed = seeds.bytes().last(kSeedSize);
  publish(matrix_seed.data(), matrix_seed.size());

  KeyPair pair{sample_small_vector(noise_seed, 0), Bytes(kMlKemPublicKeySize)};
  Vector error = sample_small_vector(noise_seed, kRank);
  for (auto& polynomial : pair.secret) polynomial.transform();
  const auto out = std::span(pair.public_key);
  for (std::size_t row = 0; row < kRank; ++row) {
    MlKemPolynomial& sum = error[row];
    sum.transform();
    for (std::size_t column = 0; column < kRank; ++column)
      sum.add_product(matrix_entry(matrix_seed, row, column), pair.secret[column]);
    encode_polynomial(sum, kUncompressedBits, out.subspan(row * kEncodedSize, kEncodedSize));
  }
  std::memcpy(out.last(kSeedSize).data(), matrix_seed.data(), kSeedSize);
  return pair;
}

// K-PKE.Encrypt (Algorithm 14).
Bytes encrypt(ByteView public_key, ByteView message, ByteView randomness) {
  const ByteView matrix_seed = public_key.last(kSeedSize);
  Vector y = sample_small_vector(randomness, 0);
  const Vector e1 = sample_small_vector(randomness, kRank);
  for (auto& polynomial : y) polynomial.transform();

  Bytes ciphertext(kMlKemCiphertextSize);
  const auto out = std::span(ciphertext);
  for (std::size_t row = 0; row < kRank; ++row) {
    MlKemPolynomial u;
    for (std::size_t column = 0; column < kRank; ++column)
      u.add_product(matrix_entry(matrix_seed, column, row), y[column]);
    u.inverse_transform();
    u.add(e1[row]);
    encode_polynomial(u, kVectorBits, out.subspan(row * kVectorPartSize, kVectorPartSize));
  }
  MlKemPolynomial v;
  for (std::size_t i = 0; i < kRank; ++i)
    v.add_product(decode_polynomial(public_key.subspan(i * kEncodedSize, kEncodedSize), kUncompressedBits),
                  y[i]);
  v.inverse_transform();
  v.add(sample_small_polynomial(randomness, 2 * kRank));
  v.add(decode_polynomial(message, 1));
  encode_polynomial(v, kScalarBits, out.subspan(kRank * kVectorPartSize));
  return ciphertext;
}

// K-PKE.Decrypt (Algorithm 15).
Secret decrypt(const Vector& secret, ByteView ciphertext) {
  MlKemPolynomial product;
  for (std::size_t i = 0; i < kRank; ++i) {
    MlKemPolynomial u =
        decode_polynomial(ciphertext.subspan(i * kVectorPartSize, kVectorPartSize), kVectorBits);
    u.transform();
    product.add_product(secret[i], u);
  }
  product.inverse_transform();
  MlKemPolynomial w = decode_polynomial(ciphertext.subspan(kRank * kVectorPartSize), kScalarBits);
  w.subtract(product);
  Secret message(kMlKemMessageSize);
  encode_polynomial(w, 1, message.bytes());
  return message;
}

// G(m ‖ H(ek)): the shared secret, then the randomness of the encryption.
Secret derive(ByteView message, ByteView public_key) {
  std::array<std::byte, 32> public_key_hash;
  keccak(Keccak::kSha3With256Bits, {public_key}, public_key_hash);
  Secret derived(kMlKemSharedSize + kSeedSize);
  keccak(Keccak::kSha3With512Bits, {message, public_key_hash}, derived.bytes());
  return derived;
}

// All ones if equal, else zero; the loop and what follows it see no branch.
std::byte mask_if_equal(ByteView a, ByteView b) {
  std::uint32_t difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) difference |= std::to_integer<std::uint32_t>(a[i] ^ b[i]);
  return static_cast<std::byte>((difference - 1) >> 8 & 0xff);
}

}  // namespace

Bytes ml_kem_own::public_key_of(ByteView seed) { return generate(seed.first(kSeedSize)).public_key; }

Secret ml_kem_own::decapsulate(ByteView seed, ByteView public_key, ByteView ciphertext) {
  const ByteView d = seed.first(kSeedSize);
  const ByteView z = seed.last(kSeedSize);
  const KeyPair pair = generate(d);
  const Secret message = decrypt(pair.secret, ciphertext);
  Secret derived = derive(message.bytes(), public_key);
  Secret rejection(kMlKemSharedSize);
  keccak(Keccak::kShake256, {z, ciphertext}, rejection.bytes());

  const Bytes again = encrypt(public_key, message.bytes(), ByteView(derived.bytes()).last(kSeedSize));
  const std::byte valid = mask_if_equal(ciphertext, again);
  Secret shared(kMlKemSharedSize);
  for (std::size_t i = 0; i < kMlKemSharedSize; ++i)
    shared.bytes()[i] = (derived.bytes()[i] & valid) | (rejection.bytes()[i] & ~valid);
  return shared;
}

MlKemEncapsulation ml_kem_own::encapsulate(ByteView public_key, ByteView message) {
  const Secret derived = derive(message, public_key);
  return {encrypt(public_key, message, derived.bytes().last(kSeedSize)),
          Secret::copy_of(derived.bytes().first(kMlKemSharedSize))};
}

}  // namespace kiroku::crypto
