#include "crypto/age_stream.h"

#include <algorithm>
#include <cstring>

#include "crypto/age_error.h"
#include "crypto/secret.h"

namespace kiroku::crypto {
namespace {

constexpr std::byte kLastChunkFlag{0x01};

// Eleven bytes of big-endian counter, of which the first three stay zero for any file below 2^80 bytes, and
// the flag.
std::array<std::byte, kAeadNonceSize> nonce_of(std::uint64_t number, ChunkPosition position) {
  std::array<std::byte, kAeadNonceSize> nonce{};
  for (std::size_t i = 10; i > 2; --i) {
    nonce[i] = static_cast<std::byte>(number & 0xff);
    number >>= 8;
  }
  if (position == ChunkPosition::kLast) nonce[11] = kLastChunkFlag;
  return nonce;
}

}  // namespace

bool AgePayloadLayout::last_chunk_is_possible() const {
  return chunks == 1 ? last_sealed_size >= kAeadTagSize : last_sealed_size > kAeadTagSize;
}

AgePayloadLayout age_payload_layout(std::uint64_t payload_size) {
  if (payload_size == 0) return {};
  const std::uint64_t whole_before_last = (payload_size - 1) / kSealedAgeChunkSize;
  return {whole_before_last + 1, payload_size - whole_before_last * kSealedAgeChunkSize};
}

void AgeChunkCipher::seal(std::uint64_t number, ChunkPosition position, ByteView plaintext,
                          std::span<std::byte> sealed) {
  cipher_.seal(nonce_of(number, position), plaintext, sealed);
}

bool AgeChunkCipher::open(std::uint64_t number, ChunkPosition position, ByteView sealed,
                          std::span<std::byte> plaintext) {
  return cipher_.open(nonce_of(number, position), sealed, plaintext);
}

AgeStreamWriter::AgeStreamWriter(ByteView payload_key, ByteSink sink)
    : cipher_(payload_key), sink_(std::move(sink)), held_(kAgeChunkSize), sealed_(kSealedAgeChunkSize) {}

AgeStreamWriter::~AgeStreamWriter() { zeroise(held_); }

void AgeStreamWriter::seal_chunk(ChunkPosition position, ByteView plaintext) {
  const auto sealed = std::span(sealed_).first(plaintext.size() + kAeadTagSize);
  cipher_.seal(next_number_++, position, plaintext, sealed);
  sink_(sealed);
}

// After one failure nobody knows what the sink has kept: every later call fails the same way.
void AgeStreamWriter::guarded(const std::function<void()>& action) {
  if (error_) std::rethrow_exception(error_);
  if (finished_) throw Error("the sealed file is finished; nothing more can be written to it");
  try {
    action();
  } catch (...) {
    error_ = std::current_exception();
    throw;
  }
}

void AgeStreamWriter::write(ByteView plaintext) {
  guarded([&] {
    // Full chunks are sealed where they lie in the caller's memory. One that nothing follows yet must wait:
    // it may be the last one, and the nonce says so.
    while (!plaintext.empty()) {
      if (held_size_ == 0 && plaintext.size() > kAgeChunkSize) {
        seal_chunk(ChunkPosition::kInside, plaintext.first(kAgeChunkSize));
        plaintext = plaintext.subspan(kAgeChunkSize);
        continue;
      }
      if (held_size_ == kAgeChunkSize) {
        seal_chunk(ChunkPosition::kInside, held_);
        held_size_ = 0;
        continue;
      }
      const auto taken = plaintext.first(std::min(plaintext.size(), kAgeChunkSize - held_size_));
      // Not std::ranges::copy: of std::byte, GCC 12 makes a loop of single bytes, a quarter of all time here.
      std::memcpy(held_.data() + held_size_, taken.data(), taken.size());
      held_size_ += taken.size();
      plaintext = plaintext.subspan(taken.size());
    }
  });
}

void AgeStreamWriter::finish() {
  guarded([&] {
    seal_chunk(ChunkPosition::kLast, ByteView(held_).first(held_size_));
    finished_ = true;
  });
}

std::size_t read_fully(const ByteReader& read, std::span<std::byte> into) {
  std::size_t filled = 0;
  while (filled < into.size()) {
    const std::size_t got = read(into.subspan(filled));
    if (got == 0) break;
    filled += got;
  }
  return filled;
}

void open_age_stream(ByteView payload_key, const ByteReader& read, const ByteSink& sink) {
  AgeChunkCipher cipher(payload_key);
  Bytes sealed(kSealedAgeChunkSize);
  Bytes plaintext(kAgeChunkSize);
  for (std::uint64_t number = 0;; ++number) {
    const auto here = [number] { return "chunk " + std::to_string(number); };
    const ByteView chunk = ByteView(sealed).first(read_fully(read, sealed));
    if (chunk.size() < kAeadTagSize)
      throw AgeError(AgeFailure::kTruncated,
                     "the sealed file ends before its last chunk: it was cut within " + here());
    if (chunk.size() == kAeadTagSize && number > 0)
      throw AgeError(AgeFailure::kPayloadDamaged,
                     "the sealed file is damaged or cut: " + here() + ", the last one, is empty");
    const auto opened = std::span(plaintext).first(chunk.size() - kAeadTagSize);
    bool last_chunk = chunk.size() < sealed.size();
    if (last_chunk || !cipher.open(number, ChunkPosition::kInside, chunk, opened)) {
      if (!cipher.open(number, ChunkPosition::kLast, chunk, opened))
        throw AgeError(AgeFailure::kPayloadDamaged,
                       "the sealed file is damaged or cut: " + here() + " does not authenticate");
      last_chunk = true;
    }
    sink(opened);
    if (!last_chunk) continue;
    std::byte more{};
    if (read({&more, 1}) != 0)
      throw AgeError(AgeFailure::kTrailingData, "the sealed file goes on after its last chunk, " + here());
    return;
  }
}

}  // namespace kiroku::crypto
