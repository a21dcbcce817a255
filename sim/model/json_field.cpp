#include "sim/model/json_field.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "base/error.h"

namespace kiroku::sim {

using nlohmann::json;

json JsonField::parse(std::string_view text, const std::string& file) {
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  const auto callback = [&](int /*depth*/, json::parse_event_t event, json& parsed) {
    if (event == json::parse_event_t::object_start) keys.emplace_back();
    if (event == json::parse_event_t::object_end) keys.pop_back();
    if (event == json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second) {
      throw Error("cannot read " + file + ": the key '" + parsed.get<std::string>() +
                  "' stands twice in one object");
    }
    return true;
  };
  try {
    return json::parse(text, callback);
  } catch (const json::exception& error) {
    // "[json.exception.parse_error.101] parse error at line 1, column 2: ..."
    const std::string sentence = error.what();
    const std::size_t end = sentence.find("] ");
    throw Error("cannot read " + file +
                ": it is no JSON: " + (end == std::string::npos ? sentence : sentence.substr(end + 2)));
  }
}

JsonField::JsonField(const json& document, std::string file) : JsonField(document, std::move(file), "") {}

JsonField::JsonField(const json& value, std::string file, std::string path)
    : value_(&value), file_(std::move(file)), path_(std::move(path)) {}

std::filesystem::path JsonField::existing_path(const std::filesystem::path& folder) const {
  const std::string name = text();
  std::filesystem::path path = folder / name;
  std::error_code failure;
  const bool there = !name.empty() && std::filesystem::exists(path, failure);
  if (failure) fail("is '" + name + "', which cannot be read: " + failure.message());
  if (!there) fail("is '" + name + "': there is no such file or folder beside the document");
  return path;
}

void JsonField::fail(const std::string& what) const {
  throw Error("cannot use " + file_ + ": " + (path_.empty() ? "the document" : path_) + " " + what);
}

void JsonField::fail_type(const char* expected) const {
  fail(std::string("is ") + (value_->is_null() ? "null" : std::string("of type ") + value_->type_name()) +
       " where " + expected + " is expected");
}

void JsonField::expect_object(std::initializer_list<std::string_view> keys) const {
  if (!value_->is_object()) fail_type("an object");
  std::string known;
  for (const std::string_view key : keys) {
    if (!known.empty()) known += ", ";
    known += key;
  }
  for (const auto& [key, value] : value_->items()) {
    if (std::ranges::find(keys, key) == keys.end())
      fail("has the unknown key '" + key + "'; known are " + known);
  }
}

JsonField JsonField::member(const char* key) const {
  const auto found = optional_member(key);
  if (!found) fail(std::string("lacks '") + key + "'");
  return *found;
}

std::optional<JsonField> JsonField::optional_member(const char* key) const {
  if (!value_->is_object()) fail_type("an object");
  const auto found = value_->find(key);
  if (found == value_->end()) return std::nullopt;
  return JsonField(*found, file_, path_.empty() ? key : path_ + "." + key);
}

std::vector<JsonField> JsonField::elements() const {
  if (!value_->is_array()) fail_type("an array");
  std::vector<JsonField> fields;
  fields.reserve(value_->size());
  for (std::size_t i = 0; i < value_->size(); ++i) {
    fields.push_back(JsonField((*value_)[i], file_, path_ + "[" + std::to_string(i) + "]"));
  }
  return fields;
}

std::vector<JsonField> JsonField::elements(std::size_t count) const {
  std::vector<JsonField> fields = elements();
  if (fields.size() != count) {
    fail("has " + std::to_string(fields.size()) + " elements, not " + std::to_string(count));
  }
  return fields;
}

std::vector<std::pair<std::string, JsonField>> JsonField::members() const {
  if (!value_->is_object()) fail_type("an object");
  std::vector<std::pair<std::string, JsonField>> fields;
  for (const auto& [key, value] : value_->items())
    fields.emplace_back(key, JsonField(value, file_, path_.empty() ? key : path_ + "." + key));
  return fields;
}

double JsonField::number() const {
  if (!value_->is_number()) fail_type("a number");
  const auto number = value_->get<double>();
  if (!std::isfinite(number)) fail("is not finite");
  return number;
}

std::optional<double> JsonField::number_or_null() const {
  if (value_->is_null()) return std::nullopt;
  return number();
}

std::int64_t JsonField::integer() const {
  const double real = number();
  if (real != std::floor(real) || std::abs(real) > 9e15) fail("is not a whole number");
  return static_cast<std::int64_t>(real);
}

bool JsonField::boolean() const {
  if (!value_->is_boolean()) fail_type("true or false");
  return value_->get<bool>();
}

std::string JsonField::text() const {
  if (!value_->is_string()) fail_type("a text");
  return value_->get<std::string>();
}

Vector3 JsonField::vector() const {
  const std::vector<JsonField> fields = elements(3);
  return {fields[0].number(), fields[1].number(), fields[2].number()};
}

}  // namespace kiroku::sim
