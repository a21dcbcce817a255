#include "recorder/vitals/csv_reader.h"

#include <utility>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

constexpr int kEnd = std::istream::traits_type::eof();

}  // namespace

CsvReader::CsvReader(std::istream& input, std::string name) : input_(input), name_(std::move(name)) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  for (const char expected : kByteOrderMark) {
    if (input_.peek() != static_cast<unsigned char>(expected)) {
      break;  // a mark that is cut short then stands in the first column's name, and is refused there
    }
    input_.get();
  }
  input_.clear(input_.rdstate() & ~std::ios::eofbit & ~std::ios::failbit);
}

void CsvReader::fail(const std::string& what) const {
  throw Error("cannot read " + name_ + ": line " + std::to_string(record_line_) + " " + what);
}

int CsvReader::take() {
  const int c = input_.get();
  if (input_.bad()) {
    fail("could not be read from the disk");
  }
  if (c == '\n') {
    ++line_;
  }
  if (c == '\0') {
    fail("contains a NUL byte; it is no table");
  }
  if (++record_bytes_ > kMaximumRecordBytes) {
    fail("is longer than 1 MiB; is a quote not closed?");
  }
  return c;
}

bool CsvReader::next(std::vector<std::string>& fields) {
  while (read_record(fields)) {
    if (fields.size() > 1 || !fields[0].empty()) {
      return true;
    }
  }
  return false;
}

bool CsvReader::read_record(std::vector<std::string>& fields) {
  fields.assign(1, "");
  record_line_ = line_;
  record_bytes_ = 0;
  if (input_.peek() == kEnd) {
    return false;
  }
  bool quoted = false, closed = false;  // the present field is inside quotes; its closing quote has been read
  for (;;) {
    int c = take();
    if (quoted) {
      if (c == kEnd) {
        fail("opens a quote that is never closed");
      }
      if (c != '"') {
        fields.back() += static_cast<char>(c);
      } else if (input_.peek() == '"') {
        fields.back() += static_cast<char>(take());
      } else {
        quoted = false;
        closed = true;
      }
      continue;
    }
    if (c == '\r' && (input_.peek() == '\n' || input_.peek() == kEnd)) {
      c = take();
    }
    if (c == '\n' || c == kEnd) {
      return true;
    }
    if (c == ',') {
      fields.emplace_back();
      closed = false;
    } else if (closed) {
      fail("has text after a closing quote");
    } else if (c == '"') {
      if (!fields.back().empty()) {
        fail("has a quote within a field that is not quoted");
      }
      quoted = true;
    } else {
      fields.back() += static_cast<char>(c);
    }
  }
}

}  // namespace kiroku::recorder
