#include "crypto/cosignature.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/error.h"

namespace kiroku::crypto {
namespace {

constexpr std::byte kEd25519Type{0x04};
constexpr std::byte kMlDsa44Type{0x06};
constexpr std::size_t kTimeSize = 8;
constexpr std::uint64_t kLatestTime = std::numeric_limits<std::int64_t>::max();
constexpr std::size_t kLongestName = 255;  // that one byte can count

std::byte type_of(CosignatureAlgorithm algorithm) {
  return algorithm == CosignatureAlgorithm::kEd25519 ? kEd25519Type : kMlDsa44Type;
}

std::size_t signature_size(CosignatureAlgorithm algorithm) {
  return algorithm == CosignatureAlgorithm::kEd25519 ? std::tuple_size_v<Ed25519Signature>
                                                     : ml_dsa_signature_size(MlDsaSet::k44);
}

void append_number(Bytes& bytes, std::uint64_t number) {
  for (std::size_t i = 0; i < sizeof number; ++i)
    bytes.push_back(static_cast<std::byte>(number >> (8 * (sizeof number - 1 - i)) & 0xff));
}

void append_counted(Bytes& bytes, std::string_view text) {
  bytes.push_back(static_cast<std::byte>(text.size()));
  append(bytes, bytes_of(text));
}

std::string ed25519_message(std::string_view text, std::uint64_t time_s) {
  return "cosignature/v1\ntime " + std::to_string(time_s) + "\n" + std::string(text);
}

/// The structure cosigned_message, of a whole tree; nothing where it cannot hold what the text says.
std::optional<Bytes> ml_dsa_message(std::string_view text, std::string_view name, std::uint64_t time_s) {
  const auto checkpoint = parse_extended_checkpoint(text);
  if (!checkpoint || checkpoint->origin.empty() || checkpoint->origin.size() > kLongestName)
    return std::nullopt;
  Bytes message = to_bytes(std::string_view("subtree/v1\n\0", 12));
  append_counted(message, name);
  append_number(message, time_s);
  append_counted(message, checkpoint->origin);
  append_number(message, 0);
  append_number(message, checkpoint->size);
  append(message, checkpoint->root);
  return message;
}

bool verify(const CosignerKey& cosigner, std::string_view text, std::uint64_t time_s, ByteView signature) {
  if (cosigner.algorithm() == CosignatureAlgorithm::kEd25519) {
    Ed25519PublicKey key;
    std::ranges::copy(cosigner.key(), key.begin());
    return verify_ed25519(key, bytes_of(ed25519_message(text, time_s)), signature);
  }
  const auto message = ml_dsa_message(text, cosigner.name(), time_s);
  return message && verify_ml_dsa(MlDsaSet::k44, cosigner.key(), *message, signature);
}

void require_time(std::uint64_t time_s) {
  if (time_s == 0 || time_s > kLatestTime)
    throw UsageError("a cosignature cannot state the time " + std::to_string(time_s));
}

std::string timed_line(const CosignerKey& cosigner, std::uint64_t time_s, ByteView signature) {
  Bytes timed;
  append_number(timed, time_s);
  append(timed, signature);
  return signature_line(cosigner.name(), cosigner.key_id(), timed);
}

}  // namespace

CosignerKey::CosignerKey(std::string name, CosignatureAlgorithm algorithm, Bytes key)
    : name_(std::move(name)), algorithm_(algorithm), key_(std::move(key)) {
  require_key_name(name_);
}

CosignerKey::CosignerKey(std::string name, const Ed25519PublicKey& key)
    : CosignerKey(std::move(name), CosignatureAlgorithm::kEd25519, to_bytes(key)) {}

CosignerKey CosignerKey::of_ml_dsa_44(std::string name, ByteView key) {
  if (key.size() != ml_dsa_public_key_size(MlDsaSet::k44))
    throw UsageError("a witness's key of ML-DSA-44 has 1312 bytes, and this one " +
                     std::to_string(key.size()));
  if (name.size() > kLongestName)
    throw UsageError(
        "the name of a witness that signs by ML-DSA-44 has at most 255 bytes; choose a shorter one");
  return {std::move(name), CosignatureAlgorithm::kMlDsa44, to_bytes(key)};
}

CosignerKey CosignerKey::parse(std::string_view text) {
  const KeyText parsed = KeyText::parse(text);
  const auto refuse = [&](const std::string& why) -> UsageError {
    return UsageError(quoted_key_text(text) + " is no key of a witness: " + why);
  };
  if (parsed.algorithm == std::byte{0x01})
    throw refuse("it is the key of a log; ask the witness for its own");
  const bool is_ml_dsa = parsed.algorithm == kMlDsa44Type;
  if (!is_ml_dsa && parsed.algorithm != kEd25519Type) throw refuse("its algorithm is unknown");
  const std::size_t size =
      is_ml_dsa ? ml_dsa_public_key_size(MlDsaSet::k44) : std::tuple_size_v<Ed25519PublicKey>;
  if (parsed.key.size() != size) throw refuse("its key has not " + std::to_string(size) + " bytes");
  if (!parsed.states_its_id()) throw refuse("its id does not belong to its name and key");
  if (is_ml_dsa) return of_ml_dsa_44(parsed.name, parsed.key);
  return {parsed.name, CosignatureAlgorithm::kEd25519, parsed.key};
}

std::uint32_t CosignerKey::key_id() const { return key_id_of(name_, type_of(algorithm_), key_); }

std::string CosignerKey::to_string() const { return KeyText{name_, type_of(algorithm_), key_}.to_string(); }

std::string cosign(std::string_view text, const std::string& name, const SigningKey& key,
                   std::uint64_t time_s) {
  require_time(time_s);
  return timed_line(CosignerKey(name, key.public_key()), time_s,
                    key.sign(bytes_of(ed25519_message(text, time_s))));
}

std::string cosign(std::string_view text, const std::string& name, const MlDsaPrivateKey& key,
                   std::uint64_t time_s) {
  require_time(time_s);
  const CosignerKey cosigner = CosignerKey::of_ml_dsa_44(name, key.public_key());
  const auto message = ml_dsa_message(text, name, time_s);
  if (!message)
    throw UsageError(
        "this cannot be cosigned by ML-DSA-44: it is no checkpoint, or its origin has more than 255 bytes");
  return timed_line(cosigner, time_s, key.sign(*message));
}

bool can_cosign_by_ml_dsa(std::string_view text) { return ml_dsa_message(text, "", 0).has_value(); }

CosignatureCheck check_cosignature(std::string_view note, const CosignerKey& cosigner) {
  return check_cosignature(parse_note(note), cosigner);
}

CosignatureCheck check_cosignature(const NoteParts& parts, const CosignerKey& cosigner) {
  using State = CosignatureCheck::State;
  const auto line = std::ranges::find_if(parts.lines, [&](const SignatureLine& each) {
    return each.name == cosigner.name() && each.key_id == cosigner.key_id();
  });
  if (line == parts.lines.end()) return {};
  if (line->signature.size() != kTimeSize + signature_size(cosigner.algorithm())) return {State::kInvalid};
  std::uint64_t time_s = 0;
  for (std::size_t i = 0; i < kTimeSize; ++i)
    time_s = time_s << 8 | std::to_integer<std::uint64_t>(line->signature[i]);
  const ByteView signature = ByteView(line->signature).subspan(kTimeSize);
  // A cosignature of a checkpoint always states its time.
  const bool holds = time_s != 0 && time_s <= kLatestTime && verify(cosigner, parts.text, time_s, signature);
  return holds ? CosignatureCheck{State::kValid, time_s} : CosignatureCheck{State::kInvalid};
}

std::optional<Checkpoint> parse_extended_checkpoint(std::string_view text) {
  std::string_view rest = text;
  for (int line = 0; line < 3; ++line) {
    if (!take_line(rest)) return std::nullopt;
  }
  auto checkpoint = Checkpoint::parse(text.substr(0, text.size() - rest.size()));
  while (!rest.empty()) {
    const auto extension = take_line(rest);
    if (!extension || extension->empty()) return std::nullopt;
  }
  return checkpoint;
}

}  // namespace kiroku::crypto
