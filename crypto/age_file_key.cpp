#include "crypto/age_file_key.h"

#include <algorithm>

#include "crypto/key_derivation.h"

namespace kiroku::crypto {
namespace {

constexpr std::size_t kFirstHeaderRead = 4096;  // holds a dozen X25519 recipients or two hybrid ones

[[noreturn]] void ends_within_header(std::size_t size) {
  throw AgeError(AgeFailure::kHeaderMalformed, size == 0
                                                   ? "the file is empty, not an age file"
                                                   : "the age header is malformed: the file ends within it");
}

}  // namespace

AgeHeader read_age_header(const ByteSource& source) {
  for (std::size_t size = kFirstHeaderRead;; size *= 2) {
    Bytes front(size);
    front.resize(source.read_at(0, front));
    if (auto header = parse_age_header(front)) return *std::move(header);
    if (front.size() < size) ends_within_header(front.size());
  }
}

AgeHeader read_age_header(const ByteReader& read, Bytes& rest) {
  Bytes front;
  for (std::size_t size = kFirstHeaderRead;; size *= 2) {
    const std::size_t had = front.size();
    front.resize(size);
    front.resize(had + read_fully(read, std::span(front).subspan(had)));
    if (auto header = parse_age_header(front)) {
      rest.assign(front.begin() + static_cast<std::ptrdiff_t>(header->size), front.end());
      return *std::move(header);
    }
    if (front.size() < size) ends_within_header(front.size());
  }
}

Secret unwrap_file_key(const AgeHeader& header, const AgeIdentities& identities) {
  if (identities.empty()) throw UsageError("a sealed file cannot be opened without an identity; give one");
  for (const auto& identity : identities) {
    auto file_key = identity->unwrap(header.stanzas);
    if (!file_key) continue;
    if (!age_header_mac_fits(header, *file_key))
      throw AgeError(AgeFailure::kHeaderForged,
                     "the age header was changed after sealing: its MAC does not fit the file key");
    return *std::move(file_key);
  }
  throw AgeError(AgeFailure::kNoMatch,
                 "none of the identities given opens this file; give one it was sealed to");
}

Bytes wrap_file_key(const Secret& file_key, const AgeRecipients& recipients) {
  if (recipients.empty()) throw UsageError("a file cannot be sealed without a recipient; give one");
  std::vector<AgeStanza> stanzas;
  for (const auto& recipient : recipients) {
    if (recipient->must_be_alone() && recipients.size() > 1)
      throw UsageError("a file sealed with a " + recipient->to_string() + " cannot have other recipients");
    if (recipient->is_post_quantum() != recipients.front()->is_post_quantum())
      throw UsageError(
          "a file cannot be sealed to both post-quantum recipients (age1pq1...) and others, which would "
          "undo the protection; give recipients of one kind");
    stanzas.push_back(recipient->wrap(file_key));
  }
  return write_age_header(stanzas, file_key);
}

Secret age_payload_key(const Secret& file_key, ByteView payload_nonce) {
  return hkdf_sha256(file_key.bytes(), payload_nonce, "payload");
}

}  // namespace kiroku::crypto
