// What renewing evidence records did, as 'kiroku renew' and 'kiroku-fleet renew' say it. Functions; the class
// is not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json_fwd.hpp>

#include "archive/upkeep/evidence_renewal.h"

namespace kiroku::apps {

/// Something was done for the case, or would be by a dry run.
bool is_renewed(archive::EvidenceRenewal::What what);

nlohmann::ordered_json renewal_json(const archive::EvidenceRenewal& renewal);

/// Tells of one run, as much at a time as is known.
class RenewalTeller {
 public:
  RenewalTeller(std::string program, bool dry_run) : program_(std::move(program)), dry_run_(dry_run) {}

  /// A line for each case of which there is something to say; what nobody need know is counted.
  /// `appliance` stands before the case where it is not empty.
  void tell(const archive::EvidenceRenewal& renewal, const std::string& appliance = {});
  /// Without saying so.
  void count(const archive::EvidenceRenewal& renewal);
  /// What was counted.
  void sum_up() const;
  /// 1 where a case must be looked at, else 3 where something waits or, of a dry run, is due, else 0.
  [[nodiscard]] int status() const;

 private:
  const std::string program_;  // "kiroku"
  const bool dry_run_;
  std::uint64_t nothing_due_ = 0, refused_ = 0, waiting_ = 0;
  std::optional<UtcTime> next_;
};

}  // namespace kiroku::apps
