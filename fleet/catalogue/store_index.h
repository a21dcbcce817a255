// The rows of a hospital's catalogue, made from what a store holds. Functions; one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "archive/catalogue/case_table.h"
#include "fleet/catalogue/fleet_catalogue.h"
#include "fleet/object_store.h"

namespace kiroku::fleet {

/// Names that objects of the store begin with and that an appliance can have. Throws StoreError.
std::vector<std::string> appliances_in_store(ObjectStore& store);

struct IndexReport {
  std::uint64_t cases = 0;  // that the store has
  std::uint64_t read = 0;   // of them: whose ledger was read, because they are new or changed
  std::vector<std::string>
      problems;  // cases whose ledger could not be had, and why; one that had a row is "unreadable" there
  std::vector<std::string> missing;  // cases that were in the table, and of which the store has nothing more
};
/// Brings an appliance's rows up to what the store lists. A case is read anew where its versions are others
/// than when its row was made; `anew`: every case is. A case of which nothing is there any more keeps its
/// row, with the state "missing": under locks that hold it cannot vanish. `scratch` is a folder for one
/// ledger at a time. Memory: the names and stamps of one appliance's cases. Throws StoreError, DatabaseError,
/// kiroku::IoError; what was entered stays.
IndexReport index_appliance(ObjectStore& store, const std::string& appliance, archive::CaseTable& table,
                            const std::filesystem::path& scratch, bool anew = false);

struct NotesReport {
  std::uint64_t notes = 0;  // that the store has
  std::uint64_t read = 0;   // of them: new or changed
  /// Objects that are no search notes of their case, the first of them with why; how many more. They are told
  /// of when they are first seen, and not read again.
  std::vector<std::string> problems;
  std::uint64_t more_problems = 0;
};
/// The same of an appliance's search notes, which are small objects beside its cases. `anew` as there. Only
/// the newest version of each counts. Throws StoreError, DatabaseError; what was entered stays.
NotesReport index_notes(ObjectStore& store, const std::string& appliance, FleetCatalogue& catalogue,
                        bool anew = false);

}  // namespace kiroku::fleet
