// Asking an authority over HTTP(S) (RFC 3161 section 3.4) with libcurl. An AuthorityClient is used by one
// thread at a time.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "base/bytes.h"
#include "base/error.h"

namespace kiroku::timestamp {

/// How an authority is reached.
struct AuthorityPath {
  std::string url{};                // http:// or https://
  std::string proxy{};              // "http://host:port", empty: none, never taken from the environment
  std::string network_interface{};  // "wwan0" or an address; empty: the routing table's choice
  std::chrono::milliseconds connect_timeout{5'000};
  std::chrono::milliseconds total_timeout{15'000};
};

/// No answer, or none that is a time-stamp response. what() says which and of whom.
class AuthorityError : public Error {
 public:
  using Error::Error;
};

/// Something that answers RFC 3161 queries: an authority over HTTP, or the embedded one in this process.
class StampSource {
 public:
  virtual ~StampSource() = default;
  /// DER TimeStampReq in, DER TimeStampResp out (not judged). Throws AuthorityError.
  virtual Bytes ask(ByteView query) = 0;
};

/// Over HTTP: POST application/timestamp-query; refuses other content types, redirects to other schemes, and
/// more than 1 MiB. TLS certificates are checked against the system's store. Throws UsageError for a URL that
/// is not http or https.
std::unique_ptr<StampSource> http_stamp_source(AuthorityPath path);

class Authority;
/// The embedded authority, asked without a network. `authority` must outlive the source.
std::unique_ptr<StampSource> embedded_stamp_source(Authority& authority);

}  // namespace kiroku::timestamp
