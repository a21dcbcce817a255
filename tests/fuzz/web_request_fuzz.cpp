// What the viewer reads of a request by itself: the target and the fields that it parses. A target that is
// taken names nothing outside, and a range lies within its bytes.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "crypto/utf8.h"
#include "http/http_head.h"
#include "viewer/http/http_fields.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

bool is_safe(const std::string& segment) {
  return !segment.empty() && segment != "." && segment != ".." && crypto::is_utf8(segment) &&
         segment.find_first_of(std::string_view("/\\\0\r\n", 5)) == std::string::npos;
}

void check_range(std::string_view field, std::uint64_t size) {
  const viewer::RangeRequest asked = viewer::parse_range(field, size);
  if (asked.kind != viewer::RangeRequest::Kind::kPart) return;
  require(asked.range.first <= asked.range.last && asked.range.last < size && asked.range.size() <= size);
}

/// A head that is taken has one end, and no line that another program would join with the one before.
void check_head(std::string_view head) {
  if (!kiroku::http_head_problem(head).empty()) return;
  require(head.find(kiroku::kEndOfHttpHead) == head.size() - kiroku::kEndOfHttpHead.size());
  require(head.find("\r\n ") == std::string_view::npos && head.find("\r\n\t") == std::string_view::npos);
  require(std::ranges::count(head, '\r') == std::ranges::count(head, '\n'));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto target = viewer::parse_target(text)) {
    require(text.starts_with('/') && std::ranges::all_of(target->segments, is_safe));
  }
  if (const auto cookie = viewer::cookie_value(text, "__Host-kiroku")) {
    require(text.find("__Host-kiroku=" + *cookie) != std::string_view::npos);
  }
  check_head(text);
  for (const std::uint64_t bytes : {0ULL, 1ULL, 1000ULL, ~0ULL}) check_range(text, bytes);
  const bool accepted = viewer::accepts_encoding(text, "gzip");
  require(!accepted || !text.empty());
  const std::string_view language = viewer::preferred_language(text);
  require(language == "en" || language == "ja");
  require(!viewer::names_entity_tag(text, "\"tag\"") || !text.empty());
  return 0;
}
