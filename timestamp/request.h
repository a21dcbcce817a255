// RFC 3161 section 2.4.1: TimeStampReq. Values; functions are pure and thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/bytes.h"
#include "crypto/hash.h"

namespace kiroku::timestamp {

/// What is asked of an authority.
struct Request {
  crypto::HashAlgorithm algorithm = crypto::HashAlgorithm::kSha256;
  Bytes imprint;                      // the hash itself, hash_size(algorithm) bytes
  std::optional<std::string> policy;  // dotted object identifier
  /// 64-bit nonce as unsigned big-endian bytes without leading zeros (foreign requests may carry longer
  /// ones; of a negative number the two's complement).
  std::optional<Bytes> nonce;
  bool want_certificates = true;  // certReq
};

/// A request for `imprint` with a random 64-bit nonce and certReq.
Request make_request(crypto::HashAlgorithm algorithm, ByteView imprint);
Bytes encode_request(const Request& request);  // DER
/// Why a request cannot be served, in RFC 3161's PKIFailureInfo terms.
enum class RequestFailure { kBadDataFormat, kBadAlgorithm, kBadRequest, kUnacceptedExtension };
struct RequestParse {
  std::optional<Request> request;
  std::optional<RequestFailure> failure;
  std::string explanation;
};
RequestParse parse_request(ByteView der);

}  // namespace kiroku::timestamp
