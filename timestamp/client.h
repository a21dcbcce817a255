// Asking an authority over HTTP(S) (RFC 3161 section 3.4) with libcurl. A StampSource is used by one thread
// at a time.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "base/error.h"

namespace kiroku::timestamp {

/// One way to reach an authority.
struct AuthorityPath {
  std::string url{};                // http:// or https://
  std::string proxy{};              // "http://host:port", empty: none, never taken from the environment
  std::string network_interface{};  // "wwan0" or an address; empty: the routing table's choice
  std::chrono::milliseconds connect_timeout{5'000};
  std::chrono::milliseconds total_timeout{15'000};
};
/// The way in words: "directly", "through the proxy http://host:port", "over wwan0", "over wwan0 through …".
/// A password in the proxy's address is left out.
std::string path_name(const AuthorityPath& path);

/// No answer, or none that is a time-stamp response. what() says which and of whom.
class AuthorityError : public Error {
 public:
  explicit AuthorityError(const std::string& sentence,
                          std::optional<std::chrono::seconds> leave_alone_for = std::nullopt)
      : Error(sentence), leave_alone_for_(leave_alone_for) {}
  /// The authority was reached and asks to be left alone for so long (HTTP 429, or 503 with Retry-After; RFC
  /// 9110 section 10.2.3, RFC 6585 section 4); at most a day. A minute where 429 does not say.
  [[nodiscard]] std::optional<std::chrono::seconds> leave_alone_for() const { return leave_alone_for_; }

 private:
  std::optional<std::chrono::seconds> leave_alone_for_;
};

/// Something that answers RFC 3161 queries: an authority over HTTP, or the embedded one in this process.
class StampSource {
 public:
  virtual ~StampSource() = default;
  /// DER TimeStampReq in, DER TimeStampResp out (not judged). Throws AuthorityError.
  virtual Bytes ask(ByteView query) = 0;
  /// The way over which the latest answer came, as path_name() says it; empty before one came, and where
  /// there is no network between.
  [[nodiscard]] virtual std::string path() const { return {}; }
};

/// Over HTTP: POST application/timestamp-query; refuses other content types, redirects to other schemes, and
/// more than 1 MiB. TLS certificates are checked against the system's store. Throws UsageError for a URL that
/// is not http or https.
std::unique_ptr<StampSource> http_stamp_source(AuthorityPath path);
/// One authority over several ways: those that lead nowhere, or to something that is no time-stamp response,
/// are passed over; the one that led to an answer is the first to be tried the next time, then the others in
/// their order. An authority that asks to be left alone is not asked over another way. Throws UsageError like
/// the above, and where `paths` is empty.
std::unique_ptr<StampSource> http_stamp_source(const std::vector<AuthorityPath>& paths);

class Authority;
/// The embedded authority, asked without a network. `authority` must outlive the source.
std::unique_ptr<StampSource> embedded_stamp_source(Authority& authority);

}  // namespace kiroku::timestamp
