#include "viewer/server/json_fields.h"

#include <nlohmann/json.hpp>

#include "viewer/server/request.h"

namespace kiroku::viewer {
namespace {

/// No user's name is as long; what is longer is one key.
constexpr std::size_t kLongestKey = 64;

}  // namespace

std::string take_text(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_string()) {
    throw Refusal(400, std::string("'") + key + "' is missing, or no text");
  }
  return found->get<std::string>();
}

crypto::Secret take_secret(nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || found->is_null()) return {};
  if (!found->is_string()) throw Refusal(400, std::string("'") + key + "' must be a text");
  auto& text = found->get_ref<std::string&>();
  crypto::Secret out = crypto::Secret::copy_of(text);
  crypto::zeroise(std::as_writable_bytes(std::span(text)));
  return out;
}

std::string user_key(const std::string& name) { return "user:" + name.substr(0, kLongestKey); }

}  // namespace kiroku::viewer
