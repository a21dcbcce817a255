#include "archive/format/line_reader.h"

#include <algorithm>

#include "archive/format/ledger_entry.h"

namespace kiroku::archive {

namespace {

constexpr std::size_t kBufferBytes = 256U << 10U;

}  // namespace

std::string unreadable_text(std::uint64_t number) {
  return "more than " + std::to_string(kMostBrokenLines) + " lines are no entries of the format: from line " +
         std::to_string(number) + " on nothing was read";
}

bool LineReader::fill() {
  buffer_.resize(kBufferBytes);
  buffer_.resize(file_->read_at(read_, std::as_writable_bytes(std::span(buffer_.data(), buffer_.size()))));
  read_ += buffer_.size();
  at_ = 0;
  return !buffer_.empty();
}

bool LineReader::next(LedgerLine& line) {
  line = {};
  line.offset = read_ - (buffer_.size() - at_);
  line_.clear();
  for (;;) {
    gave_up_ = gave_up_ || line.bytes > kMostBytesOfLine;
    if (gave_up_ || (at_ == buffer_.size() && !fill())) {
      line.torn = true;
      line.text = line_;
      line.too_long = line.bytes > kMaximumLineBytes;
      return line.bytes > 0;
    }
    const std::string_view rest = std::string_view(buffer_).substr(at_);
    const std::size_t end = rest.find('\n');
    const std::string_view piece = rest.substr(0, end);
    line.bytes += piece.size();
    if (line_.size() < kMaximumLineBytes) {
      line_ += piece.substr(0, kMaximumLineBytes - line_.size());
    }
    at_ += piece.size();
    if (end != std::string_view::npos) {
      ++at_;
      line.text = line_;
      line.too_long = line.bytes > kMaximumLineBytes;
      return true;
    }
  }
}

}  // namespace kiroku::archive
