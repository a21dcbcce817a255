#include "crypto/aead.h"

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "crypto/secret.h"

namespace kiroku::crypto {
namespace {

[[noreturn]] void fail(const char* what) {
  throw Error(std::string("cannot ") + what + " with ChaCha20-Poly1305: OpenSSL reports " +
              last_openssl_error());
}

void require(bool condition, const char* what) {
  if (!condition) throw UsageError(std::string("ChaCha20-Poly1305 was called with ") + what);
}

// Chunks are 64 KiB; OpenSSL counts in int.
int int_size(ByteView bytes) {
  require(bytes.size() <= static_cast<std::size_t>(std::numeric_limits<int>::max()),
          "more than 2 GiB at once");
  return static_cast<int>(bytes.size());
}

}  // namespace

ChaCha20Poly1305::ChaCha20Poly1305(ByteView key) {
  require(key.size() == kAeadKeySize, "a key that has not 32 bytes");
  std::ranges::copy(key, key_.begin());
}

ChaCha20Poly1305::~ChaCha20Poly1305() { zeroise(key_); }

CipherContext ChaCha20Poly1305::context(bool sealing) const {
  static const FetchedCipher cipher(EVP_CIPHER_fetch(nullptr, "ChaCha20-Poly1305", nullptr));
  CipherContext result(EVP_CIPHER_CTX_new());
  if (!cipher || !result ||
      EVP_CipherInit_ex2(result.get(), cipher.get(), openssl_bytes(ByteView(key_)), nullptr, sealing ? 1 : 0,
                         nullptr) != 1)
    fail("set a key up");
  return result;
}

void ChaCha20Poly1305::seal(ByteView nonce, ByteView plaintext, std::span<std::byte> sealed,
                            ByteView associated_data) {
  require(nonce.size() == kAeadNonceSize, "a nonce that has not 12 bytes");
  require(sealed.size() == plaintext.size() + kAeadTagSize, "room for another size of message");
  if (!seal_context_) seal_context_ = context(true);
  EVP_CIPHER_CTX* const cipher = seal_context_.get();
  int written = 0;
  if (EVP_EncryptInit_ex2(cipher, nullptr, nullptr, openssl_bytes(nonce), nullptr) != 1) fail("set a nonce");
  if (!associated_data.empty() && EVP_EncryptUpdate(cipher, nullptr, &written, openssl_bytes(associated_data),
                                                    int_size(associated_data)) != 1)
    fail("seal");
  if (!plaintext.empty() && EVP_EncryptUpdate(cipher, openssl_bytes(sealed), &written,
                                              openssl_bytes(plaintext), int_size(plaintext)) != 1)
    fail("seal");
  const auto tag = sealed.last(kAeadTagSize);
  if (EVP_EncryptFinal_ex(cipher, openssl_bytes(tag), &written) != 1 ||
      EVP_CIPHER_CTX_ctrl(cipher, EVP_CTRL_AEAD_GET_TAG, kAeadTagSize, tag.data()) != 1)
    fail("seal");
}

bool ChaCha20Poly1305::open(ByteView nonce, ByteView sealed, std::span<std::byte> plaintext,
                            ByteView associated_data) {
  require(nonce.size() == kAeadNonceSize, "a nonce that has not 12 bytes");
  if (sealed.size() < kAeadTagSize) return false;
  require(plaintext.size() == sealed.size() - kAeadTagSize, "room for another size of message");
  if (!open_context_) open_context_ = context(false);
  EVP_CIPHER_CTX* const cipher = open_context_.get();
  // A copy: OpenSSL takes the expected tag through a pointer that is not const.
  std::array<std::byte, kAeadTagSize> tag;
  std::ranges::copy(sealed.last(kAeadTagSize), tag.begin());
  const ByteView ciphertext = sealed.first(plaintext.size());
  int written = 0;
  if (EVP_DecryptInit_ex2(cipher, nullptr, nullptr, openssl_bytes(nonce), nullptr) != 1 ||
      EVP_CIPHER_CTX_ctrl(cipher, EVP_CTRL_AEAD_SET_TAG, kAeadTagSize, tag.data()) != 1)
    fail("set a nonce");
  if (!associated_data.empty() && EVP_DecryptUpdate(cipher, nullptr, &written, openssl_bytes(associated_data),
                                                    int_size(associated_data)) != 1)
    fail("open");
  if (!ciphertext.empty() && EVP_DecryptUpdate(cipher, openssl_bytes(plaintext), &written,
                                               openssl_bytes(ciphertext), int_size(ciphertext)) != 1)
    fail("open");
  if (EVP_DecryptFinal_ex(cipher, reinterpret_cast<unsigned char*>(tag.data()), &written) == 1) return true;
  // What came out is not authentic and must not be seen by anyone.
  zeroise(plaintext);
  last_openssl_error();
  return false;
}

}  // namespace kiroku::crypto
