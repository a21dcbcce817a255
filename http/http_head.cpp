#include "http/http_head.h"

#include <algorithm>
#include <cstddef>

#include "base/ascii.h"

namespace kiroku {
namespace {

/// More digits than these are no length of anything.
constexpr std::size_t kMostLengthDigits = 18;

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_blank(char c) { return c == ' ' || c == '\t'; }

/// RFC 9110 section 5.6.2: a token.
bool is_name_character(char c) {
  return (ascii_lower(c) >= 'a' && ascii_lower(c) <= 'z') || is_digit(c) ||
         std::string_view("!#$%&'*+-.^_`|~").find(c) != std::string_view::npos;
}

bool is_control(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return (byte < 0x20 && c != '\t') || byte == 0x7F;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// What one head says of where its body ends, and for whom it is.
struct Framing {
  std::size_t hosts = 0, lengths = 0, codings = 0;

  /// Why the field cannot stand, or "".
  std::string_view take(std::string_view name, std::string_view value) {
    if (same_but_for_case(name, "host")) {
      ++hosts;
      if (std::ranges::any_of(value, [](char c) { return is_blank(c) || c == ','; })) {
        return "the header Host names no host";
      }
    } else if (same_but_for_case(name, "content-length")) {
      ++lengths;
      if (value.empty() || value.size() > kMostLengthDigits || !std::ranges::all_of(value, is_digit)) {
        return "the header Content-Length is no number";
      }
    } else if (same_but_for_case(name, "transfer-encoding")) {
      ++codings;
      if (!same_but_for_case(value, "chunked")) return "the only Transfer-Encoding known here is chunked";
    }
    return "";
  }
  [[nodiscard]] std::string_view problem(bool is_version_1_1) const {
    if (hosts > 1) return "the header Host stands there twice";
    if (hosts == 0 && is_version_1_1) return "the header Host is missing";
    if (lengths > 1) return "the header Content-Length stands there twice";
    if (codings > 1) return "the header Transfer-Encoding stands there twice";
    if (lengths > 0 && codings > 0) return "Content-Length and Transfer-Encoding exclude each other";
    if (codings > 0 && !is_version_1_1) return "HTTP/1.0 knows no Transfer-Encoding";
    return "";
  }
};

}  // namespace

std::string_view http_head_problem(std::string_view head) {
  constexpr std::string_view kNoHttp = "this is not HTTP";
  if (!head.ends_with(kEndOfHttpHead)) return kNoHttp;
  head.remove_suffix(2);  // of the empty line
  Framing framing;
  bool is_request_line = true, is_version_1_1 = false;
  while (!head.empty()) {
    const std::size_t end = head.find("\r\n");
    if (end == std::string_view::npos) return kNoHttp;
    const std::string_view line = head.substr(0, end);
    head.remove_prefix(end + 2);
    if (line.empty() || std::ranges::any_of(line, is_control)) return kNoHttp;
    if (is_request_line) {
      is_request_line = false;
      is_version_1_1 = line.ends_with(" HTTP/1.1");
      continue;
    }
    if (is_blank(line.front())) return "a header is folded over several lines";
    const std::size_t colon = line.find(':');
    const std::string_view name = line.substr(0, colon);
    if (colon == std::string_view::npos || name.empty() || !std::ranges::all_of(name, is_name_character)) {
      return kNoHttp;
    }
    if (const std::string_view why = framing.take(name, trimmed(line.substr(colon + 1))); !why.empty()) {
      return why;
    }
  }
  return framing.problem(is_version_1_1);
}

}  // namespace kiroku
