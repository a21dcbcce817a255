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
    const ObjectLocks locks = locks_of(store, key);
    lock.legal_hold = lock.legal_hold || locks.legal_hold;
    // Nothing is before any time.
    lock.ends = std::max(lock.ends, locks.longest);
  }
  return lock;
}

ObjectLocks locks_of(ObjectStore& store, const std::string& key) {
  std::vector<ListedVersion> versions;
  store.for_each_version(key, [&](const ListedVersion& each) {
    if (each.key == key) versions.push_back(each);
  });
  ObjectLocks locks;
  // From the newest to the oldest.
  for (const ListedVersion& version : versions_to_try(std::move(versions))) {
    const std::optional<StoredObject> there = store.look(key, version.version);
    locks.first = there && there->compliance ? there->lock_ends : std::nullopt;
    locks.legal_hold = locks.legal_hold || (there && there->legal_hold);
    locks.longest = std::max(locks.longest, locks.first);
  }
  return locks;
}

void require_held(ObjectStore& store, const std::string& key, const std::string& version,
                  const crypto::FileHash& hash, const PutLock& lock) {
  const std::optional<StoredObject> told = store.look(key, version);
  crypto::Sha256 read;
  if (told) store.get(key, version, hash.bytes, [&](ByteView bytes) { read.update(bytes); });
  const bool is_locked =
      !lock.ends || (told && told->compliance && told->lock_ends &&
                     *told->lock_ends >= std::chrono::floor<std::chrono::seconds>(*lock.ends));
  if (!told || told->bytes != hash.bytes || read.finish() != hash.sha256 || !is_locked ||
      (lock.legal_hold && !told->legal_hold))
    throw Error("the store took " + key +
                ", and does not hold it as it was put: its locks or its disks cannot be relied on");
}

}  // namespace kiroku::fleet
