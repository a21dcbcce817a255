// The ring Z_q[X]/(X^256 + 1) of ML-DSA (FIPS 204 section 7): arithmetic, number-theoretic transform,
// rounding, packing and sampling of its polynomials. Nothing here branches, divides or indexes on a
// coefficient, but where it is said.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "base/bytes.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

inline constexpr std::uint32_t kMlDsaQ = 8380417;
inline constexpr std::size_t kMlDsaDegree = 256;
inline constexpr unsigned kMlDsaDroppedBits = 13;  // d

/// Coefficients in [0, q): a negative number x stands as q + x. In the transformed domain or not, as its user
/// knows. Zeroised when it goes.
struct MlDsaPolynomial {
  std::array<std::uint32_t, kMlDsaDegree> coefficients{};

  MlDsaPolynomial() = default;
  MlDsaPolynomial(const MlDsaPolynomial&) = default;
  MlDsaPolynomial& operator=(const MlDsaPolynomial&) = default;
  ~MlDsaPolynomial() { zeroise(std::as_writable_bytes(std::span(coefficients))); }

  void add(const MlDsaPolynomial& other);
  void subtract(const MlDsaPolynomial& other);
  /// Adds the product of two transformed polynomials (Algorithms 44 and 45).
  void add_product(const MlDsaPolynomial& a, const MlDsaPolynomial& b);
  void transform();          // Algorithm 41
  void inverse_transform();  // Algorithm 42

  /// All ones if a coefficient's absolute value is `bound` or more, else zero. `bound` is at most q / 2.
  [[nodiscard]] std::uint32_t mask_if_norm_reaches(std::uint32_t bound) const;
};

struct MlDsaRounded {
  std::uint32_t high = 0;
  std::uint32_t low = 0;  // in [0, q) as coefficients are
};
/// Power2Round (Algorithm 35) of a number in [0, q).
MlDsaRounded power_of_two_round(std::uint32_t r);
/// Decompose (Algorithm 36) of a number in [0, q); `gamma2` is one of ML-DSA's two.
MlDsaRounded decompose(std::uint32_t r, std::uint32_t gamma2);
/// 1 if adding `z` to `r` changes the high part, else 0 (MakeHint, Algorithm 39, given `r` and `r + z`).
std::uint32_t hint_of(std::uint32_t r, std::uint32_t r_and_z, std::uint32_t gamma2);
/// UseHint (Algorithm 40), for public values only.
std::uint32_t use_hint(bool hint, std::uint32_t r, std::uint32_t gamma2);

/// SimpleBitPack (Algorithm 16): 32·bits bytes.
void pack(const MlDsaPolynomial& polynomial, unsigned bits, std::span<std::byte> out);
/// BitPack (Algorithm 17) of coefficients from `most` - 2^bits + 1 to `most`.
void pack_below(const MlDsaPolynomial& polynomial, std::uint32_t most, unsigned bits,
                std::span<std::byte> out);
/// SimpleBitUnpack (Algorithm 18).
MlDsaPolynomial unpack(ByteView bytes, unsigned bits);
/// BitUnpack (Algorithm 19).
MlDsaPolynomial unpack_below(ByteView bytes, std::uint32_t most, unsigned bits);

/// RejNTTPoly (Algorithm 30) for a seed of 32 bytes and two indices; for public seeds only.
MlDsaPolynomial sample_ml_dsa_uniform(ByteView seed, std::uint8_t column, std::uint8_t row);
/// RejBoundedPoly (Algorithm 31) for a seed of 64 bytes: from -eta to eta, which is 2 or 4. Which of the
/// candidates are refused is public: the ones that are taken do not depend on it.
MlDsaPolynomial sample_ml_dsa_small(ByteView seed, std::uint16_t index, unsigned eta);
/// SampleInBall (Algorithm 29): `weight` coefficients are 1 or -1; for public seeds only.
MlDsaPolynomial sample_ml_dsa_challenge(ByteView seed, unsigned weight);

}  // namespace kiroku::crypto
