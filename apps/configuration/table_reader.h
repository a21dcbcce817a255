// Reading a table of kiroku.toml so that a wrong key, type or value is refused with its line and column. Used
// by one thread, while the tree it reads lives.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include <toml++/toml.h>

#include "archive/format/case_layout.h"
#include "base/error.h"
#include "base/joined.h"

namespace kiroku::apps {

/// A name that stands in file names of a case (archive::is_short_name). Throws kiroku::UsageError.
inline void require_short_name(const std::string& name) {
  if (!archive::is_short_name(name)) {
    throw UsageError("'name' is '" + name +
                     "': it must be 1 to 32 of a-z, 0-9 and '-', and not begin with '-'");
  }
}

/// Reads the keys of one table and refuses those that nobody asked for.
class TableReader {
 public:
  TableReader(const toml::table& table, std::string name, std::string file)
      : table_(table), name_(std::move(name)), file_(std::move(file)) {}

  [[noreturn]] void refuse(const toml::source_region& where, const std::string& sentence) const {
    throw UsageError(file_ + ":" + std::to_string(where.begin.line) + ":" +
                     std::to_string(where.begin.column) + ": " + sentence);
  }

  /// Calls `take` with the text of `key`; an error it throws gets the place of the value.
  template <typename Take>
  void text(const std::string& key, const Take& take) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<std::string>();
    if (!value) refuse(node->source(), "'" + key + "' must be a text in quotation marks");
    try {
      take(*value);
    } catch (const UsageError& error) {
      refuse(node->source(), error.what());
    }
  }
  void flag(const std::string& key, bool& into) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<bool>();
    if (!value) refuse(node->source(), "'" + key + "' must be true or false");
    into = *value;
  }
  void integer(const std::string& key, std::int64_t least, std::int64_t most, std::int64_t& into) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<std::int64_t>();
    if (!value || *value < least || *value > most) {
      refuse(node->source(), "'" + key + "' must be a whole number from " + std::to_string(least) + " to " +
                                 std::to_string(most));
    }
    into = *value;
  }
  /// Calls `take` with the texts of a list.
  template <typename Take>
  void texts(const std::string& key, const Take& take) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    std::vector<std::string> values;
    const toml::array* list = node->as_array();
    if (list == nullptr) refuse(node->source(), "'" + key + "' must be a list of texts: [\"...\"]");
    for (const toml::node& entry : *list) {
      const auto value = entry.value_exact<std::string>();
      if (!value) refuse(entry.source(), "'" + key + "' must hold texts in quotation marks");
      values.push_back(*value);
    }
    try {
      take(values);
    } catch (const UsageError& error) {
      refuse(node->source(), error.what());
    }
  }
  /// The table under `key`, null if there is none.
  const toml::table* table(const std::string& key) {
    const toml::node* node = find(key);
    if (node == nullptr) return nullptr;
    if (!node->is_table()) refuse(node->source(), "'" + key + "' must be a table: [" + key + "]");
    return node->as_table();
  }
  [[nodiscard]] const std::string& file() const { return file_; }
  const toml::node* find(const std::string& key) {
    known_.push_back(key);
    return table_.get(key);
  }
  /// Call after everything known was asked for.
  void refuse_unknown_keys() const {
    for (const auto& [key, node] : table_) {
      if (std::find(known_.begin(), known_.end(), key.str()) != known_.end()) continue;
      refuse(key.source(),
             "unknown key '" + std::string(key.str()) + "' in " + name_ + "; known are " + joined(known_));
    }
  }

 private:
  const toml::table& table_;
  std::string name_;
  const std::string file_;
  std::vector<std::string> known_;
};

/// Calls `read(table, place)` for every [[key]] of `in`; refuses what is no list of tables.
template <typename Read>
void for_each_table(TableReader& in, const std::string& key, const Read& read) {
  const toml::node* node = in.find(key);
  if (node == nullptr) return;
  const std::string sentence = "write each '" + key + "' as a table of its own";
  const toml::array* entries = node->as_array();
  if (entries == nullptr) in.refuse(node->source(), sentence);
  for (const toml::node& entry : *entries) {
    if (!entry.is_table()) in.refuse(entry.source(), sentence);
    read(*entry.as_table());
  }
}

}  // namespace kiroku::apps
