// A key on P-256 in a PKCS#11 token (OASIS PKCS #11 v2.40): a smart card, a hardware security module. The
// token is named by a URI (RFC 7512) that has module-path, and pin-source=file:... where the token asks for a
// PIN.
#pragma once

#include <memory>
#include <string>

#include "crypto/hardware_key.h"

namespace kiroku::recorder {

/// Not thread-safe. Connects when it is first asked, and again after an error. A PIN that the token refuses
/// is not tried again by this object, and no PIN where one try is left: a token locks itself for good.
class Pkcs11Key {
 public:
  /// `id` is the key's CKA_ID.
  Pkcs11Key(std::string uri, Bytes id);
  ~Pkcs11Key();
  Pkcs11Key(Pkcs11Key&&) noexcept;
  /// Has the token make a new key pair with this id, which it must not give away, and returns the public key.
  /// kiroku::Error, as all of these, saying what the token, or the way to it, answered; kiroku::UsageError
  /// for a URI that names no token.
  crypto::P256PublicKey generate();
  /// DER.
  Bytes sign(ByteView message);

 private:
  struct Connection;
  Connection& connection();
  std::string uri_;
  Bytes id_;
  std::unique_ptr<Connection> connection_;
  std::string refused_;  // why no PIN is tried any more
};

}  // namespace kiroku::recorder
