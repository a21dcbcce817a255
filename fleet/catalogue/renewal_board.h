// Whose evidence record is to be looked at, shared out among workers by the catalogue's database. What it
// says is when to look; whether a record is due, the record says. Times are the database's own. Not
// thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/utc_time.h"
#include "fleet/catalogue/postgres.h"

namespace kiroku::fleet {

/// A case that is to be looked at.
struct RenewalTurn {
  std::string appliance, case_id;
  std::string record;  // SHA-256, hexadecimal, of the record that was last known to hold; "" where none was
};

/// What a look at a case found.
struct RenewalFound {
  std::string appliance, case_id;
  std::string what, detail;
  std::optional<UtcTime> renew_from;  // from then on its record is due; nothing where no end is known
  std::string record;                 // as RenewalTurn has it
  bool again = false;                 // something is left to be done: it is looked at by the next run
};

/// Every function throws DatabaseError.
class RenewalBoard {
 public:
  /// Takes the connection. Throws UsageError where the catalogue is not of this version.
  explicit RenewalBoard(Postgres database);

  [[nodiscard]] UtcTime now();

  /// Cases that are closed, or were when they were looked at, that were not looked at since `began`, and
  struct Due {
    UtcTime began;                 // of this run, by now()
    std::chrono::seconds settled;  // that have not changed for so long, or change for two days on end,
    std::string judged_by;         // and: never were; were by another policy or other roots;
    std::chrono::seconds every;    // were last so long ago; changed since; were left undone; or are due.
    bool all = false;              // or whatever was found before
  };
  /// Leases so many at most, those that wait longest; none that another worker holds. `holder` is of this
  /// batch alone.
  std::vector<RenewalTurn> lease(const Due& due, std::size_t most, const std::string& holder,
                                 std::chrono::seconds for_how_long);
  /// The same without leasing them: all of them.
  [[nodiscard]] std::vector<RenewalTurn> look(const Due& due);
  /// How many of them another worker holds.
  [[nodiscard]] std::uint64_t held_elsewhere(const Due& due);
  /// From now on for so long, what is left of the batch. False where nothing is the holder's.
  bool extend(const std::string& holder, std::chrono::seconds for_how_long);
  /// Enters what was found, as of when the case was leased, and ends the lease. False, and nothing entered,
  /// where the lease is another's by now.
  bool enter(const std::string& holder, const std::string& judged_by, const RenewalFound& found);
  /// How many cases were refused when they were last looked at.
  [[nodiscard]] std::uint64_t refused();
  /// How many nobody looks at: those that are missing, and of those that were never looked at the unreadable
  /// ones, and such as are open, or change, for two days.
  [[nodiscard]] std::uint64_t out_of_reach();
  /// Ends what is left of the batch.
  void give_back(const std::string& holder);

 private:
  Postgres database_;
};

}  // namespace kiroku::fleet
