#include "crypto/ml_dsa_own.h"

#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "crypto/keccak.h"
#include "crypto/ml_dsa_polynomial.h"
#include "crypto/published.h"

namespace kiroku::crypto {
namespace {

constexpr std::size_t kSeedSize = 32;       // ρ and K
constexpr std::size_t kNoiseSeedSize = 64;  // ρ' and ρ''
constexpr std::size_t kHashSize = 64;       // tr
constexpr unsigned kHighBits = 10;          // of t1
constexpr std::uint32_t kMostLow = 1U << (kMlDsaDroppedBits - 1);

// FIPS 204 table 1.
struct Parameters {
  std::size_t rows;     // k
  std::size_t columns;  // l
  unsigned eta;
  unsigned weight;  // τ
  std::uint32_t gamma1;
  std::uint32_t gamma2;
  std::size_t most_hints;      // ω
  std::size_t challenge_size;  // λ / 4

  [[nodiscard]] constexpr std::uint32_t beta() const { return weight * eta; }
  [[nodiscard]] constexpr unsigned small_bits() const {
    return static_cast<unsigned>(std::bit_width(2 * eta));
  }
  [[nodiscard]] constexpr unsigned mask_bits() const {
    return static_cast<unsigned>(std::bit_width(2 * gamma1 - 1));
  }
  [[nodiscard]] constexpr unsigned commitment_bits() const {
    return static_cast<unsigned>(std::bit_width((kMlDsaQ - 1) / (2 * gamma2) - 1));
  }
  [[nodiscard]] constexpr std::size_t public_key_size() const { return kSeedSize + 32 * kHighBits * rows; }
  [[nodiscard]] constexpr std::size_t private_key_size() const {
    return 2 * kSeedSize + kHashSize + 32 * (small_bits() * (rows + columns) + kMlDsaDroppedBits * rows);
  }
  [[nodiscard]] constexpr std::size_t signature_size() const {
    return challenge_size + 32 * mask_bits() * columns + most_hints + rows;
  }
};
constexpr Parameters k44 = {4, 4, 2, 39, 1U << 17, (kMlDsaQ - 1) / 88, 80, 32};
constexpr Parameters k65 = {6, 5, 4, 49, 1U << 19, (kMlDsaQ - 1) / 32, 55, 48};
static_assert(k44.private_key_size() == 2560 && k65.private_key_size() == 4032);
static_assert(k44.public_key_size() == ml_dsa_public_key_size(MlDsaSet::k44) &&
              k65.public_key_size() == ml_dsa_public_key_size(MlDsaSet::k65));
static_assert(k44.signature_size() == ml_dsa_signature_size(MlDsaSet::k44) &&
              k65.signature_size() == ml_dsa_signature_size(MlDsaSet::k65));

const Parameters& parameters_of(MlDsaSet set) { return set == MlDsaSet::k44 ? k44 : k65; }

using Vector = std::vector<MlDsaPolynomial>;

void transform(Vector& vector) {
  for (auto& polynomial : vector) polynomial.transform();
}

// Entry (row, column) of the matrix Â (Algorithm 32), row by row.
Vector expand_matrix(const Parameters& p, ByteView matrix_seed) {
  Vector matrix;
  matrix.reserve(p.rows * p.columns);
  for (std::size_t row = 0; row < p.rows; ++row)
    for (std::size_t column = 0; column < p.columns; ++column)
      matrix.push_back(sample_ml_dsa_uniform(matrix_seed, static_cast<std::uint8_t>(column),
                                             static_cast<std::uint8_t>(row)));
  return matrix;
}

// Â times a transformed vector; not transformed back.
Vector product(const Parameters& p, const Vector& matrix, const Vector& vector) {
  Vector result(p.rows);
  for (std::size_t row = 0; row < p.rows; ++row)
    for (std::size_t column = 0; column < p.columns; ++column)
      result[row].add_product(matrix[row * p.columns + column], vector[column]);
  return result;
}

// A transformed polynomial times a transformed vector, transformed back.
Vector product(const MlDsaPolynomial& scalar, const Vector& vector) {
  Vector result(vector.size());
  for (std::size_t i = 0; i < vector.size(); ++i) {
    result[i].add_product(scalar, vector[i]);
    result[i].inverse_transform();
  }
  return result;
}

std::uint32_t mask_if_norm_reaches(const Vector& vector, std::uint32_t bound) {
  std::uint32_t reached = 0;
  for (const auto& polynomial : vector) reached |= polynomial.mask_if_norm_reaches(bound);
  return reached;
}

// Polynomials of one length each, one after the other, at the front of what is left.
class Packer {
 public:
  explicit Packer(std::span<std::byte> out) : out_(out) {}
  std::span<std::byte> take(std::size_t size) {
    const auto part = out_.first(size);
    out_ = out_.subspan(size);
    return part;
  }
  void put(ByteView bytes) { std::ranges::copy(bytes, take(bytes.size()).begin()); }
  void put(const Vector& vector, unsigned bits) {
    for (const auto& polynomial : vector) pack(polynomial, bits, take(32 * bits));
  }
  void put_below(const Vector& vector, std::uint32_t most, unsigned bits) {
    for (const auto& polynomial : vector) pack_below(polynomial, most, bits, take(32 * bits));
  }

 private:
  std::span<std::byte> out_;
};
class Unpacker {
 public:
  explicit Unpacker(ByteView in) : in_(in) {}
  ByteView take(std::size_t size) {
    const ByteView part = in_.first(size);
    in_ = in_.subspan(size);
    return part;
  }
  Vector get(std::size_t count, unsigned bits) {
    Vector vector;
    vector.reserve(count);
    for (std::size_t i = 0; i < count; ++i) vector.push_back(unpack(take(32 * bits), bits));
    return vector;
  }
  Vector get_below(std::size_t count, std::uint32_t most, unsigned bits) {
    Vector vector;
    vector.reserve(count);
    for (std::size_t i = 0; i < count; ++i) vector.push_back(unpack_below(take(32 * bits), most, bits));
    return vector;
  }

 private:
  ByteView in_;
};

struct PrivateParts {
  ByteView matrix_seed;
  ByteView signing_seed;  // K
  Vector s1, s2, t0;      // transformed
};
// skDecode (Algorithm 25).
PrivateParts unpack_private_key(const Parameters& p, ByteView key) {
  if (key.size() != p.private_key_size()) {
    throw UsageError("an ML-DSA private key has " + std::to_string(p.private_key_size()) +
                     " bytes, and this one " + std::to_string(key.size()));
  }
  Unpacker in(key);
  PrivateParts parts;
  parts.matrix_seed = in.take(kSeedSize);
  parts.signing_seed = in.take(kSeedSize);
  in.take(kHashSize);
  parts.s1 = in.get_below(p.columns, p.eta, p.small_bits());
  parts.s2 = in.get_below(p.rows, p.eta, p.small_bits());
  parts.t0 = in.get_below(p.rows, kMostLow, kMlDsaDroppedBits);
  const std::uint32_t out_of_range =
      mask_if_norm_reaches(parts.s1, p.eta + 1) | mask_if_norm_reaches(parts.s2, p.eta + 1);
  publish(&out_of_range);
  if (out_of_range != 0) throw UsageError("this is no ML-DSA private key: it has values that no key has");
  transform(parts.s1);
  transform(parts.s2);
  transform(parts.t0);
  return parts;
}

// The hash of a representative and a commitment w1.
Bytes challenge_seed(const Parameters& p, ByteView representative, const Vector& commitment) {
  Secret encoded(32 * p.commitment_bits() * p.rows);
  Packer(encoded.bytes()).put(commitment, p.commitment_bits());
  Bytes seed(p.challenge_size);
  keccak(Keccak::kShake256, {representative, encoded.bytes()}, seed);
  return seed;
}

// ExpandMask (Algorithm 34).
Vector sample_mask(const Parameters& p, ByteView seed, std::size_t nonce) {
  Vector mask;
  mask.reserve(p.columns);
  for (std::size_t i = 0; i < p.columns; ++i) {
    const std::array<std::byte, 2> nonce_bytes = {static_cast<std::byte>((nonce + i) & 0xff),
                                                  static_cast<std::byte>((nonce + i) >> 8 & 0xff)};
    Secret stream(32 * p.mask_bits());
    keccak(Keccak::kShake256, {seed, nonce_bytes}, stream.bytes());
    mask.push_back(unpack_below(stream.bytes(), p.gamma1, p.mask_bits()));
  }
  return mask;
}

// HintBitPack (Algorithm 20).
void pack_hints(const Parameters& p, const Vector& hints, std::span<std::byte> out) {
  std::size_t count = 0;
  for (std::size_t row = 0; row < p.rows; ++row) {
    for (std::size_t i = 0; i < kMlDsaDegree; ++i)
      if (hints[row].coefficients[i] != 0) out[count++] = static_cast<std::byte>(i);
    out[p.most_hints + row] = static_cast<std::byte>(count);
  }
}

// HintBitUnpack (Algorithm 21): nothing for any other form than the one that is written.
std::optional<Vector> unpack_hints(const Parameters& p, ByteView in) {
  Vector hints(p.rows);
  std::size_t read = 0;
  for (std::size_t row = 0; row < p.rows; ++row) {
    const auto end = std::to_integer<std::size_t>(in[p.most_hints + row]);
    if (end < read || end > p.most_hints) return std::nullopt;
    for (const std::size_t first = read; read < end; ++read) {
      if (read > first && in[read - 1] >= in[read]) return std::nullopt;
      hints[row].coefficients[std::to_integer<std::size_t>(in[read])] = 1;
    }
  }
  for (; read < p.most_hints; ++read)
    if (in[read] != std::byte{0}) return std::nullopt;
  return hints;
}

struct Signature {
  Bytes challenge_seed;
  Vector response;  // z
  Vector hints;     // 1 or 0
};

// One round of Algorithm 7: nothing where the signature would tell of the key.
std::optional<Signature> try_to_sign(const Parameters& p, const PrivateParts& key, const Vector& matrix,
                                     ByteView representative, Vector mask) {
  Vector transformed = mask;
  transform(transformed);
  Vector w = product(p, matrix, transformed);
  for (auto& polynomial : w) polynomial.inverse_transform();
  Vector commitment(p.rows);
  for (std::size_t row = 0; row < p.rows; ++row)
    for (std::size_t i = 0; i < kMlDsaDegree; ++i)
      commitment[row].coefficients[i] = decompose(w[row].coefficients[i], p.gamma2).high;

  Signature signature{challenge_seed(p, representative, commitment), std::move(mask), Vector(p.rows)};
  publish(signature.challenge_seed.data(), signature.challenge_seed.size());
  MlDsaPolynomial challenge = sample_ml_dsa_challenge(signature.challenge_seed, p.weight);
  challenge.transform();

  const Vector cs1 = product(challenge, key.s1);
  const Vector cs2 = product(challenge, key.s2);
  for (std::size_t column = 0; column < p.columns; ++column) signature.response[column].add(cs1[column]);
  Vector low(p.rows);
  for (std::size_t row = 0; row < p.rows; ++row) {
    w[row].subtract(cs2[row]);
    for (std::size_t i = 0; i < kMlDsaDegree; ++i)
      low[row].coefficients[i] = decompose(w[row].coefficients[i], p.gamma2).low;
  }
  const std::uint32_t tells = mask_if_norm_reaches(signature.response, p.gamma1 - p.beta()) |
                              mask_if_norm_reaches(low, p.gamma2 - p.beta());
  publish(&tells);
  if (tells != 0) return std::nullopt;

  const Vector ct0 = product(challenge, key.t0);
  std::uint32_t count = 0;
  for (std::size_t row = 0; row < p.rows; ++row) {
    MlDsaPolynomial r = w[row];
    r.add(ct0[row]);
    for (std::size_t i = 0; i < kMlDsaDegree; ++i) {
      const std::uint32_t hint = hint_of(r.coefficients[i], w[row].coefficients[i], p.gamma2);
      signature.hints[row].coefficients[i] = hint;
      count += hint;
    }
  }
  const bool too_far =
      (mask_if_norm_reaches(ct0, p.gamma2) | (static_cast<std::uint32_t>(p.most_hints) - count) >> 31) != 0;
  publish(&too_far);
  if (too_far) return std::nullopt;
  return signature;
}

}  // namespace

ml_dsa_own::Keys ml_dsa_own::generate(MlDsaSet set, ByteView seed) {
  const Parameters& p = parameters_of(set);
  const std::array<std::byte, 2> shape = {static_cast<std::byte>(p.rows), static_cast<std::byte>(p.columns)};
  Secret seeds(kSeedSize + kNoiseSeedSize + kSeedSize);
  keccak(Keccak::kShake256, {seed, shape}, seeds.bytes());
  const ByteView matrix_seed = seeds.bytes().first(kSeedSize);
  const ByteView noise_seed = seeds.bytes().subspan(kSeedSize, kNoiseSeedSize);
  const ByteView signing_seed = seeds.bytes().last(kSeedSize);
  publish(matrix_seed.data(), matrix_seed.size());

  Vector s1;
  Vector s2;
  for (std::size_t i = 0; i < p.columns + p.rows; ++i)
    (i < p.columns ? s1 : s2)
        .push_back(sample_ml_dsa_small(noise_seed, static_cast<std::uint16_t>(i), p.eta));
  Vector transformed = s1;
  transform(transformed);
  Vector t = product(p, expand_matrix(p, matrix_seed), transformed);
  Vector high(p.rows);
  Vector low(p.rows);
  for (std::size_t row = 0; row < p.rows; ++row) {
    t[row].inverse_transform();
    t[row].add(s2[row]);
    for (std::size_t i = 0; i < kMlDsaDegree; ++i) {
      const MlDsaRounded rounded = power_of_two_round(t[row].coefficients[i]);
      high[row].coefficients[i] = rounded.high;
      low[row].coefficients[i] = rounded.low;
    }
  }

  Keys keys{Bytes(p.public_key_size()), Secret(p.private_key_size())};
  Packer public_key(keys.public_key);
  public_key.put(matrix_seed);
  public_key.put(high, kHighBits);
  publish(keys.public_key.data(), keys.public_key.size());
  std::array<std::byte, kHashSize> hash;
  keccak(Keccak::kShake256, {keys.public_key}, hash);
  Packer private_key(keys.private_key.bytes());
  private_key.put(matrix_seed);
  private_key.put(signing_seed);
  private_key.put(hash);
  private_key.put_below(s1, p.eta, p.small_bits());
  private_key.put_below(s2, p.eta, p.small_bits());
  private_key.put_below(low, kMostLow, kMlDsaDroppedBits);
  return keys;
}

Bytes ml_dsa_own::representative(ByteView public_key, ByteView message, ByteView context) {
  std::array<std::byte, kHashSize> hash;
  keccak(Keccak::kShake256, {public_key}, hash);
  const std::array<std::byte, 2> pure = {std::byte{0}, static_cast<std::byte>(context.size())};
  Bytes result(kRepresentativeSize);
  keccak(Keccak::kShake256, {hash, pure, context, message}, result);
  return result;
}

Bytes ml_dsa_own::sign(MlDsaSet set, ByteView private_key, ByteView representative, ByteView randomness) {
  const Parameters& p = parameters_of(set);
  const PrivateParts key = unpack_private_key(p, private_key);
  const Vector matrix = expand_matrix(p, key.matrix_seed);
  Secret mask_seed(kNoiseSeedSize);
  keccak(Keccak::kShake256, {key.signing_seed, randomness, representative}, mask_seed.bytes());
  std::optional<Signature> signature;
  for (std::size_t nonce = 0; !signature; nonce += p.columns)
    signature = try_to_sign(p, key, matrix, representative, sample_mask(p, mask_seed.bytes(), nonce));

  for (const auto& hints : signature->hints) publish(hints.coefficients.data(), hints.coefficients.size());
  Bytes result(p.signature_size());
  Packer out(result);
  out.put(signature->challenge_seed);
  out.put_below(signature->response, p.gamma1, p.mask_bits());
  pack_hints(p, signature->hints, out.take(p.most_hints + p.rows));
  publish(result.data(), result.size());
  return result;
}

bool ml_dsa_own::verify(MlDsaSet set, ByteView public_key, ByteView representative, ByteView signature) {
  const Parameters& p = parameters_of(set);
  Unpacker in(signature);
  const ByteView stated_seed = in.take(p.challenge_size);
  Vector response = in.get_below(p.columns, p.gamma1, p.mask_bits());
  const auto hints = unpack_hints(p, in.take(p.most_hints + p.rows));
  if (!hints || mask_if_norm_reaches(response, p.gamma1 - p.beta()) != 0) return false;

  Unpacker key(public_key);
  const Vector matrix = expand_matrix(p, key.take(kSeedSize));
  Vector high = key.get(p.rows, kHighBits);
  MlDsaPolynomial challenge = sample_ml_dsa_challenge(stated_seed, p.weight);
  challenge.transform();
  transform(response);
  Vector w = product(p, matrix, response);
  Vector commitment(p.rows);
  for (std::size_t row = 0; row < p.rows; ++row) {
    for (auto& coefficient : high[row].coefficients) coefficient <<= kMlDsaDroppedBits;
    high[row].transform();
    MlDsaPolynomial shift;
    shift.add_product(challenge, high[row]);
    w[row].subtract(shift);
    w[row].inverse_transform();
    for (std::size_t i = 0; i < kMlDsaDegree; ++i)
      commitment[row].coefficients[i] =
          use_hint((*hints)[row].coefficients[i] != 0, w[row].coefficients[i], p.gamma2);
  }
  return std::ranges::equal(challenge_seed(p, representative, commitment), stated_seed);
}

}  // namespace kiroku::crypto
