#include "crypto/signed_note.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/note_format.h"

namespace kiroku::crypto {
namespace {

constexpr std::byte kEd25519SignatureType{0x01};

OpenedNote malformed(const std::string& why) {
  return {{}, {}, {}, NoteFailure::kMalformed, "this is not a signed note: " + why};
}

}  // namespace

VerifierKey::VerifierKey(std::string name, const Ed25519PublicKey& key) : name_(std::move(name)), key_(key) {
  require_key_name(name_);
}

std::uint32_t VerifierKey::key_id() const { return key_id_of(name_, kEd25519SignatureType, key_); }

std::string VerifierKey::to_string() const {
  return KeyText{name_, kEd25519SignatureType, to_bytes(key_)}.to_string();
}

VerifierKey VerifierKey::parse(std::string_view text) {
  const KeyText parsed = KeyText::parse(text);
  const auto refuse = [&](const std::string& why) -> UsageError {
    return UsageError(quoted_key_text(text) + " is no verifier key (<name>+<id>+<key>): " + why);
  };
  if (parsed.algorithm != kEd25519SignatureType) throw refuse("its algorithm is not Ed25519");
  Ed25519PublicKey key;
  if (parsed.key.size() != key.size()) throw refuse("its key has not 32 bytes");
  if (!parsed.states_its_id()) throw refuse("its id does not belong to its name and key");
  std::ranges::copy(parsed.key, key.begin());
  return {parsed.name, key};
}

std::string sign_note(std::string_view text, const std::string& name, const SigningKey& key) {
  if (!text.ends_with('\n') || !is_note_text(text))
    throw UsageError(
        "a note can only be signed if it is UTF-8 text without control characters that ends in a "
        "newline");
  const VerifierKey verifier(name, key.public_key());
  return std::string(text) + '\n' + signature_line(name, verifier.key_id(), key.sign(bytes_of(text)));
}

OpenedNote open_note(std::string_view note, const std::vector<VerifierKey>& verifiers) {
  NoteParts parts = parse_note(note);
  if (!parts.why.empty()) return malformed(parts.why);
  OpenedNote result;
  result.text = std::move(parts.text);
  bool verified = false;
  bool foreign_in_known_name = false;
  for (const SignatureLine& signature : parts.lines) {
    result.signers.push_back(signature.name);
    bool known_name = false;
    bool known_key = false;
    for (const auto& verifier : verifiers) {
      known_name = known_name || verifier.name() == signature.name;
      if (verifier.name() != signature.name || verifier.key_id() != signature.key_id) continue;
      known_key = true;
      if (verify_ed25519(verifier.key(), bytes_of(result.text), signature.signature)) {
        verified = true;
      } else if (!result.failure) {
        result.failure = NoteFailure::kBadSignature;
        result.explanation = "the signature of " + verifier.name() + " does not fit the note's text";
      }
    }
    if (!known_key)
      result.unchecked.push_back(signature.name + "+" + to_hex(big_endian_id(signature.key_id)));
    foreign_in_known_name = foreign_in_known_name || (known_name && !known_key);
  }
  // A note by another key of the name alone is of an unknown key; beside the known one it is a forgery.
  if (!result.failure && verified && foreign_in_known_name) {
    result.failure = NoteFailure::kBadSignature;
    result.explanation = "another key signed it, too, in the name of a key that is known";
  }
  if (!result.failure && !verified) {
    result.failure = NoteFailure::kUnknownKey;
    result.explanation = "the note is signed by " + result.signers.front() + ", none of the keys given";
  }
  return result;
}

std::string Checkpoint::to_text() const {
  return origin + '\n' + std::to_string(size) + '\n' + to_base64(root, Base64Padding::kPadded) + '\n';
}

std::optional<Checkpoint> Checkpoint::parse(std::string_view text) {
  const auto origin = take_line(text);
  const auto size = take_line(text);
  const auto root = take_line(text);
  if (!origin || !size || !root || !text.empty() || origin->empty()) return std::nullopt;
  Checkpoint result;
  result.origin = *origin;
  const auto [end, error] = std::from_chars(size->data(), size->data() + size->size(), result.size);
  if (error != std::errc() || end != size->data() + size->size()) return std::nullopt;
  if (size->size() > 1 && size->front() == '0') return std::nullopt;
  const auto root_bytes = from_base64(*root, Base64Padding::kPadded);
  if (!root_bytes || root_bytes->size() != result.root.size()) return std::nullopt;
  std::ranges::copy(*root_bytes, result.root.begin());
  return result;
}

}  // namespace kiroku::crypto
