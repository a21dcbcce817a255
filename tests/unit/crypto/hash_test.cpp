#include "crypto/hash.h"

#include <gtest/gtest.h>

#include "crypto/encoding.h"

namespace kiroku::crypto {
namespace {

// NIST FIPS 180 examples.
constexpr std::string_view kTwoBlocks = "abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq";

TEST(Hash, GivesThePublishedSha256Digests) {
  EXPECT_EQ(to_hex(sha256({})), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(to_hex(sha256(bytes_of("abc"))),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(to_hex(sha256(bytes_of(kTwoBlocks))),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

TEST(Hash, GivesThePublishedSha384AndSha512Digests) {
  EXPECT_EQ(to_hex(digest(HashAlgorithm::kSha384, bytes_of("abc"))),
            "cb00753f45a35e8bb5a03d699ac65007272c32ab0eded1631a8b605a43ff5bed"
            "8086072ba1e7cc2358baeca134c825a7");
  EXPECT_EQ(to_hex(digest(HashAlgorithm::kSha512, bytes_of("abc"))),
            "ddaf35a193617abacc417349ae20413112e6fa4e89a97ea20a9eeee64b55d39a"
            "2192992a274fc1a836ba3c23a3feebbd454d4423643ce80e2a9ac94fa54ca49f");
  EXPECT_EQ(digest(HashAlgorithm::kSha256, bytes_of("abc")), to_bytes(sha256(bytes_of("abc"))));
}

// FIPS 202; the values are those of NIST's examples.
TEST(Hash, GivesThePublishedSha3Digests) {
  EXPECT_EQ(to_hex(digest(HashAlgorithm::kSha3_256, bytes_of("abc"))),
            "3a985da74fe225b2045c172d6bd390bd855f086e3e9d525b46bfe24511431532");
  EXPECT_EQ(
      to_hex(digest(HashAlgorithm::kSha3_384, bytes_of("abc"))),
      "ec01498288516fc926459f58e2c6ad8df9b473cb0fc08c2596da7cf0e49be4b298d88cea927ac7f539f1edf228376d25");
  EXPECT_EQ(to_hex(digest(HashAlgorithm::kSha3_512, bytes_of("abc"))),
            "b751850b1a57168a5693cd924b6b096e08f621827444f70d884f5d0240d2712e"
            "10e116e9192af3c91a7ec57647e3934057340b4cf408d5a56592f8274eec53f0");
}

TEST(Hash, EachNameNamesItsAlgorithm) {
  for (const HashAlgorithm algorithm : kHashAlgorithms) {
    EXPECT_EQ(hash_named(hash_name(algorithm)), algorithm);
    EXPECT_EQ(digest(algorithm, {}).size(), hash_size(algorithm));
  }
  for (const char* other : {"sha224", "md5", "SHA256", ""}) EXPECT_FALSE(hash_named(other)) << other;
}

TEST(Hash, OfAStreamIsThatOfTheWholeAndGoesOn) {
  for (const HashAlgorithm algorithm : kHashAlgorithms) {
    Hasher hasher(algorithm);
    hasher.update(bytes_of("ab"));
    EXPECT_EQ(hasher.so_far(), digest(algorithm, bytes_of("ab")));
    hasher.update(bytes_of("c"));
    EXPECT_EQ(hasher.so_far(), digest(algorithm, bytes_of("abc")));
  }
}

TEST(Hash, AMillionLettersInUnevenPiecesGiveThePublishedDigest) {
  const std::string letters(1'000'000, 'a');
  std::string_view rest = letters;
  Sha256 hash;
  for (std::size_t size = 1; !rest.empty(); size = size * 3 + 1) {
    hash.update(bytes_of(rest.substr(0, size)));
    rest.remove_prefix(std::min(size, rest.size()));
  }
  EXPECT_EQ(to_hex(hash.finish()), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Hash, StartsAfreshAfterFinish) {
  Sha256 hash;
  hash.update(bytes_of("something else"));
  hash.finish();
  hash.update(bytes_of("abc"));
  EXPECT_EQ(hash.finish(), sha256(bytes_of("abc")));
}

TEST(Hash, NamesAndSizesBelongToTheAlgorithms) {
  for (const auto algorithm : {HashAlgorithm::kSha256, HashAlgorithm::kSha384, HashAlgorithm::kSha512}) {
    EXPECT_EQ(digest(algorithm, {}).size(), hash_size(algorithm));
    EXPECT_EQ(hash_name(algorithm), "sha" + std::to_string(8 * hash_size(algorithm)));
  }
}

}  // namespace
}  // namespace kiroku::crypto
