#include "crypto/approval_key.h"

#include <array>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include <openssl/obj_mac.h>
#include <openssl/objects.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include "base/error.h"
#include "crypto/pkcs8.h"
#include "crypto/signing_key.h"

namespace kiroku::crypto {
namespace {

[[noreturn]] void fail(const std::string& what) {
  throw Error("cannot " + what + ": OpenSSL reports " + last_openssl_error());
}

// OpenSSL asks for the passphrase here; `user` is the Secret, or null.
int give_passphrase(char* buffer, int size, int /*for_writing*/, void* user) {
  const auto* passphrase = static_cast<const Secret*>(user);
  if (passphrase == nullptr || size < 0 || passphrase->size() > static_cast<std::size_t>(size)) return -1;
  std::memcpy(buffer, passphrase->bytes().data(), passphrase->size());
  return static_cast<int>(passphrase->size());
}

}  // namespace

ApprovalKey::ApprovalKey(PrivateKey key) : key_(std::move(key)) {}

ApprovalKey ApprovalKey::generate() {
  PrivateKey key(EVP_PKEY_Q_keygen(nullptr, nullptr, "EC", "P-256"));
  if (!key) fail("generate an approval key");
  return ApprovalKey(std::move(key));
}

ApprovalKey ApprovalKey::from_pem(std::string_view pem, const Secret* passphrase) {
  constexpr const char* kWanted =
      "; give a file that 'kiroku boot new-key' made, or another P-256 private key as PKCS#8 PEM";
  if (pem.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error(std::string("the approval key has more than 2 GiB") + kWanted);
  const BufferIo io(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  if (!io) fail("read an approval key");
  PrivateKey key(
      PEM_read_bio_PrivateKey(io.get(), nullptr, give_passphrase, const_cast<Secret*>(passphrase)));
  if (!key) {
    last_openssl_error();
    if (SigningKey::pem_is_encrypted(pem))
      throw Error("the passphrase does not open the approval key, or its file is damaged: check both");
    throw Error(std::string("the approval key is no private key") + kWanted);
  }
  std::array<char, 64> curve{};
  std::size_t size = 0;
  const bool has_curve = EVP_PKEY_is_a(key.get(), "EC") == 1 &&
                         EVP_PKEY_get_group_name(key.get(), curve.data(), curve.size(), &size) == 1;
  if (!has_curve || OBJ_txt2nid(curve.data()) != NID_X9_62_prime256v1) {
    last_openssl_error();
    throw Error(std::string("the approval key is not on the curve P-256, which TPMs verify") + kWanted);
  }
  return ApprovalKey(std::move(key));
}

Secret ApprovalKey::to_pem(const Secret* passphrase) const {
  const KeyInfo plain(EVP_PKEY2PKCS8(key_.get()));
  if (!plain) fail("write the approval key");
  return pkcs8_pem(*plain, passphrase);
}

P256PublicKey ApprovalKey::public_key() const {
  const int size = i2d_PUBKEY(key_.get(), nullptr);
  if (size <= 0) fail("read the public half of the approval key");
  Bytes der(static_cast<std::size_t>(size));
  unsigned char* at = openssl_bytes(std::span<std::byte>(der));
  i2d_PUBKEY(key_.get(), &at);
  if (!is_p256_public_key(der)) {
    throw Error(
        "the approval key's file keeps its point compressed, or states its curve by parameters: make a key "
        "with "
        "'kiroku boot new-key'");
  }
  return der;
}

Bytes ApprovalKey::sign(ByteView message) const {
  const DigestContext context(EVP_MD_CTX_new());
  std::size_t size = 0;
  if (!context || EVP_DigestSignInit(context.get(), nullptr, EVP_sha256(), nullptr, key_.get()) != 1 ||
      EVP_DigestSign(context.get(), nullptr, &size, openssl_bytes(message), message.size()) != 1)
    fail("sign an approval");
  Bytes signature(size);
  if (EVP_DigestSign(context.get(), openssl_bytes(std::span<std::byte>(signature)), &size,
                     openssl_bytes(message), message.size()) != 1)
    fail("sign an approval");
  signature.resize(size);
  return signature;
}

}  // namespace kiroku::crypto
