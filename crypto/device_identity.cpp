#include "crypto/device_identity.h"

#include <charconv>
#include <optional>

#include "base/error.h"
#include "crypto/note_format.h"

namespace kiroku::crypto {
namespace {

std::string first_line(const std::string& device) { return "kiroku/" + device + "/identity"; }

std::optional<std::uint64_t> count_of(std::string_view text) {
  std::uint64_t count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole && (text.size() == 1 || text.front() != '0') ? std::optional(count) : std::nullopt;
}

}  // namespace

bool looks_like_device_identity(std::string_view text) {
  const auto line = take_line(text);
  return line && line->starts_with("kiroku/") && line->ends_with("/identity");
}

std::string write_device_identity(const std::string& device, const SigningKey& key, SignsSince since) {
  const VerifierKey verifier = verifier_key_of(device, key);
  if (!verifier.ml_dsa() && !verifier.hardware())
    throw UsageError("the device " + device + " has no key beside Ed25519 to state");
  std::string text = first_line(device) + '\n' + verifier.to_string() + '\n';
  if (verifier.ml_dsa()) text += verifier.ml_dsa()->to_string() + '\n' + std::to_string(since.ml_dsa) + '\n';
  if (verifier.hardware())
    text += verifier.hardware()->to_string() + '\n' + std::to_string(since.hardware) + '\n';
  SignedNote written = sign_note_by_all(text, device, key);
  if (!written.hardware_silent.empty())
    throw Error("the hardware of " + device + " did not sign its identity: " + written.hardware_silent);
  return std::move(written.note);
}

VerifierKey parse_device_identity(std::string_view note) {
  const OpenedNote unjudged = open_note(note, {});
  if (unjudged.failure == NoteFailure::kMalformed) throw UsageError(unjudged.explanation);
  std::string_view rest = unjudged.text;
  const auto origin = take_line(rest);
  const auto ed25519 = take_line(rest);
  if (!origin || !ed25519 || rest.empty()) throw UsageError("it has not the lines of a device's identity");
  VerifierKey key = VerifierKey::parse(*ed25519);
  while (!rest.empty()) {
    const auto beside = take_line(rest);
    const auto since = take_line(rest);
    const auto entries = since ? count_of(*since) : std::nullopt;
    if (!beside || !entries) throw UsageError("it has not the lines of a device's identity");
    const bool is_ml_dsa = beside->starts_with(MlDsaVerifierKey::name_of(key.name()) + "+");
    if (key.hardware() || (is_ml_dsa && key.ml_dsa()))
      throw UsageError("it states a key twice, or keys in another order");
    key = is_ml_dsa ? key.with_ml_dsa(MlDsaVerifierKey::parse(*beside), *entries)
                    : key.with_hardware(HardwareVerifierKey::parse(*beside), *entries);
  }
  if (*origin != first_line(key.name())) throw UsageError("its first line is not that of " + key.name());
  if (const OpenedNote opened = open_note(note, {key}); opened.failure)
    throw UsageError("its keys did not all sign it: " + opened.explanation);
  return key;
}

}  // namespace kiroku::crypto
