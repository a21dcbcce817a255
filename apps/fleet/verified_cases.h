// What verifications of stored cases amount to, for the catalogue, in words and as an exit status. A verdict
// that proves nothing either way is neither intact nor an alarm (docs/reference/verdicts.md).
#pragma once

#include <cstdint>
#include <string>

#include "apps/fleet/stored_holds.h"
#include "archive/verify/report.h"
#include "fleet/catalogue/fleet_catalogue.h"
#include "fleet/mender.h"

namespace kiroku::apps {

/// A report as the catalogue keeps it. An alarm is raised for a case that is not intact, and for an excerpt
/// in a case's place; not where it is incomplete or unproven.
fleet::Verification verification_of(const archive::VerificationReport& report);
/// The same, of a store in which this was mended before the case was judged, and which differs so from the
/// log about its legal hold. A hold that was lifted is one finding more, and none of the verdict's.
fleet::Verification verification_of(const archive::VerificationReport& report, const fleet::Mending& mending,
                                    const HoldDifference& hold = {});

/// Of one run of 'kiroku-fleet verify'. Not thread-safe.
class VerifiedCases {
 public:
  void add(const fleet::Verification& entered);
  /// A case that got no verdict.
  void add_unchecked() { ++unchecked_; }
  /// Objects of the store that were mended, and such as could not be.
  void add_mended(std::uint64_t mended, std::uint64_t left) {
    mended_ += mended;
    left_ += left;
  }
  /// A case under legal hold of which the store tells that it holds not all of it.
  void add_lifted() { ++lifted_; }
  /// The run was told to end before it had looked at all that it was asked for.
  void end_early() { ended_early_ = true; }
  /// What the catalogue says once a run that was asked for every case is over: whatever this run did not look
  /// at itself, and what other workers found of it meanwhile, counts as well.
  void compare(const fleet::FleetTotals& catalogue);

  /// 1 where a case is not intact, missing from the store or unreadable, else 3 where one is incomplete or
  /// unproven, got no verdict or was not looked at, an object could not be mended, or the store does not hold
  /// what is under legal hold, else 0.
  [[nodiscard]] int status() const;
  /// "12 cases verified, 1 NOT INTACT, 2 incomplete, 1 could not be checked; not looked at: 1 missing from
  /// the store".
  [[nodiscard]] std::string summary() const;

  /// As compare() was told of; 0 before.
  [[nodiscard]] std::uint64_t missing() const { return missing_; }
  [[nodiscard]] std::uint64_t unreadable() const { return unreadable_; }  // and never judged as they are now
  [[nodiscard]] std::uint64_t unsettled() const { return unsettled_; }    // closed, and changed just now
  [[nodiscard]] bool ended_early() const { return ended_early_; }

 private:
  std::uint64_t done_ = 0, not_intact_ = 0, incomplete_ = 0, unproven_ = 0, unchecked_ = 0;
  std::uint64_t mended_ = 0, left_ = 0, lifted_ = 0;
  std::uint64_t elsewhere_not_intact_ = 0, elsewhere_unproven_ = 0;  // by other workers, or from before
  std::uint64_t missing_ = 0, unreadable_ = 0, unsettled_ = 0;
  bool ended_early_ = false;
};

}  // namespace kiroku::apps
