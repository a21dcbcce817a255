#include "sim/mesh/mesh_cursor.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/error.h"

namespace kiroku::sim {
namespace {

bool is_space(char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

/// A word as an error may show it: short.
std::string shown(std::string_view word) {
  constexpr std::size_t kLongest = 24;
  if (word.empty()) return "missing: the file ends there";
  const std::string text(word.substr(0, kLongest));
  return "'" + text + (word.size() > kLongest ? "...'" : "'");
}

/// from_chars knows no plus sign.
std::string_view without_plus(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  return word;
}

template <typename Number>
bool parse(std::string_view word, Number& into) {
  word = without_plus(word);
  const auto [end, failure] = std::from_chars(word.data(), word.data() + word.size(), into);
  return failure == std::errc() && end == word.data() + word.size();
}

}  // namespace

MeshCursor::MeshCursor(std::string_view text, std::string name) : text_(text), name_(std::move(name)) {}

void MeshCursor::set_binary(bool binary, std::endian order) {
  binary_ = binary;
  ever_binary_ = ever_binary_ || binary;
  swapped_ = order != std::endian::native;
}

void MeshCursor::fail(const std::string& sentence) const {
  const std::string place =
      ever_binary_ ? "byte " + std::to_string(last_)
                   : "line " + std::to_string(1 + std::ranges::count(text_.substr(0, last_), '\n'));
  throw Error("cannot read " + name_ + ", " + place + ": " + sentence);
}

bool MeshCursor::more() {
  while (at_ < text_.size() && is_space(text_[at_])) ++at_;
  last_ = at_;
  return at_ < text_.size();
}

std::string_view MeshCursor::word() {
  more();
  while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
  return text_.substr(last_, at_ - last_);
}

std::string_view MeshCursor::line() {
  last_ = at_;
  const std::size_t end = std::min(text_.find('\n', at_), text_.size());
  std::string_view whole = text_.substr(at_, end - at_);
  at_ = std::min(end + 1, text_.size());
  while (!whole.empty() && is_space(whole.back())) whole.remove_suffix(1);
  while (!whole.empty() && is_space(whole.front())) whole.remove_prefix(1);
  return whole;
}

std::string_view MeshCursor::until(std::string_view end) {
  const std::size_t found = text_.find(end, at_);
  if (found == std::string_view::npos) fail("there is no " + std::string(end) + " after this");
  const std::string_view before = text_.substr(at_, found - at_);
  last_ = at_;
  at_ = found + end.size();
  return before;
}

std::string_view MeshCursor::expected_word(const char* what) {
  const std::string_view next = word();
  if (next.empty()) fail(std::string(what) + " is " + shown(next));
  return next;
}

std::int64_t MeshCursor::text_integer(const char* what) {
  const std::string_view next = expected_word(what);
  std::int64_t number = 0;
  if (!parse(next, number)) fail(std::string(what) + " is " + shown(next) + ", not a whole number");
  return number;
}

std::uint64_t MeshCursor::text_count(const char* what) {
  const std::string_view next = expected_word(what);
  std::uint64_t number = 0;
  if (!parse(next, number)) fail(std::string(what) + " is " + shown(next) + ", not a whole number from 0");
  return number;
}

double MeshCursor::text_real(const char* what) {
  const std::string_view next = expected_word(what);
  double number = 0;
  if (!parse(next, number) || !std::isfinite(number)) {
    fail(std::string(what) + " is " + shown(next) + ", not a finite number");
  }
  return number;
}

std::string_view MeshCursor::take(std::size_t bytes, const char* what) {
  last_ = at_;
  if (remaining() < bytes) fail(std::string(what) + " is cut off: the file ends before it does");
  at_ += bytes;
  return text_.substr(last_, bytes);
}

template <typename Number>
Number MeshCursor::binary_number(const char* what) {
  std::array<char, sizeof(Number)> bytes{};
  std::ranges::copy(take(sizeof(Number), what), bytes.begin());
  if (swapped_) std::ranges::reverse(bytes);
  return std::bit_cast<Number>(bytes);
}

std::int64_t MeshCursor::integer(std::size_t bytes, const char* what) {
  if (!binary_) return text_integer(what);
  return bytes == 4 ? binary_number<std::int32_t>(what) : binary_number<std::int64_t>(what);
}

std::uint64_t MeshCursor::count(std::size_t bytes, const char* what) {
  if (!binary_) return text_count(what);
  const std::int64_t number = integer(bytes, what);
  if (number < 0) fail(std::string(what) + " is " + std::to_string(number) + ", not a number from 0");
  return static_cast<std::uint64_t>(number);
}

double MeshCursor::real(std::size_t bytes, const char* what) {
  if (!binary_) return text_real(what);
  const double number = bytes == 4 ? binary_number<float>(what) : binary_number<double>(what);
  if (!std::isfinite(number)) fail(std::string(what) + " is not a finite number");
  return number;
}

}  // namespace kiroku::sim
