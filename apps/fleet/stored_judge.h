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
#include "apps/fleet/stored_holds.h"
#include "archive/verify/verifier.h"
#include "base/utc_time.h"
#include "fleet/fetcher.h"
#include "fleet/object_store.h"
#include "fleet/store_connections.h"

namespace kiroku::apps {

struct JudgingRequest;

/// Not thread-safe.
class StoredJudge {
 public:
  /// `configuration` must outlive the object. `scratch`: where there is room for a case without its segments,
  /// and for a whole one where it mends, or where segments have several versions; nothing: where temporary
  /// files lie. Throws kiroku::IoError; to mend, also as StoreMending does.
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
  /// Where the store held the last case that was judged otherwise than the log in the store says.
  [[nodiscard]] const HoldDifference& hold() const { return hold_; }

 private:
  fleet::FetchedCase fetched(const std::string& appliance, const std::string& case_id,
                             const std::filesystem::path& device, fleet::SegmentBytes segments);
  archive::VerificationReport judge_there(const std::string& appliance, const std::string& case_id,
                                          fleet::FetchedCase& there, JudgingRequest& judging);
  std::filesystem::path log_of(const std::string& appliance, UtcTime changed);
  std::filesystem::path fetch_log(const std::string& appliance);
  fleet::HoldsSeen holds_seen(const std::string& appliance, const std::string& case_id,
                              const std::filesystem::path& device, const fleet::FetchedCase& there);
  HoldDifference hold_of(const std::string& appliance, const std::string& case_id,
                         const std::filesystem::path& device, const fleet::FetchedCase& there);
  const archive::Holds& holds_of(const std::string& appliance, const std::filesystem::path& device);

  const FleetConfiguration& configuration_;
  fleet::ObjectStore store_;
  fleet::StoreConnections connections_;
  const ScratchFolder scratch_;
  std::optional<StoreMending> mending_;
  fleet::Mending done_;
  HoldDifference hold_;
  std::map<std::string, UtcTime> logs_;          // when each was fetched
  std::map<std::string, archive::Holds> holds_;  // by those, where they were read
};

}  // namespace kiroku::apps
