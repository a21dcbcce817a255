// Published vectors of ML-DSA: Wycheproof's, every case, and ACVP's (vectors/README.md says which and
// whence).
#include <charconv>
#include <fstream>
#include <map>
#include <sstream>

#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "crypto/keccak.h"
#include "crypto/ml_dsa_own.h"
#include "tests/support/build_paths.h"
#include "tests/support/ml_dsa_cases.h"

namespace kiroku::crypto {
namespace {

std::string hash_of(ByteView bytes) { return to_hex(sha256(bytes)); }

std::size_t number_of(std::string_view text) {
  std::size_t number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

Bytes from_hex_text(std::string_view text) {
  auto bytes = from_hex(text);
  if (!bytes) throw Error("the vectors hold a word that is no hex: " + std::string(text));
  return *bytes;
}

/// The lines of vectors/ml_dsa.txt as words, and the byte strings that they refer to.
class MlDsaVectors {
 public:
  using Line = std::vector<std::string>;

  MlDsaVectors() {
    std::ifstream in(test::source_folder() / "tests/unit/crypto/vectors/ml_dsa.txt");
    for (std::string text; std::getline(in, text);) {
      std::istringstream words(text);
      Line line;
      for (std::string word; words >> word;) line.push_back(std::move(word));
      if (line.at(0) == "blob")
        blobs_.push_back(from_base64(line.at(1), Base64Padding::kPadded).value());
      else
        lines_.push_back(std::move(line));
    }
  }

  /// Those of a kind and a parameter set.
  [[nodiscard]] std::vector<Line> of(const std::string& kind, MlDsaSet set) const {
    const std::string level = set == MlDsaSet::k44 ? "44" : "65";
    std::vector<Line> found;
    for (const Line& line : lines_)
      if (line[0] == kind && line[1] == level) found.push_back(line);
    return found;
  }

  /// "-", hex, or "#number" of an earlier byte string with ",place:byte" for what differs.
  [[nodiscard]] Bytes bytes(std::string_view word) const {
    if (word == "-") return {};
    if (!word.starts_with('#')) return from_hex_text(word);
    Bytes bytes = blobs_.at(number_of(word.substr(1)));
    while (word.find(',') != std::string_view::npos) {
      word.remove_prefix(word.find(',') + 1);
      bytes.at(number_of(word)) = from_hex_text(word.substr(word.find(':') + 1, 2))[0];
    }
    return bytes;
  }

 private:
  std::vector<Line> lines_;
  std::vector<Bytes> blobs_;
};

const MlDsaVectors& vectors() {
  static const MlDsaVectors all;
  return all;
}

/// Of the internal interface: a message is hashed behind the public key's hash, without a context.
Bytes internal_representative(ByteView public_key_hash, ByteView message) {
  Bytes result(ml_dsa_own::kRepresentativeSize);
  keccak(Keccak::kShake256, {public_key_hash, message}, result);
  return result;
}

class MlDsaPublished : public MlDsa {
 protected:
  static bool is_own() { return GetParam().provider == MlDsaProvider::kOwn; }
  static std::string name_of(const MlDsaVectors::Line& line) {
    return line[0] + " " + line[1] + " " + line[2] + " " + line[4];
  }
};
INSTANTIATE_TEST_SUITE_P(, MlDsaPublished, testing::ValuesIn(test::ml_dsa_cases()), test::ml_dsa_case_name);

// sign SET CASE RESULT seed SEED HASH-OF-PUBLIC-KEY RND WHAT CONTEXT HASH-OF-SIGNATURE, or with "key KEY
// HASH-OF-KEY" for a private key that is given expanded. WHAT is a message, or "mu:" and its representative.
TEST_P(MlDsaPublished, WycheproofSignsFromSeeds) {
  std::size_t count = 0;
  for (const auto& line : vectors().of("sign", set())) {
    if (line[4] != "seed") continue;
    ++count;
    SCOPED_TRACE(name_of(line));
    const Bytes seed = vectors().bytes(line[5]);
    const Bytes context = vectors().bytes(line[9]);
    if (line[3] == "invalid") {
      EXPECT_THROW(static_cast<void>(key_of(seed).sign({}, context)), UsageError);
      continue;
    }
    const auto key = key_of(seed);
    EXPECT_EQ(hash_of(key.public_key()), line[6]);
    const Bytes randomness = line[7] == "-" ? Bytes(kMlDsaRandomnessSize) : vectors().bytes(line[7]);
    if (line[8].starts_with("mu:")) {  // only our own takes a representative
      if (!is_own()) continue;
      const auto keys = ml_dsa_own::generate(set(), seed);
      EXPECT_EQ(hash_of(ml_dsa_own::sign(set(), keys.private_key.bytes(), from_hex_text(line[8].substr(3)),
                                         randomness)),
                line[10]);
      continue;
    }
    const Bytes message = vectors().bytes(line[8]);
    const Bytes signature = key.sign_with(randomness, message, context);
    EXPECT_EQ(hash_of(signature), line[10]);
    EXPECT_TRUE(verify(key.public_key(), message, signature, context));
  }
  EXPECT_EQ(count, set() == MlDsaSet::k44 ? 86U : 105U);
}

TEST_P(MlDsaPublished, WycheproofSignsWithExpandedKeys) {
  if (!is_own()) GTEST_SKIP() << "only our own implementation takes an expanded key";
  std::size_t count = 0;
  for (const auto& line : vectors().of("sign", set())) {
    if (line[4] != "key") continue;
    ++count;
    SCOPED_TRACE(name_of(line));
    constexpr std::string_view kExpand = "expand:";
    Secret key;
    Bytes public_key;
    if (line[5].starts_with(kExpand)) {
      auto keys = ml_dsa_own::generate(set(), from_hex_text(line[5].substr(kExpand.size())));
      key = std::move(keys.private_key);
      public_key = std::move(keys.public_key);
    } else {
      key = Secret::copy_of(vectors().bytes(line[5]));
    }
    ASSERT_EQ(hash_of(key.bytes()), line[6]);
    const Bytes context = vectors().bytes(line[9]);
    const Bytes randomness = line[7] == "-" ? Bytes(kMlDsaRandomnessSize) : vectors().bytes(line[7]);
    if (line[3] == "invalid") {
      if (context.size() > kMlDsaLongestContext) continue;  // the key's user refuses it, as from a seed
      const Bytes any(ml_dsa_own::kRepresentativeSize);
      EXPECT_THROW(ml_dsa_own::sign(set(), key.bytes(), any, randomness), UsageError);
      continue;
    }
    Bytes representative;
    if (line[8].starts_with("mu:")) {
      representative = from_hex_text(line[8].substr(3));
    } else {
      // A key without a known seed holds its public key's hash, and that alone.
      Bytes pure{std::byte{0}, static_cast<std::byte>(context.size())};
      append(pure, context);
      append(pure, vectors().bytes(line[8]));
      representative = internal_representative(ByteView(key.bytes()).subspan(64, 64), pure);
    }
    const Bytes signature = ml_dsa_own::sign(set(), key.bytes(), representative, randomness);
    EXPECT_EQ(hash_of(signature), line[10]);
    EXPECT_TRUE(public_key.empty() || ml_dsa_own::verify(set(), public_key, representative, signature));
  }
  EXPECT_EQ(count, set() == MlDsaSet::k44 ? 73U : 78U);
}

// verify SET CASE RESULT PUBLIC-KEY MESSAGE CONTEXT SIGNATURE, of which "case:NUMBER" is what a case from a
// seed signs, and "seed:SEED" that seed's key.
TEST_P(MlDsaPublished, WycheproofVerifies) {
  std::map<std::string, MlDsaVectors::Line> signing;
  for (const auto& line : vectors().of("sign", set()))
    if (line[4] == "seed") signing[line[2]] = line;
  std::size_t count = 0;
  for (const auto& line : vectors().of("verify", set())) {
    ++count;
    SCOPED_TRACE(name_of(line));
    const Bytes public_key = line[4].starts_with("seed:")
                                 ? key_of(from_hex_text(line[4].substr(5))).public_key()
                                 : vectors().bytes(line[4]);
    Bytes signature;
    if (line[7].starts_with("case:")) {
      const auto& made = signing.at(line[7].substr(5));
      signature = key_of(vectors().bytes(made[5]))
                      .sign_deterministically(vectors().bytes(made[8]), vectors().bytes(made[9]));
      ASSERT_EQ(hash_of(signature), made[10]);
    } else {
      signature = vectors().bytes(line[7]);
    }
    EXPECT_EQ(verify(public_key, vectors().bytes(line[5]), signature, vectors().bytes(line[6])),
              line[3] == "valid");
  }
  EXPECT_EQ(count, set() == MlDsaSet::k44 ? 180U : 210U);
}

// acvp-key SET CASE SEED HASH-OF-PUBLIC-KEY HASH-OF-PRIVATE-KEY.
TEST_P(MlDsaPublished, AcvpGeneratesKeys) {
  const auto lines = vectors().of("acvp-key", set());
  EXPECT_EQ(lines.size(), 25U);
  for (const auto& line : lines) {
    const Bytes seed = from_hex_text(line[3]);
    EXPECT_EQ(hash_of(key_of(seed).public_key()), line[4]) << line[2];
    EXPECT_EQ(hash_of(ml_dsa_own::generate(set(), seed).private_key.bytes()), line[5]) << line[2];
  }
}

// acvp-sign SET CASE PRIVATE-KEY MESSAGE RND HASH-OF-SIGNATURE.
TEST_P(MlDsaPublished, AcvpSigns) {
  // ACVP's interface is the internal one.
  if (!is_own()) GTEST_SKIP() << "only our own implementation has the internal interface";
  const auto lines = vectors().of("acvp-sign", set());
  EXPECT_EQ(lines.size(), 4U);
  for (const auto& line : lines) {
    const Bytes key = vectors().bytes(line[3]);
    const Bytes randomness = line[5] == "-" ? Bytes(kMlDsaRandomnessSize) : from_hex_text(line[5]);
    const ByteView public_key_hash = ByteView(key).subspan(64, 64);
    const Bytes representative = internal_representative(public_key_hash, vectors().bytes(line[4]));
    EXPECT_EQ(hash_of(ml_dsa_own::sign(set(), key, representative, randomness)), line[6]) << line[2];
  }
}

// acvp-verify SET CASE RESULT PUBLIC-KEY MESSAGE SIGNATURE.
TEST_P(MlDsaPublished, AcvpVerifies) {
  if (!is_own()) GTEST_SKIP() << "only our own implementation has the internal interface";
  const auto lines = vectors().of("acvp-verify", set());
  EXPECT_EQ(lines.size(), 15U);
  for (const auto& line : lines) {
    const Bytes public_key = vectors().bytes(line[4]);
    Bytes public_key_hash(64);
    keccak(Keccak::kShake256, {public_key}, public_key_hash);
    const Bytes representative = internal_representative(public_key_hash, vectors().bytes(line[5]));
    EXPECT_EQ(ml_dsa_own::verify(set(), public_key, representative, vectors().bytes(line[6])),
              line[3] == "valid")
        << line[2];
  }
}

}  // namespace
}  // namespace kiroku::crypto
