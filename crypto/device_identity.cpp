#include "crypto/device_identity.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <tuple>

#include "base/error.h"
#include "crypto/encoding.h"
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

/// Entries that the log had before a key signed, and its root then, where that is stated.
struct LogBefore {
  std::uint64_t entries = 0;
  std::optional<Sha256Digest> root;

  [[nodiscard]] std::string to_line() const {
    return std::to_string(entries) + (root ? ' ' + to_base64(*root, Base64Padding::kPadded) : "") + '\n';
  }
  static std::optional<LogBefore> parse(std::string_view line) {
    const std::size_t space = line.find(' ');
    const auto entries = count_of(line.substr(0, space));
    if (!entries) return std::nullopt;
    LogBefore before{*entries, std::nullopt};
    if (space == std::string_view::npos) return before;
    const auto bytes = from_base64(line.substr(space + 1), Base64Padding::kPadded);
    if (!bytes || bytes->size() != std::tuple_size_v<Sha256Digest>) return std::nullopt;
    std::ranges::copy(*bytes, before.root.emplace().begin());
    return before;
  }
};

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
  if (verifier.hardware()) {
    const LogBefore before{since.hardware, since.log_root_before_hardware};
    if ((before.entries > 0) != before.root.has_value())
      throw UsageError(
          "an identity states the log's root from before a key in hardware, or that it was empty");
    text += verifier.hardware()->to_string() + '\n' + before.to_line();
  }
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
    const auto before = since ? LogBefore::parse(*since) : std::nullopt;
    if (!beside || !before) throw UsageError("it has not the lines of a device's identity");
    const bool is_ml_dsa = beside->starts_with(MlDsaVerifierKey::name_of(key.name()) + "+");
    if (before->root.has_value() != (!is_ml_dsa && before->entries > 0))
      throw UsageError("it has not the lines of a device's identity: a size of the log lacks its root there");
    if (key.hardware() || (is_ml_dsa && key.ml_dsa()))
      throw UsageError("it states a key twice, or keys in another order");
    key = is_ml_dsa ? key.with_ml_dsa(MlDsaVerifierKey::parse(*beside), before->entries)
                    : key.with_hardware(HardwareVerifierKey::parse(*beside), before->entries, before->root);
  }
  if (*origin != first_line(key.name())) throw UsageError("its first line is not that of " + key.name());
  if (const OpenedNote opened = open_note(note, {key}); opened.failure)
    throw UsageError("its keys did not all sign it: " + opened.explanation);
  return key;
}

}  // namespace kiroku::crypto
