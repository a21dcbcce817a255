#include "crypto/openssl_handles.h"

#include <array>

#include <openssl/err.h>

namespace kiroku::crypto {

std::string last_openssl_error() {
  const unsigned long code = ERR_peek_last_error();
  ERR_clear_error();
  if (code == 0) return "unknown error";
  std::array<char, 256> text{};
  ERR_error_string_n(code, text.data(), text.size());
  return text.data();
}

}  // namespace kiroku::crypto
