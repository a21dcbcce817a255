// The embedded RFC 3161 authority: its own CA and time-stamping certificate (P-256, critical sole
// timeStamping EKU), for demonstration, tests and closed networks. Its time is this machine's: what it stamps
// is "self-issued", never "external", as timestamp/own_authority.h tells.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "base/bytes.h"
#include "base/utc_time.h"

namespace kiroku::timestamp {

/// Policy of every token of an embedded authority, under the UUID arc (2.25). Whoever holds the authority's
/// key can write another one: a token with this policy is self-issued, one without it need not be outside
/// time.
inline constexpr std::string_view kEmbeddedPolicy = "2.25.197830237812365870224498532130945381713";
/// Common name of every embedded authority's CA.
inline constexpr std::string_view kEmbeddedRootName = "Kiroku embedded time-stamping CA";

/// Answers queries. respond() is thread-safe.
class Authority {
 public:
  /// Makes `folder` with ca.pem, ca.key, tsa.pem, tsa.key (mode 0600) and the serial counter; refuses a
  /// folder that exists with an authority in it.
  static Authority create(const std::filesystem::path& folder, const std::string& organisation);
  static Authority open(const std::filesystem::path& folder);
  Authority(Authority&&) noexcept;
  Authority& operator=(Authority&&) noexcept;
  ~Authority();

  /// RFC 3161 response for any bytes: rejections (badDataFormat, badAlg, badRequest, unacceptedPolicy,
  /// unacceptedExtension) are responses, too. Each token's serial number is durable before the token leaves,
  /// so it never repeats, also after a crash. While the clock stands behind the last token of this object by
  /// more than tokens state as their accuracy, requests are rejected (timeNotAvailable).
  Bytes respond(ByteView query);
  [[nodiscard]] std::string root_pem() const;   // the CA certificate
  [[nodiscard]] std::string chain_pem() const;  // signer and CA
  /// Replaces the clock, for tests of clocks that go wrong; what the old one said does not count any more.
  void set_clock(std::function<UtcTime()> now);

 private:
  struct State;
  explicit Authority(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::timestamp
