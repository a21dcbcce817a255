// [[authority]]: time-stamping authorities, of an appliance (kiroku.toml) or of a hospital's fleet
// (fleet.toml). Pure functions, thread-safe.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "timestamp/client.h"

namespace kiroku::apps {

class TableReader;

/// One [[authority]].
struct AuthorityConfiguration {
  std::string name;                             // [a-z0-9-], at most 32
  std::string url;                              // "embedded" for the home's own
  std::vector<timestamp::AuthorityPath> paths;  // at least one; all of this url
  std::chrono::nanoseconds min_interval{0};     // between two requests
  /// Of an appliance: whether it has its tokens from the hospital's aggregator, and for how long it waits.
  bool shared = false;
  std::chrono::nanoseconds shared_patience = std::chrono::seconds(90);
  [[nodiscard]] bool is_embedded() const { return url == "embedded"; }
};

enum class AuthorityUse { kOfAppliance, kOfFleet };
/// All [[authority]] of the whole file. Throws kiroku::UsageError with line and column.
std::vector<AuthorityConfiguration> read_authorities(TableReader& top, AuthorityUse use);

}  // namespace kiroku::apps
