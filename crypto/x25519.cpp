#include "crypto/x25519.h"

#include <algorithm>

#include "base/error.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {
namespace {

PrivateKey private_key_of(ByteView bytes) {
  PrivateKey key(EVP_PKEY_new_raw_private_key(EVP_PKEY_X25519, nullptr, openssl_bytes(bytes), bytes.size()));
  if (!key) throw Error("cannot use an X25519 key: OpenSSL reports " + last_openssl_error());
  return key;
}

}  // namespace

X25519PublicKey x25519_public_key(ByteView private_key) {
  const PrivateKey key = private_key_of(private_key);
  X25519PublicKey result;
  std::size_t size = result.size();
  if (EVP_PKEY_get_raw_public_key(key.get(), openssl_bytes(std::span<std::byte>(result)), &size) != 1)
    throw Error("cannot derive an X25519 public key: OpenSSL reports " + last_openssl_error());
  return result;
}

std::optional<Secret> x25519(ByteView private_key, const X25519PublicKey& share) {
  const PrivateKey key = private_key_of(private_key);
  const PrivateKey peer(
      EVP_PKEY_new_raw_public_key(EVP_PKEY_X25519, nullptr, openssl_bytes(ByteView(share)), share.size()));
  const PrivateKeyContext context(EVP_PKEY_CTX_new(key.get(), nullptr));
  if (!peer || !context || EVP_PKEY_derive_init(context.get()) != 1 ||
      EVP_PKEY_derive_set_peer(context.get(), peer.get()) != 1)
    throw Error("cannot agree on an X25519 secret: OpenSSL reports " + last_openssl_error());
  Secret result(kX25519KeySize);
  std::size_t size = result.size();
  const bool derived = EVP_PKEY_derive(context.get(), openssl_bytes(result.bytes()), &size) == 1;
  // OpenSSL refuses the all-zero secret by itself; this does not depend on it.
  const Secret zeros(kX25519KeySize);
  if (!derived || equal_constant_time(result.bytes(), zeros.bytes())) {
    last_openssl_error();
    return std::nullopt;
  }
  return result;
}

}  // namespace kiroku::crypto
