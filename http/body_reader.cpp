#include "http/body_reader.h"

#include <algorithm>
#include <cerrno>
#include <string_view>
#include <unistd.h>

#include "base/error.h"

namespace kiroku::http {
namespace {

/// What a client must take within the write limit.
constexpr std::size_t kWriteUnit = 256U << 10;

}  // namespace

std::optional<std::uint64_t> BodyReader::size() const {
  if (const auto* text = std::get_if<std::string>(&body_)) return text->size();
  if (const auto* bytes = std::get_if<BytesBody>(&body_)) return bytes->size;
  if (const auto* file = std::get_if<FileBody>(&body_)) return file->size;
  if (const auto* read = std::get_if<ReadBody>(&body_)) return read->size;
  return {};
}

bool BodyReader::may_block() const {
  return std::holds_alternative<FileBody>(body_) || std::holds_alternative<ReadBody>(body_) ||
         std::holds_alternative<StreamBody>(body_);
}

ByteView BodyReader::next() {
  if (const auto* stream = std::get_if<StreamBody>(&body_)) {
    buffer_.clear();
    while (buffer_.empty()) {
      if (!(*stream)(buffer_)) return {};
    }
    return buffer_;
  }
  const std::uint64_t left = *size() - done_;
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(left, kWriteUnit));
  ByteView out;
  if (const auto* text = std::get_if<std::string>(&body_)) {
    out = bytes_of(std::string_view(*text).substr(static_cast<std::size_t>(done_), count));
  } else if (const auto* bytes = std::get_if<BytesBody>(&body_)) {
    out = ByteView(*bytes->bytes).subspan(static_cast<std::size_t>(bytes->offset + done_), count);
  } else if (const auto* read = std::get_if<ReadBody>(&body_)) {
    buffer_.resize(count);
    read->read(read->offset + done_, buffer_);
    out = buffer_;
  } else {
    out = read_file(std::get<FileBody>(body_), count);
  }
  done_ += count;
  return out;
}

ByteView BodyReader::read_file(const FileBody& file, std::size_t count) {
  buffer_.resize(count);
  std::size_t got = 0;
  while (got < count) {
    const ssize_t read = ::pread(file.file->number(), buffer_.data() + got, count - got,
                                 static_cast<off_t>(file.offset + done_ + got));
    if (read < 0 && errno == EINTR) continue;
    if (read <= 0) throw Error("a file became shorter while it was sent");
    got += static_cast<std::size_t>(read);
  }
  return buffer_;
}

}  // namespace kiroku::http
