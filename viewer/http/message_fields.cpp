#include "viewer/http/message_fields.h"

#include <nlohmann/json.hpp>

#include "viewer/http/request.h"

namespace kiroku::viewer {

using nlohmann::json;

const json& message_field(const json& object, const char* key) {
  if (!object.is_object()) throw Refusal(400, std::string("'") + key + "' must stand in an object");
  const auto found = object.find(key);
  if (found == object.end()) throw Refusal(400, std::string("'") + key + "' is missing");
  return *found;
}

std::string message_text(const json& object, const char* key) {
  const json& value = message_field(object, key);
  if (!value.is_string()) throw Refusal(400, std::string("'") + key + "' must be a text");
  return value.get<std::string>();
}

double message_number(const json& object, const char* key, double least, double most) {
  const json& value = message_field(object, key);
  if (!value.is_number() || !(value.get<double>() >= least && value.get<double>() <= most)) {
    throw Refusal(400, std::string("'") + key + "' must be a number from " + json(least).dump() + " to " +
                           json(most).dump());
  }
  return value.get<double>();
}

std::uint64_t message_count(const json& object, const char* key) {
  const json& value = message_field(object, key);
  if (!value.is_number_unsigned())
    throw Refusal(400, std::string("'") + key + "' must be a whole number from 0 on");
  return value.get<std::uint64_t>();
}

bool message_flag(const json& object, const char* key) {
  const json& value = message_field(object, key);
  if (!value.is_boolean()) throw Refusal(400, std::string("'") + key + "' must be true or false");
  return value.get<bool>();
}

}  // namespace kiroku::viewer
