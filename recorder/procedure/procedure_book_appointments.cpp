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
  kept.doubt = kept.message.is_status_unclear   ? Doubt::kStatusUnclear
               : before.is_doubtful             ? Doubt::kOneAppointment
               : kept.message.are_rooms_unclear ? Doubt::kRoomUnclear
               : kept.message.patient.empty()   ? Doubt::kUnnamed
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

/// A change leaves the rooms that it does not take out by name, unless it states all that there are.
void ProcedureBook::keep_rooms(ProcedureMessage& message, const ProcedureMessage& before) const {
  const bool names_any = names_rooms(message);
  if (names_any && !message.is_update) return;  // these are all
  const auto says_by_pv1 = [](const ProcedureMessage& one) {
    return std::ranges::any_of(one.places, [&](const std::string& place) {
      return std::ranges::none_of(one.planned_places, [&](const PlannedPlace& each) {
        return std::ranges::find(each.spellings, place) != each.spellings.end();
      });
    });
  };
  const bool is_by_pv1 = !names_rooms(before);
  if (is_by_pv1 && (names_any || (says_by_pv1(message) && before.planned_places.empty()))) return;
  const bool is_another_place = says_by_pv1(message) && !share_a_place(message.places, before.places);
  if (is_by_pv1 && says_by_pv1(before) && is_another_place) message.are_rooms_unclear = true;
  const auto is_in = [](const PlannedPlace& place, const std::vector<PlannedPlace>& places) {
    return std::ranges::any_of(
        places, [&](const PlannedPlace& other) { return share_a_place(place.spellings, other.spellings); });
  };
  const bool names_a_new_one = std::ranges::any_of(
      message.planned_places, [&](const PlannedPlace& each) { return !is_in(each, before.planned_places); });
  // What it states of these is theirs from now on.
  std::vector<PlannedPlace> stated = std::exchange(message.planned_places, {});
  const bool states_time = message.planned || message.is_time_unclear || message.within;
  const bool is_another_time = states_time && (!message.planned || message.planned != before.planned);
  bool keeps_unnamed = false;
  for (const PlannedPlace& place : before.planned_places) {
    if (share_a_place(place.spellings, message.taken_out)) continue;
    const auto own = std::ranges::find_if(
        stated, [&](const PlannedPlace& other) { return share_a_place(place.spellings, other.spellings); });
    if (own == stated.end()) {
      message.planned_places.push_back(place);
      keeps_unnamed = true;
      if (!is_another_time) continue;
      message.planned_places.back().planned = message.planned;
      message.planned_places.back().is_time_unclear = message.is_time_unclear;
      message.planned_places.back().planned_text = message.data.planned;
      message.planned_places.back().within = message.within;
    } else {
      message.planned_places.push_back(std::move(*own));
      stated.erase(own);
    }
  }
  for (PlannedPlace& place : stated) message.planned_places.push_back(std::move(place));
  // Another room in place of one, or beside it.
  if (names_any && names_a_new_one && keeps_unnamed && !message.adds_rooms) message.are_rooms_unclear = true;
  message.names_rooms = message.names_rooms || before.names_rooms;
  if (names_rooms(message)) {
    message.places.clear();
    for (const PlannedPlace& place : message.planned_places)
      message.places.insert(message.places.end(), place.spellings.begin(), place.spellings.end());
  } else {
    message.places = before.places;
  }
  if (keeps_unnamed || message.data.location.empty()) message.data.location = before.data.location;
}

/// A change that says nothing of rooms, or states no time, as "checked in" may, leaves what was stated
/// before.
void ProcedureBook::keep_plan(ProcedureMessage& message, const ProcedureMessage& before) const {
  const auto states = [](const auto& one) { return one.planned || one.is_time_unclear || one.within; };
  if (message.kind != ProcedureMessage::Kind::kAppointment || (message.books && !message.rebooks)) return;
  keep_rooms(message, before);
  if (states(message)) return;
  const auto is_kept = [&](const PlannedPlace& place) {
    return std::ranges::any_of(before.planned_places, [&](const PlannedPlace& other) {
      return place.planned == other.planned && share_a_place(place.spellings, other.spellings);
    });
  };
  const bool states_one = std::ranges::any_of(
      message.planned_places, [&](const PlannedPlace& each) { return states(each) && !is_kept(each); });
  if (states_one) return;
  message.planned = before.planned;
  message.is_time_unclear = before.is_time_unclear;
  message.within = before.within;
  message.data.planned = before.data.planned;
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

/// Whose appointment a change is that names nobody: whose it was. Of one that is not known nobody can tell.
void ProcedureBook::name_patients(std::vector<ProcedureMessage>& messages) {
  std::vector<ProcedureMessage> named;
  for (ProcedureMessage& message : messages) {
    if (message.kind != ProcedureMessage::Kind::kAppointment || !message.patient.empty()) {
      named.push_back(std::move(message));
      continue;
    }
    std::set<std::string> known;
    for (Messages* const those : {&appointments_, &ended_}) {
      if (!known.empty()) break;  // what was cancelled counts where nothing is planned
      for (auto& [key, kept] : *those) {
        const ProcedureMessage& before = kept.message;
        const bool is_that_one = is_of_appointment(before) && !before.patient.empty() &&
                                 same_appointment(message, before) == Likeness::kSure;
        if (!is_that_one) continue;
        if (is_another_name(message.data.patient, before.data.patient)) {
          kept.doubt = Doubt::kOneAppointment;
          continue;
        }
        if (!known.insert(before.patient).second) continue;
        ProcedureMessage one = message;
        one.patient = before.patient;
        one.numbers = before.numbers;
        one.facility = before.facility;
        one.data.patient_id = before.data.patient_id;
        one.data.patient_id_issuer = before.data.patient_id_issuer;
        one.data.patient = before.data.patient;
        one.data.birth_date = before.data.birth_date;
        one.data.sex = before.data.sex;
        named.push_back(std::move(one));
      }
    }
    if (known.empty()) named.push_back(std::move(message));
  }
  messages = std::move(named);
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
      if (kept.doubt == Doubt::kRoomUnclear && !message.names_resources && !message.books)
        message.are_rooms_unclear = true;
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
