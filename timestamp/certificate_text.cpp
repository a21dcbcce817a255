#include "timestamp/certificate_text.h"

#include <array>
#include <optional>
#include <string>

#include "crypto/encoding.h"
#include "timestamp/asn1_objects.h"

namespace kiroku::timestamp {
namespace {

using RevocationList = std::unique_ptr<X509_CRL, OpenSslDeleter<X509_CRL_free>>;

struct Kind {
  std::string_view begin, end;
  bool (*is)(ByteView der);
};
constexpr std::array kKinds{
    Kind{"-----BEGIN CERTIFICATE-----", "-----END CERTIFICATE-----",
         [](ByteView der) { return decode_with<Certificate, d2i_X509>(der) != nullptr; }},
    Kind{"-----BEGIN X509 CRL-----", "-----END X509 CRL-----",
         [](ByteView der) { return decode_with<RevocationList, d2i_X509_CRL>(der) != nullptr; }}};

/// The line at the front without its LF, which is cut off, too; nothing where no LF ends it.
std::optional<std::string_view> take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos) return std::nullopt;
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end + 1);
  return line;
}

const Kind* kind_that_begins(const std::optional<std::string_view>& line) {
  for (const Kind& kind : kKinds) {
    if (line == kind.begin) return &kind;
  }
  return nullptr;
}

bool take_block(std::string_view& text) {
  const Kind* kind = kind_that_begins(take_line(text));
  if (kind == nullptr) return false;
  std::string base64;
  for (;;) {
    const std::optional<std::string_view> line = take_line(text);
    if (!line || line->empty()) return false;
    if (*line == kind->end) break;
    base64 += *line;
  }
  const auto der = crypto::from_base64(base64, crypto::Base64Padding::kPadded);
  return der && kind->is(*der);
}

}  // namespace

bool is_certificate_text(std::string_view pem) {
  if (pem.empty()) return false;
  while (!pem.empty()) {
    if (!take_block(pem)) return false;
  }
  return true;
}

}  // namespace kiroku::timestamp
