#include "base/connection_places.h"

#include <algorithm>
#include <string_view>
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

void ConnectionPlaces::Place::note_known(const std::string& owner) {
  const std::lock_guard guard(places_.mutex_);
  const auto entry = places_.entries_.find(id_);
  if (entry == places_.entries_.end()) return;
  entry->second.standing = Standing::kKnown;
  entry->second.owner = owner;
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
  std::function<void()> end_of_leaving;
  std::unique_ptr<Place> place;
  {
    const std::lock_guard guard(mutex_);
    const auto of_this = of_holder_.find(holder);
    const bool holder_is_full = of_this != of_holder_.end() && of_this->second >= limits_.of_holder;
    if (holder_is_full || entries_.size() >= limits_.all) {
      const auto makes_room = leaving(holder_is_full ? &holder : nullptr);
      if (makes_room == entries_.end()) return nullptr;
      end_of_leaving = std::move(makes_room->second.end);
      forget(makes_room);
    }
    const std::uint64_t id = next_++;
    place.reset(new Place(*this, id));
    entries_.emplace(id, Entry{.holder = holder, .owner = "", .end = std::move(end), .last = id});
    ++of_holder_[holder];
  }
  if (end_of_leaving) end_of_leaving();
  return place;
}

std::size_t ConnectionPlaces::count() const {
  const std::lock_guard guard(mutex_);
  return entries_.size();
}

ConnectionPlaces::Entries::iterator ConnectionPlaces::leaving(const std::string* of_holder) {
  const std::size_t places = of_holder != nullptr ? limits_.of_holder : limits_.all;
  if (others(of_holder) < places / limits_.one_for_others_in) {
    const auto found = idlest_of_greatest_owner(of_holder);
    if (found != entries_.end()) return found;
  }
  const auto found = idlest(of_holder);
  return found != entries_.end() ? found : idlest_of_greatest_owner(of_holder);
}

std::size_t ConnectionPlaces::others(const std::string* of_holder) const {
  return static_cast<std::size_t>(std::ranges::count_if(entries_, [&](const auto& each) {
    const Entry& entry = each.second;
    return entry.owner.empty() && entry.standing < limits_.safe &&
           (of_holder == nullptr || entry.holder == *of_holder);
  }));
}

ConnectionPlaces::Entries::iterator ConnectionPlaces::idlest_of_greatest_owner(const std::string* of_holder) {
  struct Owner {
    std::size_t count = 0;
    Entries::iterator idlest;
  };
  std::map<std::string_view, Owner> owners;
  const auto comes_first = [](const Entry& one, const Entry& other) {
    return std::tie(one.is_busy, one.last) < std::tie(other.is_busy, other.last);
  };
  for (auto each = entries_.begin(); each != entries_.end(); ++each) {
    const Entry& entry = each->second;
    if (entry.owner.empty() || (of_holder != nullptr && entry.holder != *of_holder)) continue;
    Owner& owner = owners.try_emplace(entry.owner, Owner{0, each}).first->second;
    ++owner.count;
    if (comes_first(entry, owner.idlest->second)) owner.idlest = each;
  }
  const auto greatest =
      std::ranges::max_element(owners, {}, [](const auto& each) { return each.second.count; });
  if (greatest == owners.end() || greatest->second.count <= limits_.kept_of_owner) return entries_.end();
  return greatest->second.idlest;
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
