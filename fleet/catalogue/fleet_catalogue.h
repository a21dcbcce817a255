// The cases of all appliances of a hospital, in PostgreSQL: an index for lists, searches and sharing out
// work. The store is the truth: index_appliance() and index_notes() make it anew from there. No patient's
// data is in it: what a case is about stays sealed, and search notes say it to nobody without their key. Not
// thread-safe; any number of processes may use one database.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "archive/catalogue/case_table.h"
#include "base/utc_time.h"
#include "fleet/catalogue/postgres.h"

namespace kiroku::fleet {

struct FleetCase {
  std::string appliance;
  archive::CatalogueRow row;
  /// The newest verdict says that the case is not intact. It stays where the case changed since and has no
  /// verdict now.
  bool alarm = false;
  std::optional<std::string> unchecked = {};  // why the newest try gave no verdict
  /// Its search note as the store has it (archive/search/search_note.h), where CaseQuery::with_notes asks for
  /// it; "": one that cannot be used.
  std::optional<std::string> search_note = {};
};

/// What is asked for; an empty field asks for anything. Newest first.
struct CaseQuery {
  std::optional<std::string> appliance = {}, case_id = {}, state = {}, verdict = {};
  bool unverified = false;      // without a verdict as it is now, also where it had one before it changed
  bool needs_a_person = false;  // an alarm, incomplete, unproven, not checked, missing, or unreadable
  std::optional<UtcTime> opened_from = {}, opened_before = {};  // half open
  std::size_t limit = 100;
  /// What follows this one in the same order: the last of the page before.
  struct Place {
    UtcTime opened;
    std::string appliance, case_id;
  };
  std::optional<Place> after = {};
  bool with_notes = false;
};

/// A case that one worker verifies. Once its time is over another may take it; until one does, it is still
/// this worker's, and may be extended.
struct Lease {
  std::string appliance, case_id;
  UtcTime changed;     // when the catalogue saw it last as other than before, by the database's clock
  std::string holder;  // of this lease alone
};

/// What one verification found.
struct Verification {
  std::string verdict;
  bool alarm = false;  // the case is not intact; not told of old ones
  std::size_t findings = 0;
  std::string detail;  // the first finding's sentence, or why it could not be judged; may be empty
};
/// One that was entered.
struct EnteredVerification : Verification {
  UtcTime when;  // by the database's clock
};

struct FleetTotals {
  std::uint64_t cases = 0, segments = 0, bytes = 0;
  std::uint64_t open = 0, unreadable = 0, missing = 0;
  std::uint64_t unverified = 0;  // as CaseQuery has it; of those that are not missing
  std::uint64_t unverified_closed = 0, unverified_unreadable = 0;  // of these, that nobody tried in vain
  std::uint64_t alarms = 0, incomplete = 0, unproven = 0, unchecked = 0;
  std::uint64_t being_verified = 0;
};

/// Of one appliance.
struct ApplianceTotals {
  std::string appliance;
  FleetTotals totals;
  UtcTime newest;  // when its newest case began, as its ledger says
  UtcTime seen;    // when a row of it changed last, by the database's clock
};

/// Every function throws DatabaseError.
class FleetCatalogue {
 public:
  /// Makes tables and roles, or brings older ones up to this program's version. `database` belongs to
  /// somebody who may create roles. kiroku_reader may read, and accuse; kiroku_indexer may also write rows;
  /// kiroku_verifier may also lease cases, enter verdicts and what renewals found; kiroku_reporter may also
  /// enrol appliances and take their reports. No role may change or remove what was entered into a case's
  /// verifications, and kiroku_indexer no verdict.
  static void prepare(Postgres& database);

  /// Takes the connection. Throws UsageError where prepare() of this version has not been run on it.
  explicit FleetCatalogue(Postgres database);

  [[nodiscard]] std::vector<std::string> appliances();
  /// Its rows alone; lives no longer than this object.
  [[nodiscard]] std::unique_ptr<archive::CaseTable> table_of(const std::string& appliance);
  [[nodiscard]] std::vector<FleetCase> find(const CaseQuery& query);
  /// Of an appliance's search notes: which version of the store's object each was read from, by case.
  [[nodiscard]] std::map<std::string, std::string> note_versions(const std::string& appliance);
  /// Keeps a case's note in the place of the one before; "" for one that cannot be used.
  void put_note(const std::string& appliance, const std::string& case_id, const std::string& version,
                const std::string& note);
  [[nodiscard]] FleetTotals totals();
  /// In the order of their names.
  [[nodiscard]] std::vector<ApplianceTotals> totals_by_appliance();

  /// Now by the database's clock, by which all here is.
  [[nodiscard]] UtcTime now();
  /// Which cases are due: by when the catalogue saw them, as a ledger claims what its writer likes, and
  /// workers' clocks may differ.
  struct Due {
    /// Last verified so long ago, or before this moment of now(); or without a verdict, and
    std::variant<std::chrono::seconds, UtcTime> verified_before;
    std::chrono::seconds settled;  // closed and unchanged for so long,
    std::chrono::seconds
        longest_pending;  // or, whatever it is and however it changes, without one for so long
  };
  /// Leases a case that is due; the one that waits longest. None that another worker holds (FOR UPDATE
  /// SKIP LOCKED). Nothing where none is due.
  std::optional<Lease> lease(const Due& due, std::chrono::seconds for_how_long);
  /// From now on for so long. False where the lease is another's by now, or the case changed.
  bool extend(const Lease& lease, std::chrono::seconds for_how_long);
  /// How many cases that are due another worker holds.
  [[nodiscard]] std::uint64_t held_elsewhere(const Due& due);
  /// Enters what was found as of now(), and ends the lease. False, and nothing entered, where the lease is
  /// another's by now, or the case changed since it was leased.
  bool enter(const Lease& lease, const Verification& found);
  /// Ends it without a verdict, so that another may try once `pause` is over. `why` is kept among what was
  /// found, as of the verdict "could-not-check", unless it is empty; what the case's row says stays. Nothing
  /// where the lease is another's by now.
  void give_back(const Lease& lease, std::chrono::seconds pause, const std::string& why);
  /// What somebody found of a case who leased none and enters no verdicts: the page, or a renewal. Its row
  /// needs a person until it is verified anew, which is due at once; what was found is kept. Nothing where
  /// there is no such case.
  void accuse(const std::string& appliance, const std::string& case_id, const Verification& found);
  /// Every case that waits after it could not be checked may be tried at once. Leases stay.
  void end_pauses();
  /// All that was ever found of a case, oldest first.
  [[nodiscard]] std::vector<EnteredVerification> verifications(const std::string& appliance,
                                                               const std::string& case_id);

 private:
  void keep(const Lease& lease, const Verification& found);
  Postgres database_;
};

}  // namespace kiroku::fleet
