// RFC 3161 sections 2.4.2 and 2.4.2.1: TimeStampResp and the TSTInfo inside its CMS token, read with
// OpenSSL's CMS functions (the older PKCS7/TS path refuses real tokens that carry OCSP answers and accepts
// forged bags). Parsing only: nothing here is trusted yet, see token_verifier.h. Pure functions, thread-safe.
// Response and TSTInfo must be DER, as RFC 3161 says; around the TSTInfo, BER is read where CMS permits it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "base/utc_time.h"
#include "crypto/hash.h"

namespace kiroku::timestamp {

/// TSTInfo: what the authority says.
struct TokenInfo {
  std::string policy;  // dotted object identifier
  std::optional<crypto::HashAlgorithm>
      algorithm;  // nothing: one not known here (the name is in algorithm_name)
  std::string algorithm_name;
  Bytes imprint;
  std::string serial;  // hex, lower case, without leading zeros; "-" in front of a negative one
  UtcTime gen_time;
  std::int64_t accuracy_ns = 0;  // 0 where the token states none
  bool ordering = false;
  std::optional<Bytes> nonce;  // unsigned big endian, no leading zeros
};

/// A TimeStampResp or a bare token, split.
struct Response {
  int status = 0;  // PKIStatus: 0 granted, 1 granted with modifications, 2 rejection, …
  std::vector<std::string> status_text;
  std::optional<int> failure_info;  // bit number of PKIFailureInfo
  Bytes token;                      // DER of the CMS ContentInfo, empty if none
};

/// Whether and what a response says; nothing for bytes that are neither a TimeStampResp nor a token (HTML,
/// say); `explanation` then says why. Trailing bytes after the DER are refused.
std::optional<Response> parse_response(ByteView der, std::string& explanation);
/// The TSTInfo of a token; nothing if malformed.
std::optional<TokenInfo> parse_token_info(ByteView token, std::string& explanation);

}  // namespace kiroku::timestamp
