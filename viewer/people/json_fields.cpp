#include "viewer/people/json_fields.h"

#include <nlohmann/json.hpp>

#include "viewer/http/request.h"
#include "viewer/people/user_store.h"

namespace kiroku::viewer {
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

std::string user_key(const std::string& name) { return "user:" + (is_user_name(name) ? name : "") + "@"; }

}  // namespace kiroku::viewer
