// Signing keys with known private halves, so that tests can compare whole signatures.
#pragma once

#include <string>

#include "crypto/encoding.h"
#include "crypto/signing_key.h"

namespace kiroku::test {

/// The Ed25519 key of a 32-byte seed (RFC 8032), by way of its PKCS#8 form.
inline crypto::SigningKey key_from_seed(ByteView seed) {
  Bytes pkcs8 = *crypto::from_hex("302e020100300506032b657004220420");
  append(pkcs8, seed);
  const std::string pem = "-----BEGIN PRIVATE KEY-----\n" +
                          crypto::to_base64(pkcs8, crypto::Base64Padding::kPadded) +
                          "\n-----END PRIVATE KEY-----\n";
  return crypto::SigningKey::from_pem(pem, nullptr);
}

}  // namespace kiroku::test
