// What verifications of stored cases amount to, for the catalogue, in words and as an exit status. A verdict
// that proves nothing either way is neither intact nor an alarm (docs/reference/verdicts.md).
#pragma once

#include <cstdint>
#include <string>

#include "archive/verify/report.h"
#include "fleet/catalogue/fleet_catalogue.h"

namespace kiroku::apps {

/// A report as the catalogue keeps it. An alarm is raised for a case that is not intact, and for an excerpt
/// in a case's place; not where it is incomplete or unproven.
fleet::Verification verification_of(const archive::VerificationReport& report);

/// Of one run of 'kiroku-fleet verify'. Not thread-safe.
class VerifiedCases {
 public:
  void add(const fleet::Verification& entered);
  /// A case that got no verdict.
  void add_unchecked() { ++unchecked_; }

  /// 1 where a case is not intact, else 3 where one is incomplete or unproven or got no verdict, else 0.
  [[nodiscard]] int status() const;
  /// "12 cases verified, 1 NOT INTACT, 2 incomplete, 1 could not be checked".
  [[nodiscard]] std::string summary() const;

 private:
  std::uint64_t done_ = 0, not_intact_ = 0, incomplete_ = 0, unproven_ = 0, unchecked_ = 0;
};

}  // namespace kiroku::apps
