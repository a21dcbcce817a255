// The age test vectors of C2SP/CCTV: what must open, and how exactly everything else must fail.
#include <algorithm>

#include <gtest/gtest.h>
#ifdef KIROKU_TEST_ZLIB
#include <zlib.h>
#endif

#include "crypto/age_file.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "tests/support/shared_data.h"

namespace kiroku::crypto {
namespace {

constexpr std::size_t kAgeVectors = 96;

struct AgeVector {
  std::string name;
  std::string expect;
  std::string payload_hash;
  AgeIdentities identities;
  bool armored = false;
  bool compressed = false;
  Bytes file;
};

Bytes inflate(ByteView compressed) {
#ifdef KIROKU_TEST_ZLIB
  Bytes plain(64 << 20);
  uLongf size = plain.size();
  if (uncompress(reinterpret_cast<Bytef*>(plain.data()), &size,
                 reinterpret_cast<const Bytef*>(compressed.data()), compressed.size()) != Z_OK)
    throw Error("a vector does not decompress");
  plain.resize(size);
  return plain;
#else
  return to_bytes(compressed);
#endif
}

AgeVector read_vector(const std::filesystem::path& path) {
  AgeVector vector;
  vector.name = path.filename();
  const Bytes content = test::read_whole(path);
  std::string_view text = text_of(content);
  while (true) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 1);
    if (line.empty()) break;
    const std::string_view key = line.substr(0, line.find(": "));
    const std::string_view value = line.substr(key.size() + 2);
    if (key == "expect")
      vector.expect = value;
    else if (key == "payload")
      vector.payload_hash = value;
    else if (key == "identity")
      vector.identities.push_back(parse_identity(value));
    else if (key == "passphrase")
      vector.identities.push_back(passphrase_identity(Secret::copy_of(value)));
    else if (key == "armored")
      vector.armored = true;
    else if (key == "compressed")
      vector.compressed = true;
    else if (key != "file key" && key != "comment")
      throw Error("unknown line in vector " + vector.name);
  }
  vector.file = vector.compressed ? inflate(bytes_of(text)) : to_bytes(text);
  return vector;
}

std::vector<AgeVector> all_vectors() {
  std::vector<AgeVector> vectors;
  for (const auto& entry : std::filesystem::directory_iterator(test::shared_data("timestamp/age-cctv")))
    vectors.push_back(read_vector(entry.path()));
  std::ranges::sort(vectors, {}, &AgeVector::name);
  return vectors;
}

#ifdef KIROKU_TEST_ZLIB
#define KIROKU_NEEDS_VECTORS() KIROKU_NEEDS_SHARED_DATA("timestamp/age-cctv")
#else
#define KIROKU_NEEDS_VECTORS() GTEST_SKIP() << "built without zlib, which some vectors are compressed with"
#endif

bool is_payload_failure(AgeFailure failure) {
  return failure == AgeFailure::kPayloadDamaged || failure == AgeFailure::kTruncated ||
         failure == AgeFailure::kTrailingData;
}

// The vectors' own words for what we say.
std::string expectation_of(AgeFailure failure) {
  if (is_payload_failure(failure)) return "payload failure";
  switch (failure) {
    case AgeFailure::kArmored:
      return "armored";
    case AgeFailure::kHeaderForged:
      return "HMAC failure";
    case AgeFailure::kNoMatch:
      return "no match";
    default:
      return "header failure";
  }
}

struct Outcome {
  std::string expectation = "success";
  Bytes plaintext;  // all that left before a failure
};

Outcome stream(const AgeVector& vector) {
  Outcome outcome;
  ByteView rest = vector.file;
  const auto read = [&](std::span<std::byte> into) {
    // Pieces of odd sizes, as a pipe would give.
    const auto piece = rest.first(std::min({rest.size(), into.size(), std::size_t{1031}}));
    std::ranges::copy(piece, into.begin());
    rest = rest.subspan(piece.size());
    return piece.size();
  };
  try {
    unseal_stream(read, vector.identities, [&](ByteView bytes) { append(outcome.plaintext, bytes); });
  } catch (const AgeError& error) {
    outcome.expectation = expectation_of(error.failure());
  }
  return outcome;
}

Outcome open_whole(const AgeVector& vector, unsigned threads) {
  Outcome outcome;
  const auto source = memory_source(vector.file);
  try {
    const AgeFile file = AgeFile::open(*source, vector.identities);
    file.read_all([&](ByteView bytes) { append(outcome.plaintext, bytes); }, threads);
    EXPECT_EQ(file.plaintext_size(), outcome.plaintext.size());
  } catch (const AgeError& error) {
    outcome.expectation = expectation_of(error.failure());
  }
  return outcome;
}

bool begins_with(ByteView whole, ByteView front) {
  return front.size() <= whole.size() && std::ranges::equal(whole.first(front.size()), front);
}

TEST(AgeVectors, StreamsOpenAndFailAsPublished) {
  KIROKU_NEEDS_VECTORS();
  const auto vectors = all_vectors();
  EXPECT_EQ(vectors.size(), kAgeVectors);
  std::size_t armored = 0;
  for (const auto& vector : vectors) {
    SCOPED_TRACE(vector.name);
    const Outcome outcome = stream(vector);
    if (vector.armored) {
      ++armored;
      EXPECT_EQ(outcome.expectation, "armored");
      continue;
    }
    EXPECT_EQ(outcome.expectation, vector.expect);
    if (!vector.payload_hash.empty()) {
      EXPECT_EQ(to_hex(sha256(outcome.plaintext)), vector.payload_hash);
    }
  }
  EXPECT_EQ(armored, 22U);
}

TEST(AgeVectors, FilesOpenAndFailAsPublished) {
  KIROKU_NEEDS_VECTORS();
  for (const auto& vector : all_vectors()) {
    SCOPED_TRACE(vector.name);
    const std::string expectation = vector.armored ? "armored" : vector.expect;
    const Bytes streamed = stream(vector).plaintext;
    for (const unsigned threads : {1U, 3U}) {
      const Outcome outcome = open_whole(vector, threads);
      EXPECT_EQ(outcome.expectation, expectation);
      // A reader by offset may see damage sooner than one that reads along, never emit anything else.
      EXPECT_TRUE(begins_with(streamed, outcome.plaintext));
      if (expectation == "success") {
        EXPECT_EQ(outcome.plaintext, streamed);
      }
    }
  }
}

}  // namespace
}  // namespace kiroku::crypto
