#include "archive/format/age_layout.h"

#include <string>

namespace kiroku::archive {

std::optional<Bytes> age_header_text(const crypto::ByteSource& file) {
  Bytes front(kMaximumAgeHeaderBytes);
  front.resize(file.read_at(0, front));
  const std::string_view text = text_of(front);
  if (!text.starts_with(kAgeFirstLine)) {
    return std::nullopt;
  }
  const std::size_t mac = text.find("\n--- ");
  const std::size_t end = mac == std::string_view::npos ? mac : text.find('\n', mac + 1);
  if (end == std::string_view::npos) {
    return std::nullopt;
  }
  front.resize(end + 1);
  return front;
}

std::optional<std::uint64_t> age_header_bytes(const crypto::ByteSource& file) {
  const std::optional<Bytes> header = age_header_text(file);
  return header ? std::optional<std::uint64_t>(header->size()) : std::nullopt;
}

}  // namespace kiroku::archive
