#include "crypto/ml_dsa_polynomial.h"

#include "crypto/keccak.h"
#include "crypto/published.h"

namespace kiroku::crypto {
namespace {

constexpr std::uint32_t kQ = kMlDsaQ;
constexpr std::uint32_t kRootOfUnity = 1753;  // of order 512
constexpr std::uint32_t kInverseOf256 = 8347681;
constexpr std::size_t kShake128Block = 168;
constexpr std::size_t kShake256Block = 136;

// All ones if a < b, else zero; both below 2^31.
constexpr std::uint32_t mask_if_less(std::uint32_t a, std::uint32_t b) { return 0U - ((a - b) >> 31); }

// x mod q for x < 2q.
constexpr std::uint32_t reduce_once(std::uint32_t x) {
  const std::uint32_t reduced = x - kQ;
  return reduced + (kQ & (0U - (reduced >> 31)));
}

constexpr std::uint32_t add(std::uint32_t a, std::uint32_t b) { return reduce_once(a + b); }
constexpr std::uint32_t subtract(std::uint32_t a, std::uint32_t b) { return reduce_once(a + kQ - b); }

// x mod q for x < 2^46. As q = 2^23 - 2^13 + 1, what stands above bit 23 counts 2^13 - 1 times as much
// below: three foldings leave less than 2q.
constexpr std::uint32_t reduce(std::uint64_t x) {
  constexpr unsigned kBits = 23;
  constexpr std::uint64_t kLow = (1U << kBits) - 1;
  constexpr std::uint64_t kFactor = (1U << 13) - 1;
  static_assert(kQ == (1U << kBits) - kFactor);
  for (int folding = 0; folding < 3; ++folding) x = (x & kLow) + (x >> kBits) * kFactor;
  return reduce_once(static_cast<std::uint32_t>(x));
}

constexpr std::uint32_t multiply(std::uint32_t a, std::uint32_t b) { return reduce(std::uint64_t{a} * b); }

// ζ^BitRev8(i), of FIPS 204 appendix B.
constexpr std::array<std::uint32_t, 256> kZetas = [] {
  std::array<std::uint32_t, 256> table{};
  std::uint32_t power = 1;
  for (unsigned exponent = 0; exponent < 256; ++exponent) {
    unsigned reversed = 0;
    for (unsigned bit = 0; bit < 8; ++bit) reversed |= (exponent >> bit & 1) << (7 - bit);
    table[reversed] = power;
    power = multiply(power, kRootOfUnity);
  }
  return table;
}();

// floor(x / (2·gamma2)) for x < 2^24, by multiplication: a division instruction takes longer for some
// numbers than for others. 2·gamma2 is (q - 1) / 44 or (q - 1) / 16.
constexpr std::uint32_t quotient(std::uint32_t x, std::uint32_t gamma2) {
  constexpr unsigned kShift = 48;
  constexpr std::uint32_t kSmall = (kQ - 1) / 44;
  constexpr std::uint32_t kLarge = (kQ - 1) / 16;
  constexpr std::uint64_t kFactorOfSmall = (std::uint64_t{1} << kShift) / kSmall + 1;
  constexpr std::uint64_t kFactorOfLarge = (std::uint64_t{1} << kShift) / kLarge + 1;
  return static_cast<std::uint32_t>(x * (2 * gamma2 == kSmall ? kFactorOfSmall : kFactorOfLarge) >> kShift);
}

// How often 2·gamma2 fits into q - 1.
constexpr std::uint32_t highest(std::uint32_t gamma2) { return 2 * gamma2 == (kQ - 1) / 44 ? 44 : 16; }

}  // namespace

void MlDsaPolynomial::add(const MlDsaPolynomial& other) {
  for (std::size_t i = 0; i < kMlDsaDegree; ++i)
    coefficients[i] = crypto::add(coefficients[i], other.coefficients[i]);
}

void MlDsaPolynomial::subtract(const MlDsaPolynomial& other) {
  for (std::size_t i = 0; i < kMlDsaDegree; ++i)
    coefficients[i] = crypto::subtract(coefficients[i], other.coefficients[i]);
}

void MlDsaPolynomial::add_product(const MlDsaPolynomial& a, const MlDsaPolynomial& b) {
  for (std::size_t i = 0; i < kMlDsaDegree; ++i)
    coefficients[i] = crypto::add(coefficients[i], multiply(a.coefficients[i], b.coefficients[i]));
}

void MlDsaPolynomial::transform() {
  std::size_t next_zeta = 1;
  for (std::size_t length = 128; length >= 1; length /= 2) {
    for (std::size_t start = 0; start < kMlDsaDegree; start += 2 * length) {
      const std::uint32_t zeta = kZetas[next_zeta++];
      for (std::size_t i = start; i < start + length; ++i) {
        const std::uint32_t product = multiply(zeta, coefficients[i + length]);
        coefficients[i + length] = crypto::subtract(coefficients[i], product);
        coefficients[i] = crypto::add(coefficients[i], product);
      }
    }
  }
}

void MlDsaPolynomial::inverse_transform() {
  std::size_t next_zeta = 255;
  for (std::size_t length = 1; length <= 128; length *= 2) {
    for (std::size_t start = 0; start < kMlDsaDegree; start += 2 * length) {
      const std::uint32_t zeta = kZetas[next_zeta--];
      for (std::size_t i = start; i < start + length; ++i) {
        const std::uint32_t first = coefficients[i];
        coefficients[i] = crypto::add(first, coefficients[i + length]);
        // Times -ζ.
        coefficients[i + length] = multiply(zeta, crypto::subtract(coefficients[i + length], first));
      }
    }
  }
  for (auto& coefficient : coefficients) coefficient = multiply(coefficient, kInverseOf256);
}

std::uint32_t MlDsaPolynomial::mask_if_norm_reaches(std::uint32_t bound) const {
  std::uint32_t reached = 0;
  for (const std::uint32_t coefficient : coefficients)
    reached |= ~mask_if_less(coefficient, bound) & mask_if_less(coefficient, kQ - bound + 1);
  return reached;
}

MlDsaRounded power_of_two_round(std::uint32_t r) {
  const std::uint32_t high = (r + (1U << (kMlDsaDroppedBits - 1)) - 1) >> kMlDsaDroppedBits;
  return {high, subtract(r, high << kMlDsaDroppedBits)};
}

MlDsaRounded decompose(std::uint32_t r, std::uint32_t gamma2) {
  std::uint32_t high = quotient(r + gamma2 - 1, gamma2);
  // What would be rounded up to q - 1 is rounded to zero, from below.
  high &= mask_if_less(high, highest(gamma2));
  return {high, subtract(r, high * 2 * gamma2)};
}

std::uint32_t hint_of(std::uint32_t r, std::uint32_t r_and_z, std::uint32_t gamma2) {
  const std::uint32_t difference = decompose(r, gamma2).high ^ decompose(r_and_z, gamma2).high;
  return (0U - difference) >> 31;
}

std::uint32_t use_hint(bool hint, std::uint32_t r, std::uint32_t gamma2) {
  const auto [high, low] = decompose(r, gamma2);
  if (!hint) return high;
  const std::uint32_t count = highest(gamma2);
  const bool positive = low != 0 && low <= gamma2;
  return (high + (positive ? 1 : count - 1)) % count;
}

void pack(const MlDsaPolynomial& polynomial, unsigned bits, std::span<std::byte> out) {
  std::uint64_t held = 0;
  unsigned held_bits = 0;
  std::size_t written = 0;
  for (const std::uint32_t coefficient : polynomial.coefficients) {
    held |= std::uint64_t{coefficient} << held_bits;
    for (held_bits += bits; held_bits >= 8; held_bits -= 8) {
      out[written++] = static_cast<std::byte>(held & 0xff);
      held >>= 8;
    }
  }
}

void pack_below(const MlDsaPolynomial& polynomial, std::uint32_t most, unsigned bits,
                std::span<std::byte> out) {
  MlDsaPolynomial below;
  for (std::size_t i = 0; i < kMlDsaDegree; ++i)
    below.coefficients[i] = subtract(most, polynomial.coefficients[i]);
  pack(below, bits, out);
}

MlDsaPolynomial unpack(ByteView bytes, unsigned bits) {
  MlDsaPolynomial polynomial;
  std::uint64_t held = 0;
  unsigned held_bits = 0;
  std::size_t read = 0;
  for (auto& coefficient : polynomial.coefficients) {
    for (; held_bits < bits; held_bits += 8)
      held |= std::to_integer<std::uint64_t>(bytes[read++]) << held_bits;
    coefficient = static_cast<std::uint32_t>(held & ((1U << bits) - 1));
    held >>= bits;
    held_bits -= bits;
  }
  return polynomial;
}

MlDsaPolynomial unpack_below(ByteView bytes, std::uint32_t most, unsigned bits) {
  MlDsaPolynomial polynomial = unpack(bytes, bits);
  for (auto& coefficient : polynomial.coefficients) coefficient = subtract(most, coefficient);
  return polynomial;
}

MlDsaPolynomial sample_ml_dsa_uniform(ByteView seed, std::uint8_t column, std::uint8_t row) {
  const std::array<std::byte, 2> indices = {std::byte{column}, std::byte{row}};
  // Five blocks are nearly always enough; if not, the same stream is made again, longer.
  for (std::size_t blocks = 5;; ++blocks) {
    Bytes stream(blocks * kShake128Block);
    keccak(Keccak::kShake128, {seed, indices}, stream);
    MlDsaPolynomial polynomial;
    std::size_t filled = 0;
    for (std::size_t i = 0; i < stream.size() && filled < kMlDsaDegree; i += 3) {
      const std::uint32_t candidate = std::to_integer<std::uint32_t>(stream[i]) |
                                      std::to_integer<std::uint32_t>(stream[i + 1]) << 8 |
                                      std::to_integer<std::uint32_t>(stream[i + 2] & std::byte{0x7f}) << 16;
      if (candidate < kQ) polynomial.coefficients[filled++] = candidate;
    }
    if (filled == kMlDsaDegree) return polynomial;
  }
}

MlDsaPolynomial sample_ml_dsa_small(ByteView seed, std::uint16_t index, unsigned eta) {
  const std::array<std::byte, 2> index_bytes = {static_cast<std::byte>(index & 0xff),
                                                static_cast<std::byte>(index >> 8)};
  const std::uint32_t candidates = eta == 2 ? 15 : 9;  // of the 16 that four bits can be
  for (std::size_t blocks = 2;; ++blocks) {
    Secret stream(blocks * kShake256Block);
    keccak(Keccak::kShake256, {seed, index_bytes}, stream.bytes());
    MlDsaPolynomial polynomial;
    std::size_t filled = 0;
    for (std::size_t i = 0; i < 2 * stream.size() && filled < kMlDsaDegree; ++i) {
      const std::uint32_t bits = std::to_integer<std::uint32_t>(stream.bytes()[i / 2]) >> (i % 2 * 4) & 15;
      const std::uint32_t taken = mask_if_less(bits, candidates);
      publish(&taken);
      if (taken == 0) continue;
      // Modulo 5 where eta is 2: 205 / 1024 is a fifth for what is so small.
      const std::uint32_t rest = eta == 2 ? bits - (bits * 205 >> 10) * 5 : bits;
      polynomial.coefficients[filled++] = subtract(eta, rest);
    }
    if (filled == kMlDsaDegree) return polynomial;
  }
}

MlDsaPolynomial sample_ml_dsa_challenge(ByteView seed, unsigned weight) {
  for (std::size_t blocks = 1;; ++blocks) {
    Bytes stream(blocks * kShake256Block);
    keccak(Keccak::kShake256, {seed}, stream);
    constexpr std::size_t kSigns = 8;
    MlDsaPolynomial polynomial;
    auto& c = polynomial.coefficients;
    std::size_t i = kMlDsaDegree - weight;
    for (std::size_t read = kSigns; read < stream.size() && i < kMlDsaDegree; ++read) {
      const auto j = std::to_integer<std::size_t>(stream[read]);
      if (j > i) continue;
      const std::size_t sign = i + weight - kMlDsaDegree;
      const bool negative = (std::to_integer<unsigned>(stream[sign / 8]) >> sign % 8 & 1) != 0;
      c[i] = c[j];
      c[j] = negative ? kQ - 1 : 1;
      ++i;
    }
    if (i == kMlDsaDegree) return polynomial;
  }
}

}  // namespace kiroku::crypto
