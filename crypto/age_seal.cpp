// Whole age files in one pass: sealing, opening from a stream, and new headers over old payloads.
#include <algorithm>

#include "crypto/age_file.h"
#include "crypto/age_file_key.h"

namespace kiroku::crypto {

AgeSealer::AgeSealer(const AgeRecipients& recipients, ByteSink sink) {
  const Secret file_key = Secret::random(kFileKeySize);
  Bytes front = wrap_file_key(file_key, recipients);
  Bytes nonce(kAgePayloadNonceSize);
  fill_random(nonce);
  append(front, nonce);
  sink(front);
  payload_ = std::make_unique<AgeStreamWriter>(age_payload_key(file_key, nonce).bytes(), std::move(sink));
}

AgeSealer::AgeSealer(AgeSealer&&) noexcept = default;
AgeSealer& AgeSealer::operator=(AgeSealer&&) noexcept = default;
AgeSealer::~AgeSealer() = default;

void AgeSealer::write(ByteView plaintext) { payload_->write(plaintext); }

void AgeSealer::finish() { payload_->finish(); }

void unseal_stream(const ByteReader& read, const AgeIdentities& identities, const ByteSink& sink) {
  Bytes rest;
  const AgeHeader header = read_age_header(read, rest);
  const Secret file_key = unwrap_file_key(header, identities);
  // What was read beyond the header comes first, then the stream goes on.
  ByteView unread = rest;
  const ByteReader read_on = [&](std::span<std::byte> into) -> std::size_t {
    if (unread.empty()) return read(into);
    const auto taken = unread.first(std::min(unread.size(), into.size()));
    std::copy(taken.begin(), taken.end(), into.begin());
    unread = unread.subspan(taken.size());
    return taken.size();
  };
  Bytes nonce(kAgePayloadNonceSize);
  if (read_fully(read_on, nonce) != nonce.size())
    throw AgeError(AgeFailure::kHeaderMalformed,
                   "the age file ends before the nonce that follows its header");
  open_age_stream(age_payload_key(file_key, nonce).bytes(), read_on, sink);
}

Bytes seal_bytes(ByteView plaintext, const AgeRecipients& recipients) {
  Bytes sealed;
  AgeSealer sealer(recipients, [&](ByteView bytes) { append(sealed, bytes); });
  sealer.write(plaintext);
  sealer.finish();
  return sealed;
}

Bytes unseal_bytes(ByteView sealed, const AgeIdentities& identities) {
  const auto source = memory_source(sealed);
  const AgeFile file = AgeFile::open(*source, identities);
  Bytes plaintext(static_cast<std::size_t>(file.plaintext_size()));
  file.read_at(0, plaintext);
  return plaintext;
}

Bytes rekey_header(const ByteSource& source, const AgeIdentities& identities, const AgeRecipients& recipients,
                   std::uint64_t& old_header_size) {
  const AgeHeader old_header = read_age_header(source);
  old_header_size = old_header.size;
  return wrap_file_key(unwrap_file_key(old_header, identities), recipients);
}

bool same_file_key(const ByteSource& source, ByteView other_header, const AgeIdentities& identities) {
  const auto other = parse_age_header(other_header);
  if (!other || other->size != other_header.size())
    throw AgeError(AgeFailure::kHeaderMalformed, "the other header is cut, or goes on after its MAC line");
  const Secret file_key = unwrap_file_key(read_age_header(source), identities);
  return age_header_mac_fits(*other, file_key);
}

}  // namespace kiroku::crypto
