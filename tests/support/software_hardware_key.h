// A key on P-256 in this process where a device has one in hardware, which can fall silent.
#pragma once

#include <atomic>
#include <memory>

#include <openssl/evp.h>
#include <openssl/x509.h>

#include "crypto/hardware_key.h"
#include "crypto/openssl_handles.h"

namespace kiroku::test {

class SoftwareHardwareKey : public crypto::HardwareSigner {
 public:
  [[nodiscard]] const crypto::P256PublicKey& public_key() const override { return public_key_; }
  [[nodiscard]] Answer sign(ByteView message) const override {
    if (silent_) return {{}, "the test keeps it silent"};
    const crypto::DigestContext context(EVP_MD_CTX_new());
    std::size_t size = 128;
    Bytes signature(size);
    if (EVP_DigestSignInit(context.get(), nullptr, EVP_sha256(), nullptr, key_.get()) != 1 ||
        EVP_DigestSign(context.get(), crypto::openssl_bytes(std::span<std::byte>(signature)), &size,
                       crypto::openssl_bytes(message), message.size()) != 1)
      return {{}, crypto::last_openssl_error()};
    signature.resize(size);
    return {std::move(signature), ""};
  }
  void fall_silent(bool silent = true) { silent_ = silent; }

 private:
  crypto::PrivateKey key_{EVP_PKEY_Q_keygen(nullptr, nullptr, "EC", "P-256")};
  crypto::P256PublicKey public_key_ = [this] {
    Bytes der(static_cast<std::size_t>(i2d_PUBKEY(key_.get(), nullptr)));
    unsigned char* at = crypto::openssl_bytes(std::span<std::byte>(der));
    i2d_PUBKEY(key_.get(), &at);
    return der;
  }();
  std::atomic<bool> silent_ = false;
};

}  // namespace kiroku::test
