// What a TrustStore holds, for token_verifier.cpp.
#pragma once

#include <vector>

#include "timestamp/asn1_objects.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {

/// Trusted certificates of one kind.
struct Anchors {
  CertificateStore store;  // the same certificates, as path validation wants them
  std::vector<Certificate> certificates;
};

struct TrustStore::State {
  Anchors outside, own;
  std::vector<Certificate> untrusted;
};

/// Opens TrustStore for the verifier, and for nobody else.
class TokenVerifierAccess {
 public:
  using State = TrustStore::State;
  static const State& state_of(const TrustStore& store) { return *store.state_; }
};

}  // namespace kiroku::timestamp
