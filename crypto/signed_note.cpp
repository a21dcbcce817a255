#include "crypto/signed_note.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/ml_dsa.h"
#include "crypto/note_format.h"

namespace kiroku::crypto {
namespace {

constexpr std::byte kEd25519SignatureType{0x01};
constexpr std::byte kUnassignedSignatureType{0xff};
constexpr std::string_view kMlDsaTypeText = "kiroku/ml-dsa-65";
constexpr std::string_view kMlDsaNameEnd = "/ml-dsa-65";
constexpr std::byte kEcdsaSignatureType{0x02};
constexpr std::string_view kHardwareNameEnd = "/ecdsa-p256";

OpenedNote malformed(const std::string& why) {
  OpenedNote note;
  note.failure = NoteFailure::kMalformed;
  note.explanation = "this is not a signed note: " + why;
  return note;
}

/// What follows the type's byte of an ML-DSA-65 key.
Bytes typed_ml_dsa_key(ByteView key) {
  Bytes typed = to_bytes(bytes_of(kMlDsaTypeText));
  append(typed, key);
  return typed;
}

/// Of signature type 0x02: of the DER of the key alone.
std::uint32_t ecdsa_key_id(ByteView key) {
  std::uint32_t id = 0;
  const Sha256Digest digest = sha256(key);
  for (std::size_t i = 0; i < kKeyIdSize; ++i) id = id << 8 | std::to_integer<std::uint32_t>(digest.at(i));
  return id;
}

/// What the lines of a note say of one verifier.
class SignatureCheck {
 public:
  explicit SignatureCheck(const VerifierKey& verifier) : verifier_(&verifier) {}

  enum class By { kOther, kForeignKey, kVerifier };
  /// Whose line it is: the verifier's, or one in the name of a key of it by another key.
  By take(const SignatureLine& line, ByteView text) {
    if (line.name == verifier_->name()) {
      if (line.key_id != verifier_->key_id()) return By::kForeignKey;
      (verify_ed25519(verifier_->key(), text, line.signature) ? ed25519_ : bad_ed25519_) = true;
      return By::kVerifier;
    }
    const auto& hardware = verifier_->hardware();
    if (hardware && line.name == hardware->name()) {
      if (line.key_id != hardware->key_id()) return By::kForeignKey;
      (verify_ecdsa_p256(hardware->key(), text, line.signature) ? hardware_ : bad_hardware_) = true;
      return By::kVerifier;
    }
    const auto& ml_dsa = verifier_->ml_dsa();
    if (!ml_dsa || line.name != ml_dsa->name()) return By::kOther;
    if (line.key_id != ml_dsa->key_id()) return By::kForeignKey;
    (verify_ml_dsa(MlDsaSet::k65, ml_dsa->key(), text, line.signature) ? ml_dsa_ : bad_ml_dsa_) = true;
    return By::kVerifier;
  }

  [[nodiscard]] bool has_signed() const { return ed25519_; }
  [[nodiscard]] bool has_ml_dsa() const { return ml_dsa_; }
  [[nodiscard]] bool lacks_ml_dsa() const { return ed25519_ && verifier_->ml_dsa() && !ml_dsa_; }
  [[nodiscard]] bool has_hardware() const { return hardware_; }
  [[nodiscard]] bool lacks_hardware() const { return ed25519_ && verifier_->hardware() && !hardware_; }
  [[nodiscard]] const std::string& name() const { return verifier_->name(); }
  /// The key whose signature does not hold; empty if there is none.
  [[nodiscard]] std::string bad() const {
    if (bad_ed25519_) return verifier_->name();
    if (bad_hardware_) return verifier_->hardware()->name();
    return bad_ml_dsa_ ? verifier_->ml_dsa()->name() : std::string();
  }

 private:
  const VerifierKey* verifier_;
  bool ed25519_ = false, bad_ed25519_ = false, ml_dsa_ = false, bad_ml_dsa_ = false;
  bool hardware_ = false, bad_hardware_ = false;
};

}  // namespace

MlDsaVerifierKey::MlDsaVerifierKey(const std::string& device, ByteView key)
    : name_(name_of(device)), key_(to_bytes(key)) {
  require_key_name(device);
  if (key_.size() != ml_dsa_public_key_size(MlDsaSet::k65))
    throw UsageError("the ML-DSA-65 key of " + device + " has not 1952 bytes");
  key_id_ = key_id_of(name_, kUnassignedSignatureType, typed_ml_dsa_key(key_));
}

std::string MlDsaVerifierKey::name_of(const std::string& device) {
  return device + std::string(kMlDsaNameEnd);
}

std::string MlDsaVerifierKey::device() const { return name_.substr(0, name_.size() - kMlDsaNameEnd.size()); }

std::string MlDsaVerifierKey::to_string() const {
  return KeyText{name_, kUnassignedSignatureType, typed_ml_dsa_key(key_)}.to_string();
}

MlDsaVerifierKey MlDsaVerifierKey::parse(std::string_view text) {
  const KeyText parsed = KeyText::parse(text);
  const auto refuse = [&](const std::string& why) -> UsageError {
    return UsageError(quoted_key_text(text) + " is no ML-DSA-65 key of a device (<name>+<id>+<key>): " + why);
  };
  if (!parsed.name.ends_with(kMlDsaNameEnd) || parsed.name.size() == kMlDsaNameEnd.size())
    throw refuse("its name does not end with " + std::string(kMlDsaNameEnd));
  if (parsed.algorithm != kUnassignedSignatureType || !text_of(parsed.key).starts_with(kMlDsaTypeText))
    throw refuse("its algorithm is not ML-DSA-65");
  const ByteView key = ByteView(parsed.key).subspan(kMlDsaTypeText.size());
  if (key.size() != ml_dsa_public_key_size(MlDsaSet::k65)) throw refuse("its key has not 1952 bytes");
  if (!parsed.states_its_id()) throw refuse("its id does not belong to its name and key");
  return {parsed.name.substr(0, parsed.name.size() - kMlDsaNameEnd.size()), key};
}

HardwareVerifierKey::HardwareVerifierKey(const std::string& device, ByteView key)
    : name_(name_of(device)), key_(to_bytes(key)) {
  require_key_name(device);
  if (!is_p256_public_key(key_))
    throw UsageError("the key in the hardware of " + device + " is not of P-256");
  key_id_ = ecdsa_key_id(key_);
}

std::string HardwareVerifierKey::name_of(const std::string& device) {
  return device + std::string(kHardwareNameEnd);
}

std::string HardwareVerifierKey::device() const {
  return name_.substr(0, name_.size() - kHardwareNameEnd.size());
}

std::string HardwareVerifierKey::to_string() const {
  Bytes typed = {kEcdsaSignatureType};
  append(typed, key_);
  return name_ + "+" + to_hex(big_endian_id(key_id_)) + "+" + to_base64(typed, Base64Padding::kPadded);
}

HardwareVerifierKey HardwareVerifierKey::parse(std::string_view text) {
  const KeyText parsed = KeyText::parse(text);
  const auto refuse = [&](const std::string& why) -> UsageError {
    return UsageError(quoted_key_text(text) +
                      " is no key in the hardware of a device (<name>+<id>+<key>): " + why);
  };
  if (!parsed.name.ends_with(kHardwareNameEnd) || parsed.name.size() == kHardwareNameEnd.size())
    throw refuse("its name does not end with " + std::string(kHardwareNameEnd));
  if (parsed.algorithm != kEcdsaSignatureType) throw refuse("its algorithm is not ECDSA");
  if (!is_p256_public_key(parsed.key)) throw refuse("its key is not of P-256");
  if (parsed.stated_id != ecdsa_key_id(parsed.key)) throw refuse("its id does not belong to its key");
  return {parsed.name.substr(0, parsed.name.size() - kHardwareNameEnd.size()), parsed.key};
}

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

VerifierKey VerifierKey::with_ml_dsa(MlDsaVerifierKey key, std::uint64_t since) const {
  if (key.device() != name_)
    throw UsageError("the ML-DSA-65 key " + key.name() + " is not that of the device " + name_);
  VerifierKey both = *this;
  both.ml_dsa_ = std::move(key);
  both.ml_dsa_since_ = since;
  return both;
}

VerifierKey VerifierKey::with_hardware(HardwareVerifierKey key, std::uint64_t since,
                                       const std::optional<Sha256Digest>& root_then) const {
  if (key.device() != name_)
    throw UsageError("the key in hardware " + key.name() + " is not that of the device " + name_);
  VerifierKey both = *this;
  both.hardware_ = std::move(key);
  both.hardware_since_ = since;
  both.log_root_before_hardware_ = root_then;
  return both;
}

VerifierKey verifier_key_of(const std::string& name, const SigningKey& key) {
  VerifierKey all(name, key.public_key());
  if (key.ml_dsa() != nullptr) all = all.with_ml_dsa({name, key.ml_dsa()->public_key()}, 0);
  if (key.hardware() != nullptr) all = all.with_hardware({name, key.hardware()->public_key()}, 0);
  return all;
}

std::string sign_note(std::string_view text, const std::string& name, const SigningKey& key) {
  return sign_note_by_all(text, name, key).note;
}

SignedNote sign_note_by_all(std::string_view text, const std::string& name, const SigningKey& key,
                            AskHardware ask) {
  if (!text.ends_with('\n') || !is_note_text(text))
    throw UsageError(
        "a note can only be signed if it is UTF-8 text without control characters that ends in a "
        "newline");
  const VerifierKey verifier = verifier_key_of(name, key);
  std::string note =
      std::string(text) + '\n' + signature_line(name, verifier.key_id(), key.sign(bytes_of(text)));
  if (const auto& ml_dsa = verifier.ml_dsa())
    note += signature_line(ml_dsa->name(), ml_dsa->key_id(), key.ml_dsa()->sign(bytes_of(text)));
  SignedNote result{std::move(note), ""};
  if (const auto& hardware = verifier.hardware(); hardware && ask == AskHardware::kYes) {
    HardwareSigner::Answer answer = key.hardware()->sign(bytes_of(text));
    // A line that does not verify would read as a forgery for ever.
    if (!answer.signature.empty() && !verify_ecdsa_p256(hardware->key(), bytes_of(text), answer.signature))
      answer = {{}, "its signature does not fit the key that it is known by"};
    if (answer.signature.empty())
      result.hardware_silent = std::move(answer.why);
    else
      result.note += signature_line(hardware->name(), hardware->key_id(), answer.signature);
  }
  return result;
}

OpenedNote open_note(std::string_view note, const std::vector<VerifierKey>& verifiers) {
  NoteParts parts = parse_note(note);
  if (!parts.why.empty()) return malformed(parts.why);
  OpenedNote result;
  result.text = std::move(parts.text);
  std::vector<SignatureCheck> checks(verifiers.begin(), verifiers.end());
  bool foreign_in_known_name = false;
  for (const SignatureLine& line : parts.lines) {
    result.signers.push_back(line.name);
    bool known_key = false;
    bool known_name = false;
    for (SignatureCheck& check : checks) {
      const SignatureCheck::By by = check.take(line, bytes_of(result.text));
      known_key = known_key || by == SignatureCheck::By::kVerifier;
      known_name = known_name || by == SignatureCheck::By::kForeignKey;
    }
    foreign_in_known_name = foreign_in_known_name || (known_name && !known_key);
    if (!known_key) result.unchecked.push_back(line.name + "+" + to_hex(big_endian_id(line.key_id)));
  }
  const auto fail = [&](NoteFailure failure, std::string why) {
    if (result.failure) return;
    result.failure = failure;
    result.explanation = std::move(why);
  };
  for (const SignatureCheck& check : checks) {
    if (!check.bad().empty())
      fail(NoteFailure::kBadSignature, "the signature of " + check.bad() + " does not fit the note's text");
    result.by_ml_dsa = result.by_ml_dsa || (check.has_signed() && check.has_ml_dsa());
    result.by_hardware = result.by_hardware || (check.has_signed() && check.has_hardware());
  }
  const bool verified = std::ranges::any_of(checks, &SignatureCheck::has_signed);
  // A note by another key of the name alone is of an unknown key; beside the known one it is a forgery.
  if (verified && foreign_in_known_name)
    fail(NoteFailure::kBadSignature, "another key signed it, too, in the name of a key that is known");
  if (!verified)
    fail(NoteFailure::kUnknownKey,
         "the note is signed by " + result.signers.front() + ", none of the keys given");
  const auto lacking = std::ranges::find_if(checks, &SignatureCheck::lacks_ml_dsa);
  if (lacking != checks.end())
    fail(NoteFailure::kLacksMlDsa,
         "it has no signature by the ML-DSA key of " + lacking->name() + ", which signs beside Ed25519");
  const auto silent = std::ranges::find_if(checks, &SignatureCheck::lacks_hardware);
  if (silent != checks.end())
    fail(NoteFailure::kLacksHardware, "it has no signature by the key in the hardware of " + silent->name());
  const bool holds_in_part =
      result.failure == NoteFailure::kLacksMlDsa || result.failure == NoteFailure::kLacksHardware;
  if (result.failure && !holds_in_part) result.by_ml_dsa = result.by_hardware = false;
  return result;
}

bool is_signed_for_log(const OpenedNote& opened, const VerifierKey& device, std::uint64_t size) {
  return !opened.failure || opened.failure == NoteFailure::kLacksHardware ||
         (opened.failure == NoteFailure::kLacksMlDsa && size <= device.ml_dsa_since());
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
