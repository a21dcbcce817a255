// The rows of one appliance's cases in a database: what the embedded catalogue (SQLite) and a hospital's
// (PostgreSQL) have in common. Not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/utc_time.h"

namespace kiroku::archive {

struct CatalogueRow {
  std::string case_id;                      // name of the folder
  UtcTime opened;                           // by the ledger; of an unreadable case, by the folder's name
  std::optional<std::int64_t> duration_ns;  // nothing while open
  std::string state;                        // "closed", "open", "unreadable"; in a hospital's also "missing"
  std::vector<std::string> streams;
  std::uint64_t segments = 0, bytes = 0, tokens = 0;
  std::optional<std::string> last_verdict;  // and when it was last verified
  std::optional<UtcTime> verified;
};

/// What tells that a case changed since its row was made, by whoever makes the row.
struct CaseStamp {
  std::int64_t bytes = -1;  // of its ledger; -1 if there was none
  std::int64_t changed = 0;
  friend bool operator==(const CaseStamp&, const CaseStamp&) = default;
};

/// Every function throws kiroku::Error where the database cannot be used.
class CaseTable {
 public:
  CaseTable() = default;
  virtual ~CaseTable() = default;
  CaseTable(const CaseTable&) = delete;
  CaseTable& operator=(const CaseTable&) = delete;

  /// Adds a row, or replaces it. The verdict is not taken from `row`: what is there stays if the stamp is the
  /// same, and is forgotten if it is another.
  virtual void put(const CatalogueRow& row, const CaseStamp& stamp) = 0;
  virtual std::map<std::string, CaseStamp> stamps() = 0;
  /// Newest first; of those that began at the same time, the greater identifier first.
  virtual std::vector<CatalogueRow> rows() = 0;
  /// Nothing happens for a case that is not in the table.
  virtual void remove(const std::string& case_id) = 0;
  /// Likewise.
  virtual void set_verdict(const std::string& case_id, const std::string& verdict, UtcTime when) = 0;
  /// All that `work` does to the table, or nothing of it where it throws.
  virtual void together(const std::function<void()>& work) = 0;
};

/// Names of streams in one text, a space between, and back.
std::string joined_names(const std::vector<std::string>& names);
std::vector<std::string> split_names(const std::string& text);

/// A row of a case whose folder holds a ledger, or none that can be read; without verdict.
CatalogueRow read_catalogue_row(const std::string& case_id, const std::filesystem::path& case_folder);

}  // namespace kiroku::archive
