#include "crypto/cosignature.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/error.h"

namespace kiroku::crypto {
namespace {

constexpr std::byte kCosignatureType{0x04};
constexpr std::size_t kTimeSize = 8;
constexpr std::uint64_t kLatestTime = std::numeric_limits<std::int64_t>::max();

std::string message(std::string_view text, std::uint64_t time_s) {
  return "cosignature/v1\ntime " + std::to_string(time_s) + "\n" + std::string(text);
}

}  // namespace

CosignerKey::CosignerKey(std::string name, const Ed25519PublicKey& key) : name_(std::move(name)), key_(key) {
  require_key_name(name_);
}

CosignerKey CosignerKey::parse(std::string_view text) {
  const KeyText parsed = KeyText::parse(text);
  const auto refuse = [&](const std::string& why) -> UsageError {
    return UsageError(quoted_key_text(text) + " is no key of a witness: " + why);
  };
  if (parsed.algorithm == std::byte{0x01})
    throw refuse("it is the key of a log; ask the witness for its own");
  if (parsed.algorithm == std::byte{0x06}) throw refuse("it is of ML-DSA-44, which is not known here");
  if (parsed.algorithm != kCosignatureType) throw refuse("its algorithm is unknown");
  Ed25519PublicKey key;
  if (parsed.key.size() != key.size()) throw refuse("its key has not 32 bytes");
  if (!parsed.states_its_id()) throw refuse("its id does not belong to its name and key");
  std::ranges::copy(parsed.key, key.begin());
  return {parsed.name, key};
}

std::uint32_t CosignerKey::key_id() const { return key_id_of(name_, kCosignatureType, key_); }

std::string CosignerKey::to_string() const {
  return KeyText{name_, kCosignatureType, to_bytes(key_)}.to_string();
}

std::string cosign(std::string_view text, const std::string& name, const SigningKey& key,
                   std::uint64_t time_s) {
  if (time_s == 0 || time_s > kLatestTime)
    throw UsageError("a cosignature cannot state the time " + std::to_string(time_s));
  const CosignerKey cosigner(name, key.public_key());
  Bytes signature;
  for (std::size_t i = 0; i < kTimeSize; ++i)
    signature.push_back(static_cast<std::byte>(time_s >> (8 * (kTimeSize - 1 - i)) & 0xff));
  append(signature, key.sign(bytes_of(message(text, time_s))));
  return signature_line(name, cosigner.key_id(), signature);
}

CosignatureCheck check_cosignature(std::string_view note, const CosignerKey& cosigner) {
  return check_cosignature(parse_note(note), cosigner);
}

CosignatureCheck check_cosignature(const NoteParts& parts, const CosignerKey& cosigner) {
  using State = CosignatureCheck::State;
  const auto line = std::ranges::find_if(parts.lines, [&](const SignatureLine& each) {
    return each.name == cosigner.name() && each.key_id == cosigner.key_id();
  });
  if (line == parts.lines.end()) return {};
  if (line->signature.size() != kTimeSize + std::tuple_size_v<Ed25519Signature>) return {State::kInvalid};
  std::uint64_t time_s = 0;
  for (std::size_t i = 0; i < kTimeSize; ++i)
    time_s = time_s << 8 | std::to_integer<std::uint64_t>(line->signature[i]);
  const ByteView signature = ByteView(line->signature).subspan(kTimeSize);
  // A cosignature of a checkpoint always states its time.
  const bool holds = time_s != 0 && time_s <= kLatestTime &&
                     verify_ed25519(cosigner.key(), bytes_of(message(parts.text, time_s)), signature);
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
