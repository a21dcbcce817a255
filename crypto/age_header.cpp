#include "crypto/age_header.h"

#include <algorithm>
#include <string_view>

#include "crypto/encoding.h"
#include "crypto/key_derivation.h"

namespace kiroku::crypto {
namespace {

constexpr std::string_view kIntro = "age-encryption.org/v1\n";
constexpr std::string_view kStanzaMark = "->";
constexpr std::string_view kMacMark = "---";
constexpr std::size_t kColumns = 64;
constexpr std::size_t kBytesPerLine = kColumns / 4 * 3;

[[noreturn]] void malformed(const std::string& why) {
  throw AgeError(AgeFailure::kHeaderMalformed, "the age header is malformed: " + why);
}

// Lines from the front of a text. Only take() moves on.
class LineCursor {
 public:
  explicit LineCursor(std::string_view text) : text_(text) {}
  [[nodiscard]] std::string_view rest() const { return text_.substr(position_); }
  [[nodiscard]] std::size_t position() const { return position_; }
  /// The next line without its newline; nothing if no newline is there yet.
  std::optional<std::string_view> take() {
    const std::size_t end = text_.find('\n', position_);
    if (end == std::string_view::npos) return std::nullopt;
    const std::string_view line = text_.substr(position_, end - position_);
    position_ = end + 1;
    return line;
  }

 private:
  std::string_view text_;
  std::size_t position_ = 0;
};

bool is_argument(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= 33 && c <= 126; });
}

// "-> type argument…"; every argument is at least one visible ASCII character.
AgeStanza parse_stanza_opening(std::string_view line) {
  if (!line.starts_with("-> ")) malformed("a stanza does not begin with \"-> \"");
  AgeStanza stanza;
  std::size_t begin = kStanzaMark.size();
  while (begin != std::string_view::npos) {
    const std::size_t end = line.find(' ', begin + 1);
    const std::string_view argument =
        line.substr(begin + 1, end == std::string_view::npos ? end : end - begin - 1);
    if (!is_argument(argument))
      malformed("a stanza's argument is empty or has a character that is not visible");
    if (stanza.type.empty())
      stanza.type = argument;
    else
      stanza.arguments.emplace_back(argument);
    begin = end;
  }
  return stanza;
}

// Lines of base64 up to and including the first short one. False: more bytes are needed.
bool take_stanza_body(LineCursor& cursor, Bytes& body) {
  while (true) {
    const auto line = cursor.take();
    if (!line) {
      if (cursor.rest().size() > kColumns)
        malformed("a line of a stanza's body is longer than 64 characters");
      return false;
    }
    if (line->size() > kColumns) malformed("a line of a stanza's body is longer than 64 characters");
    const auto bytes = from_base64(*line, Base64Padding::kUnpadded);
    if (!bytes) malformed("a line of a stanza's body is not canonical base64");
    append(body, *bytes);
    if (bytes->size() < kBytesPerLine) return true;
  }
}

// "-----BEGIN AGE ENCRYPTED FILE-----" and everything that tries to look like it.
bool looks_armored(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r\n");
  return begin != std::string_view::npos && text.substr(begin).starts_with("-----");
}

void require_scrypt_alone(const std::vector<AgeStanza>& stanzas) {
  if (stanzas.size() > 1 && std::ranges::any_of(stanzas, [](const auto& s) { return s.type == "scrypt"; }))
    malformed("a passphrase stanza does not stand alone");
}

Sha256Digest mac_of(ByteView authenticated_text, const Secret& file_key) {
  const Secret key = hkdf_sha256(file_key.bytes(), {}, "header");
  return hmac_sha256(key.bytes(), authenticated_text);
}

void append_stanza(std::string& text, const AgeStanza& stanza) {
  text += kStanzaMark;
  text += ' ' + stanza.type;
  for (const auto& argument : stanza.arguments) text += ' ' + argument;
  text += '\n';
  const std::string body = to_base64(stanza.body, Base64Padding::kUnpadded);
  std::size_t written = 0;
  for (; body.size() - written >= kColumns; written += kColumns) {
    text += std::string_view(body).substr(written, kColumns);
    text += '\n';
  }
  text += std::string_view(body).substr(written);  // the short line that ends the body; it may be empty
  text += '\n';
}

}  // namespace

std::optional<AgeHeader> parse_age_header(ByteView bytes) {
  const std::string_view text = text_of(bytes.first(std::min(bytes.size(), kMaximumAgeHeaderSize)));
  const auto more_needed = [&]() -> std::optional<AgeHeader> {
    if (bytes.size() >= kMaximumAgeHeaderSize) malformed("it is longer than a megabyte");
    return std::nullopt;
  };
  if (!text.starts_with(kIntro)) {
    if (looks_armored(text))
      throw AgeError(AgeFailure::kArmored,
                     "the file is ASCII-armored, which is not read here; use `age -d`, or strip the armor");
    // Enough to tell armor behind white space from other files.
    const bool undecided =
        kIntro.starts_with(text) || (text.size() < 1024 && text.find_first_not_of(" \t\r\n") == text.npos);
    if (undecided) return std::nullopt;
    malformed("it does not begin with \"age-encryption.org/v1\"");
  }
  LineCursor cursor(text);
  cursor.take();
  AgeHeader header;
  while (true) {
    if (cursor.rest().size() < kMacMark.size()) return more_needed();
    const std::size_t line_begin = cursor.position();
    const bool is_mac_line = cursor.rest().starts_with(kMacMark);
    if (!is_mac_line && !cursor.rest().starts_with(kStanzaMark))
      malformed("a line begins neither a stanza nor the MAC");
    const auto line = cursor.take();
    if (!line) return more_needed();
    if (!is_mac_line) {
      header.stanzas.push_back(parse_stanza_opening(*line));
      if (!take_stanza_body(cursor, header.stanzas.back().body)) return more_needed();
      continue;
    }
    const auto mac =
        line->starts_with("--- ") ? from_base64(line->substr(4), Base64Padding::kUnpadded) : std::nullopt;
    if (!mac || mac->size() != header.mac.size())
      malformed("its MAC line is not \"--- \" and 32 bytes of base64");
    if (header.stanzas.empty()) malformed("it has no recipient stanza");
    require_scrypt_alone(header.stanzas);
    std::ranges::copy(*mac, header.mac.begin());
    header.authenticated_text = to_bytes(text.substr(0, line_begin + kMacMark.size()));
    header.size = cursor.position();
    return header;
  }
}

bool age_header_mac_fits(const AgeHeader& header, const Secret& file_key) {
  return equal_constant_time(mac_of(header.authenticated_text, file_key), header.mac);
}

Bytes write_age_header(const std::vector<AgeStanza>& stanzas, const Secret& file_key) {
  std::string text(kIntro);
  for (const auto& stanza : stanzas) append_stanza(text, stanza);
  text += kMacMark;
  const auto mac = mac_of(bytes_of(text), file_key);
  text += ' ' + to_base64(mac, Base64Padding::kUnpadded) + '\n';
  return to_bytes(text);
}

}  // namespace kiroku::crypto
