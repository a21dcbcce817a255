#include "base/connection_places.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace kiroku {

ConnectionPlaces::Place::~Place() {
  const std::lock_guard guard(places_.mutex_);
  const auto entry = places_.entries_.find(id_);
  if (entry != places_.entries_.end()) places_.forget(entry);
}

void ConnectionPlaces::Place::note(Standing shown) {
  const std::lock_guard guard(places_.mutex_);
  const auto entry = places_.entries_.find(id_);
  if (entry == places_.entries_.end()) return;
  entry->second.standing = std::max(entry->second.standing, shown);
  entry->second.last = places_.next_++;
}

void ConnectionPlaces::Place::set_busy(bool is_busy) {
  const std::lock_guard guard(places_.mutex_);
  const auto entry = places_.entries_.find(id_);
  if (entry == places_.entries_.end()) return;
  entry->second.is_busy = is_busy;
  entry->second.last = places_.next_++;
}

std::unique_ptr<ConnectionPlaces::Place> ConnectionPlaces::enter(const std::string& holder,
                                                                 std::function<void()> end) {
  std::function<void()> end_of_idlest;
  std::unique_ptr<Place> place;
  {
    const std::lock_guard guard(mutex_);
    const auto of_this = of_holder_.find(holder);
    const bool holder_is_full = of_this != of_holder_.end() && of_this->second >= limits_.of_holder;
    if (holder_is_full || entries_.size() >= limits_.all) {
      const auto leaving = idlest(holder_is_full ? &holder : nullptr);
      if (leaving == entries_.end()) return nullptr;
      end_of_idlest = std::move(leaving->second.end);
      forget(leaving);
    }
    const std::uint64_t id = next_++;
    place.reset(new Place(*this, id));
    entries_.emplace(id, Entry{.holder = holder, .end = std::move(end), .last = id});
    ++of_holder_[holder];
  }
  if (end_of_idlest) end_of_idlest();
  return place;
}

std::size_t ConnectionPlaces::count() const {
  const std::lock_guard guard(mutex_);
  return entries_.size();
}

ConnectionPlaces::Entries::iterator ConnectionPlaces::idlest(const std::string* of_holder) {
  auto found = entries_.end();
  for (auto each = entries_.begin(); each != entries_.end(); ++each) {
    const Entry& entry = each->second;
    if (entry.is_busy || entry.standing >= limits_.safe) continue;
    if (of_holder != nullptr && entry.holder != *of_holder) continue;
    if (found == entries_.end() ||
        std::tie(entry.standing, entry.last) < std::tie(found->second.standing, found->second.last)) {
      found = each;
    }
  }
  return found;
}

void ConnectionPlaces::forget(Entries::iterator entry) {
  const auto of_this = of_holder_.find(entry->second.holder);
  if (--of_this->second == 0) of_holder_.erase(of_this);
  entries_.erase(entry);
}

}  // namespace kiroku
