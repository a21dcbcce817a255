#include "archive/format/age_layout.h"

#include <algorithm>
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

bool is_age_header(std::string_view text) {
  constexpr std::string_view kStanza = "-> ";
  constexpr std::string_view kMac = "--- ";
  constexpr std::size_t kMacDigits = 43;  // base64 of 32 bytes, without padding
  if (!text.starts_with(kAgeFirstLine) || !text.substr(kAgeFirstLine.size()).starts_with(kStanza)) {
    return false;
  }
  const std::size_t last = text.find("\n" + std::string(kMac));
  if (last == std::string_view::npos) {
    return false;
  }
  const std::string_view mac = text.substr(last + 1 + kMac.size());
  return mac.size() == kMacDigits + 1 && mac.ends_with('\n') &&
         std::ranges::all_of(mac.substr(0, kMacDigits), [](char digit) {
           return (digit >= 'A' && digit <= 'Z') || (digit >= 'a' && digit <= 'z') ||
                  (digit >= '0' && digit <= '9') || digit == '+' || digit == '/';
         });
}

AgeForm age_form(const crypto::ByteSource& file) {
  const std::optional<Bytes> header = age_header_text(file);
  if (!header || !is_age_header(text_of(*header)) || file.size() <= header->size() + kAgeNonceBytes) {
    return AgeForm::kNone;
  }
  const std::uint64_t payload = file.size() - header->size() - kAgeNonceBytes;
  const std::uint64_t last = payload % (kAgeChunkBytes + kAgeTagBytes);
  if (last == 0 || last > kAgeTagBytes) return AgeForm::kHolding;
  return payload == kAgeTagBytes ? AgeForm::kEmpty : AgeForm::kBegun;
}

}  // namespace kiroku::archive
