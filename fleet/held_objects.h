// What is put beside what a store has of a case: under no shorter a lock, and counted only once the store
// told of it. Functions; one thread at a time.
#pragma once

#include <string>
#include <vector>

#include "crypto/file_hash.h"
#include "fleet/object_store.h"

namespace kiroku::fleet {

/// The longest COMPLIANCE lock that any version of these objects is under, whether it ended or not, and a
/// legal hold where one of them is. Of each object versions_to_try() are asked for. Throws
/// StoreError.
PutLock longest_lock(ObjectStore& store, const std::vector<std::string>& keys);

/// Throws kiroku::Error where the store does not hold a version, read back, as it was put: without
/// `lock.ends` no lock is asked about. Throws StoreError.
void require_held(ObjectStore& store, const std::string& key, const std::string& version,
                  const crypto::FileHash& hash, const PutLock& lock);

}  // namespace kiroku::fleet
