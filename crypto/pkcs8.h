// PKCS#8 private keys (RFC 5958) as PEM, plain or encrypted, also of algorithms that the OpenSSL that runs
// does not know. Functions are pure and thread-safe.
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include <openssl/x509.h>

#include "crypto/ml_dsa.h"
#include "crypto/openssl_handles.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

using KeyInfo = std::unique_ptr<PKCS8_PRIV_KEY_INFO, OpenSslDeleter<PKCS8_PRIV_KEY_INFO_free>>;

/// Encrypted (PBES2, AES-256-CBC, PBKDF2) when a passphrase is given. kiroku::UsageError for one that is too
/// long, kiroku::Error if OpenSSL fails.
Secret pkcs8_pem(const PKCS8_PRIV_KEY_INFO& key, const Secret* passphrase);

/// The key as its seed alone (RFC 9881).
Secret ml_dsa_pem(const MlDsaPrivateKey& key, const Secret* passphrase);
/// Nothing where the PEM is of another algorithm or none, or the passphrase does not open it. kiroku::Error
/// if it is a key of this set that is not kept as its seed alone.
std::optional<MlDsaPrivateKey> ml_dsa_of_pem(MlDsaSet set, std::string_view pem, const Secret* passphrase);

}  // namespace kiroku::crypto
