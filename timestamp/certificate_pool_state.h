// What a CertificatePool holds, for token_verifier.cpp.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "crypto/hash.h"
#include "timestamp/asn1_objects.h"
#include "timestamp/certificate_path.h"
#include "timestamp/certificate_pool.h"

namespace kiroku::timestamp {

struct CertificatePool::State {
  /// By the hash of their DER; nothing for what is no certificate.
  std::map<crypto::Sha256Digest, Certificate> certificates;
  /// Explanations, by signer and all that is enclosed with it: whatever the time, no path leads from there to
  /// a trusted root.
  std::map<crypto::Sha256Digest, std::string> without_path;
  /// Of the certificates here and those that are trusted. Apart, so that whoever holds the key of the
  /// recorder's own authority spends nothing of what outside ones need.
  VerifiedSignatures verified_own, verified_outside;
};

class CertificatePoolAccess {
 public:
  using State = CertificatePool::State;
  static State& state_of(CertificatePool& pool) { return *pool.state_; }
};

}  // namespace kiroku::timestamp
