// Makes RFC 3161 tokens of any shape, also those that no authority would issue: each member of the recipe is
// one way to go wrong.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "timestamp/certificate_maker.h"

namespace kiroku::test {

/// A CA and a signer under it, valid from 2020 to 2040.
struct TestAuthority {
  timestamp::Credential ca;
  timestamp::Credential signer;
  [[nodiscard]] std::string root_pem() const;
};
TestAuthority make_test_authority(const std::string& extended_key_usage = "critical,timeStamping");

/// Another signer under the same CA, of any key.
timestamp::Credential make_signer(const TestAuthority& authority, crypto::PrivateKey key);
/// A key whose signatures take a hundred times as long to verify as an honest one's: RSA of 2048 bits whose
/// public exponent is as long.
crypto::PrivateKey make_dear_key();

/// PEM of one certificate.
std::string pem_of(X509* certificate);

/// A well-formed token unless changed.
struct TokenRecipe {
  int imprint_algorithm = NID_sha256;
  Bytes imprint = Bytes(32, std::byte{0x11});
  std::string gen_time = "20260805091502.25Z";
  std::string policy = "1.2.3.4";
  long version = 1;
  std::optional<std::uint64_t> nonce;
  bool critical_extension = false;
  Bytes after_info;  // bytes appended to the TSTInfo before it is signed

  const timestamp::Credential* signer = nullptr;
  const timestamp::Credential* second_signer = nullptr;
  std::vector<X509*> enclosed;  // certificates in the bag
  X509* identified = nullptr;   // what ESSCertIDv2 names; null: the signer
  bool identify_v1 = false;
  bool identify_v2 = true;
  X509* issuer_serial_of = nullptr;  // adds issuerSerial of this certificate
  int content_type = NID_id_smime_ct_TSTInfo;
  const EVP_MD* digest = EVP_sha256();
  bool detached = false;
  bool by_key_identifier = false;
};

Bytes make_token(const TokenRecipe& recipe);
/// TimeStampResp with status granted around a token.
Bytes make_response(ByteView token);

}  // namespace kiroku::test
