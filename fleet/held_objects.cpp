#include "fleet/held_objects.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "base/error.h"
#include "crypto/hash.h"

namespace kiroku::fleet {

PutLock longest_lock(ObjectStore& store, const std::vector<std::string>& keys) {
  PutLock lock;
  for (const std::string& key : keys) {
    std::vector<ListedVersion> versions;
    store.for_each_version(key, [&](const ListedVersion& each) {
      if (each.key == key) versions.push_back(each);
    });
    for (const ListedVersion& version : versions_to_try(std::move(versions))) {
      const std::optional<StoredObject> there = store.look(key, version.version);
      if (!there) continue;
      lock.legal_hold = lock.legal_hold || there->legal_hold;
      if (there->compliance && there->lock_ends)
        lock.ends = std::max(lock.ends.value_or(*there->lock_ends), *there->lock_ends);
    }
  }
  return lock;
}

void require_held(ObjectStore& store, const std::string& key, const std::string& version,
                  const crypto::FileHash& hash, const PutLock& lock) {
  const std::optional<StoredObject> told = store.look(key, version);
  crypto::Sha256 read;
  if (told) store.get(key, version, hash.bytes, [&](ByteView bytes) { read.update(bytes); });
  const auto is_locked = [&] {
    return told->compliance && told->lock_ends &&
           *told->lock_ends >= std::chrono::floor<std::chrono::seconds>(*lock.ends);
  };
  if (!told || told->bytes != hash.bytes || read.finish() != hash.sha256 || (lock.ends && !is_locked()) ||
      (lock.legal_hold && !told->legal_hold))
    throw Error("the store took " + key +
                ", and does not hold it as it was put: its locks or its disks cannot be relied on");
}

}  // namespace kiroku::fleet
