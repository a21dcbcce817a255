#include "viewer/http/request.h"

#include <charconv>

#include <nlohmann/json.hpp>

#include "base/foreign_json.h"
#include "crypto/secret.h"

namespace kiroku::viewer {

Request::~Request() { crypto::zeroise(std::as_writable_bytes(std::span(body))); }

std::string_view Request::header(std::string_view name) const {
  const auto found = headers.find(name);
  return found == headers.end() ? std::string_view() : std::string_view(found->second);
}

const std::string& Request::parameter(std::string_view name) const {
  const auto found = parameters.find(name);
  if (found == parameters.end()) throw std::out_of_range("the route has no parameter " + std::string(name));
  return found->second;
}

std::uint64_t Request::number(std::string_view name) const {
  const std::string& text = parameter(name);
  std::uint64_t value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

std::optional<std::string> Request::query_text(std::string_view name) const {
  std::optional<std::string> found;
  for (const auto& [field, value] : query) {
    if (field != name) continue;
    if (found) throw Refusal(400, "'" + std::string(name) + "' stands twice in the address");
    found = value;
  }
  return found;
}

std::vector<std::string> Request::query_texts(std::string_view name) const {
  std::vector<std::string> found;
  for (const auto& [field, value] : query) {
    if (field == name) found.push_back(value);
  }
  return found;
}

std::optional<std::int64_t> Request::query_integer(std::string_view name) const {
  const std::optional<std::string> text = query_text(name);
  if (!text) return {};
  std::int64_t value = 0;
  const auto [stop, failure] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (text->empty() || failure != std::errc() || stop != text->data() + text->size()) {
    throw Refusal(400, "'" + std::string(name) + "' must be a whole number");
  }
  return value;
}

nlohmann::json Request::json() const {
  nlohmann::json object = parse_foreign_json(body);
  if (!object.is_object()) throw Refusal(400, "the body must be one JSON object");
  return object;
}

}  // namespace kiroku::viewer
