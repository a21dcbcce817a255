#include "crypto/signing_key.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include <openssl/pem.h>

#include "base/error.h"
#include "crypto/pkcs8.h"

namespace kiroku::crypto {
namespace {

[[noreturn]] void fail(const std::string& what) {
  throw Error("cannot " + what + ": OpenSSL reports " + last_openssl_error());
}

BufferIo reader_of(std::string_view text) {
  if (text.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error("cannot read a signing key of more than 2 GiB; give the PEM file of the key");
  BufferIo io(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  if (!io) fail("read a signing key");
  return io;
}

// OpenSSL asks for the passphrase here; `user` is the Secret, or null.
int give_passphrase(char* buffer, int size, int /*for_writing*/, void* user) {
  const auto* passphrase = static_cast<const Secret*>(user);
  if (passphrase == nullptr || size < 0 || passphrase->size() > static_cast<std::size_t>(size)) return -1;
  std::memcpy(buffer, passphrase->bytes().data(), passphrase->size());
  return static_cast<int>(passphrase->size());
}

}  // namespace

bool verify_ed25519(const Ed25519PublicKey& key, ByteView message, ByteView signature) {
  if (signature.size() != std::tuple_size_v<Ed25519Signature>) return false;
  const PrivateKey public_key(
      EVP_PKEY_new_raw_public_key(EVP_PKEY_ED25519, nullptr, openssl_bytes(ByteView(key)), key.size()));
  const DigestContext context(EVP_MD_CTX_new());
  if (!public_key || !context) fail("check a signature");
  const bool valid = EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, public_key.get()) == 1 &&
                     EVP_DigestVerify(context.get(), openssl_bytes(signature), signature.size(),
                                      openssl_bytes(message), message.size()) == 1;
  if (!valid)
    last_openssl_error();  // a refused signature is an answer, not an error for somebody else's queue
  return valid;
}

SigningKey::SigningKey(PrivateKey key) : key_(std::move(key)) {}

SigningKey SigningKey::generate() {
  PrivateKey key(EVP_PKEY_Q_keygen(nullptr, nullptr, "ED25519"));
  if (!key) fail("generate a signing key");
  return SigningKey(std::move(key));
}

bool SigningKey::pem_is_encrypted(std::string_view pem) {
  return pem.find("-----BEGIN ENCRYPTED PRIVATE KEY-----") != std::string_view::npos;
}

SigningKey SigningKey::from_pem(std::string_view pem, const Secret* passphrase) {
  const bool encrypted = pem_is_encrypted(pem);
  if (encrypted && passphrase == nullptr)
    throw Error(
        "the signing key is protected by a passphrase and none was given; give it, or use a plain key");
  const BufferIo io = reader_of(pem);
  PrivateKey key(
      PEM_read_bio_PrivateKey(io.get(), nullptr, give_passphrase, const_cast<Secret*>(passphrase)));
  if (!key) {
    last_openssl_error();
    if (encrypted)
      throw Error("the passphrase does not open the signing key, or the key file is damaged; check both");
    throw Error(
        "the signing key is no PKCS#8 PEM private key; give the file that begins "
        "\"-----BEGIN PRIVATE KEY-----\"");
  }
  if (EVP_PKEY_get_id(key.get()) != EVP_PKEY_ED25519)
    throw Error(std::string("the signing key is of type ") + OBJ_nid2sn(EVP_PKEY_get_base_id(key.get())) +
                ", but it must be Ed25519");
  return SigningKey(std::move(key));
}

Secret SigningKey::to_pem(const Secret* passphrase) const {
  const KeyInfo plain(EVP_PKEY2PKCS8(key_.get()));
  if (!plain) fail("write the signing key");
  return pkcs8_pem(*plain, passphrase);
}

SigningKey SigningKey::with_ml_dsa(MlDsaPrivateKey key) && {
  if (key.set() != MlDsaSet::k65)
    throw UsageError("a device signs by ML-DSA-65 beside Ed25519, by no other set");
  SigningKey both = std::move(*this);
  both.ml_dsa_.emplace(std::move(key));
  return both;
}

SigningKey SigningKey::with_hardware(std::shared_ptr<const HardwareSigner> signer) && {
  SigningKey both = std::move(*this);
  both.hardware_ = std::move(signer);
  return both;
}

Ed25519PublicKey SigningKey::public_key() const {
  Ed25519PublicKey result;
  std::size_t size = result.size();
  if (EVP_PKEY_get_raw_public_key(key_.get(), openssl_bytes(std::span<std::byte>(result)), &size) != 1)
    fail("read the public half of the signing key");
  return result;
}

Ed25519Signature SigningKey::sign(ByteView message) const {
  const DigestContext context(EVP_MD_CTX_new());
  Ed25519Signature result;
  std::size_t size = result.size();
  if (!context || EVP_DigestSignInit(context.get(), nullptr, nullptr, nullptr, key_.get()) != 1 ||
      EVP_DigestSign(context.get(), openssl_bytes(std::span<std::byte>(result)), &size,
                     openssl_bytes(message), message.size()) != 1)
    fail("sign");
  return result;
}

}  // namespace kiroku::crypto
