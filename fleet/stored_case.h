// What a store lists of one case, to tell whether it still comes, and what other devices put beside it
// (archive/format/store_statement.h). Functions; one thread at a time.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/utc_time.h"
#include "fleet/object_store.h"

namespace kiroku::fleet {

/// The objects of a case, and the parts of its ledger.
struct StoredCase {
  std::map<std::string, std::string> newest;  // by key, its newest version
  std::optional<UtcTime> put;  // when the newest of them was, by the store; nothing where it does not tell
  std::string newest_key;      // of that one
  /// Under whose locks that lies which is put beside: keys of the ledger, or its last part, and of the newest
  /// object.
  [[nodiscard]] std::vector<std::string> telling_keys(const std::string& appliance,
                                                      const std::string& case_id) const;
};
/// Throws StoreError, kiroku::Error.
StoredCase list_case(ObjectStore& store, const std::string& appliance, const std::string& case_id);
/// When anything of the appliance's log came last, by the store; nothing where nothing did.
std::optional<UtcTime> log_came_last(ObjectStore& store, const std::string& appliance);

/// Where the statements of a case lie in the store.
std::string store_statements_prefix(const std::string& appliance, const std::string& case_id);

/// What was put beside a case.
struct PutBeside {
  std::string key, version;
  UtcTime lock_ends;
};
/// Puts a file below store_statements_prefix() of the case, under a lock that ends no earlier than `until`,
/// nor than any of the case's, and under legal hold where it is. It is read back. Throws StoreError,
/// kiroku::Error, kiroku::IoError.
PutBeside put_beside(ObjectStore& store, const std::string& appliance, const std::string& case_id,
                     const StoredCase& of, const std::filesystem::path& file, UtcTime until);

}  // namespace kiroku::fleet
