// A stored case, fetched and judged as 'kiroku-verify' does.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "apps/common/scratch_folder.h"
#include "apps/fleet/fleet_configuration.h"
#include "apps/fleet/store_mending.h"
#include "archive/verify/verifier.h"
#include "base/utc_time.h"
#include "fleet/object_store.h"

namespace kiroku::apps {

/// Not thread-safe.
class StoredJudge {
 public:
  /// `configuration` must outlive the object. `scratch`: where there is room for a whole case; nothing: where
  /// temporary files lie. Throws kiroku::IoError; to mend, also as StoreMending does.
  enum class Mends { kNo, kAsConfigured };
  StoredJudge(const FleetConfiguration& configuration, const std::optional<std::string>& scratch,
              Mends mends = Mends::kNo);

  /// By its appliance's key, the roots of [verification], the policy of [evidence] and the appliance's log in
  /// the store, with the evidence record that counts. The log is
  /// fetched anew for a case that changed after it was; `changed` says when the case did. Throws StoreError,
  /// kiroku::Error; nothing is left behind.
  archive::VerificationReport judge(const std::string& appliance, const std::string& case_id,
                                    UtcTime changed);
  /// What was mended in the store before the last case was judged, also where it then could not be judged.
  [[nodiscard]] const fleet::Mending& mending() const { return done_; }

 private:
  fleet::FetchedCase fetched(const std::string& appliance, const std::string& case_id,
                             const std::filesystem::path& device);
  std::filesystem::path log_of(const std::string& appliance, UtcTime changed);

  const FleetConfiguration& configuration_;
  fleet::ObjectStore store_;
  const ScratchFolder scratch_;
  std::optional<StoreMending> mending_;
  fleet::Mending done_;
  std::map<std::string, UtcTime> logs_;  // when each was fetched
};

}  // namespace kiroku::apps
