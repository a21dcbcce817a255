#include "crypto/file_key_wrap.h"

#include "crypto/age_error.h"

namespace kiroku::crypto {
namespace {

constexpr std::array<std::byte, kAeadNonceSize> kZeroNonce{};

}  // namespace

Bytes wrap_file_key(const Secret& wrap_key, const Secret& file_key) {
  Bytes body(file_key.size() + kAeadTagSize);
  ChaCha20Poly1305(wrap_key.bytes()).seal(kZeroNonce, file_key.bytes(), body);
  return body;
}

std::optional<Secret> unwrap_file_key(const Secret& wrap_key, ByteView body) {
  Secret file_key(kFileKeySize);
  if (!ChaCha20Poly1305(wrap_key.bytes()).open(kZeroNonce, body, file_key.bytes())) return std::nullopt;
  return file_key;
}

void require_stanza(bool condition, const AgeStanza& stanza, const std::string& what) {
  if (!condition)
    throw AgeError(AgeFailure::kHeaderMalformed,
                   "the age header is malformed: its " + stanza.type + " stanza " + what);
}

}  // namespace kiroku::crypto
