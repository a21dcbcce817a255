#include "archive/age_layout.h"

#include <string>

namespace kiroku::archive {

std::optional<std::uint64_t> age_header_bytes(const crypto::ByteSource& file) {
  std::string text(kMaximumAgeHeaderBytes, '\0');
  text.resize(file.read_at(0, std::as_writable_bytes(std::span(text.data(), text.size()))));
  if (!text.starts_with(kAgeFirstLine)) {
    return std::nullopt;
  }
  const std::size_t mac = text.find("\n--- ");
  const std::size_t end = mac == std::string::npos ? mac : text.find('\n', mac + 1);
  if (end == std::string::npos) {
    return std::nullopt;
  }
  return end + 1;
}

}  // namespace kiroku::archive
