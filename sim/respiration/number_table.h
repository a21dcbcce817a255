// Tables of numbers with a line of column names: traces, positions on radiographs. Immutable, thread-safe.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kiroku::sim {

/// Fields are separated by commas; empty lines and lines that begin with # count for nothing; a quoted field
/// is not known. Every column may hold words; at() asks for a number.
class NumberTable {
 public:
  /// `name` stands in errors. kiroku::Error for a text without a line of names, a column named twice, and
  /// lines of another number of fields.
  static NumberTable parse(std::string_view text, const std::string& name);

  [[nodiscard]] std::size_t rows() const { return rows_.size(); }
  [[nodiscard]] std::size_t columns() const { return columns_.size(); }
  /// The names are all numbers: the line of names is missing.
  [[nodiscard]] bool nameless() const;
  [[nodiscard]] std::optional<std::size_t> column(std::string_view name) const;
  /// kiroku::Error with the names that are there.
  [[nodiscard]] std::size_t needed_column(std::string_view name) const;
  [[nodiscard]] const std::string& word(std::size_t row, std::size_t column) const {
    return rows_[row].fields[column];
  }
  /// Finite; kiroku::Error for a field that is no number.
  [[nodiscard]] double at(std::size_t row, std::size_t column) const;

  /// "cannot use NAME, line 7: it WHAT"; of a table without rows its first line.
  [[noreturn]] void fail(std::size_t row, const std::string& what) const;

 private:
  struct Row {
    std::size_t line = 0;
    std::vector<std::string> fields;
  };
  std::string name_;
  std::size_t header_line_ = 0;
  std::vector<std::string> columns_;
  std::vector<Row> rows_;
};

/// The number that a whole text is; nothing for any other text, and for what is not finite.
std::optional<double> number_of(std::string_view text);

}  // namespace kiroku::sim
