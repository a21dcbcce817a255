// Until when algorithms count: what RFC 5698 (DSSC) says in XML, as a TOML file for people to write
// (docs/reference/format-evidence.md). Immutable; thread-safe.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/utc_time.h"
#include "crypto/hash.h"
#include "timestamp/token_verifier.h"

namespace kiroku::evidence {

inline constexpr std::size_t kMaximumPolicyBytes = 1U << 20U;

/// What a policy says of one algorithm.
struct Term {
  bool listed = false;  // false: the policy does not know it, so it counts never (RFC 5698 section 4.2)
  std::optional<UtcTime> end;  // the first moment at which it counts no more; nothing: no end is known

  [[nodiscard]] bool holds_at(UtcTime time) const { return listed && (!end || time < *end); }
};

class Policy {
 public:
  /// Every algorithm that is known here counts for ever: for whoever gives no policy.
  static Policy without_ends();
  /// Throws kiroku::UsageError with file, line and column for what is no policy.
  static Policy parse(std::string_view toml, const std::string& name_for_errors);

  [[nodiscard]] bool was_given() const { return given_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  /// How long before an end a record is due for renewal.
  [[nodiscard]] std::chrono::days renew_before() const { return renew_before_; }
  /// What new records and hash-tree renewals hash with: 'new_hash', else the first hash listed.
  [[nodiscard]] crypto::HashAlgorithm new_hash() const { return new_hash_; }

  [[nodiscard]] Term hash(std::string_view name) const;  // "sha256"
  /// The earlier end of key and hash; for a hash without a name the key's alone.
  [[nodiscard]] Term signature(const timestamp::SignatureUse& use) const;

 private:
  struct Entry {
    std::string name;
    int minimum_bits = 0;
    std::optional<UtcTime> end;
  };
  [[nodiscard]] Term find(std::string_view name, int bits) const;

  bool given_ = false;
  std::string name_;
  std::chrono::days renew_before_{180};
  crypto::HashAlgorithm new_hash_ = crypto::HashAlgorithm::kSha256;
  std::vector<Entry> entries_;
};

/// "sha256", "rsa with 2048 bits over sha256".
std::string words_of(const timestamp::SignatureUse& use);

}  // namespace kiroku::evidence
