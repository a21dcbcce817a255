#include "crypto/age_file.h"

#include <algorithm>
#include <fcntl.h>
#include <fstream>
#include <thread>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/patterned_bytes.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::crypto {
namespace {

using test::patterned_bytes;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::size_t kSizes[] = {0,      1,      65535,  65536,   65537,   131071,
                                  131072, 131073, 600000, 1048576, 1310720, 1310721};

struct Keys {
  AgeRecipients recipients;
  AgeIdentities identities;
};

Keys new_keys() {
  const AgeKeyPair pair = generate_age_key();
  return {{parse_recipient(pair.recipient)}, {parse_identity(pair.identity_text.text())}};
}

const Keys& keys() {
  static const Keys result = new_keys();
  return result;
}

Bytes read_all(const AgeFile& file, unsigned threads) {
  Bytes plaintext;
  file.read_all([&](ByteView bytes) { append(plaintext, bytes); }, threads);
  return plaintext;
}

Bytes unseal_by_stream(ByteView sealed, const AgeIdentities& identities, Bytes* plaintext = nullptr) {
  Bytes own;
  Bytes& out = plaintext == nullptr ? own : *plaintext;
  unseal_stream(
      [&](std::span<std::byte> into) {
        const auto taken = sealed.first(std::min(into.size(), sealed.size()));
        std::ranges::copy(taken, into.begin());
        sealed = sealed.subspan(taken.size());
        return taken.size();
      },
      identities, [&](ByteView bytes) { append(out, bytes); });
  return out;
}

// How opening and reading everything fails; what left before it.
struct Refusal {
  std::optional<AgeFailure> failure;
  std::string message;
  Bytes plaintext;
};

Refusal open_and_read(ByteView sealed, Truncation truncation = Truncation::kRefuse, unsigned threads = 1) {
  Refusal result;
  try {
    const auto source = memory_source(sealed);
    const AgeFile file = AgeFile::open(*source, keys().identities, truncation);
    file.read_all([&](ByteView bytes) { append(result.plaintext, bytes); }, threads);
  } catch (const AgeError& error) {
    result.failure = error.failure();
    result.message = error.what();
  }
  return result;
}

std::size_t header_size_of(ByteView sealed) {
  const auto source = memory_source(sealed);
  return static_cast<std::size_t>(
      AgeFile::open(*source, keys().identities, Truncation::kTolerate).header_size());
}

Bytes front_of(ByteView bytes, std::size_t size) { return to_bytes(bytes.first(size)); }

TEST(AgeFile, ReturnsWhatWasSealedAtEverySize) {
  for (const std::size_t size : kSizes) {
    const Bytes plaintext = patterned_bytes(size);
    const Bytes sealed = seal_bytes(plaintext, keys().recipients);
    const auto source = memory_source(sealed);
    const AgeFile file = AgeFile::open(*source, keys().identities);
    EXPECT_EQ(file.plaintext_size(), size);
    EXPECT_FALSE(file.is_truncated());
    for (const unsigned threads : {1U, 2U, 5U}) EXPECT_EQ(read_all(file, threads), plaintext) << size;
    EXPECT_EQ(unseal_by_stream(sealed, keys().identities), plaintext) << size;
    EXPECT_EQ(unseal_bytes(sealed, keys().identities), plaintext) << size;
  }
}

TEST(AgeFile, PiecesOfAnySizeGiveTheSameChunks) {
  const Bytes plaintext = patterned_bytes(300000);
  for (const std::size_t piece : {1UL, 1000UL, 65535UL, 65536UL, 65537UL, 200000UL}) {
    Bytes sealed;
    std::vector<std::size_t> calls;
    AgeSealer sealer(keys().recipients, [&](ByteView bytes) {
      append(sealed, bytes);
      calls.push_back(bytes.size());
    });
    for (std::size_t begin = 0; begin < plaintext.size(); begin += piece)
      sealer.write(ByteView(plaintext).subspan(begin, std::min(piece, plaintext.size() - begin)));
    sealer.finish();
    EXPECT_EQ(unseal_bytes(sealed, keys().identities), plaintext) << piece;
    // Header and nonce, four full chunks, the rest.
    ASSERT_EQ(calls.size(), 6U);
    for (std::size_t i = 1; i < 5; ++i) EXPECT_EQ(calls[i], kSealedAgeChunkSize);
    EXPECT_EQ(calls[5], plaintext.size() - 4 * kAgeChunkSize + kAeadTagSize);
  }
}

TEST(AgeFile, EachRecipientOpensItAndNobodyElse) {
  const Keys first = new_keys();
  const Keys second = new_keys();
  const Bytes sealed = seal_bytes(bytes_of("film"), {first.recipients[0], second.recipients[0]});
  EXPECT_EQ(text_of(unseal_bytes(sealed, first.identities)), "film");
  EXPECT_EQ(text_of(unseal_bytes(sealed, second.identities)), "film");
  EXPECT_EQ(text_of(unseal_bytes(sealed, {keys().identities[0], second.identities[0]})), "film");
  EXPECT_EQ(open_and_read(sealed).failure, AgeFailure::kNoMatch);
}

TEST(AgeFile, NeedsRecipientsAndIdentities) {
  EXPECT_THROW(seal_bytes({}, {}), UsageError);
  EXPECT_THROW(unseal_bytes(seal_bytes({}, keys().recipients), {}), UsageError);
}

TEST(AgeFile, TwoSealingsShareNoBytesBeyondTheForm) {
  const Bytes plaintext(1000);
  const Bytes first = seal_bytes(plaintext, keys().recipients);
  const Bytes second = seal_bytes(plaintext, keys().recipients);
  EXPECT_EQ(first.size(), second.size());
  EXPECT_FALSE(std::equal(first.end() - 1016, first.end(), second.end() - 1016));
}

TEST(AgeFile, ReadsAnyRange) {
  const Bytes plaintext = patterned_bytes(200000);
  const Bytes sealed = seal_bytes(plaintext, keys().recipients);
  const auto source = memory_source(sealed);
  const AgeFile file = AgeFile::open(*source, keys().identities);
  for (const std::size_t offset : {0UL, 1UL, 65535UL, 65536UL, 65537UL, 131072UL, 199999UL}) {
    for (const std::size_t size : {0UL, 1UL, 65535UL, 65536UL, 65537UL, 300000UL}) {
      Bytes into(size, std::byte{0xee});
      const std::size_t expected = std::min(size, plaintext.size() - offset);
      ASSERT_EQ(file.read_at(offset, into), expected);
      EXPECT_TRUE(
          std::ranges::equal(ByteView(into).first(expected), ByteView(plaintext).subspan(offset, expected)));
    }
  }
  Bytes into(10);
  EXPECT_EQ(file.read_at(200000, into), 0U);
  EXPECT_EQ(file.read_at(~std::uint64_t{0}, into), 0U);
}

TEST(AgeFile, ReadsFromManyThreadsAtOnce) {
  const Bytes plaintext = patterned_bytes(500000);
  const Bytes sealed = seal_bytes(plaintext, keys().recipients);
  const auto source = memory_source(sealed);
  const AgeFile file = AgeFile::open(*source, keys().identities);
  std::vector<std::thread> readers;
  std::array<bool, 4> right{};
  for (std::size_t number = 0; number < right.size(); ++number) {
    readers.emplace_back([&, number] {
      bool good = true;
      for (std::size_t offset = number * 7919; offset + 5000 < plaintext.size(); offset += 14983) {
        Bytes into(5000);
        good = file.read_at(offset, into) == into.size() &&
               std::ranges::equal(into, ByteView(plaintext).subspan(offset, into.size())) && good;
      }
      right[number] = good;
    });
  }
  for (auto& reader : readers) reader.join();
  EXPECT_THAT(right, testing::Each(true));
}

TEST(AgeFile, EveryCutIsFound) {
  const Bytes plaintext = patterned_bytes(65536 + 100);
  const Bytes sealed = seal_bytes(plaintext, keys().recipients);
  const std::size_t header = header_size_of(sealed);
  for (std::size_t size = 0; size < sealed.size();
       size += size < 400 || size > sealed.size() - 200 ? 1U : 997U) {
    const Refusal refusal = open_and_read(front_of(sealed, size));
    ASSERT_TRUE(refusal.failure) << size;
    EXPECT_EQ(refusal.failure == AgeFailure::kHeaderMalformed, size < header + 16) << size;
    Bytes streamed;
    EXPECT_THROW(unseal_by_stream(ByteView(sealed).first(size), keys().identities, &streamed), AgeError);
    EXPECT_TRUE(streamed.empty() || streamed == front_of(plaintext, kAgeChunkSize)) << size;
  }
  // After a whole chunk, or with less than a tag left, there is no doubt that it was cut.
  const std::size_t first_chunk_end = header + 16 + kSealedAgeChunkSize;
  for (const std::size_t size :
       {header + 16, header + 17, first_chunk_end, first_chunk_end + 1, first_chunk_end + 15})
    EXPECT_EQ(open_and_read(front_of(sealed, size)).failure, AgeFailure::kTruncated) << size;
}

TEST(AgeFile, ATruncatedFileCanBeReadUpToItsLastWholeChunk) {
  const Bytes plaintext = patterned_bytes(10 * kAgeChunkSize + 5);
  const Bytes sealed = seal_bytes(plaintext, keys().recipients);
  const std::size_t payload = header_size_of(sealed) + 16;
  const auto readable = [&](const Bytes& cut, std::size_t chunks) {
    const auto source = memory_source(cut);
    const AgeFile file = AgeFile::open(*source, keys().identities, Truncation::kTolerate);
    EXPECT_TRUE(file.is_truncated());
    EXPECT_EQ(file.plaintext_size(), chunks * kAgeChunkSize);
    const std::size_t end = payload + chunks * kSealedAgeChunkSize;
    EXPECT_EQ(file.unreadable_size(), cut.size() - std::min(cut.size(), end));
    for (const unsigned threads : {1U, 2U})
      EXPECT_EQ(read_all(file, threads), front_of(plaintext, chunks * kAgeChunkSize));
  };
  readable(front_of(sealed, sealed.size() - 1), 10);
  readable(front_of(sealed, payload + 10 * kSealedAgeChunkSize), 10);
  readable(front_of(sealed, payload + 10 * kSealedAgeChunkSize - 1), 9);
  readable(front_of(sealed, payload + kSealedAgeChunkSize + 3), 1);
  readable(front_of(sealed, payload + 3), 0);
  readable(front_of(sealed, payload), 0);
  readable(front_of(sealed, payload - 5), 0);  // within the nonce
  Bytes zeros_behind =
      front_of(sealed, payload + 4 * kSealedAgeChunkSize + 1000);  // as a power cut leaves them
  zeros_behind.resize(zeros_behind.size() + 3 * kSealedAgeChunkSize);
  readable(zeros_behind, 4);
  Bytes zeros_between = sealed;
  std::fill_n(zeros_between.begin() + static_cast<std::ptrdiff_t>(payload + 3 * kSealedAgeChunkSize + 4096),
              4096, std::byte{0});
  readable(zeros_between, 3);  // what follows them opens, and yet nobody reads on over a hole
  readable(front_of(zeros_between, sealed.size() - 1), 3);

  const auto source = memory_source(sealed);
  const AgeFile whole = AgeFile::open(*source, keys().identities, Truncation::kTolerate);
  EXPECT_FALSE(whole.is_truncated());
  EXPECT_EQ(whole.unreadable_size(), 0U);
  EXPECT_EQ(read_all(whole, 1), plaintext);
}

TEST(AgeFile, SaysWhichChunkIsDamagedAfterEverythingBeforeIt) {
  constexpr std::size_t kChunks = 40;  // several runs for each of the threads
  const Bytes plaintext = patterned_bytes(kChunks * kAgeChunkSize - 7);
  const Bytes sealed = seal_bytes(plaintext, keys().recipients);
  const std::size_t payload = header_size_of(sealed) + 16;
  for (const std::size_t damaged : {0UL, 7UL, 8UL, 30UL}) {
    Bytes bad = sealed;
    bad[payload + damaged * kSealedAgeChunkSize + 1234] ^= std::byte{0x10};
    for (const unsigned threads : {1U, 2U, 4U}) {
      const Refusal refusal = open_and_read(bad, Truncation::kRefuse, threads);
      EXPECT_EQ(refusal.failure, AgeFailure::kPayloadDamaged);
      EXPECT_THAT(refusal.message, HasSubstr("chunk " + std::to_string(damaged) + " at byte " +
                                             std::to_string(payload + damaged * kSealedAgeChunkSize)));
      EXPECT_EQ(refusal.plaintext, front_of(plaintext, damaged * kAgeChunkSize));
    }
    Bytes streamed;
    EXPECT_THAT([&] { unseal_by_stream(bad, keys().identities, &streamed); },
                ThrowsMessage<AgeError>(HasSubstr("chunk " + std::to_string(damaged) + " ")));
    EXPECT_EQ(streamed, front_of(plaintext, damaged * kAgeChunkSize));
    const auto source = memory_source(bad);
    const AgeFile file = AgeFile::open(*source, keys().identities);
    Bytes into(100);
    EXPECT_THROW(file.read_at(damaged * kAgeChunkSize + 50, into), AgeError);
    EXPECT_THROW(file.read_at(damaged * kAgeChunkSize + 50, into), AgeError);  // and again
    EXPECT_EQ(file.read_at(20 * kAgeChunkSize, into), into.size());
  }
}

TEST(AgeFile, DamageInTheLastChunkIsFoundWhenOpening) {
  const Bytes plaintext = patterned_bytes(3 * kAgeChunkSize + 100);
  Bytes sealed = seal_bytes(plaintext, keys().recipients);
  sealed.back() ^= std::byte{1};
  const Refusal refusal = open_and_read(sealed);
  EXPECT_EQ(refusal.failure, AgeFailure::kPayloadDamaged);
  EXPECT_THAT(refusal.message, HasSubstr("chunk 3 at byte"));
  EXPECT_TRUE(refusal.plaintext.empty());
}

TEST(AgeFile, ExchangedChunksAreFound) {
  Bytes sealed = seal_bytes(patterned_bytes(4 * kAgeChunkSize), keys().recipients);
  const auto first = sealed.begin() + static_cast<std::ptrdiff_t>(header_size_of(sealed) + 16);
  std::swap_ranges(first, first + kSealedAgeChunkSize, first + kSealedAgeChunkSize);
  EXPECT_EQ(open_and_read(sealed).failure, AgeFailure::kPayloadDamaged);
}

TEST(AgeFile, WhatGoesOnAfterTheLastChunkIsFoundAndNamed) {
  for (const std::size_t size : {std::size_t{100}, 2 * kAgeChunkSize, 5 * kAgeChunkSize}) {
    const Bytes plaintext = patterned_bytes(size);
    const Bytes sealed = seal_bytes(plaintext, keys().recipients);
    for (const std::size_t more : {std::size_t{1}, std::size_t{17}, 3 * kSealedAgeChunkSize}) {
      Bytes longer = sealed;
      append(longer, patterned_bytes(more));
      const Refusal refusal = open_and_read(longer);
      // Behind a short last chunk, the chunk itself no longer ends where it should.
      EXPECT_EQ(refusal.failure,
                size % kAgeChunkSize == 0 ? AgeFailure::kTrailingData : AgeFailure::kPayloadDamaged)
          << size << "+" << more;
      EXPECT_THROW(unseal_by_stream(longer, keys().identities), AgeError);
    }
  }
}

TEST(AgeFile, TwoFilesOneAfterTheOtherAreRefused) {
  Bytes sealed = seal_bytes(patterned_bytes(kAgeChunkSize), keys().recipients);
  append(sealed, Bytes(sealed));
  EXPECT_EQ(open_and_read(sealed).failure, AgeFailure::kTrailingData);
}

TEST(AgeSealer, ASinksErrorStays) {
  int calls = 0;
  AgeSealer sealer(keys().recipients, [&](ByteView) {
    if (++calls == 2) throw IoError("write", "film.part", ENOSPC);
  });
  const Bytes plaintext(3 * kAgeChunkSize);
  EXPECT_THROW(sealer.write(plaintext), IoError);
  EXPECT_THROW(sealer.write(plaintext), IoError);
  EXPECT_THROW(sealer.finish(), IoError);
  EXPECT_EQ(calls, 2);
}

TEST(AgeSealer, NothingCanBeWrittenAfterTheEnd) {
  AgeSealer sealer(keys().recipients, [](ByteView) {});
  sealer.finish();
  EXPECT_THROW(sealer.write({}), Error);
  EXPECT_THROW(sealer.finish(), Error);
}

TEST(AgeFile, ASinksErrorEndsTheReading) {
  const Bytes sealed = seal_bytes(patterned_bytes(50 * kAgeChunkSize), keys().recipients);
  const auto source = memory_source(sealed);
  const AgeFile file = AgeFile::open(*source, keys().identities);
  for (const unsigned threads : {1U, 3U}) {
    int calls = 0;
    EXPECT_THROW(file.read_all(
                     [&](ByteView) {
                       if (++calls == 3) throw IoError("write", "film.ts", ENOSPC);
                     },
                     threads),
                 IoError);
    EXPECT_EQ(calls, 3);
  }
}

class OutputFile {
 public:
  explicit OutputFile(std::filesystem::path name)
      : name_(std::move(name)),
        descriptor_(::open(name_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600)) {}
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile() { ::close(descriptor_); }
  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] const std::filesystem::path& name() const { return name_; }
  [[nodiscard]] Bytes content() const { return test::read_whole(name_); }

 private:
  std::filesystem::path name_;
  int descriptor_;
};

TEST(AgeFile, WritesAFileFromSeveralThreads) {
  const test::TemporaryFolder folder;
  for (const std::size_t size : kSizes) {
    const Bytes plaintext = patterned_bytes(size);
    const Bytes sealed = seal_bytes(plaintext, keys().recipients);
    const auto source = memory_source(sealed);
    for (const unsigned threads : {1U, 2U, 5U}) {
      const OutputFile out(folder / "plain");
      AgeFile::open(*source, keys().identities).write_to(out.descriptor(), out.name(), {}, threads);
      EXPECT_EQ(out.content(), plaintext) << size;
    }
  }
}

TEST(AgeFile, AWrittenFileEndsBeforeTheDamage) {
  const test::TemporaryFolder folder;
  const Bytes plaintext = patterned_bytes(60 * kAgeChunkSize);
  Bytes sealed = seal_bytes(plaintext, keys().recipients);
  const std::size_t payload = header_size_of(sealed) + 16;
  sealed[payload + 29 * kSealedAgeChunkSize] ^= std::byte{1};
  sealed[payload + 50 * kSealedAgeChunkSize] ^= std::byte{1};
  const auto source = memory_source(sealed);
  for (const unsigned threads : {1U, 2U, 5U}) {
    const OutputFile out(folder / "plain");
    EXPECT_THAT(
        [&] {
          AgeFile::open(*source, keys().identities).write_to(out.descriptor(), out.name(), {}, threads);
        },
        ThrowsMessage<AgeError>(HasSubstr("chunk 29 ")));
    EXPECT_EQ(out.content(), front_of(plaintext, 29 * kAgeChunkSize));
  }
}

TEST(AgeFile, TellsWhenAFileCannotBeWritten) {
  if (::access("/dev/full", W_OK) != 0) GTEST_SKIP() << "no /dev/full here";
  const Bytes sealed = seal_bytes(patterned_bytes(100), keys().recipients);
  const auto source = memory_source(sealed);
  const OutputFile out("/dev/full");
  EXPECT_THROW(AgeFile::open(*source, keys().identities).write_to(out.descriptor(), out.name(), {}, 2),
               IoError);
}

TEST(AgeFile, ANewHeaderOpensTheSamePayloadForAnotherReader) {
  const Keys new_reader = new_keys();
  const Bytes plaintext = patterned_bytes(100000);
  const Bytes sealed = seal_bytes(plaintext, keys().recipients);
  const auto source = memory_source(sealed);
  std::uint64_t old_size = 0;
  const Bytes header = rekey_header(*source, keys().identities, new_reader.recipients, old_size);
  EXPECT_EQ(old_size, header_size_of(sealed));
  Bytes rekeyed = header;
  append(rekeyed, ByteView(sealed).subspan(static_cast<std::size_t>(old_size)));
  EXPECT_EQ(unseal_bytes(rekeyed, new_reader.identities), plaintext);
  EXPECT_EQ(open_and_read(rekeyed).failure, AgeFailure::kNoMatch);

  const auto rekeyed_source = memory_source(rekeyed);
  const ByteView old_header = ByteView(sealed).first(static_cast<std::size_t>(old_size));
  EXPECT_TRUE(same_file_key(*rekeyed_source, old_header, new_reader.identities));
  const Bytes other = seal_bytes(plaintext, keys().recipients);
  EXPECT_FALSE(
      same_file_key(*rekeyed_source, ByteView(other).first(header_size_of(other)), new_reader.identities));
  EXPECT_THROW(static_cast<void>(same_file_key(*rekeyed_source, sealed, new_reader.identities)), AgeError);
  EXPECT_THROW(static_cast<void>(same_file_key(*rekeyed_source, old_header.first(50), new_reader.identities)),
               AgeError);
}

TEST(AgeFile, AForgedHeaderIsRefused) {
  Bytes sealed = seal_bytes(bytes_of("film"), keys().recipients);
  // One more stanza, well formed, that the MAC does not know of.
  const std::string_view intro = "age-encryption.org/v1\n";
  Bytes forged = to_bytes(intro);
  append(forged, bytes_of("-> grease\n\n"));
  append(forged, ByteView(sealed).subspan(intro.size()));
  EXPECT_EQ(open_and_read(forged).failure, AgeFailure::kHeaderForged);
  EXPECT_EQ(open_and_read(forged, Truncation::kTolerate).failure, AgeFailure::kHeaderForged);
}

TEST(ByteSource, ReadsFilesAndRefusesTheRest) {
  const test::TemporaryFolder folder;
  std::ofstream(folder / "file") << "abcdef";
  const auto source = open_file_source(folder / "file");
  EXPECT_EQ(source->size(), 6U);
  Bytes into(10);
  EXPECT_EQ(source->read_at(4, into), 2U);
  EXPECT_EQ(text_of(ByteView(into).first(2)), "ef");
  EXPECT_EQ(source->read_at(6, into), 0U);
  EXPECT_THROW(open_file_source(folder / "absent"), IoError);
  EXPECT_THROW(open_file_source(folder.path()), UsageError);
}

}  // namespace
}  // namespace kiroku::crypto
