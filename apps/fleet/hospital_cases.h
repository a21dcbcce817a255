// All appliances' cases for the hospital's page: rows from the catalogue, ledgers and segments from the
// store.
#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "apps/common/scratch_folder.h"
#include "apps/fleet/fleet_configuration.h"
#include "apps/fleet/stored_judge.h"
#include "archive/search/search_note.h"
#include "fleet/case_shelf.h"
#include "fleet/store_connections.h"
#include "viewer/api/stored_cases.h"

namespace kiroku::apps {

/// Thread-safe.
class HospitalCases final : public viewer::StoredCases {
 public:
  /// `scratch`: where ledgers of cases that are looked at lie, and a whole one while it is verified.
  /// `search_key`: the file of the site's search key, where cases may be searched for by patient or
  /// procedure. Throws DatabaseError, kiroku::UsageError, kiroku::IoError.
  HospitalCases(const FleetConfiguration& configuration, const std::optional<std::string>& scratch,
                const std::optional<std::string>& search_key);

  viewer::StoredCasesPage list(const viewer::StoredCasesQuestion& question) override;
  [[nodiscard]] bool can_search() const override { return has_search_key_; }
  viewer::StoredCasesSearch search(const viewer::StoredCasesQuestion& question,
                                   const viewer::StoredCasesSubject& subject) override;
  std::vector<viewer::StoredAppliance> appliances() override;
  std::optional<viewer::StoredCase> row(const std::string& name) override;
  std::optional<Found> find(const std::string& name) override;
  archive::VerificationReport verify(const std::filesystem::path& folder) override;

 private:
  /// What `work` makes of the catalogue; a connection that broke is made anew the next time.
  template <typename Work>
  auto with_catalogue(const Work& work);

  const FleetConfiguration configuration_;
  const std::optional<std::string> scratch_parent_;
  std::mutex mutex_;  // guards the next
  std::optional<fleet::FleetCatalogue> catalogue_;
  const ScratchFolder scratch_;
  fleet::StoreConnections store_;
  fleet::CaseShelf shelf_;  // behind the two before, which it uses
  const bool has_search_key_;
  std::mutex searching_;  // guards the next
  std::optional<search::NoteReader> notes_;
  std::mutex judging_;  // guards the next
  std::optional<StoredJudge> judge_;
};

}  // namespace kiroku::apps
