// The form of C2SP signed notes (signed-note.md), for the files of this folder that make and judge signature
// lines. Functions are pure and thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/bytes.h"

namespace kiroku::crypto {

inline constexpr std::string_view kSignaturePrefix = "\u2014 ";  // em dash, space
inline constexpr std::size_t kKeyIdSize = 4;

bool is_key_name(std::string_view name);
/// Throws kiroku::UsageError.
void require_key_name(const std::string& name);
/// UTF-8 without control characters other than newlines.
bool is_note_text(std::string_view text);

/// First four bytes of SHA-256(name ‖ "\n" ‖ algorithm ‖ key), big endian.
std::uint32_t key_id_of(std::string_view name, std::byte algorithm, ByteView key);
std::array<std::byte, kKeyIdSize> big_endian_id(std::uint32_t value);

/// "<name>+<key id, 8 hex digits>+<base64 of the algorithm's byte and the key>".
struct KeyText {
  std::string name;
  std::byte algorithm{};
  Bytes key;
  std::uint32_t stated_id = 0;  // of a text that was parsed
  [[nodiscard]] std::string to_string() const;
  [[nodiscard]] bool states_its_id() const { return stated_id == key_id_of(name, algorithm, key); }
  /// Throws kiroku::UsageError naming what is wrong. Whether the algorithm, the key's length and then the
  /// stated identifier are right is for the caller to say.
  static KeyText parse(std::string_view text);
};

/// Its beginning, in quotation marks: what is no key may be a file of megabytes.
std::string quoted_key_text(std::string_view text);

struct SignatureLine {
  std::string name;
  std::uint32_t key_id = 0;
  Bytes signature;
};
/// "— <name> <base64>" and a newline.
std::string signature_line(const std::string& name, std::uint32_t key_id, ByteView signature);

struct NoteParts {
  std::string text;  // what was signed
  std::vector<SignatureLine> lines;
  std::string why;  // it is no note, in half a sentence; empty if it is one
};
/// At most a megabyte and 100 signature lines, as golang.org/x/mod/sumdb/note has it: that bounds what a
/// hostile note can ask for. Two lines of one key are no form.
NoteParts parse_note(std::string_view note);
/// The line at the front of `text` without its newline, which is cut off, too; nothing if there is none.
std::optional<std::string_view> take_line(std::string_view& text);

}  // namespace kiroku::crypto
