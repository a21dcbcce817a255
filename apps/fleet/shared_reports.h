// Who reports to the fleet, for several threads: one connection to the database, made anew where it broke.
// Thread-safe.
#pragma once

#include <mutex>
#include <optional>

#include "apps/fleet/fleet_configuration.h"
#include "fleet/catalogue/fleet_reports.h"

namespace kiroku::apps {

class SharedReports {
 public:
  /// Connects at once. `configuration` must outlive it. Throws fleet::DatabaseError, kiroku::UsageError.
  explicit SharedReports(const FleetConfiguration& configuration)
      : configuration_(configuration), reports_(configuration.open_reports()) {}

  /// What `work` makes of it, one thread at a time. Throws what `work` throws, and fleet::DatabaseError.
  template <typename Work>
  auto with(const Work& work) {
    const std::lock_guard guard(mutex_);
    try {
      if (!reports_) reports_.emplace(configuration_.open_reports());
      return work(*reports_);
    } catch (const fleet::DatabaseError&) {
      reports_.reset();
      throw;
    }
  }

 private:
  const FleetConfiguration& configuration_;
  std::mutex mutex_;  // guards the next
  std::optional<fleet::FleetReports> reports_;
};

}  // namespace kiroku::apps
