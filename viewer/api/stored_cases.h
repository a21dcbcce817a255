// Cases of many appliances that lie in a store, as a hospital's page shows them. Who has them is no part of
// the viewer (apps/fleet).
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "archive/catalogue/case_table.h"
#include "archive/verify/verifier.h"
#include "base/utc_time.h"
#include "viewer/playback/case_place.h"

namespace kiroku::viewer {

/// A case of the list. Its name is viewer::stored_case_name() (viewer/http/case_name.h).
struct StoredCase {
  std::string appliance;
  archive::CatalogueRow row;
  bool alarm = false;                    // the newest verdict says that it is not intact
  std::optional<std::string> unchecked;  // why the newest try gave no verdict
};

/// Empty fields ask for anything.
struct StoredCasesQuestion {
  std::optional<std::string> appliance, state, verdict;
  bool unverified = false, needs_a_person = false;
  std::optional<UtcTime> opened_from, opened_before;
  std::size_t limit = 50;
  std::optional<std::string> after;  // StoredCasesPage::next of the page before
};
struct StoredCasesPage {
  std::vector<StoredCase> cases;  // newest first
  std::optional<std::string> next;
};

/// Whom or what a case is about, as somebody wrote it; empty fields ask for anything.
struct StoredCasesSubject {
  std::string patient, authority;        // the patient's number, and who gave it
  std::string procedure, coding_system;  // the procedure's code
};
struct StoredCasesSearch {
  StoredCasesPage page;
  /// Of the cases that the question asks for otherwise: how many there are, of which so many cannot be
  /// searched and so many have a note of another key.
  std::uint64_t looked_at = 0, without_note = 0, foreign = 0;
};

/// What the catalogue knows of an appliance.
struct StoredAppliance {
  std::string name;
  std::uint64_t cases = 0, bytes = 0;
  std::uint64_t open = 0, unverified = 0, alarms = 0, incomplete = 0, unproven = 0, unchecked = 0;
  std::uint64_t missing = 0, unreadable = 0;
  UtcTime newest;  // when its newest case began, as its ledger says
  UtcTime seen;    // when the catalogue saw the last change, by the database's clock
};

/// Implementations are thread-safe. All functions throw Refusal (503) where store or database are away, and
/// kiroku::Error.
class StoredCases {
 public:
  virtual ~StoredCases() = default;

  /// Throws Refusal (400) where the question makes no sense.
  virtual StoredCasesPage list(const StoredCasesQuestion& question) = 0;
  /// Whether this server has the site's search key.
  [[nodiscard]] virtual bool can_search() const = 0;
  /// can_search() must be so. Throws Refusal as list(), and (400) where nothing can be searched by the
  /// subject. Takes seconds where there are hundreds of thousands of cases; one search at a time.
  virtual StoredCasesSearch search(const StoredCasesQuestion& question,
                                   const StoredCasesSubject& subject) = 0;
  virtual std::vector<StoredAppliance> appliances() = 0;
  /// The row of one case; nothing where the catalogue has none.
  virtual std::optional<StoredCase> row(const std::string& name) = 0;

  struct Found {
    playback::CasePlace place;
    /// Checkpoints and time-stamps are still being fetched.
    bool proofs_are_coming = false;
    std::string problem;  // why they could not be fetched; "" where they could
  };
  /// Nothing where the store has no such case.
  virtual std::optional<Found> find(const std::string& name) = 0;
  /// Of the case whose place is `folder`, out of the store. Takes as long as fetching all of it does.
  virtual archive::VerificationReport verify(const std::filesystem::path& folder) = 0;
};

}  // namespace kiroku::viewer
