// The ring Z_q[X]/(X^256 + 1) of ML-KEM (FIPS 203 section 4): arithmetic, number-theoretic transform,
// compression and byte encoding of its polynomials. Nothing here branches, divides or indexes on a
// coefficient.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "base/bytes.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

inline constexpr std::uint32_t kMlKemQ = 3329;
inline constexpr std::size_t kMlKemDegree = 256;

/// Coefficients in [0, q); in the transformed domain or not, as its user knows. Zeroised when it goes.
struct MlKemPolynomial {
  std::array<std::uint16_t, kMlKemDegree> coefficients{};

  MlKemPolynomial() = default;
  MlKemPolynomial(const MlKemPolynomial&) = default;
  MlKemPolynomial& operator=(const MlKemPolynomial&) = default;
  ~MlKemPolynomial() { zeroise(std::as_writable_bytes(std::span(coefficients))); }

  void add(const MlKemPolynomial& other);
  void subtract(const MlKemPolynomial& other);
  /// Adds the product of two transformed polynomials (Algorithm 11).
  void add_product(const MlKemPolynomial& a, const MlKemPolynomial& b);
  void transform();          // Algorithm 9
  void inverse_transform();  // Algorithm 10
};

/// Compress_d and ByteEncode_d (Algorithm 5): 32·bits bytes. 12 bits are encoded as they are.
void encode_polynomial(const MlKemPolynomial& polynomial, unsigned bits, std::span<std::byte> out);
/// ByteDecode_d (Algorithm 6) and Decompress_d. With 12 bits, values from q to 4095 are reduced.
MlKemPolynomial decode_polynomial(ByteView bytes, unsigned bits);

/// SampleNTT (Algorithm 7) for a seed of 32 bytes and two indices; for public seeds only.
MlKemPolynomial sample_uniform_polynomial(ByteView seed, std::uint8_t column, std::uint8_t row);
/// SamplePolyCBD_2 of PRF_2(seed, nonce) (Algorithm 8).
MlKemPolynomial sample_small_polynomial(ByteView seed, std::uint8_t nonce);

}  // namespace kiroku::crypto
