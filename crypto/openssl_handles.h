// OpenSSL objects as unique_ptr. Every OpenSSL handle of the project is one of these.
#pragma once

#include <memory>
#include <string>

#include <openssl/evp.h>

namespace kiroku::crypto {

template <auto Free>
struct OpenSslDeleter {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};

using DigestContext = std::unique_ptr<EVP_MD_CTX, OpenSslDeleter<EVP_MD_CTX_free>>;
using CipherContext = std::unique_ptr<EVP_CIPHER_CTX, OpenSslDeleter<EVP_CIPHER_CTX_free>>;
using PrivateKey = std::unique_ptr<EVP_PKEY, OpenSslDeleter<EVP_PKEY_free>>;
using PrivateKeyContext = std::unique_ptr<EVP_PKEY_CTX, OpenSslDeleter<EVP_PKEY_CTX_free>>;

/// The newest message of OpenSSL's error queue, which is emptied; "unknown error" if there is none.
std::string last_openssl_error();

}  // namespace kiroku::crypto
