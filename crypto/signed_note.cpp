#include "crypto/signed_note.h"

#include <algorithm>
#include <charconv>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/utf8.h"

namespace kiroku::crypto {
namespace {

constexpr std::byte kEd25519SignatureType{0x01};
constexpr std::string_view kSignaturePrefix = "\u2014 ";  // em dash, space
constexpr std::size_t kKeyIdSize = 4;
// What golang.org/x/mod/sumdb/note accepts; bounds the work that a hostile note can ask for.
constexpr std::size_t kMaximumNoteSize = 1'000'000;
constexpr std::size_t kMaximumSignatures = 100;

bool is_key_name(std::string_view name) {
  return !name.empty() && is_utf8(name) && !has_unicode_space(name) &&
         name.find('+') == std::string_view::npos &&
         std::ranges::none_of(name, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

void require_key_name(const std::string& name) {
  if (!is_key_name(name))
    throw UsageError("\"" + name +
                     "\" cannot name a key; use letters, digits and - . / without spaces or a plus sign");
}

bool is_note_text(std::string_view text) {
  return is_utf8(text) &&
         std::ranges::none_of(text, [](char c) { return static_cast<unsigned char>(c) < 0x20 && c != '\n'; });
}

std::array<std::byte, kKeyIdSize> big_endian(std::uint32_t value) {
  return {static_cast<std::byte>(value >> 24), static_cast<std::byte>(value >> 16 & 0xff),
          static_cast<std::byte>(value >> 8 & 0xff), static_cast<std::byte>(value & 0xff)};
}

std::uint32_t big_endian(ByteView bytes) {
  std::uint32_t value = 0;
  for (const std::byte byte : bytes.first(kKeyIdSize))
    value = value << 8 | std::to_integer<std::uint32_t>(byte);
  return value;
}

struct SignatureLine {
  std::string name;
  std::uint32_t key_id = 0;
  Bytes signature;
};

std::optional<SignatureLine> parse_signature_line(std::string_view line) {
  if (!line.starts_with(kSignaturePrefix)) return std::nullopt;
  line.remove_prefix(kSignaturePrefix.size());
  const std::size_t space = line.find(' ');
  if (space == std::string_view::npos || !is_key_name(line.substr(0, space))) return std::nullopt;
  const auto bytes = from_base64(line.substr(space + 1), Base64Padding::kPadded);
  if (!bytes || bytes->size() <= kKeyIdSize) return std::nullopt;
  return SignatureLine{std::string(line.substr(0, space)), big_endian(*bytes),
                       Bytes(bytes->begin() + kKeyIdSize, bytes->end())};
}

OpenedNote malformed(const std::string& why) {
  return {{}, {}, NoteFailure::kMalformed, "this is not a signed note: " + why};
}

// The line at the front of `text` without its newline, which is cut off, too; nothing if there is none.
std::optional<std::string_view> take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos) return std::nullopt;
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end + 1);
  return line;
}

}  // namespace

VerifierKey::VerifierKey(std::string name, const Ed25519PublicKey& key) : name_(std::move(name)), key_(key) {
  require_key_name(name_);
}

std::uint32_t VerifierKey::key_id() const {
  Sha256 hash;
  hash.update(bytes_of(name_));
  hash.update(bytes_of("\n"));
  hash.update({&kEd25519SignatureType, 1});
  hash.update(key_);
  return big_endian(hash.finish());
}

std::string VerifierKey::to_string() const {
  Bytes typed_key = {kEd25519SignatureType};
  append(typed_key, key_);
  return name_ + "+" + to_hex(big_endian(key_id())) + "+" + to_base64(typed_key, Base64Padding::kPadded);
}

VerifierKey VerifierKey::parse(std::string_view text) {
  const auto refuse = [&](const std::string& why) -> UsageError {
    return UsageError("\"" + std::string(text) + "\" is no verifier key (<name>+<id>+<key>): " + why);
  };
  const std::size_t first_plus = text.find('+');
  const std::size_t second_plus =
      first_plus == std::string_view::npos ? first_plus : text.find('+', first_plus + 1);
  if (second_plus == std::string_view::npos) throw refuse("it must have three parts joined by plus signs");
  const std::string_view name = text.substr(0, first_plus);
  if (!is_key_name(name)) throw refuse("its name is empty or has forbidden characters");
  const auto id = from_hex(text.substr(first_plus + 1, second_plus - first_plus - 1));
  if (!id || id->size() != kKeyIdSize) throw refuse("its id is not 8 lower-case hex digits");
  const auto typed_key = from_base64(text.substr(second_plus + 1), Base64Padding::kPadded);
  if (!typed_key || typed_key->empty()) throw refuse("its key is not base64");
  if (typed_key->front() != kEd25519SignatureType) throw refuse("its algorithm is not Ed25519");
  Ed25519PublicKey key;
  if (typed_key->size() != 1 + key.size()) throw refuse("its key has not 32 bytes");
  std::copy(typed_key->begin() + 1, typed_key->end(), key.begin());
  VerifierKey result{std::string(name), key};
  if (result.key_id() != big_endian(*id)) throw refuse("its id does not belong to its name and key");
  return result;
}

std::string sign_note(std::string_view text, const std::string& name, const SigningKey& key) {
  if (!text.ends_with('\n') || !is_note_text(text))
    throw UsageError(
        "a note can only be signed if it is UTF-8 text without control characters that ends in a "
        "newline");
  const VerifierKey verifier(name, key.public_key());
  Bytes signature = to_bytes(big_endian(verifier.key_id()));
  append(signature, key.sign(bytes_of(text)));
  std::string note(text);
  note += '\n';
  note += kSignaturePrefix;
  note += name + ' ' + to_base64(signature, Base64Padding::kPadded) + '\n';
  return note;
}

OpenedNote open_note(std::string_view note, const std::vector<VerifierKey>& verifiers) {
  if (note.size() > kMaximumNoteSize) return malformed("it is longer than a megabyte");
  if (!is_note_text(note)) return malformed("it is not UTF-8 or has control characters");
  const std::size_t blank_line = note.rfind("\n\n");
  if (blank_line == std::string_view::npos) return malformed("no blank line parts text and signatures");
  OpenedNote result;
  result.text = note.substr(0, blank_line + 1);
  std::string_view rest = note.substr(blank_line + 2);
  if (rest.empty()) return malformed("it has no signature line");
  if (!rest.ends_with('\n')) return malformed("its last line has no newline");

  bool verified = false;
  std::vector<Bytes> signature_of(verifiers.size());
  while (const auto line = take_line(rest)) {
    const auto signature = parse_signature_line(*line);
    if (!signature) return malformed("a signature line is not \"\u2014 <name> <base64>\"");
    result.signers.push_back(signature->name);
    if (result.signers.size() > kMaximumSignatures) return malformed("it has more than 100 signatures");
    for (std::size_t i = 0; i < verifiers.size(); ++i) {
      const auto& verifier = verifiers[i];
      if (verifier.name() != signature->name || verifier.key_id() != signature->key_id) continue;
      // Ed25519 is deterministic: another signature of one key over one text is none that its holder's
      // program made. So each key costs one check, however often it signs.
      const bool again = !signature_of[i].empty();
      if (again ? signature->signature == signature_of[i]
                : verify_ed25519(verifier.key(), bytes_of(result.text), signature->signature)) {
        verified = true;
      } else if (!result.failure) {
        result.failure = NoteFailure::kBadSignature;
        result.explanation = "the signature of " + verifier.name() + " does not fit the note's text";
      }
      if (!again) signature_of[i] = signature->signature;
    }
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
