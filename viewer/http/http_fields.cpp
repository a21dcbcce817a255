#include "viewer/http/http_fields.h"

#include <algorithm>
#include <charconv>

#include "base/ascii.h"
#include "crypto/utf8.h"

namespace kiroku::viewer {
namespace {

/// A target's segments are few; more are no address of ours.
constexpr std::size_t kMostSegments = 16;
constexpr std::size_t kMostQueryFields = 32;

int hex_digit(char character) {
  if (character >= '0' && character <= '9') return character - '0';
  if (character >= 'a' && character <= 'f') return character - 'a' + 10;
  if (character >= 'A' && character <= 'F') return character - 'A' + 10;
  return -1;
}

std::optional<std::string> percent_decoded(std::string_view text, bool plus_is_space) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%') {
      if (text.size() - i < 3) return {};
      const int high = hex_digit(text[i + 1]);
      const int low = hex_digit(text[i + 2]);
      if (high < 0 || low < 0) return {};
      out += static_cast<char>(high * 16 + low);
      i += 2;
    } else {
      out += plus_is_space && text[i] == '+' ? ' ' : text[i];
    }
  }
  // Databases and the operating system end a text at its first zero byte: they would be asked something else.
  if (!crypto::is_utf8(out) || out.find('\0') != std::string::npos) return {};
  return out;
}

bool is_control(char character) {
  const auto code = static_cast<unsigned char>(character);
  return code < 0x20 || code == 0x7f;
}

bool is_plain_segment(std::string_view segment) {
  return !segment.empty() && segment != "." && segment != ".." &&
         std::ranges::none_of(segment, [](char c) { return c == '/' || c == '\\' || is_control(c); });
}

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

/// Calls `visit` with each trimmed part between separators.
template <typename Visit>
void for_each_part(std::string_view text, char separator, const Visit& visit) {
  while (true) {
    const std::size_t end = text.find(separator);
    visit(trimmed(text.substr(0, end)));
    if (end == std::string_view::npos) return;
    text.remove_prefix(end + 1);
  }
}

std::optional<std::uint64_t> decimal(std::string_view text) {
  std::uint64_t value = 0;
  const auto [stop, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || failure != std::errc() || stop != text.data() + text.size()) return {};
  return value;
}

/// One member of a list with weights, "gzip;q=0.5": its name, and its weight in thousandths (RFC 9110
/// section 12.4.2); -1 where the weight is malformed.
std::pair<std::string_view, int> weighted(std::string_view member) {
  const std::size_t end = member.find(';');
  const std::string_view name = trimmed(member.substr(0, end));
  if (end == std::string_view::npos) return {name, 1000};
  const std::string_view weight = trimmed(member.substr(end + 1));
  if (weight.size() < 3 || weight.size() > 7 || (weight[0] != 'q' && weight[0] != 'Q') || weight[1] != '=') {
    return {name, -1};
  }
  const std::string_view number = weight.substr(2);
  if ((number[0] != '0' && number[0] != '1') || (number.size() > 1 && number[1] != '.')) return {name, -1};
  int thousandths = (number[0] - '0') * 1000;
  int place = 100;
  for (const char digit : number.substr(std::min<std::size_t>(2, number.size()))) {
    if (digit < '0' || digit > '9') return {name, -1};
    thousandths += (digit - '0') * place;
    place /= 10;
  }
  return {name, thousandths > 1000 ? -1 : thousandths};
}

}  // namespace

std::optional<Target> parse_target(std::string_view target) {
  if (target.empty() || target[0] != '/') return {};
  Target out;
  const std::size_t question = target.find('?');
  std::string_view path = target.substr(1, question == std::string_view::npos ? question : question - 1);
  while (!path.empty()) {
    const std::size_t end = path.find('/');
    std::optional<std::string> segment = percent_decoded(path.substr(0, end), false);
    if (!segment || !is_plain_segment(*segment) || out.segments.size() == kMostSegments) return {};
    out.segments.push_back(std::move(*segment));
    if (end == std::string_view::npos) break;
    path.remove_prefix(end + 1);
    if (path.empty()) return {};  // "/api/" is not "/api"
  }
  if (question == std::string_view::npos) return out;
  std::string_view query = target.substr(question + 1);
  while (!query.empty()) {
    const std::size_t end = query.find('&');
    const std::string_view field = query.substr(0, end);
    const std::size_t equals = field.find('=');
    std::optional<std::string> name = percent_decoded(field.substr(0, equals), true);
    std::optional<std::string> value =
        percent_decoded(equals == std::string_view::npos ? "" : field.substr(equals + 1), true);
    if (!name || !value || out.query.size() == kMostQueryFields) return {};
    if (!field.empty()) out.query.emplace_back(std::move(*name), std::move(*value));
    query.remove_prefix(end == std::string_view::npos ? query.size() : end + 1);
  }
  return out;
}

std::optional<std::string> cookie_value(std::string_view field, std::string_view name) {
  std::optional<std::string> found;
  bool twice = false;
  for_each_part(field, ';', [&](std::string_view pair) {
    const std::size_t equals = pair.find('=');
    if (equals == std::string_view::npos || pair.substr(0, equals) != name) return;
    twice = twice || found.has_value();
    found = std::string(pair.substr(equals + 1));
  });
  return twice ? std::nullopt : found;
}

RangeRequest parse_range(std::string_view field, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  const std::string_view set = trimmed(field);
  if (set.size() < kUnit.size() || !same_but_for_case(set.substr(0, kUnit.size()), kUnit)) return {};
  const std::string_view spec = trimmed(set.substr(kUnit.size()));
  const std::size_t dash = spec.find('-');
  if (dash == std::string_view::npos || spec.find(',') != std::string_view::npos) return {};
  const std::string_view from = spec.substr(0, dash);
  const std::string_view to = spec.substr(dash + 1);
  const auto first = decimal(from);
  const auto last = decimal(to);
  if (from.empty()) {
    if (!last) return {};
    if (*last == 0 || size == 0) return {RangeRequest::Kind::kUnsatisfiable, {}};
    return {RangeRequest::Kind::kPart, {size - std::min(*last, size), size - 1}};
  }
  if (!first || (!to.empty() && (!last || *last < *first))) return {};
  if (*first >= size) return {RangeRequest::Kind::kUnsatisfiable, {}};
  return {RangeRequest::Kind::kPart, {*first, last ? std::min(*last, size - 1) : size - 1}};
}

bool accepts_encoding(std::string_view field, std::string_view coding) {
  bool accepted = false;
  for_each_part(field, ',', [&](std::string_view member) {
    const auto [name, weight] = weighted(member);
    if (same_but_for_case(name, coding)) accepted = weight > 0;
  });
  return accepted;
}

std::string_view preferred_language(std::string_view field) {
  int english = -1;
  int japanese = -1;
  for_each_part(field, ',', [&](std::string_view member) {
    const auto [name, weight] = weighted(member);
    const std::string_view primary = name.substr(0, name.find('-'));
    if (same_but_for_case(primary, "en")) english = std::max(english, weight);
    if (same_but_for_case(primary, "ja")) japanese = std::max(japanese, weight);
  });
  return japanese > 0 && japanese > english ? "ja" : "en";
}

bool names_entity_tag(std::string_view field, std::string_view entity_tag) {
  bool named = trimmed(field) == "*";
  for_each_part(field, ',', [&](std::string_view member) {
    if (member.starts_with("W/")) member.remove_prefix(2);
    named = named || member == entity_tag;
  });
  return named;
}

}  // namespace kiroku::viewer
