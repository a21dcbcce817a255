// What is put beside what a store has of a case: under no shorter a lock, and counted only once the store
// told of it. Functions; one thread at a time.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/utc_time.h"
#include "crypto/file_hash.h"
#include "fleet/object_store.h"

namespace kiroku::fleet {

/// The longest COMPLIANCE lock that any version of these objects is under, whether it ended or not, and a
/// legal hold where one of them is. Of each object versions_to_try() are asked for. Throws
/// StoreError.
PutLock longest_lock(ObjectStore& store, const std::vector<std::string>& keys);

/// The locks of the versions of one object that versions_to_try() says.
struct ObjectLocks {
  /// Of the first version that was put: nobody can put one before it. Nothing where the store does not tell
  /// of that version, or it is under no COMPLIANCE lock.
  std::optional<UtcTime> first;
  std::optional<UtcTime> longest;  // COMPLIANCE, ended or not
  bool legal_hold = false;         // of any
};
/// Throws StoreError.
ObjectLocks locks_of(ObjectStore& store, const std::string& key);

/// Throws kiroku::Error where the store does not hold a version, read back, as it was put: under the lock,
/// where `lock` has one, and the hold. Throws StoreError.
void require_held(ObjectStore& store, const std::string& key, const std::string& version,
                  const crypto::FileHash& hash, const PutLock& lock);

}  // namespace kiroku::fleet
