// What many tokens of one case have in common: the certificates that they enclose, each decoded once, and
// from which signers no path leads to a trusted root. OpenSSL looks for a decoder of the key of each
// certificate that it reads, which takes longer than all else of a token that is not verified. Not
// thread-safe.
#pragma once

#include <cstddef>
#include <memory>

namespace kiroku::timestamp {

/// For tokens that are judged one after the other under one TrustStore.
class CertificatePool {
 public:
  /// Different certificates that are decoded. Authorities enclose one to five and change them once in months,
  /// so that no recording has as many; a token that encloses one more is not judged (kTooDear).
  static constexpr std::size_t kMostCertificates = 256;

  CertificatePool();
  ~CertificatePool();
  CertificatePool(const CertificatePool&) = delete;
  CertificatePool& operator=(const CertificatePool&) = delete;

 private:
  friend class CertificatePoolAccess;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::timestamp
