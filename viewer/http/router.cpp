#include "viewer/http/router.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <stdexcept>

#include "archive/format/case_layout.h"
#include "viewer/http/case_name.h"

namespace kiroku::viewer {
namespace {

constexpr std::size_t kLongestText = 128;

bool is_number(std::string_view text) {
  std::int64_t value = 0;
  const auto [stop, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  return !text.empty() && text[0] != '-' && (text[0] != '0' || text.size() == 1) && failure == std::errc() &&
         stop == text.data() + text.size();
}

using IsOfKind = bool (*)(std::string_view);
constexpr std::array<std::pair<std::string_view, IsOfKind>, 4> kKinds{
    {{"case", is_case_name},
     {"name", archive::is_short_name},
     {"number", is_number},
     {"text", [](std::string_view text) { return !text.empty() && text.size() <= kLongestText; }}}};

/// One segment of a pattern: "pieces", or "{piece:number}.mp4".
struct SegmentPattern {
  std::string before, parameter, after;
  IsOfKind is_of_kind = nullptr;  // null: only `before`

  /// The parameter's value, "" where there is none; nothing if the segment does not fit.
  [[nodiscard]] std::optional<std::string> match(std::string_view segment) const {
    if (is_of_kind == nullptr) return segment == before ? std::optional<std::string>("") : std::nullopt;
    if (segment.size() < before.size() + after.size() || !segment.starts_with(before) ||
        !segment.ends_with(after)) {
      return {};
    }
    const std::string_view value =
        segment.substr(before.size(), segment.size() - before.size() - after.size());
    return is_of_kind(value) ? std::optional<std::string>(value) : std::nullopt;
  }
};

SegmentPattern parse_segment(std::string_view text) {
  SegmentPattern out;
  const std::size_t open = text.find('{');
  if (open == std::string_view::npos) {
    out.before = text;
    return out;
  }
  const std::size_t colon = text.find(':', open);
  const std::size_t close = text.find('}', open);
  if (colon == std::string_view::npos || close == std::string_view::npos || colon > close) {
    throw std::invalid_argument("a parameter is written {name:kind}, not " + std::string(text));
  }
  const std::string_view kind = text.substr(colon + 1, close - colon - 1);
  const auto* const known = std::ranges::find(kKinds, kind, &std::pair<std::string_view, IsOfKind>::first);
  if (known == kKinds.end()) throw std::invalid_argument("no kind of parameter: " + std::string(kind));
  out.before = text.substr(0, open);
  out.parameter = text.substr(open + 1, colon - open - 1);
  out.after = text.substr(close + 1);
  out.is_of_kind = known->second;
  return out;
}

std::vector<SegmentPattern> parse_pattern(std::string_view pattern) {
  std::vector<SegmentPattern> out;
  while (!pattern.empty()) {
    const std::size_t end = std::min(pattern.find('/'), pattern.size());
    out.push_back(parse_segment(pattern.substr(0, end)));
    pattern.remove_prefix(std::min(end + 1, pattern.size()));
  }
  return out;
}

}  // namespace

struct Router::Entry {
  Route route;
  std::vector<SegmentPattern> segments;
};

Router::Router() = default;
Router::~Router() = default;

void Router::add(Route route) {
  if (route.socket && route.right == Right::kNone) {
    throw std::invalid_argument("the WebSocket " + route.pattern + " needs a right");
  }
  for (const auto& entry : entries_) {
    if (entry->route.method == route.method && entry->route.pattern == route.pattern) {
      throw std::invalid_argument(route.method + " " + route.pattern + " is there already");
    }
  }
  auto segments = parse_pattern(route.pattern);
  entries_.push_back(std::make_unique<Entry>(Entry{std::move(route), std::move(segments)}));
}

void Router::add(std::string method, std::string pattern, Right right, Handler handler) {
  Route route;
  route.method = std::move(method);
  route.pattern = std::move(pattern);
  route.right = right;
  route.handler = std::move(handler);
  add(std::move(route));
}

void Router::add_socket(std::string pattern, Right right, SocketOpener opener) {
  Route route;
  route.method = "GET";
  route.pattern = std::move(pattern);
  route.right = right;
  route.socket = std::move(opener);
  add(std::move(route));
}

Router::Match Router::match(std::string_view method, const std::vector<std::string>& segments) const {
  Match out;
  for (const auto& entry : entries_) {
    if (entry->segments.size() != segments.size()) continue;
    std::map<std::string, std::string, std::less<>> parameters;
    bool fits = true;
    for (std::size_t i = 0; fits && i < segments.size(); ++i) {
      std::optional<std::string> value = entry->segments[i].match(segments[i]);
      fits = value.has_value();
      if (fits && !entry->segments[i].parameter.empty()) {
        parameters[entry->segments[i].parameter] = std::move(*value);
      }
    }
    if (!fits) continue;
    if (entry->route.method == method) {
      out.route = &entry->route;
      out.parameters = std::move(parameters);
      return out;
    }
    out.allowed.push_back(entry->route.method);
  }
  return out;
}

std::vector<const Route*> Router::routes() const {
  std::vector<const Route*> out;
  for (const auto& entry : entries_) out.push_back(&entry->route);
  return out;
}

}  // namespace kiroku::viewer
