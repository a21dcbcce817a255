// The text formats that strangers hand us: signed notes, checkpoints, verifier keys, recipients and their
// encodings. Every decoder is strict: what it accepts, its encoder writes again, letter for letter.
#include <cstdint>
#include <cstdlib>

#include "base/error.h"
#include "crypto/age_recipient.h"
#include "crypto/encoding.h"
#include "crypto/signed_note.h"

namespace {

using namespace kiroku;          // NOLINT(google-build-using-namespace)
using namespace kiroku::crypto;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

std::string in_lower_case(std::string_view text) {
  std::string result(text);
  for (char& c : result)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return result;
}

void check_encodings(std::string_view text) {
  for (const auto padding : {Base64Padding::kPadded, Base64Padding::kUnpadded})
    if (const auto bytes = from_base64(text, padding)) require(to_base64(*bytes, padding) == text);
  if (const auto bytes = from_hex(text)) require(to_hex(*bytes) == text);
  // A human part without letters does not tell the case of the rest.
  if (const auto decoded = from_bech32(text))
    require(in_lower_case(to_bech32(decoded->human_part, decoded->bytes)) == in_lower_case(text));
}

void check_keys(std::string_view text) {
  try {
    require(VerifierKey::parse(text).to_string() == text);
  } catch (const UsageError&) {
  }
  try {
    require(parse_recipient(text)->to_string() == text);
  } catch (const UsageError&) {
  }
  try {
    require(!parse_recipients(text, "fuzz").empty());
  } catch (const UsageError&) {
  }
}

// Nobody signed for this key, so no note is ever accepted.
void check_note(std::string_view text) {
  static const std::vector<VerifierKey> kVerifiers = {
      VerifierKey("fuzz", SigningKey::generate().public_key())};
  const OpenedNote note = open_note(text, kVerifiers);
  require(note.failure.has_value() && !note.explanation.empty());
  if (*note.failure == NoteFailure::kMalformed) return;
  require(!note.signers.empty() && note.text.ends_with('\n') && text.starts_with(note.text));
  if (const auto checkpoint = Checkpoint::parse(note.text)) require(checkpoint->to_text() == note.text);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = text_of(std::as_bytes(std::span(data, size)));
  check_encodings(text);
  check_keys(text);
  check_note(text);
  if (const auto checkpoint = Checkpoint::parse(text)) require(checkpoint->to_text() == text);
  return 0;
}
