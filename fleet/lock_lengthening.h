// Locks in a store that end earlier than [store] asks for now: an object is locked when it is put, for the
// time that was asked for then. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "fleet/object_store.h"
#include "fleet/shipping_list.h"

namespace kiroku::fleet {

/// Lengthens the locks of what an appliance has in the store, all versions of an object that
/// versions_to_try() says: each until as long after the object's first version was put as is asked for. What
/// is sealed of a case stays for no longer than the case's ledger. Nothing is shortened, and nothing is
/// locked that no lock in COMPLIANCE mode was put on. How far it came stands in the list, so that a crash
/// costs nothing.
class LockLengthening {
 public:
  /// What is given must outlive it.
  LockLengthening(ObjectStore& store, ShippingList& list, std::string appliance,
                  std::chrono::seconds retention, const Clock& clock);

  /// Asks the store about `most` versions at most, which it takes from `most`, and about the other versions
  /// of the last object. The next call goes on. Ends early once `is_ended`. What could not be lengthened
  /// stands in the list, and is tried again an hour later, or by another object of this class. So many were
  /// lengthened. Throws StoreError where the store is away or lists nothing, kiroku::Error where its list
  /// makes no sense.
  std::uint64_t go_on(std::uint64_t& most, const std::function<bool()>& is_ended);

  /// What is left of it; nothing where each lock is as long as is asked for, as far as is known. Asks the
  /// list alone.
  [[nodiscard]] static std::optional<ShippingList::LockLook> left(ShippingList& list,
                                                                  std::chrono::seconds retention);

 private:
  [[nodiscard]] bool is_to_be_looked_at();
  [[nodiscard]] bool is_ours(const std::string& key) const;
  void look_at(std::vector<ListedVersion> versions, std::uint64_t& most);
  void look_at_version(const ListedVersion& version, const std::optional<ShippedObject>& known,
                       UtcTime until);
  [[nodiscard]] UtcTime end_of(const ListedVersion& first) const;
  [[nodiscard]] std::optional<UtcTime> end_of_what_is_sealed(const std::string& case_id);
  void guarded(const std::string& key, const std::function<void()>& work);
  void fail(const std::string& why);
  ObjectStore& store_;
  ShippingList& list_;
  const std::string prefix_;
  const std::chrono::seconds retention_;
  const Clock& clock_;
  ShippingList::LockLook look_;
  std::optional<Clock::Time> failed_at_;  // what is tried again then
  struct {
    std::string case_id;
    std::optional<UtcTime> end;
  } sealed_;  // of the case that was asked about last
};

}  // namespace kiroku::fleet
