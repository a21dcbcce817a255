#include "archive/format/line_reader.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

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
  bool has_zero = false;
  for (;;) {
    // Of a line that may still be one of the format the next bytes are read.
    const bool is_endless = line.bytes > kMaximumLineBytes && wasted_ + line.bytes > kMostBytesOfLine;
    gave_up_ = gave_up_ || is_endless;
    if (gave_up_ || (at_ == buffer_.size() && !fill())) {
      line.torn = true;
      line.text = line_;
      line.too_long = line.bytes > kMaximumLineBytes;
      return line.bytes > 0;
    }
    const std::string_view rest = std::string_view(buffer_).substr(at_);
    if (wasted_ > kMostBytesOfLine) {
      line.bytes = 1;
      gave_up_ = line.torn = line.too_long = true;
      return true;
    }
    const std::size_t end = rest.find('\n');
    const std::string_view piece = rest.substr(0, end);
    line.bytes += piece.size();
    has_zero = has_zero || piece.find('\0') != std::string_view::npos;
    if (line_.size() < kMaximumLineBytes) {
      line_ += piece.substr(0, kMaximumLineBytes - line_.size());
    }
    at_ += piece.size();
    if (end != std::string_view::npos) {
      ++at_;
      line.text = line_;
      line.too_long = line.bytes > kMaximumLineBytes;
      wasted_ += line.too_long || has_zero ? line.bytes : 0;
      return true;
    }
  }
}

std::optional<std::string> first_whole_line(const crypto::ByteSource& file) {
  std::string text;
  std::array<char, 4096> part{};
  while (text.size() <= kMaximumLineBytes) {
    const std::size_t count = file.read_at(text.size(), std::as_writable_bytes(std::span(part)));
    const std::string_view piece(part.data(), count);
    const std::size_t end = piece.find_first_of(std::string_view("\n\0", 2));
    text += piece.substr(0, end);
    if (end != std::string_view::npos) {
      const bool is_whole = piece[end] == '\n' && text.size() <= kMaximumLineBytes;
      return is_whole ? std::optional(std::move(text)) : std::nullopt;
    }
    if (count == 0) break;
  }
  return std::nullopt;
}

}  // namespace kiroku::archive
