#include "media/json_line.h"

#include <algorithm>
#include <limits>

#include "crypto/utf8.h"

namespace kiroku::media {
namespace {

constexpr std::string_view kBlanks = " \t\r";  // a line feed ends the line
constexpr std::string_view kDigits = "0123456789";

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Whether the text is a number as RFC 8259, section 6 has it.
bool is_number(std::string_view text) {
  const auto digits = [&text] {
    const std::size_t count = std::min(text.find_first_not_of(kDigits), text.size());
    text.remove_prefix(count);
    return count;
  };
  const auto next_is = [&text](std::string_view one_of) {
    const bool is = !text.empty() && one_of.find(text.front()) != std::string_view::npos;
    text.remove_prefix(is ? 1 : 0);
    return is;
  };
  next_is("-");
  const bool begins_with_zero = text.starts_with('0');
  const std::size_t whole = digits();
  bool holds = whole == 1 || (whole > 1 && !begins_with_zero);
  if (next_is(".")) {
    holds = digits() > 0 && holds;
  }
  if (next_is("eE")) {
    next_is("+-");
    holds = digits() > 0 && holds;
  }
  return holds && text.empty();
}

std::optional<unsigned> hex_of(std::string_view text) {
  unsigned code = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), code, 16);
  return text.size() == 4 && error == std::errc() && end == text.data() + 4 ? std::optional(code)
                                                                            : std::nullopt;
}

void append_character(std::string& into, unsigned code) {
  const auto add = [&into](unsigned byte) { into += static_cast<char>(byte); };
  if (code < 0x80) {
    add(code);
  } else if (code < 0x800) {
    add(0xC0U | code >> 6U);
    add(0x80U | (code & 0x3FU));
  } else if (code < 0x10000) {
    add(0xE0U | code >> 12U);
    add(0x80U | (code >> 6U & 0x3FU));
    add(0x80U | (code & 0x3FU));
  } else {
    add(0xF0U | code >> 18U);
    add(0x80U | (code >> 12U & 0x3FU));
    add(0x80U | (code >> 6U & 0x3FU));
    add(0x80U | (code & 0x3FU));
  }
}

/// The character of an escape `\u…` (two of them for one beyond U+FFFF), and how many bytes it takes.
std::optional<std::pair<unsigned, std::size_t>> escaped_code(std::string_view text) {
  const std::optional<unsigned> first = hex_of(text.substr(2, 4));
  constexpr std::size_t kOne = 6;
  if (!first || *first < 0xD800 || *first > 0xDFFF) {
    return first ? std::optional(std::pair(*first, kOne)) : std::nullopt;
  }
  const std::string_view rest = text.substr(std::min(kOne, text.size()));
  const std::optional<unsigned> second = rest.starts_with("\\u") ? hex_of(rest.substr(2, 4)) : std::nullopt;
  if (*first > 0xDBFF || !second || *second < 0xDC00 || *second > 0xDFFF) {
    return std::nullopt;
  }
  return std::pair(0x10000U + ((*first - 0xD800U) << 10U) + (*second - 0xDC00U), 2 * kOne);
}

}  // namespace

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

LineFields::LineFields(std::string_view line) : line_(line) { read(); }

bool LineFields::fail(std::size_t position, std::string_view what) {
  if (problem_.empty()) {
    problem_ = std::string(what) + " at column " + std::to_string(position + 1);
  }
  return false;
}

bool LineFields::refuse(std::string_view key, std::string_view what) {
  const std::size_t index = index_of(key);
  return fail(index == count_ ? line_.size() : position_of(members_[index].value),
              std::string(key) + " " + std::string(what));
}

std::size_t LineFields::position_of(std::string_view part) const {
  return static_cast<std::size_t>(part.data() - line_.data());
}

std::size_t LineFields::after_blanks(std::size_t position) const {
  return std::min(line_.find_first_not_of(kBlanks, position), line_.size());
}

/// Behind the closing quote of the text that begins at `position`; npos where there is none.
std::size_t LineFields::after_text(std::size_t position) const {
  for (std::size_t at = position + 1; at < line_.size(); ++at) {
    if (line_[at] == '"') {
      return at + 1;
    }
    if (line_[at] == '\\') {
      ++at;
    }
  }
  return std::string_view::npos;
}

/// Behind a value; what stands in it is looked at by whoever takes it. npos where it has no end.
std::size_t LineFields::after_value(std::size_t position) const {
  if (line_.substr(position).starts_with('"')) {
    return after_text(position);
  }
  if (line_.substr(position).starts_with('[')) {
    const std::size_t end = line_.find(']', position);
    return end == std::string_view::npos ? end : end + 1;
  }
  return std::min(line_.find_first_of(" \t\r,}", position), line_.size());
}

void LineFields::read() {
  position_ = after_blanks(0);
  if (!line_.substr(position_).starts_with('{')) {
    fail(position_, "expected {");
    return;
  }
  position_ = after_blanks(position_ + 1);
  if (line_.substr(position_).starts_with('}')) {
    ++position_;
  } else {
    bool more = true;
    while (more && read_member()) {
      more = line_.substr(position_).starts_with(',');
      position_ = more ? after_blanks(position_ + 1) : position_;
    }
    if (!problem_.empty()) {
      return;
    }
    if (!line_.substr(position_).starts_with('}')) {
      fail(position_, "expected , or }");
      return;
    }
    ++position_;
  }
  position_ = after_blanks(position_);
  if (position_ != line_.size()) {
    fail(position_, "there is more after the object");
  }
}

bool LineFields::read_member() {
  const std::size_t key_begin = position_;
  if (!line_.substr(position_).starts_with('"')) {
    return fail(position_, "expected a key");
  }
  const std::size_t key_end = after_text(position_);
  if (key_end == std::string_view::npos) {
    return fail(key_begin, "a key has no end");
  }
  const std::string_view key = line_.substr(key_begin + 1, key_end - key_begin - 2);
  if (key.find('\\') != std::string_view::npos) {
    return fail(key_begin, "a key is written with escapes");  // no key of any line needs one
  }
  position_ = after_blanks(key_end);
  if (!line_.substr(position_).starts_with(':')) {
    return fail(position_, "expected :");
  }
  position_ = after_blanks(position_ + 1);
  const std::size_t end = after_value(position_);
  if (end == std::string_view::npos || end == position_) {
    return fail(position_, "expected a value");
  }
  if (index_of(key) < count_) {
    return fail(key_begin, "a key stands twice");
  }
  if (count_ == kMostMembers) {
    return fail(key_begin, "there are more keys than any line has");
  }
  members_[count_++] = {key, line_.substr(position_, end - position_)};
  position_ = after_blanks(end);
  return true;
}

std::size_t LineFields::index_of(std::string_view key) const {
  std::size_t index = 0;
  while (index < count_ && members_[index].key != key) {
    ++index;
  }
  return index;
}

bool LineFields::has(std::string_view key) const { return problem_.empty() && index_of(key) < count_; }

const LineFields::Member* LineFields::take(std::string_view key) {
  if (!problem_.empty()) {
    return nullptr;
  }
  const std::size_t index = index_of(key);
  if (index == count_) {
    fail(line_.size(), std::string(key) + " is missing");
    return nullptr;
  }
  members_[index].taken = true;
  return &members_[index];
}

bool LineFields::decode(std::string_view quoted, std::string& into) {
  const std::string_view inner = quoted.substr(1, quoted.size() - 2);
  const auto is_plain = [](char c) { return c != '\\' && static_cast<unsigned char>(c) >= 0x20; };
  into.clear();
  for (std::size_t at = 0; at < inner.size();) {
    const auto* const begin = inner.begin() + at;
    const auto* const end = std::find_if_not(begin, inner.end(), is_plain);
    into.append(begin, end);
    at += static_cast<std::size_t>(end - begin);
    if (at == inner.size()) {
      break;
    }
    if (inner[at] != '\\') {
      return fail(position_of(inner) + at, "a control character is not escaped");
    }
    constexpr std::string_view kEscapes = "\"\\/bfnrt";
    constexpr std::string_view kMeant = "\"\\/\b\f\n\r\t";
    const char kind = at + 1 < inner.size() ? inner[at + 1] : '\0';
    if (const std::size_t known = kEscapes.find(kind); known != std::string_view::npos) {
      into += kMeant[known];
      at += 2;
    } else if (const auto code = kind == 'u' ? escaped_code(inner.substr(at)) : std::nullopt) {
      append_character(into, code->first);
      at += code->second;
    } else {
      return fail(position_of(inner) + at, "an escape is none of JSON");
    }
  }
  return crypto::is_utf8(inner) || fail(position_of(inner), "a text is not UTF-8");
}

bool LineFields::text(std::string_view key, std::string& into) {
  const Member* const member = take(key);
  if (member == nullptr) {
    return false;
  }
  return member->value.starts_with('"') ? decode(member->value, into) : refuse(key, "is no text");
}

bool LineFields::utc(std::string_view key, UtcTime& into) {
  std::string words;
  if (!text(key, words)) {
    return false;
  }
  const auto time = parse_utc(words);
  if (!time || format_utc(*time) != words) {
    return refuse(key, "is not RFC 3339 UTC with six decimals");
  }
  into = *time;
  return true;
}

bool LineFields::check_number(std::string_view key, std::string_view written, bool whole) {
  if (!is_number(written)) {
    return fail(position_of(written), std::string(key) + " is no number");
  }
  if (whole && !std::all_of(written.begin() + (written.front() == '-' ? 1 : 0), written.end(), is_digit)) {
    return fail(position_of(written), std::string(key) + " is no whole number");
  }
  return true;
}

bool LineFields::number_or_null(std::string_view key, std::optional<double>& into) {
  const Member* const member = take(key);
  if (member == nullptr) {
    return false;
  }
  into.reset();
  return member->value == "null" || read_number(key, member->value, into.emplace());
}

bool LineFields::numbers(std::string_view key, std::vector<double>& into) {
  const Member* const member = take(key);
  if (member == nullptr) {
    return false;
  }
  if (!member->value.starts_with('[')) {
    return refuse(key, "is no list");
  }
  std::string_view rest = member->value.substr(1, member->value.size() - 2);
  into.clear();
  for (bool more = true; more;) {
    const std::size_t comma = rest.find(',');
    std::string_view item = rest.substr(0, comma);
    item.remove_prefix(std::min(item.find_first_not_of(kBlanks), item.size()));
    item = item.substr(0, item.find_last_not_of(kBlanks) + 1);
    if (item == "null") {
      into.push_back(std::numeric_limits<double>::quiet_NaN());
    } else if (!read_number(key, item, into.emplace_back())) {
      return false;
    }
    more = comma != std::string_view::npos;
    rest.remove_prefix(more ? comma + 1 : rest.size());
  }
  return true;
}

bool LineFields::no_more() {
  if (!problem_.empty()) {
    return false;
  }
  const auto end = members_.begin() + static_cast<std::ptrdiff_t>(count_);
  const auto unknown = std::find_if(members_.begin(), end, [](const Member& each) { return !each.taken; });
  return unknown == end || fail(position_of(unknown->key) - 1, "a key is none of those that such a line has");
}

}  // namespace kiroku::media
