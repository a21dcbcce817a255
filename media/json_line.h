// One JSON object a line: what the lines of a vitals segment are written and read with. Written in one form,
// read in every form that RFC 8259 allows. Not for JSON that nests.
#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

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

/// The members of a line's one object, in whatever order and with whatever blanks they were written. Values
/// are texts, numbers, true, false, null, and lists of numbers and null. A key that stands twice is refused.
/// Each accessor takes its member; after the first failure every call fails, and problem() stays. `line` must
/// outlive the object, which belongs to one thread.
class LineFields {
 public:
  explicit LineFields(std::string_view line);

  /// What was wrong and at which column, "" if nothing was.
  [[nodiscard]] const std::string& problem() const { return problem_; }
  [[nodiscard]] bool has(std::string_view key) const;

  /// UTF-8, its escapes decoded.
  bool text(std::string_view key, std::string& into);
  /// A text that is RFC 3339 UTC with six decimals.
  bool utc(std::string_view key, UtcTime& into);
  /// A number, whole for an integer type, that the type holds.
  template <typename Number>
  bool number(std::string_view key, Number& into) {
    const Member* const member = take(key);
    return member != nullptr && read_number(key, member->value, into);
  }
  /// Nothing for null.
  bool number_or_null(std::string_view key, std::optional<double>& into);
  /// A list of at least one; NaN for null.
  bool numbers(std::string_view key, std::vector<double>& into);
  /// Every member that nobody took is unknown, which is a problem.
  bool no_more();
  /// States a problem of the caller's own about a member: "<key> <what> at column <n>".
  bool refuse(std::string_view key, std::string_view what);

 private:
  struct Member {
    std::string_view key;  // as it stands in the line, without quotes
    std::string_view value;
    bool taken = false;
  };
  static constexpr std::size_t kMostMembers = 16;  // more than any line has

  bool fail(std::size_t position, std::string_view what);
  void read();
  bool read_member();
  [[nodiscard]] std::size_t after_blanks(std::size_t position) const;
  [[nodiscard]] std::size_t after_text(std::size_t position) const;
  [[nodiscard]] std::size_t after_value(std::size_t position) const;
  /// Of a member; count_ where there is none.
  [[nodiscard]] std::size_t index_of(std::string_view key) const;
  const Member* take(std::string_view key);
  [[nodiscard]] std::size_t position_of(std::string_view part) const;
  bool decode(std::string_view quoted, std::string& into);
  bool check_number(std::string_view key, std::string_view written, bool whole);
  template <typename Number>
  bool read_number(std::string_view key, std::string_view written, Number& into) {
    if (!check_number(key, written, std::is_integral_v<Number>)) {
      return false;
    }
    const auto [end, error] = std::from_chars(written.data(), written.data() + written.size(), into);
    if (error != std::errc() || end != written.data() + written.size()) {
      return fail(position_of(written), std::string(key) + " is beyond what it may be");
    }
    return true;
  }

  std::string_view line_;
  std::size_t position_ = 0;  // up to which the line was read
  std::array<Member, kMostMembers> members_{};
  std::size_t count_ = 0;
  std::string problem_;
};

}  // namespace kiroku::media
