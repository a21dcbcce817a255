#include "recorder/vitals/hl7_charset.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <iconv.h>
#include <utility>

#include "crypto/utf8.h"

namespace kiroku::recorder {
namespace {

/// The name without case, blanks, hyphens and underscores: "UNICODE UTF-8" and "unicode_utf8" are one.
std::string plain(std::string_view name) {
  std::string result;
  for (const char c : name) {
    if (c >= 'a' && c <= 'z') {
      result += static_cast<char>(c - 'a' + 'A');
    } else if (c != ' ' && c != '-' && c != '_') {
      result += c;
    }
  }
  return result;
}

constexpr std::array<std::pair<std::string_view, const char*>, 30> kNames{{
    {"ASCII", "ASCII"},
    {"USASCII", "ASCII"},
    {"ISOIR6", "ASCII"},
    {"UNICODEUTF8", "UTF-8"},
    {"UTF8", "UTF-8"},
    {"UNICODE", "UTF-8"},
    {"ISOIR192", "UTF-8"},
    {"ISOIR100", "ISO-8859-1"},
    {"LATIN1", "ISO-8859-1"},
    {"ISOIR14", "ISO-2022-JP-3"},
    {"ISOIR87", "ISO-2022-JP-3"},
    {"ISOIR159", "ISO-2022-JP-3"},
    {"ISO2022JP", "ISO-2022-JP-3"},
    {"SHIFTJIS", "CP932"},
    {"SJIS", "CP932"},
    {"MS932", "CP932"},
    {"CP932", "CP932"},
    {"WINDOWS31J", "CP932"},
    {"EUCJP", "EUC-JP"},
    {"GB180302000", "GB18030"},
    {"GB18030", "GB18030"},
    {"GBK", "GB18030"},
    {"GB2312", "GB18030"},
    {"KSX1001", "EUC-KR"},
    {"EUCKR", "EUC-KR"},
    {"CNS116431992", "EUC-TW"},
    {"BIG5", "BIG5"},
    {"WINDOWS1252", "CP1252"},
    {"CP1252", "CP1252"},
    {"CP1251", "CP1251"},
}};

/// For a sentence: what a message states is bytes of no known character set yet.
std::string in_ascii(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) >= 0x80; }, '?');
  return text;
}

/// iconv's name for what a message states, "" if unknown.
std::string iconv_name(std::string_view stated) {
  const std::string name = plain(stated);
  constexpr std::string_view kLatin = "8859/";
  const std::size_t latin = name.find(kLatin);
  if (latin != std::string::npos && latin <= 3 && name.size() > latin + kLatin.size()) {
    return "ISO-8859-" + name.substr(latin + kLatin.size());
  }
  const auto* const found = std::ranges::find(kNames, name, &std::pair<std::string_view, const char*>::first);
  return found == kNames.end() ? "" : found->second;
}

bool is_ascii(std::string_view bytes) {
  return std::ranges::all_of(bytes, [](char c) { return static_cast<unsigned char>(c) < 0x80 && c != 0x1B; });
}

/// ISO 8859-1 has every byte, and each is the character of its number: needs no table, so it cannot fail.
std::string latin1_as_utf8(std::string_view bytes) {
  std::string text;
  text.reserve(bytes.size());
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80) {
      text += c;
    } else {
      text += static_cast<char>(0xC0U | (byte >> 6U));
      text += static_cast<char>(0x80U | (byte & 0x3FU));
    }
  }
  return text;
}

class Converter {
 public:
  explicit Converter(const std::string& from) : handle_(iconv_open("UTF-8", from.c_str())) {}
  ~Converter() {
    if (is_open()) {
      iconv_close(handle_);
    }
  }
  Converter(const Converter&) = delete;
  Converter& operator=(const Converter&) = delete;

  [[nodiscard]] bool is_open() const { return handle_ != reinterpret_cast<iconv_t>(-1); }

  std::optional<std::string> convert(std::string_view bytes) {
    std::string result;
    std::array<char, 4096> piece{};
    // iconv does not write through its input; the C interface lacks the const.
    char* in = const_cast<char*>(bytes.data());
    std::size_t in_left = bytes.size();
    while (in_left > 0) {
      char* out = piece.data();
      std::size_t out_left = piece.size();
      const bool failed = iconv(handle_, &in, &in_left, &out, &out_left) == static_cast<std::size_t>(-1);
      result.append(piece.data(), out);
      if (failed && errno != E2BIG) {
        return std::nullopt;
      }
    }
    return result;
  }

 private:
  iconv_t handle_;
};

}  // namespace

std::optional<std::string> converted_to_utf8(std::string_view bytes, const std::string& charset) {
  Converter converter(charset);
  if (!converter.is_open()) {
    return std::nullopt;
  }
  return converter.convert(bytes);
}

void keep_charsets_at_hand() {
  // Never closed: the C library lets go of the tables of a set that nobody converts.
  for (const auto& [name, charset] : kNames) {
    if (const auto handle = iconv_open("UTF-8", charset); handle != reinterpret_cast<iconv_t>(-1))
      (void)iconv(handle, nullptr, nullptr, nullptr, nullptr);
  }
  for (int part = 1; part <= 16; ++part)
    (void)iconv_open("UTF-8", ("ISO-8859-" + std::to_string(part)).c_str());
}

Utf8Text hl7_text_as_utf8(std::string_view bytes, const std::vector<std::string>& stated) {
  if (is_ascii(bytes)) {
    return {std::string(bytes), ""};  // the same in all of them
  }
  std::string name, unknown, charset = "ASCII";
  for (const std::string& one : stated) {
    if (one.empty()) {
      continue;
    }
    name += (name.empty() ? "" : "~") + in_ascii(one);
    const std::string known = iconv_name(one);
    if (known.empty()) {
      unknown = in_ascii(one);
    } else if (known != "ASCII") {
      charset = known;  // of several the last beyond ASCII: ISO 2022 switches between them
    }
  }
  if (charset == "UTF-8") {
    if (crypto::is_utf8(bytes)) {
      return {std::string(bytes), ""};
    }
  } else if (charset != "ASCII" && unknown.empty()) {
    if (auto text = converted_to_utf8(bytes, charset)) {
      return {std::move(*text), ""};
    }
  }
  const std::string complaint =
      name.empty()      ? "the message states no character set (MSH-18) but is not ASCII"
      : unknown.empty() ? "the message is not in the character set '" + name + "' that it states (MSH-18)"
                        : "the character set '" + unknown + "' (MSH-18) is not known";
  if (crypto::is_utf8(bytes)) {
    return {std::string(bytes), complaint + "; it was read as UTF-8"};
  }
  return {latin1_as_utf8(bytes), complaint + "; it was read as ISO 8859-1"};
}

}  // namespace kiroku::recorder
