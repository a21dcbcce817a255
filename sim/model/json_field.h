// Taking a JSON document apart so that every refusal names the file and the path of the value. Not
// thread-safe.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// A value and where it stands: "cannot use liver.json: materials[0].poisson_ratio is a text where a number
/// is expected". The document must outlive its fields.
class JsonField {
 public:
  /// Parses; kiroku::Error with line and column for what is no JSON, and for a key that stands twice in an
  /// object.
  static nlohmann::json parse(std::string_view text, const std::string& file);
  JsonField(const nlohmann::json& document, std::string file);

  /// Whose only keys are these; others are refused, so that a slip of the pen does not go unnoticed.
  void expect_object(std::initializer_list<std::string_view> keys) const;
  [[nodiscard]] bool has(const char* key) const { return value_->contains(key); }
  [[nodiscard]] JsonField member(const char* key) const;  // refused if absent
  [[nodiscard]] std::optional<JsonField> optional_member(const char* key) const;
  [[nodiscard]] std::vector<JsonField> elements() const;                   // of an array
  [[nodiscard]] std::vector<JsonField> elements(std::size_t count) const;  // of an array of so many

  /// Of an object, by its keys in alphabetical order.
  [[nodiscard]] std::vector<std::pair<std::string, JsonField>> members() const;

  [[nodiscard]] double number() const;  // finite
  [[nodiscard]] std::optional<double> number_or_null() const;
  [[nodiscard]] std::int64_t integer() const;
  [[nodiscard]] bool boolean() const;
  [[nodiscard]] std::string text() const;
  [[nodiscard]] bool is_text() const { return value_->is_string(); }
  [[nodiscard]] bool is_object() const { return value_->is_object(); }
  [[nodiscard]] bool is_array() const { return value_->is_array(); }
  [[nodiscard]] Vector3 vector() const;  // of three numbers

  [[nodiscard]] const std::string& path() const { return path_; }
  /// The file or folder that the text names, from `folder` on; refused if nothing is there.
  [[nodiscard]] std::filesystem::path existing_path(const std::filesystem::path& folder) const;
  /// "cannot use FILE: PATH WHAT".
  [[noreturn]] void fail(const std::string& what) const;

 private:
  JsonField(const nlohmann::json& value, std::string file, std::string path);
  [[noreturn]] void fail_type(const char* expected) const;

  const nlohmann::json* value_;
  std::string file_, path_;
};

}  // namespace kiroku::sim
