// OpenSSL objects as unique_ptr. Every OpenSSL handle of the project is one of these.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/kdf.h>

#include "base/bytes.h"

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
using FetchedDigest = std::unique_ptr<EVP_MD, OpenSslDeleter<EVP_MD_free>>;
using FetchedCipher = std::unique_ptr<EVP_CIPHER, OpenSslDeleter<EVP_CIPHER_free>>;
using FetchedKem = std::unique_ptr<EVP_KEM, OpenSslDeleter<EVP_KEM_free>>;
using FetchedKdf = std::unique_ptr<EVP_KDF, OpenSslDeleter<EVP_KDF_free>>;
using KdfContext = std::unique_ptr<EVP_KDF_CTX, OpenSslDeleter<EVP_KDF_CTX_free>>;
using BufferIo = std::unique_ptr<BIO, OpenSslDeleter<BIO_free_all>>;

/// The newest message of OpenSSL's error queue, which is emptied; "unknown error" if there is none.
std::string last_openssl_error();

/// Bytes as OpenSSL's functions take them; the same memory.
inline const unsigned char* openssl_bytes(ByteView bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}
inline unsigned char* openssl_bytes(std::span<std::byte> bytes) {
  return reinterpret_cast<unsigned char*>(bytes.data());
}

}  // namespace kiroku::crypto
