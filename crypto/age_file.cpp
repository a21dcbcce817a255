#include "crypto/age_file.h"

#include <algorithm>
#include <cstring>
#include <mutex>

#include "crypto/age_chunk_reader.h"
#include "crypto/age_file_key.h"
#include "crypto/age_parallel.h"

namespace kiroku::crypto {
namespace {

// Find out why the end of the file is no last chunk. Chunks before the true end authenticate as inside ones,
// what was appended behind it does not, so the end is where a search by halves changes from yes to no.
[[noreturn]] void explain_bad_end(const AgePayload& payload, AgeChunkReader& reader) {
  std::uint64_t begin = 0;
  std::uint64_t end = payload.chunks;
  while (begin < end) {
    const std::uint64_t middle = begin + (end - begin) / 2;
    if (reader.authenticates(middle, payload.sealed_size(middle), ChunkPosition::kInside))
      begin = middle + 1;
    else
      end = middle;
  }
  const std::string where = "byte " + std::to_string(payload.offset_of(begin));
  if (begin == payload.chunks)
    throw AgeError(AgeFailure::kTruncated,
                   "the sealed file ends before its last chunk: it was cut at " + where);
  if (begin + 1 < payload.chunks &&
      reader.authenticates(begin, payload.sealed_size(begin), ChunkPosition::kLast))
    throw AgeError(AgeFailure::kTrailingData, "the sealed file goes on after its last chunk, number " +
                                                  std::to_string(begin) + " at " + where);
  if (begin + 1 == payload.chunks &&
      !AgePayloadLayout{payload.chunks, payload.last_sealed_size}.last_chunk_is_possible())
    throw AgeError(AgeFailure::kTruncated,
                   "the sealed file ends before its last chunk: it was cut within the chunk at " + where);
  throw AgeError(AgeFailure::kPayloadDamaged, "the sealed file is damaged or cut: chunk " +
                                                  std::to_string(begin) + " at " + where +
                                                  " does not authenticate");
}

// Leaves the chunks before the first that does not authenticate. A power cut leaves half a chunk, or blocks
// of zeros: behind what was flushed, but also between blocks that reached the disk. So every chunk is tried.
void cut_to_authentic_chunks(AgePayload& payload, AgeChunkReader& reader) {
  std::uint64_t number = 0;
  while (number < payload.chunks && payload.sealed_size(number) == kSealedAgeChunkSize &&
         reader.authenticates(number, kSealedAgeChunkSize, ChunkPosition::kInside)) {
    ++number;
  }
  const bool may_be_last =
      number + 1 < payload.chunks ||
      AgePayloadLayout{payload.chunks, payload.last_sealed_size}.last_chunk_is_possible();
  if (number < payload.chunks && may_be_last &&
      reader.authenticates(number, payload.sealed_size(number), ChunkPosition::kLast)) {
    if (number + 1 == payload.chunks) return;
    throw AgeError(AgeFailure::kTrailingData, "the sealed file goes on after its last chunk, number " +
                                                  std::to_string(number) + " at byte " +
                                                  std::to_string(payload.offset_of(number)));
  }
  payload.ends_with_last_chunk = false;
  payload.chunks = number;
  payload.last_sealed_size = kSealedAgeChunkSize;
}

}  // namespace

struct AgeFile::State {
  AgePayload payload;
  std::uint64_t header_size = 0;
  std::uint64_t unreadable_size = 0;

  // The newest chunk read in part.
  std::mutex cache_mutex;
  std::uint64_t cached_number = ~std::uint64_t{0};
  std::shared_ptr<const Bytes> cached_plaintext;

  std::shared_ptr<const Bytes> chunk(std::uint64_t number, AgeChunkReader& reader) {
    {
      const std::lock_guard lock(cache_mutex);
      if (cached_number == number) return cached_plaintext;
    }
    auto plaintext = std::make_shared<Bytes>(reader.plaintext_size(number, 1));
    std::size_t authentic_size = 0;
    reader.read(number, 1, *plaintext, authentic_size);
    const std::lock_guard lock(cache_mutex);
    cached_number = number;
    cached_plaintext = plaintext;
    return plaintext;
  }
};

AgeFile AgeFile::open(const ByteSource& source, const AgeIdentities& identities, Truncation truncation) {
  const AgeHeader header = read_age_header(source);
  const Secret file_key = unwrap_file_key(header, identities);
  Bytes nonce(kAgePayloadNonceSize);
  const bool nonce_is_whole = source.read_at(header.size, nonce) == nonce.size();
  if (!nonce_is_whole && truncation == Truncation::kRefuse)
    throw AgeError(AgeFailure::kHeaderMalformed,
                   "the age file ends before the nonce that follows its header");

  auto state = std::make_unique<State>();
  state->header_size = header.size;
  AgePayload& payload = state->payload;
  payload.source = &source;
  payload.key = age_payload_key(file_key, nonce);
  payload.offset = header.size + kAgePayloadNonceSize;
  const auto layout = age_payload_layout(nonce_is_whole ? source.size() - payload.offset : 0);
  payload.chunks = layout.chunks;
  payload.last_sealed_size = layout.last_sealed_size;

  AgeChunkReader reader(payload);
  if (truncation == Truncation::kTolerate) {
    cut_to_authentic_chunks(payload, reader);
    if (!payload.ends_with_last_chunk)
      state->unreadable_size = source.size() - std::min(source.size(), payload.offset_of(payload.chunks));
    return AgeFile(std::move(state));
  }
  const bool complete =
      layout.last_chunk_is_possible() &&
      reader.authenticates(payload.chunks - 1, payload.last_sealed_size, ChunkPosition::kLast);
  if (!complete) explain_bad_end(payload, reader);
  return AgeFile(std::move(state));
}

AgeFile::AgeFile(std::unique_ptr<State> state) : state_(std::move(state)) {}
AgeFile::AgeFile(AgeFile&&) noexcept = default;
AgeFile& AgeFile::operator=(AgeFile&&) noexcept = default;
AgeFile::~AgeFile() = default;

std::uint64_t AgeFile::plaintext_size() const { return state_->payload.plaintext_size(); }
std::uint64_t AgeFile::header_size() const { return state_->header_size; }
bool AgeFile::is_truncated() const { return !state_->payload.ends_with_last_chunk; }
std::uint64_t AgeFile::unreadable_size() const { return state_->unreadable_size; }

std::size_t AgeFile::read_at(std::uint64_t offset, std::span<std::byte> into) const {
  const std::uint64_t size = plaintext_size();
  if (offset >= size) return 0;
  into = into.first(static_cast<std::size_t>(std::min<std::uint64_t>(into.size(), size - offset)));
  AgeChunkReader reader(state_->payload);
  std::size_t filled = 0;
  while (filled < into.size()) {
    const std::uint64_t number = (offset + filled) / kAgeChunkSize;
    const auto skipped = static_cast<std::size_t>((offset + filled) % kAgeChunkSize);
    const std::size_t chunk_size = reader.plaintext_size(number, 1);
    const auto part = into.subspan(filled, std::min(into.size() - filled, chunk_size - skipped));
    if (part.size() == chunk_size) {
      std::size_t authentic_size = 0;
      reader.read(number, 1, part, authentic_size);
    } else {
      const auto plaintext = state_->chunk(number, reader);
      std::memcpy(part.data(), plaintext->data() + skipped, part.size());
    }
    filled += part.size();
  }
  return filled;
}

void AgeFile::read_all(const ByteSink& sink, unsigned threads) const {
  read_payload_in_order(state_->payload, sink, threads);
}

void AgeFile::write_to(int file_descriptor, const std::filesystem::path& name, const ByteProgress& progress,
                       unsigned threads) const {
  write_payload_to_file(state_->payload, file_descriptor, name, progress, threads);
}

}  // namespace kiroku::crypto
