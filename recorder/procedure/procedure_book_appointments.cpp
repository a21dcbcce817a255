#include <algorithm>
#include <set>
#include <utility>

#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/procedure_matching.h"
#include "recorder/procedure/window.h"

namespace kiroku::recorder {

void ProcedureBook::keep_appointment(ProcedureMessage message, const Arrival& received,
                                     const TakenOut& before) {
  std::erase_if(ended_, [&](const auto& each) {
    const ProcedureMessage& other = each.second.message;
    return is_of_appointment(other) && same_appointment(message, other) == Likeness::kSure;
  });
  const std::string key = key_of_appointment(message);
  Kept kept{received, std::move(message)};
  kept.booked = before.booked.value_or(received);
  kept.doubt = kept.message.is_status_unclear ? Doubt::kStatusUnclear
               : before.is_doubtful           ? Doubt::kOneAppointment
                                              : Doubt::kNone;
  appointments_.insert_or_assign(key, std::move(kept));
}

void ProcedureBook::keep_cancelled(ProcedureMessage message, const Arrival& received) {
  const std::string key = key_of_ended(message);
  std::vector<std::string> places = rooms_of(message);
  leave_identity(message);
  message.places = std::move(places);
  message.names_rooms = false;
  ended_.insert_or_assign(key, Kept{received, std::move(message)});
}

bool ProcedureBook::names_rooms(const ProcedureMessage& message) const {
  const auto is_a_room = [this](const std::string& place) {
    return std::ranges::any_of(rules_, [&](const ProcedureRule& rule) { return is_of_room(rule, place); });
  };
  // A resource (AIG) may be a room, or a machine in one.
  return message.names_rooms || std::ranges::any_of(message.planned_places, [&](const PlannedPlace& each) {
           return std::ranges::any_of(each.spellings, is_a_room);
         });
}

std::vector<std::string> ProcedureBook::rooms_of(const ProcedureMessage& message) const {
  if (!names_rooms(message)) return message.places;
  std::vector<std::string> rooms;
  for (const PlannedPlace& place : message.planned_places)
    rooms.insert(rooms.end(), place.spellings.begin(), place.spellings.end());
  return rooms;
}

bool ProcedureBook::concerns(const ProcedureRule& rule, const ProcedureMessage& message) const {
  return rule.locations.empty() || std::ranges::any_of(rooms_of(message), [&](const std::string& place) {
           return is_of_room(rule, place);
         });
}

/// A change that says nothing of rooms, or states no time, as "checked in" may, leaves what was stated
/// before.
void ProcedureBook::keep_plan(ProcedureMessage& message, const ProcedureMessage& before) {
  const auto states = [](const auto& one) { return one.planned || one.is_time_unclear || one.within; };
  if (message.kind != ProcedureMessage::Kind::kAppointment || message.books) return;
  const bool says_nothing_of_rooms =
      !message.names_resources && message.planned_places.empty() && !before.planned_places.empty();
  if (says_nothing_of_rooms) {
    message.places = before.places;
    message.planned_places = before.planned_places;
    message.names_rooms = before.names_rooms;
    message.data.location = before.data.location;
  }
  if (states(message)) {
    for (PlannedPlace& place : message.planned_places) {
      if (!says_nothing_of_rooms) break;
      place.planned = message.planned;
      place.is_time_unclear = message.is_time_unclear;
      place.planned_text = message.data.planned;
      place.within = message.within;
    }
    return;
  }
  if (std::ranges::any_of(message.planned_places, states)) return;
  message.planned = before.planned;
  message.is_time_unclear = before.is_time_unclear;
  message.within = before.within;
  message.data.planned = before.data.planned;
  if (says_nothing_of_rooms) return;
  for (PlannedPlace& place : message.planned_places) {
    const auto same = std::ranges::find_if(before.planned_places, [&](const PlannedPlace& other) {
      return share_a_place(place.spellings, other.spellings);
    });
    if (same == before.planned_places.end()) continue;
    place.planned = same->planned;
    place.is_time_unclear = same->is_time_unclear;
    place.planned_text = same->planned_text;
    place.within = same->within;
  }
}

/// Whatever `by` changes or cancels; what it was called before, it is called still. Where it is not sure that
/// it is that one, both are in doubt, unless they say the same.
ProcedureBook::TakenOut ProcedureBook::take_out_appointment(std::vector<ProcedureMessage>& by) {
  TakenOut taken;
  const auto sameness = [&by](const ProcedureMessage& before) {
    Likeness most = Likeness::kNone;
    for (const ProcedureMessage& message : by) {
      if (is_of_appointment(message)) most = std::max(most, same_appointment(message, before));
    }
    return most;
  };
  // One that was of several patients is only of those whom it names now.
  std::set<std::uint64_t> known;
  for (const auto& [key, kept] : appointments_) {
    if (sameness(kept.message) == Likeness::kSure) known.insert(kept.received.number);
  }
  const auto says_the_same = [&](const ProcedureMessage& message, const ProcedureMessage& before) {
    if (message.kind == ProcedureMessage::Kind::kCancels || message.is_over) return false;
    if (!message.patient.empty() && likeness(message, before) == Likeness::kNone) return false;
    const bool says_when = message.planned || message.is_time_unclear || message.within;
    if (!says_when && message.planned_places.empty()) return true;
    return message.planned == before.planned && share_a_place(rooms_of(message), rooms_of(before));
  };
  const auto is_meant = [&](const Kept& kept) {
    const Likeness same = sameness(kept.message);
    return same == Likeness::kSure || (same == Likeness::kPerhaps && known.contains(kept.received.number));
  };
  for (auto& [key, kept] : appointments_) {
    for (const ProcedureMessage& message : by) {
      const bool may_be = is_of_appointment(message) && !is_meant(kept) &&
                          same_appointment(message, kept.message) != Likeness::kNone;
      if (!may_be || says_the_same(message, kept.message)) continue;
      kept.doubt = Doubt::kOneAppointment;
      taken.is_doubtful = true;
    }
  }
  std::erase_if(appointments_, [&](const auto& each) {
    const Kept& kept = each.second;
    const ProcedureMessage& before = kept.message;
    if (!is_meant(kept)) return false;
    for (ProcedureMessage& message : by) {
      if (message.placer.empty() || (message.placer == before.placer && message.placer_by == Assigner())) {
        message.placer = before.placer;
        message.placer_by = before.placer_by;
      }
      if (message.filler.empty() || (message.filler == before.filler && message.filler_by == Assigner())) {
        message.filler = before.filler;
        message.filler_by = before.filler_by;
      }
      if (message.kind == ProcedureMessage::Kind::kCancels) {
        // Many cancel by the number alone: what it was is not planned for that time and place any more.
        std::vector<std::string> rooms = rooms_of(message);
        for (std::string& room : rooms_of(before)) {
          if (std::ranges::find(rooms, room) == rooms.end()) rooms.push_back(std::move(room));
        }
        message.places = std::move(rooms);
        message.planned_places.clear();
        message.names_rooms = false;
        if (!message.planned) message.planned = before.planned;
        add_numbers(message.numbers, before.numbers);
      }
      keep_plan(message, before);
      // What says nothing of it leaves a waiting list's entry one.
      if (message.says_no_status && !message.books && kept.doubt == Doubt::kStatusUnclear)
        message.is_status_unclear = true;
      const bool is_moved = message.planned && message.planned != before.planned;
      if (!message.books && !is_moved) taken.booked = kept.booked;
    }
    return true;
  });
  return taken;
}

UtcTime ProcedureBook::planned_last(const Kept& kept, const ProcedureMoment& at) {
  UtcTime last = planned(kept, at);
  if (kept.message.within) last = std::max(last, kept.message.within->latest);
  for (const PlannedPlace& place : kept.message.planned_places) {
    last = std::max(last, place.planned.value_or(last));
    if (place.within) last = std::max(last, place.within->latest);
  }
  return last;
}

ProcedureBook::PlannedHere ProcedureBook::planned_here(const ProcedureRule& rule, const Kept& kept,
                                                       const ProcedureMoment& at) {
  const ProcedureMessage& message = kept.message;
  std::optional<PlannedHere> here;
  for (const PlannedPlace& place : message.planned_places) {
    const bool is_here = rule.locations.empty() || std::ranges::any_of(place.spellings, [&](const auto& one) {
                           return is_of_room(rule, one);
                         });
    if (!is_here) continue;
    const bool is_absent = !place.planned && !message.planned && !place.is_time_unclear;
    const PlannedHere found{place.planned.value_or(planned(kept, at)), &place, place.is_time_unclear,
                            place.within, is_absent};
    if (!here) {
      here = found;
      continue;
    }
    const auto distance = [&](const PlannedHere& one) { return std::chrono::abs(one.time - at.utc); };
    const PlannedHere& unclear = here->is_unclear ? *here : found;
    const bool is_unclear = unclear.is_unclear;
    const std::optional<TimeSpan> within = unclear.within;
    if (distance(found) < distance(*here)) here = found;
    here->is_unclear = is_unclear;
    here->within = within;
  }
  if (here) return *here;
  return {planned(kept, at), nullptr, message.is_time_unclear, message.within,
          !message.planned && !message.is_time_unclear};
}

std::optional<UtcTime::duration> ProcedureBook::nearest_unclear(const ProcedureRule& rule, const Kept& kept,
                                                                const ProcedureMoment& at) {
  const PlannedHere here = planned_here(rule, kept, at);
  if (!here.is_unclear && !here.is_absent) return {};
  const auto distance = [&](UtcTime time) { return std::chrono::abs(time - at.utc); };
  UtcTime::duration least = UtcTime::duration::zero();  // of a time of which nothing is known
  if (here.is_absent) {
    // Whoever states no time may mean about now.
    least = distance(at.by_this_clock(kept.received.at));
    return is_within(least, rule.window) ? std::optional(UtcTime::duration::zero()) : std::nullopt;
  }
  if (here.within) {
    least = least_distance(here.within, at.utc);
  } else if (kept.message.planned) {
    // The appointment says when it is, and not when it is here.
    const auto nearer = std::min(distance(planned(kept, at)), distance(planned_last(kept, at)));
    if (!is_within(nearer, rule.window)) return {};
  }
  return is_within(least, rule.window) ? std::optional(least) : std::nullopt;
}

ProcedureData ProcedureBook::data_of(const Kept& kept, const PlannedHere& here) {
  ProcedureData data = kept.message.data;
  if (here.place == nullptr) return data;
  if (!here.place->planned_text.empty()) data.planned = here.place->planned_text;
  if (!here.place->location.empty()) data.location = here.place->location;
  if (!here.place->description.empty() || !here.place->code.empty()) {
    data.description = here.place->description;
    data.code = here.place->code;
    data.coding_system = here.place->coding_system;
  }
  return data;
}

}  // namespace kiroku::recorder
