#include "crypto/age_chunk_reader.h"

#include <algorithm>

#include "crypto/age_error.h"

namespace kiroku::crypto {

AgeChunkReader::AgeChunkReader(const AgePayload& payload) : payload_(payload), cipher_(payload.key.bytes()) {}

std::span<std::byte> AgeChunkReader::sealed_buffer(std::size_t size) {
  if (sealed_.size() < size) sealed_.resize(size);
  return std::span(sealed_).first(size);
}

std::size_t AgeChunkReader::plaintext_size(std::uint64_t first, std::uint64_t count) const {
  const std::uint64_t begin = first * kAgeChunkSize;
  const std::uint64_t end = std::min((first + count) * kAgeChunkSize, payload_.plaintext_size());
  return static_cast<std::size_t>(end - begin);
}

void AgeChunkReader::read(std::uint64_t first, std::uint64_t count, std::span<std::byte> plaintext,
                          std::size_t& authentic_size) {
  authentic_size = 0;
  const auto run = sealed_buffer(plaintext.size() + static_cast<std::size_t>(count) * kAeadTagSize);
  if (payload_.source->read_at(payload_.offset_of(first), run) != run.size())
    throw AgeError(AgeFailure::kTruncated, "the sealed file became shorter while it was read");
  ByteView rest = run;
  for (std::uint64_t number = first; number < first + count; ++number) {
    const auto chunk = rest.first(static_cast<std::size_t>(payload_.sealed_size(number)));
    const auto opened = plaintext.subspan(authentic_size, chunk.size() - kAeadTagSize);
    if (!cipher_.open(number, payload_.position_of(number), chunk, opened)) refuse(number, chunk);
    authentic_size += opened.size();
    rest = rest.subspan(chunk.size());
  }
}

void AgeChunkReader::refuse(std::uint64_t number, ByteView sealed) {
  const std::string where =
      "chunk " + std::to_string(number) + " at byte " + std::to_string(payload_.offset_of(number));
  scratch_.resize(sealed.size() - kAeadTagSize);
  if (payload_.position_of(number) == ChunkPosition::kInside &&
      cipher_.open(number, ChunkPosition::kLast, sealed, scratch_))
    throw AgeError(AgeFailure::kTrailingData, "the sealed file goes on after its last chunk, " + where);
  throw AgeError(AgeFailure::kPayloadDamaged,
                 "the sealed file is damaged: " + where + " does not authenticate");
}

bool AgeChunkReader::authenticates(std::uint64_t number, std::uint64_t sealed_size, ChunkPosition position) {
  if (sealed_size < kAeadTagSize) return false;
  const auto sealed = sealed_buffer(static_cast<std::size_t>(sealed_size));
  if (payload_.source->read_at(payload_.offset_of(number), sealed) != sealed.size()) return false;
  scratch_.resize(sealed.size() - kAeadTagSize);
  return cipher_.open(number, position, sealed, scratch_);
}

}  // namespace kiroku::crypto
