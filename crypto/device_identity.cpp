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

std::string write_device_identity(const std::string& device, const SigningKey& key, std::uint64_t since) {
  const VerifierKey verifier = verifier_key_of(device, key);
  if (!verifier.ml_dsa()) throw UsageError("the device " + device + " has no ML-DSA key to state");
  const std::string text = first_line(device) + '\n' + verifier.to_string() + '\n' +
                           verifier.ml_dsa()->to_string() + '\n' + std::to_string(since) + '\n';
  return sign_note(text, device, key);
}

VerifierKey parse_device_identity(std::string_view note) {
  const OpenedNote unjudged = open_note(note, {});
  if (unjudged.failure == NoteFailure::kMalformed) throw UsageError(unjudged.explanation);
  std::string_view rest = unjudged.text;
  const auto origin = take_line(rest);
  const auto ed25519 = take_line(rest);
  const auto ml_dsa = take_line(rest);
  const auto since = take_line(rest);
  const auto entries = since ? count_of(*since) : std::nullopt;
  if (!origin || !ed25519 || !ml_dsa || !entries || !rest.empty())
    throw UsageError("it has not the four lines of a device's identity");
  const VerifierKey key =
      VerifierKey::parse(*ed25519).with_ml_dsa(MlDsaVerifierKey::parse(*ml_dsa), *entries);
  if (*origin != first_line(key.name())) throw UsageError("its first line is not that of " + key.name());
  if (const OpenedNote opened = open_note(note, {key}); opened.failure)
    throw UsageError("its two keys did not both sign it: " + opened.explanation);
  return key;
}

}  // namespace kiroku::crypto
