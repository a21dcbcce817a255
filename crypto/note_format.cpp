#include "crypto/note_format.h"

#include <algorithm>
#include <set>
#include <utility>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "crypto/utf8.h"

namespace kiroku::crypto {
namespace {

constexpr std::size_t kMaximumNoteSize = 1'000'000;
constexpr std::size_t kMaximumSignatures = 100;

std::uint32_t from_big_endian(ByteView bytes) {
  std::uint32_t value = 0;
  for (const std::byte byte : bytes.first(kKeyIdSize))
    value = value << 8 | std::to_integer<std::uint32_t>(byte);
  return value;
}

std::optional<SignatureLine> parse_signature_line(std::string_view line) {
  if (!line.starts_with(kSignaturePrefix)) return std::nullopt;
  line.remove_prefix(kSignaturePrefix.size());
  const std::size_t space = line.find(' ');
  if (space == std::string_view::npos || !is_key_name(line.substr(0, space))) return std::nullopt;
  const auto bytes = from_base64(line.substr(space + 1), Base64Padding::kPadded);
  if (!bytes || bytes->size() <= kKeyIdSize) return std::nullopt;
  return SignatureLine{std::string(line.substr(0, space)), from_big_endian(*bytes),
                       Bytes(bytes->begin() + kKeyIdSize, bytes->end())};
}

NoteParts no_note(std::string why) { return {{}, {}, std::move(why)}; }

}  // namespace

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

std::uint32_t key_id_of(std::string_view name, std::byte algorithm, ByteView key) {
  Sha256 hash;
  hash.update(bytes_of(name));
  hash.update(bytes_of("\n"));
  hash.update({&algorithm, 1});
  hash.update(key);
  return from_big_endian(hash.finish());
}

std::array<std::byte, kKeyIdSize> big_endian_id(std::uint32_t value) {
  return {static_cast<std::byte>(value >> 24), static_cast<std::byte>(value >> 16 & 0xff),
          static_cast<std::byte>(value >> 8 & 0xff), static_cast<std::byte>(value & 0xff)};
}

std::string KeyText::to_string() const {
  Bytes typed_key = {algorithm};
  append(typed_key, key);
  return name + "+" + to_hex(big_endian_id(key_id_of(name, algorithm, key))) + "+" +
         to_base64(typed_key, Base64Padding::kPadded);
}

std::string quoted_key_text(std::string_view text) {
  constexpr std::size_t kMost = 200;
  const bool is_long = text.size() > kMost;
  return "\"" + std::string(text.substr(0, kMost)) + (is_long ? "\u2026" : "") + "\"";
}

KeyText KeyText::parse(std::string_view text) {
  const auto refuse = [&](const std::string& why) -> UsageError {
    return UsageError(quoted_key_text(text) + " is no verifier key (<name>+<id>+<key>): " + why);
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
  return {std::string(name), typed_key->front(), Bytes(typed_key->begin() + 1, typed_key->end()),
          from_big_endian(*id)};
}

std::string signature_line(const std::string& name, std::uint32_t key_id, ByteView signature) {
  Bytes bytes = to_bytes(big_endian_id(key_id));
  append(bytes, signature);
  return std::string(kSignaturePrefix) + name + ' ' + to_base64(bytes, Base64Padding::kPadded) + '\n';
}

NoteParts parse_note(std::string_view note) {
  if (note.size() > kMaximumNoteSize) return no_note("it is longer than a megabyte");
  if (!is_note_text(note)) return no_note("it is not UTF-8 or has control characters");
  const std::size_t blank_line = note.rfind("\n\n");
  if (blank_line == std::string_view::npos) return no_note("no blank line parts text and signatures");
  NoteParts result;
  result.text = note.substr(0, blank_line + 1);
  std::string_view rest = note.substr(blank_line + 2);
  if (rest.empty()) return no_note("it has no signature line");
  if (!rest.ends_with('\n')) return no_note("its last line has no newline");
  std::set<std::pair<std::string, std::uint32_t>> keys;
  while (const auto line = take_line(rest)) {
    auto signature = parse_signature_line(*line);
    if (!signature) return no_note("a signature line is not \"\u2014 <name> <base64>\"");
    if (result.lines.size() == kMaximumSignatures) return no_note("it has more than 100 signatures");
    if (!keys.emplace(signature->name, signature->key_id).second)
      return no_note("two of its signature lines are of one key");
    result.lines.push_back(std::move(*signature));
  }
  return result;
}

std::optional<std::string_view> take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos) return std::nullopt;
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end + 1);
  return line;
}

}  // namespace kiroku::crypto
