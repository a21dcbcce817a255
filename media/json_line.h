// One JSON object a line in the one form it can have: what the lines of a vitals segment are written and read
// with. Not for JSON from elsewhere.
#pragma once

#include <array>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>

#include "base/utc_time.h"

namespace kiroku::media {

/// The shortest decimal that reads back to the same number.
template <typename Number>
void append_number(std::string& line, Number number) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), number).ptr;
  line.append(text.data(), end);
}

/// In quotes; \", \\ and \u00xx for control characters, nothing else is escaped.
void append_text(std::string& line, std::string_view text);

/// Reads a line from its start; after the first failure every call fails, and problem() stays. `line` must
/// outlive it. An object belongs to one thread.
class LineCursor {
 public:
  explicit LineCursor(std::string_view line) : line_(line) {}

  /// What was wrong and at which column, "" if nothing was.
  [[nodiscard]] const std::string& problem() const { return problem_; }
  [[nodiscard]] bool at_end() const { return position_ == line_.size(); }

  bool fail(std::string_view what);
  /// Steps over `expected` if it comes next.
  bool skip(std::string_view expected);
  bool expect(std::string_view expected);
  /// A number in exactly the form append_number gives it.
  template <typename Number>
  bool number(Number& into) {
    if (!problem_.empty()) {
      return false;
    }
    const char* const begin = line_.data() + position_;
    const auto [end, error] = std::from_chars(begin, line_.data() + line_.size(), into);
    if (error != std::errc()) {
      return fail("expected a number");
    }
    std::string canonical;
    append_number(canonical, into);
    const auto length = static_cast<std::size_t>(end - begin);
    if (line_.substr(position_, length) != canonical) {
      return fail("a number is not in its shortest form");
    }
    position_ += length;
    return true;
  }
  /// A text in exactly the form append_text gives it; UTF-8.
  bool text(std::string& into);
  /// A text that is RFC 3339 UTC with six decimals.
  bool utc(UtcTime& into, std::string_view name);
  /// The object's end, which must be the line's.
  bool end_of_object();

 private:
  bool escape(char& c, std::size_t& length);

  std::string_view line_;
  std::size_t position_ = 0;
  std::string problem_;
};

}  // namespace kiroku::media
