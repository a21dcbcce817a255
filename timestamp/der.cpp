#include "timestamp/der.h"

namespace kiroku::timestamp {
namespace {

constexpr int kDeepest = 32;

/// Length of the identifier and length octets, and of the contents; `content` is empty for the indefinite
/// form.
struct Header {
  std::size_t size = 0;
  std::optional<std::size_t> content;
};

std::uint8_t octet(ByteView bytes, std::size_t at) { return std::to_integer<std::uint8_t>(bytes[at]); }

std::optional<Header> read_header(ByteView bytes, Encoding encoding) {
  if (bytes.size() < 2 || (octet(bytes, 0) & 0x1f) == 0x1f) return {};
  const std::uint8_t first = octet(bytes, 1);
  if (first < 0x80) {
    if (first > bytes.size() - 2) return {};
    return Header{2, first};
  }
  const bool constructed = (octet(bytes, 0) & 0x20) != 0;
  if (first == 0x80) {
    if (encoding == Encoding::kDer || !constructed) return {};
    return Header{2, {}};
  }
  const std::size_t octets = first & 0x7f;
  if (octets > sizeof(std::uint32_t) || bytes.size() < 2 + octets) return {};
  std::size_t length = 0;
  for (std::size_t i = 0; i < octets; ++i) length = length << 8 | octet(bytes, 2 + i);
  if (encoding == Encoding::kDer && (octet(bytes, 2) == 0 || length < 0x80)) return {};
  if (length > bytes.size() - 2 - octets) return {};
  return Header{2 + octets, length};
}

std::optional<DerElement> read_element(ByteView bytes, Encoding encoding, int depth) {
  const auto header = read_header(bytes, encoding);
  if (!header || depth > kDeepest) return {};
  if (header->content) {
    return DerElement{octet(bytes, 0), bytes.subspan(header->size, *header->content),
                      bytes.first(header->size + *header->content)};
  }
  // Indefinite: values follow until the end-of-contents octets 00 00.
  std::size_t at = header->size;
  while (true) {
    if (bytes.size() - at < 2) return {};
    if (octet(bytes, at) == 0 && octet(bytes, at + 1) == 0) break;
    const auto inner = read_element(bytes.subspan(at), encoding, depth + 1);
    if (!inner) return {};
    at += inner->whole.size();
  }
  return DerElement{octet(bytes, 0), bytes.subspan(header->size, at - header->size), bytes.first(at + 2)};
}

}  // namespace

std::optional<DerElement> DerReader::next() {
  const auto element = read_element(rest_, encoding_, 0);
  if (element) rest_ = rest_.subspan(element->whole.size());
  return element;
}

std::optional<DerElement> DerReader::next(std::uint8_t identifier) {
  if (rest_.empty() || octet(rest_, 0) != identifier) return {};
  return next();
}

std::optional<DerElement> sole_element(ByteView bytes, std::uint8_t identifier) {
  DerReader reader(bytes);
  const auto element = reader.next(identifier);
  if (!element || !reader.at_end()) return {};
  return element;
}

Bytes der_value(std::uint8_t identifier, std::initializer_list<ByteView> contents) {
  std::size_t length = 0;
  for (const ByteView part : contents) length += part.size();
  Bytes out{std::byte{identifier}};
  if (length < 0x80) {
    out.push_back(std::byte(length));
  } else {
    int octets = 1;
    while (length >> (8 * octets) != 0) ++octets;
    out.push_back(std::byte(0x80 | octets));
    for (int i = octets - 1; i >= 0; --i) out.push_back(std::byte(length >> (8 * i) & 0xff));
  }
  for (const ByteView part : contents) append(out, part);
  return out;
}

}  // namespace kiroku::timestamp
