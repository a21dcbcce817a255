#include "crypto/ml_kem_polynomial.h"

#include "crypto/keccak.h"

namespace kiroku::crypto {
namespace {

constexpr std::uint32_t kQ = kMlKemQ;
constexpr std::uint32_t kRootOfUnity = 17;  // of order 256
constexpr std::uint32_t kInverseOf128 = 3303;

// x mod q for x < 2q: subtracts q, and adds it again if that went below zero.
constexpr std::uint16_t reduce_once(std::uint32_t x) {
  const std::uint32_t reduced = x - kQ;
  const std::uint32_t went_below = 0U - (reduced >> 31);
  return static_cast<std::uint16_t>((reduced + (kQ & went_below)) & 0xffff);
}

// floor(x / q) or one less, for x < 2^24 or so: Barrett's multiplication, because a division instruction
// takes longer for some numbers than for others.
constexpr unsigned kBarrettShift = 24;
constexpr std::uint64_t kBarrettFactor = (std::uint64_t{1} << kBarrettShift) / kQ;  // 5039
constexpr std::uint32_t quotient_or_one_less(std::uint32_t x) {
  return static_cast<std::uint32_t>(x * kBarrettFactor >> kBarrettShift);
}

// x mod q for x ≤ 2(q - 1)²: there the quotient is at most one too small.
constexpr std::uint16_t reduce(std::uint32_t x) { return reduce_once(x - quotient_or_one_less(x) * kQ); }

constexpr std::uint16_t multiply(std::uint32_t a, std::uint32_t b) { return reduce(a * b); }
constexpr std::uint16_t add(std::uint32_t a, std::uint32_t b) { return reduce_once(a + b); }
constexpr std::uint16_t subtract(std::uint32_t a, std::uint32_t b) { return reduce_once(a + kQ - b); }

constexpr std::uint32_t reverse_7_bits(std::uint32_t x) {
  std::uint32_t result = 0;
  for (unsigned bit = 0; bit < 7; ++bit) result |= (x >> bit & 1) << (6 - bit);
  return result;
}

constexpr std::uint16_t power_of_root(std::uint32_t exponent) {
  std::uint32_t result = 1;
  for (std::uint32_t i = 0; i < exponent; ++i) result = result * kRootOfUnity % kQ;
  return static_cast<std::uint16_t>(result);
}

// ζ^BitRev7(i), and ζ^(2·BitRev7(i) + 1), of FIPS 203 appendix A.
constexpr std::array<std::uint16_t, 128> kZetas = [] {
  std::array<std::uint16_t, 128> table{};
  for (std::uint32_t i = 0; i < 128; ++i) table[i] = power_of_root(reverse_7_bits(i));
  return table;
}();
constexpr std::array<std::uint16_t, 128> kGammas = [] {
  std::array<std::uint16_t, 128> table{};
  for (std::uint32_t i = 0; i < 128; ++i) table[i] = power_of_root(2 * reverse_7_bits(i) + 1);
  return table;
}();

// All ones if a < b, else zero; both below 2^31.
constexpr std::uint32_t mask_if_less(std::uint32_t a, std::uint32_t b) { return 0U - ((a - b) >> 31); }

// round(2^bits / q · x) mod 2^bits.
constexpr std::uint32_t compress(std::uint32_t x, unsigned bits) {
  const std::uint32_t scaled = x << bits;
  std::uint32_t quotient = quotient_or_one_less(scaled);
  const std::uint32_t remainder = scaled - quotient * kQ;  // below 2q
  quotient += 1 & mask_if_less(kQ / 2, remainder);
  quotient += 1 & mask_if_less(kQ + kQ / 2, remainder);
  return quotient & ((1U << bits) - 1);
}

// round(q / 2^bits · y).
constexpr std::uint16_t decompress(std::uint32_t y, unsigned bits) {
  return static_cast<std::uint16_t>((y * kQ + (1U << (bits - 1))) >> bits);
}

constexpr unsigned kUncompressedBits = 12;

}  // namespace

void MlKemPolynomial::add(const MlKemPolynomial& other) {
  for (std::size_t i = 0; i < kMlKemDegree; ++i)
    coefficients[i] = crypto::add(coefficients[i], other.coefficients[i]);
}

void MlKemPolynomial::subtract(const MlKemPolynomial& other) {
  for (std::size_t i = 0; i < kMlKemDegree; ++i)
    coefficients[i] = crypto::subtract(coefficients[i], other.coefficients[i]);
}

void MlKemPolynomial::add_product(const MlKemPolynomial& a, const MlKemPolynomial& b) {
  for (std::size_t i = 0; i < kMlKemDegree; i += 2) {
    const std::uint32_t a0 = a.coefficients[i];
    const std::uint32_t a1 = a.coefficients[i + 1];
    const std::uint32_t b0 = b.coefficients[i];
    const std::uint32_t b1 = b.coefficients[i + 1];
    // Modulo X² - γ.
    const std::uint16_t low = reduce(a0 * b0 + multiply(multiply(a1, b1), kGammas[i / 2]));
    const std::uint16_t high = reduce(a0 * b1 + a1 * b0);
    coefficients[i] = crypto::add(coefficients[i], low);
    coefficients[i + 1] = crypto::add(coefficients[i + 1], high);
  }
}

void MlKemPolynomial::transform() {
  std::size_t next_zeta = 1;
  for (std::size_t length = 128; length >= 2; length /= 2) {
    for (std::size_t start = 0; start < kMlKemDegree; start += 2 * length) {
      const std::uint16_t zeta = kZetas[next_zeta++];
      for (std::size_t i = start; i < start + length; ++i) {
        const std::uint16_t product = multiply(zeta, coefficients[i + length]);
        coefficients[i + length] = crypto::subtract(coefficients[i], product);
        coefficients[i] = crypto::add(coefficients[i], product);
      }
    }
  }
}

void MlKemPolynomial::inverse_transform() {
  std::size_t next_zeta = 127;
  for (std::size_t length = 2; length <= 128; length *= 2) {
    for (std::size_t start = 0; start < kMlKemDegree; start += 2 * length) {
      const std::uint16_t zeta = kZetas[next_zeta--];
      for (std::size_t i = start; i < start + length; ++i) {
        const std::uint16_t first = coefficients[i];
        coefficients[i] = crypto::add(first, coefficients[i + length]);
        coefficients[i + length] = multiply(zeta, crypto::subtract(coefficients[i + length], first));
      }
    }
  }
  for (auto& coefficient : coefficients) coefficient = multiply(coefficient, kInverseOf128);
}

void encode_polynomial(const MlKemPolynomial& polynomial, unsigned bits, std::span<std::byte> out) {
  std::uint32_t held = 0;
  unsigned held_bits = 0;
  std::size_t written = 0;
  for (const std::uint32_t coefficient : polynomial.coefficients) {
    held |= (bits == kUncompressedBits ? coefficient : compress(coefficient, bits)) << held_bits;
    for (held_bits += bits; held_bits >= 8; held_bits -= 8) {
      out[written++] = static_cast<std::byte>(held & 0xff);
      held >>= 8;
    }
  }
}

MlKemPolynomial decode_polynomial(ByteView bytes, unsigned bits) {
  MlKemPolynomial polynomial;
  std::uint32_t held = 0;
  unsigned held_bits = 0;
  std::size_t read = 0;
  for (auto& coefficient : polynomial.coefficients) {
    for (; held_bits < bits; held_bits += 8)
      held |= std::to_integer<std::uint32_t>(bytes[read++]) << held_bits;
    const std::uint32_t value = held & ((1U << bits) - 1);
    held >>= bits;
    held_bits -= bits;
    coefficient = bits == kUncompressedBits ? reduce_once(value) : decompress(value, bits);
  }
  return polynomial;
}

MlKemPolynomial sample_uniform_polynomial(ByteView seed, std::uint8_t column, std::uint8_t row) {
  constexpr std::size_t kShakeBlock = 168;
  const std::array<std::byte, 2> indices = {std::byte{column}, std::byte{row}};
  // Three blocks are nearly always enough; if not, the same stream is made again, longer.
  for (std::size_t blocks = 3;; ++blocks) {
    Bytes stream(blocks * kShakeBlock);
    keccak(Keccak::kShake128, {seed, indices}, stream);
    MlKemPolynomial polynomial;
    std::size_t filled = 0;
    for (std::size_t i = 0; i < stream.size() && filled < kMlKemDegree; i += 3) {
      const auto b0 = std::to_integer<std::uint32_t>(stream[i]);
      const auto b1 = std::to_integer<std::uint32_t>(stream[i + 1]);
      const auto b2 = std::to_integer<std::uint32_t>(stream[i + 2]);
      const std::uint32_t candidates[] = {b0 | (b1 & 15) << 8, b1 >> 4 | b2 << 4};
      for (const std::uint32_t candidate : candidates)
        if (candidate < kQ && filled < kMlKemDegree)
          polynomial.coefficients[filled++] = static_cast<std::uint16_t>(candidate);
    }
    if (filled == kMlKemDegree) return polynomial;
  }
}

MlKemPolynomial sample_small_polynomial(ByteView seed, std::uint8_t nonce) {
  const std::byte nonce_byte{nonce};
  std::array<std::byte, 128> stream;
  keccak(Keccak::kShake256, {seed, {&nonce_byte, 1}}, stream);
  MlKemPolynomial polynomial;
  for (std::size_t i = 0; i < kMlKemDegree; ++i) {
    // Four bits a coefficient: the sum of two minus the sum of the other two.
    const std::uint32_t bits = std::to_integer<std::uint32_t>(stream[i / 2]) >> (i % 2 * 4) & 15;
    polynomial.coefficients[i] = subtract((bits & 1) + (bits >> 1 & 1), (bits >> 2 & 1) + (bits >> 3 & 1));
  }
  zeroise(stream);
  return polynomial;
}

}  // namespace kiroku::crypto
