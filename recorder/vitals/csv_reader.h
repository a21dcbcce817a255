// Records of comma-separated values (RFC 4180), one at a time, in constant memory. An object belongs to one
// thread.
#pragma once

#include <cstdint>
#include <istream>
#include <string>
#include <vector>

namespace kiroku::recorder {

class CsvReader {
 public:
  static constexpr std::size_t kMaximumRecordBytes = 1U << 20;

  /// `input` must outlive the reader; `name` stands in errors. A UTF-8 byte order mark is passed over.
  CsvReader(std::istream& input, std::string name);

  /// Reads the next record into `fields`; false at the end. Empty lines are passed over. Throws kiroku::Error
  /// naming the line: a quote inside an unquoted field, text after a closing quote, a quote not closed, a
  /// NUL, a record longer than kMaximumRecordBytes, a read that fails.
  bool next(std::vector<std::string>& fields);
  /// Line on which the last record began, from 1.
  [[nodiscard]] std::uint64_t line() const { return record_line_; }

 private:
  [[noreturn]] void fail(const std::string& what) const;
  bool read_record(std::vector<std::string>& fields);
  int take();

  std::istream& input_;
  std::string name_;
  std::uint64_t line_ = 1, record_line_ = 0;
  std::size_t record_bytes_ = 0;
};

}  // namespace kiroku::recorder
