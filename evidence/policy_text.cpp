#include "evidence/policy_text.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <utility>

#include "base/error.h"
#include "base/printable.h"

namespace kiroku::evidence {
namespace {

constexpr std::size_t kMostAlgorithms = 1'000;
constexpr std::size_t kMostKeys = 100;  // of one table, known or not
constexpr std::string_view kAlgorithm = "algorithm";
constexpr int kEarliestYear = 1970;

bool is_blank(char c) { return c == ' ' || c == '\t'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_of_bare_key(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || is_digit(c) || c == '_' || c == '-';
}

void append_utf8(std::string& to, std::uint32_t point) {
  const auto tail = [&](int shift) { to += static_cast<char>(0x80U | ((point >> shift) & 0x3FU)); };
  if (point < 0x80) {
    to += static_cast<char>(point);
  } else if (point < 0x800) {
    to += static_cast<char>(0xC0U | (point >> 6));
    tail(0);
  } else if (point < 0x10000) {
    to += static_cast<char>(0xE0U | (point >> 12));
    tail(6);
    tail(0);
  } else {
    to += static_cast<char>(0xF0U | (point >> 18));
    tail(12);
    tail(6);
    tail(0);
  }
}

/// 2040-12-31, of which all ten characters are given and all but the hyphens are digits.
std::optional<UtcTime> day_of(std::string_view text) {
  int year = 0;
  unsigned month = 0, day = 0;
  std::from_chars(text.data(), text.data() + 4, year);
  std::from_chars(text.data() + 5, text.data() + 7, month);
  std::from_chars(text.data() + 8, text.data() + 10, day);
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month),
                                         std::chrono::day(day)};
  if (!date.ok() || year < kEarliestYear) return {};
  return UtcTime(std::chrono::sys_days(date));
}
bool is_written_as_day(std::string_view text) {
  constexpr std::string_view kForm = "0000-00-00";
  if (text.size() != kForm.size()) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (kForm[i] == '0' ? !is_digit(text[i]) : text[i] != kForm[i]) return false;
  }
  return true;
}

/// One line.
class LineOfPolicy {
 public:
  LineOfPolicy(std::string_view line, std::size_t number, const std::string& file)
      : line_(line), number_(number), file_(file) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      const auto c = static_cast<unsigned char>(line[i]);
      if ((c >= 0x20 && c < 0x7F) || c == '\t') continue;
      at_ = i;
      refuse(
          "holds a control character, or one that is not ASCII; write it as \\u and four hexadecimal digits, "
          "in a text");
    }
  }

  [[nodiscard]] PolicyPlace place() const { return {number_, at_ + 1}; }
  [[noreturn]] void refuse(const std::string& sentence) const { refuse_policy(file_, place(), sentence); }

  void skip_blanks() {
    while (at_ < line_.size() && is_blank(line_[at_])) ++at_;
  }
  /// Whether nothing but a comment is left.
  bool is_over() {
    skip_blanks();
    return at_ == line_.size() || line_[at_] == '#';
  }
  bool take(std::string_view what) {
    if (!line_.substr(at_).starts_with(what)) return false;
    at_ += what.size();
    return true;
  }
  [[nodiscard]] bool is_at(std::string_view what) const { return line_.substr(at_).starts_with(what); }
  void require_over() {
    if (!is_over()) refuse("stands behind what the line says; write it on a line of its own, or behind a #");
  }

  std::string key() {
    skip_blanks();
    if (is_at("\"") || is_at("'")) return text();
    const std::size_t begin = at_;
    while (at_ < line_.size() && is_of_bare_key(line_[at_])) ++at_;
    if (at_ == begin) refuse("is no key; write a line as: key = value");
    return std::string(line_.substr(begin, at_ - begin));
  }

  std::variant<std::string, std::int64_t, PolicyDay> value() {
    skip_blanks();
    if (is_at("\"") || is_at("'")) return text();
    const std::size_t begin = at_;
    std::size_t end = at_;
    while (end < line_.size() && !is_blank(line_[end]) && line_[end] != '#') ++end;
    const std::string_view word = line_.substr(begin, end - begin);
    if (is_written_as_day(word)) {
      const std::optional<UtcTime> day = day_of(word);
      if (!day) refuse("'" + std::string(word) + "' is no day from 1970 on; write one as 2040-12-31");
      at_ = end;
      return PolicyDay{*day};
    }
    const std::optional<std::int64_t> number = whole_number(word);
    if (!number) {
      refuse(word.empty() ? "has no value; write a text in quotation marks, a whole number, or a day as "
                            "2040-12-31"
                          : "'" + printable(word) +
                                "' is no value of a policy; write a text in quotation marks, a whole number, "
                                "or a day as 2040-12-31");
    }
    at_ = end;
    return *number;
  }

 private:
  /// As TOML writes them to the base of ten: a sign or none, no leading zero, '_' between digits.
  static std::optional<std::int64_t> whole_number(std::string_view word) {
    std::string digits;
    if (word.starts_with('-')) digits += '-';
    if (word.starts_with('-') || word.starts_with('+')) word.remove_prefix(1);
    if (word.empty() || (word.size() > 1 && word.front() == '0')) return {};
    for (std::size_t i = 0; i < word.size(); ++i) {
      const bool is_between =
          word[i] == '_' && i > 0 && i + 1 < word.size() && is_digit(word[i - 1]) && is_digit(word[i + 1]);
      if (is_between) continue;
      if (!is_digit(word[i])) return {};
      digits += word[i];
    }
    std::int64_t number = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    return error == std::errc() && end == digits.data() + digits.size() ? std::optional(number)
                                                                        : std::nullopt;
  }

  std::string text() {
    const char mark = line_[at_];
    if (is_at("\"\"\"") || is_at("'''")) refuse("begins a text of several lines; write it on one");
    ++at_;
    std::string read;
    for (;;) {
      if (at_ == line_.size()) refuse("the text does not end on its line; close it with its quotation mark");
      const char c = line_[at_];
      if (c == mark) break;
      if (c == '\\' && mark == '"') {
        escape(read);
      } else {
        read += c;
        ++at_;
      }
    }
    ++at_;
    return read;
  }
  void escape(std::string& into) {
    constexpr std::string_view kLetters = "btnfr\"\\", kMeant = "\b\t\n\f\r\"\\";
    const char letter = at_ + 1 < line_.size() ? line_[at_ + 1] : '\0';
    if (const std::size_t known = kLetters.find(letter); letter != '\0' && known != std::string_view::npos) {
      into += kMeant[known];
      at_ += 2;
      return;
    }
    const std::size_t digits = letter == 'u' ? 4 : letter == 'U' ? 8 : 0;
    std::uint32_t point = 0;
    const std::string_view hex = line_.substr(std::min(at_ + 2, line_.size()), digits);
    const auto [end, error] = std::from_chars(hex.data(), hex.data() + hex.size(), point, 16);
    const bool is_surrogate = point >= 0xD800 && point <= 0xDFFF;
    if (digits == 0 || hex.size() != digits || error != std::errc() || end != hex.data() + digits ||
        point > 0x10FFFF || is_surrogate) {
      refuse("'\\' begins what TOML does not know; write a backslash as \\\\, or put the text in '…'");
    }
    append_utf8(into, point);
    at_ += 2 + digits;
  }

  const std::string_view line_;
  const std::size_t number_;
  const std::string& file_;
  std::size_t at_ = 0;
};

class PolicyReader {
 public:
  explicit PolicyReader(const std::string& file) : file_(file) {}

  PolicyText read(std::string_view text) {
    for (std::size_t begin = 0, number = 1; begin < text.size(); ++number) {
      const std::size_t end = std::min(text.find('\n', begin), text.size());
      std::string_view line = text.substr(begin, end - begin);
      if (line.ends_with('\r') && end < text.size()) line.remove_suffix(1);
      read_line(LineOfPolicy(line, number, file_));
      begin = end + 1;
    }
    return std::move(read_);
  }

 private:
  void read_line(LineOfPolicy line) {
    if (line.is_over()) return;
    if (line.is_at("[")) {
      begin_table(line);
    } else {
      read_value(line);
    }
  }

  void begin_table(LineOfPolicy& line) {
    const PolicyPlace place = line.place();
    const bool is_of_list = line.take("[[");
    if (!is_of_list) line.take("[");
    const std::string name = line.key();
    line.skip_blanks();
    if (!line.take(is_of_list ? "]]" : "]"))
      line.refuse("the bracket that begins the line is not closed; write [[algorithm]]");
    line.require_over();
    if (!is_of_list || name != kAlgorithm) {
      refuse_policy(file_, place,
                    "a policy has no table '" + printable(name) + "' in such brackets; write [[algorithm]]");
    }
    if (read_.algorithms.size() == kMostAlgorithms)
      refuse_policy(file_, place, "more than 1,000 algorithms are no policy; leave some out");
    read_.algorithms.push_back({place, {}});
  }

  void read_value(LineOfPolicy& line) {
    PolicyTable& table = read_.algorithms.empty() ? read_.top : read_.algorithms.back();
    PolicyValue value;
    value.key_place = line.place();
    value.key = line.key();
    if (const PolicyValue* before = table.find(value.key)) {
      refuse_policy(file_, value.key_place,
                    "'" + printable(value.key) + "' stands in line " +
                        std::to_string(before->key_place.line) + " already; leave one of them out");
    }
    if (table.values.size() == kMostKeys)
      refuse_policy(file_, value.key_place, "a table with more than 100 keys is none of a policy's");
    line.skip_blanks();
    if (!line.take("=")) line.refuse("no '=' stands behind the key; write a line as: key = value");
    line.skip_blanks();
    value.place = line.place();
    value.value = line.value();
    line.require_over();
    table.values.push_back(std::move(value));
  }

  const std::string& file_;
  PolicyText read_;
};

}  // namespace

const PolicyValue* PolicyTable::find(std::string_view key) const {
  const auto found = std::ranges::find(values, key, &PolicyValue::key);
  return found == values.end() ? nullptr : &*found;
}

void refuse_policy(const std::string& file, const PolicyPlace& place, const std::string& sentence) {
  throw UsageError(file + ":" + std::to_string(place.line) + ":" + std::to_string(place.column) + ": " +
                   sentence);
}

PolicyText read_policy_text(std::string_view text, const std::string& file) {
  return PolicyReader(file).read(text);
}

}  // namespace kiroku::evidence
