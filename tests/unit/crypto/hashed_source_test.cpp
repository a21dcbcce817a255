#include "crypto/hashed_source.h"

#include <algorithm>
#include <array>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "crypto/hash_trails.h"
#include "tests/support/patterned_bytes.h"

namespace kiroku::crypto {
namespace {

constexpr std::size_t kBlock = HashTrail::kBlockBytes;

/// Bytes that a test may change while they are read. Counts how many were asked for.
class ChangingSource final : public ByteSource {
 public:
  explicit ChangingSource(Bytes content) : bytes(std::move(content)), stated_size(bytes.size()) {}
  [[nodiscard]] std::uint64_t size() const override { return stated_size; }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    const std::size_t got = memory_source(bytes)->read_at(offset, into);
    read += got;
    return got;
  }

  Bytes bytes;
  std::uint64_t stated_size;
  mutable std::uint64_t read = 0;
};

std::shared_ptr<const HashTrail> trail_of(const ByteSource& source, const HashBegin& begin = {}) {
  return std::make_shared<const HashTrail>(HashTrail::of(source, begin));
}

Bytes read_whole(const HashedSource& source) {
  Bytes bytes(source.size());
  bytes.resize(source.read_at(0, bytes));
  return bytes;
}

auto changed_from(std::uint64_t offset) {
  return testing::Throws<SourceChanged>(testing::Property(&SourceChanged::offset, offset));
}

TEST(HashedSource, GivesTheBytesAndTheirHashAtEverySize) {
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{1}, kBlock - 1, kBlock, kBlock + 1, 3 * kBlock + 7}) {
    const ChangingSource source(test::patterned_bytes(size));
    const auto trail = trail_of(source);
    EXPECT_EQ(trail->digest(), sha256(source.bytes)) << size;
    EXPECT_EQ(source.read, size) << "each byte once";
    const HashedSource hashed(source, trail, "film");
    EXPECT_EQ(read_whole(hashed), source.bytes) << size;
    EXPECT_EQ(source.read, 2 * size) << "and once more";
  }
}

TEST(HashedSource, FurtherHashesAreOfTheSameBytesReadOnce) {
  constexpr std::array kFurther{HashAlgorithm::kSha512, HashAlgorithm::kSha3_512};
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, kBlock, 2 * kBlock + 7}) {
    const ChangingSource source(test::patterned_bytes(size));
    std::vector<Hasher> further(kFurther.begin(), kFurther.end());
    const HashTrail trail = HashTrail::of(source, {}, {}, further);
    EXPECT_EQ(source.read, size);
    EXPECT_EQ(trail.digest(), sha256(source.bytes)) << size;
    for (std::size_t i = 0; i < further.size(); ++i)
      EXPECT_EQ(further[i].so_far(), digest(kFurther[i], source.bytes)) << size;
  }
}

TEST(HashedSource, ReadsAnyRange) {
  const ChangingSource source(test::patterned_bytes(2 * kBlock + 100));
  const HashedSource hashed(source, trail_of(source), "film");
  for (const std::size_t offset : {std::size_t{0}, kBlock - 3, kBlock, 2 * kBlock - 1, 2 * kBlock + 99}) {
    for (const std::size_t size : {std::size_t{1}, std::size_t{10}, kBlock + 1}) {
      Bytes part(size);
      part.resize(hashed.read_at(offset, part));
      const std::size_t there = std::min(size, source.bytes.size() - offset);
      EXPECT_EQ(part, Bytes(source.bytes.begin() + static_cast<std::ptrdiff_t>(offset),
                            source.bytes.begin() + static_cast<std::ptrdiff_t>(offset + there)));
    }
  }
  Bytes none(1);
  EXPECT_EQ(hashed.read_at(source.bytes.size(), none), 0U);
}

TEST(HashedSource, AChangedByteIsRefusedWhereverItIs) {
  for (const std::size_t at : {std::size_t{0}, kBlock - 1, kBlock, 2 * kBlock - 1, 2 * kBlock + 99}) {
    ChangingSource source(test::patterned_bytes(2 * kBlock + 100));
    const HashedSource hashed(source, trail_of(source), "film");
    source.bytes[at] ^= std::byte{1};
    Bytes part(1);
    EXPECT_THAT([&] { hashed.read_at(at, part); }, changed_from(at / kBlock * kBlock)) << at;
    EXPECT_EQ(hashed.changed_at(), at / kBlock * kBlock);
  }
}

TEST(HashedSource, BytesBeforeTheChangeAreThoseThatWereHashed) {
  ChangingSource source(test::patterned_bytes(2 * kBlock));
  const HashedSource hashed(source, trail_of(source), "film");
  source.bytes[kBlock] ^= std::byte{1};
  Bytes first(kBlock);
  EXPECT_EQ(hashed.read_at(0, first), kBlock);
  EXPECT_TRUE(std::equal(first.begin(), first.end(), source.bytes.begin()));
  EXPECT_EQ(hashed.changed_at(), std::nullopt);
}

TEST(HashedSource, OnceChangedItGivesNothingMore) {
  ChangingSource source(test::patterned_bytes(2 * kBlock));
  const HashedSource hashed(source, trail_of(source), "film");
  const Bytes honest = source.bytes;
  source.bytes[kBlock] ^= std::byte{1};
  Bytes part(1);
  EXPECT_THAT([&] { hashed.read_at(kBlock, part); }, changed_from(kBlock));
  source.bytes = honest;
  EXPECT_THAT([&] { hashed.read_at(0, part); }, changed_from(kBlock));
}

TEST(HashedSource, BlocksThatChangePlacesAreRefused) {
  ChangingSource source(test::patterned_bytes(2 * kBlock));
  const HashedSource hashed(source, trail_of(source), "film");
  std::rotate(source.bytes.begin(), source.bytes.begin() + kBlock, source.bytes.end());
  Bytes part(1);
  EXPECT_THAT([&] { hashed.read_at(0, part); }, changed_from(0));
}

TEST(HashedSource, ASourceThatBecameShorterIsRefused) {
  ChangingSource source(test::patterned_bytes(2 * kBlock));
  const HashedSource hashed(source, trail_of(source), "film");
  source.bytes.resize(2 * kBlock - 1);
  EXPECT_THAT([&] { read_whole(hashed); }, changed_from(kBlock));
}

TEST(HashedSource, ASourceThatBecomesShorterWhileItIsHashedLeavesATrailOfTheRest) {
  ChangingSource source(test::patterned_bytes(2 * kBlock));
  source.bytes.resize(kBlock + 5);
  const auto trail = trail_of(source);
  EXPECT_EQ(trail->end(), kBlock + 5);
  EXPECT_EQ(trail->digest(), sha256(source.bytes));
}

TEST(HashedSource, AFrontStandsForWhatWasNotHashed) {
  const Bytes front = to_bytes(std::string_view("new front"));
  ChangingSource source(front);
  append(source.bytes, test::patterned_bytes(kBlock + 50));
  source.stated_size = source.bytes.size();
  const HashBegin begin{front.size(), bytes_of("the front as it was")};
  const auto trail = trail_of(source, begin);
  Bytes original = to_bytes(std::string_view("the front as it was"));
  append(original, ByteView(source.bytes).subspan(front.size()));
  EXPECT_EQ(trail->digest(), sha256(original));
  const HashedSource hashed(source, trail, "film", front);
  const Bytes honest = source.bytes;
  source.bytes[3] ^= std::byte{1};
  EXPECT_EQ(read_whole(hashed), honest) << "the front is read from the file no more";
  source.bytes[front.size()] ^= std::byte{1};
  EXPECT_EQ(read_whole(HashedSource(source, trail_of(source, begin), "film", front)).size(), honest.size());
  const HashedSource again(source, trail, "film", front);
  EXPECT_THAT([&] { read_whole(again); }, changed_from(front.size()));
}

TEST(HashedSource, SmallReadsInOrderReadNothingTwice) {
  const ChangingSource source(test::patterned_bytes(2 * kBlock));
  const HashedSource hashed(source, trail_of(source), "film");
  Bytes part(1000);
  for (std::uint64_t offset = 0; offset < source.bytes.size(); offset += part.size())
    hashed.read_at(offset, part);
  EXPECT_EQ(source.read, 4 * kBlock);
}

TEST(HashedSource, SaysWhatChangedAndWhatToDo) {
  EXPECT_STREQ(
      SourceChanged("segments/room/1", 42).what(),
      "segments/room/1 changed after it was hashed: from byte 42 on it holds other bytes, and nothing "
      "of them was used. Find out what writes to the file, or whether the disk fails, and try again");
}

TEST(HashTrails, ForgetTheOldestWhereThereAreTooMany) {
  HashTrails trails(3);
  std::vector<std::shared_ptr<const HashTrail>> made;
  for (std::uint8_t i = 0; i < 3; ++i) {
    const ChangingSource source(Bytes(kBlock + 1, std::byte{i}));
    made.push_back(trail_of(source));
    trails.add(made.back());
    trails.add(made.back());
  }
  EXPECT_EQ(trails.find(made[0]->digest()), nullptr);
  EXPECT_EQ(trails.find(made[1]->digest()), nullptr);
  EXPECT_EQ(trails.find(made[2]->digest()), made[2]);
}

}  // namespace
}  // namespace kiroku::crypto
