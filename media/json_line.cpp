#include "media/json_line.h"

#include "crypto/utf8.h"

namespace kiroku::media {

void append_text(std::string& line, std::string_view text) {
  constexpr std::string_view kHexDigits = "0123456789abcdef";
  line += '"';
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      line += '\\';
      line += c;
    } else if (code < 0x20) {
      line += "\\u00";
      line += kHexDigits[code >> 4U];
      line += kHexDigits[code & 0xFU];
    } else {
      line += c;
    }
  }
  line += '"';
}

bool LineCursor::fail(std::string_view what) {
  if (problem_.empty()) {
    problem_ = std::string(what) + " at column " + std::to_string(position_ + 1);
  }
  return false;
}

bool LineCursor::skip(std::string_view expected) {
  if (!problem_.empty() || !line_.substr(position_).starts_with(expected)) {
    return false;
  }
  position_ += expected.size();
  return true;
}

bool LineCursor::expect(std::string_view expected) {
  return skip(expected) || fail("expected " + std::string(expected));
}

bool LineCursor::text(std::string& into) {
  if (!expect("\"")) {
    return false;
  }
  const std::size_t begin = position_;
  into.clear();
  while (position_ < line_.size() && line_[position_] != '"') {
    char c = line_[position_];
    std::size_t length = 1;
    if (static_cast<unsigned char>(c) < 0x20) {
      return fail("a control character is not escaped");
    }
    if (c == '\\' && !escape(c, length)) {
      return false;
    }
    into += c;
    position_ += length;
  }
  if (!crypto::is_utf8(line_.substr(begin, position_ - begin))) {
    return fail("a text is not UTF-8");
  }
  return expect("\"");
}

bool LineCursor::utc(UtcTime& into, std::string_view name) {
  std::string words;
  if (!text(words)) {
    return false;
  }
  const auto time = parse_utc(words);
  if (!time || format_utc(*time) != words) {
    return fail(std::string(name) + " is not RFC 3339 UTC with six decimals");
  }
  into = *time;
  return true;
}

bool LineCursor::end_of_object() {
  return expect("}") && (at_end() || fail("there is more after the object"));
}

bool LineCursor::escape(char& c, std::size_t& length) {
  const std::string_view rest = line_.substr(position_);
  if (rest.starts_with("\\\"") || rest.starts_with("\\\\")) {
    c = rest[1];
    length = 2;
    return true;
  }
  unsigned code = 0;
  if (rest.starts_with("\\u00") && rest.size() >= 6) {
    const auto [end, error] = std::from_chars(rest.data() + 4, rest.data() + 6, code, 16);
    c = static_cast<char>(code);
    std::string canonical;
    append_text(canonical, std::string_view(&c, 1));
    if (error == std::errc() && end == rest.data() + 6 && code < 0x20 &&
        canonical.substr(1, 6) == rest.substr(0, 6)) {
      length = 6;
      return true;
    }
  }
  return fail("a character is escaped that need not be");
}

}  // namespace kiroku::media
