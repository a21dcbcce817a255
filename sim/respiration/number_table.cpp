#include "sim/respiration/number_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "base/error.h"

namespace kiroku::sim {
namespace {

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r\xEF\xBB\xBF";
  const std::size_t first = text.find_first_not_of(kSpace);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kSpace) - first + 1);
}

std::vector<std::string> fields_of(std::string_view line) {
  std::vector<std::string> fields;
  for (std::size_t from = 0;;) {
    const std::size_t comma = line.find(',', from);
    fields.emplace_back(trimmed(line.substr(from, comma - from)));
    if (comma == std::string_view::npos) return fields;
    from = comma + 1;
  }
}

}  // namespace

std::optional<double> number_of(std::string_view text) {
  double number = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (failure != std::errc() || end != text.data() + text.size() || !std::isfinite(number))
    return std::nullopt;
  return number;
}

NumberTable NumberTable::parse(std::string_view text, const std::string& name) {
  NumberTable table;
  table.name_ = name;
  std::size_t number = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    ++number;
    if (line.empty() || line.front() == '#') continue;
    std::vector<std::string> fields = fields_of(line);
    if (table.columns_.empty()) {
      table.columns_ = std::move(fields);
      table.header_line_ = number;
      for (const std::string& column : table.columns_) {
        if (std::ranges::count(table.columns_, column) > 1)
          throw Error("cannot use " + name + ": two of its columns are called '" + column + "'");
      }
      continue;
    }
    table.rows_.push_back({number, std::move(fields)});
    if (table.rows_.back().fields.size() != table.columns_.size()) {
      table.fail(table.rows_.size() - 1, "has " + std::to_string(table.rows_.back().fields.size()) +
                                             " fields where the line of names has " +
                                             std::to_string(table.columns_.size()));
    }
  }
  if (table.columns_.empty())
    throw Error("cannot use " + name + ": it is empty; its first line must name its columns");
  return table;
}

bool NumberTable::nameless() const {
  return std::ranges::all_of(columns_, [](const std::string& name) { return number_of(name).has_value(); });
}

std::optional<std::size_t> NumberTable::column(std::string_view name) const {
  const auto found = std::ranges::find(columns_, name);
  if (found == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns_.begin());
}

std::size_t NumberTable::needed_column(std::string_view name) const {
  if (const auto found = column(name)) return *found;
  std::string names;
  for (const std::string& column : columns_) names += (names.empty() ? "'" : ", '") + column + "'";
  throw Error("cannot use " + name_ + ": it has no column '" + std::string(name) + "'; it has " + names);
}

double NumberTable::at(std::size_t row, std::size_t column) const {
  if (const auto number = number_of(word(row, column))) return *number;
  fail(row, "has '" + word(row, column) + "' as its " + columns_[column] + ", where a number is expected");
}

void NumberTable::fail(std::size_t row, const std::string& what) const {
  const std::size_t line = row < rows_.size() ? rows_[row].line : header_line_;
  throw Error("cannot use " + name_ + ", line " + std::to_string(line) + ": it " + what);
}

}  // namespace kiroku::sim
