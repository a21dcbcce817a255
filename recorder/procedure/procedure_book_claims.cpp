#include <algorithm>
#include <set>
#include <utility>

#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/procedure_matching.h"
#include "recorder/procedure/window.h"

namespace kiroku::recorder {

void ProcedureBook::claim() {
  // Most are as they were before the message.
  const auto is_known = [](const Messages& claims, const std::string& key, const Kept& kept) {
    const auto known = claims.find(key);
    if (known == claims.end()) return false;
    const Kept& its = known->second;
    return its.received.number == kept.received.number && its.message.told == kept.message.told &&
           its.message.planned == kept.message.planned && its.message.patient == kept.message.patient &&
           its.message.data.patient == kept.message.data.patient &&
           its.message.data.birth_date == kept.message.data.birth_date &&
           its.message.numbers.size() == kept.message.numbers.size() && its.visits == kept.visits &&
           std::ranges::all_of(kept.since, [&](const auto& each) {
             const auto same = its.since.find(each.first);
             return same != its.since.end() && same->second.number == each.second.number;
           });
  };
  const auto counts = [this](const std::string& place) { return rules_.empty() || is_watched(place); };
  for (const auto& [key, kept] : placed_) {
    if (is_known(claims_, key, kept)) continue;
    std::map<std::string, Arrival> since;
    for (const auto& [place, came] : kept.since) {
      if (kept.way_to(place) != Way::kRecord && counts(place)) since.emplace(place, came);
    }
    if (since.empty()) continue;
    Kept& its = claims_.try_emplace(key, Kept{kept.received, {}}).first->second;
    its.received = kept.received;
    its.message = kept.message;
    its.moved = kept.moved;
    its.apart = kept.apart;
    its.visits.insert(kept.visits.begin(), kept.visits.end());
    for (const auto& [place, came] : since) {
      its.since.insert_or_assign(place, came);
      its.note_way(place, kept.way_to(place));
    }
  }
  for (const auto& [key, kept] : appointments_) {
    if (kept.message.is_over || is_known(planned_claims_, key, kept)) continue;
    if (!std::ranges::any_of(rooms_of(kept.message), counts)) continue;
    planned_claims_.insert_or_assign(key, kept);
  }
}

void ProcedureBook::end_claims(const ProcedureMessage& message) {
  using Kind = ProcedureMessage::Kind;
  if (is_of_appointment(message)) {
    end_claims_of_appointment(message);
  } else if (message.kind == Kind::kLeaves || message.kind == Kind::kDeparts ||
             (message.kind == Kind::kPlaces && message.moves)) {
    end_claims_of_patient(message);
  }
}

void ProcedureBook::end_claims_of_patient(const ProcedureMessage& message) {
  const bool moves = message.kind == ProcedureMessage::Kind::kPlaces;
  // As whoever leaves is known by half a number where nobody else may be meant.
  std::vector<std::string> sure, perhaps;
  for (const auto& [key, its] : claims_) {
    const Likeness alike = likeness(message, its.message);
    if (alike == Likeness::kSure) sure.push_back(key);
    if (alike == Likeness::kPerhaps && !is_another_name(message.data.patient, its.message.data.patient))
      perhaps.push_back(key);
  }
  if (sure.empty() && perhaps.size() == 1 && !moves) sure = std::move(perhaps);
  for (const std::string& key : sure) {
    Kept& its = claims_.find(key)->second;
    std::vector<std::string> claimed;
    for (const auto& [place, came] : its.since) claimed.push_back(place);
    const bool share =
        share_a_place(message.places, its.message.places) || share_a_place(message.places, claimed);
    if (moves) {
      if (message.places.empty() || !takes_away(its, message)) continue;
      // Two systems may number one visit each: whoever is in one place for both is there once.
      if (!message.is_of_any_visit && its.is_of_another_visit(message) && !share) continue;
      std::erase_if(its.since, [&](const auto& each) {
        return std::ranges::find(message.places, each.first) == message.places.end();
      });
    } else {
      const bool is_of_these = share || message.places.empty();
      if (message.kind == ProcedureMessage::Kind::kDeparts && !is_of_these) continue;
      if (its.is_of_another_visit(message) && (message.is_of_record || !share)) continue;
      if (may_leave_another_stay(its, message)) continue;
      its.since.clear();
    }
    if (its.since.empty()) claims_.erase(key);
  }
}

void ProcedureBook::end_claims_of_appointment(const ProcedureMessage& message) {
  using Kind = ProcedureMessage::Kind;
  const auto counts = [this](const std::string& place) { return rules_.empty() || is_watched(place); };
  // One that was of several patients is only of those whom it names now.
  std::set<std::uint64_t> known;
  for (const auto& [key, its] : planned_claims_) {
    if (same_appointment(message, its.message) == Likeness::kSure) known.insert(its.received.number);
  }
  const auto is_ended = [&](Kept& its) {
    const Likeness same = same_appointment(message, its.message);
    const bool is_meant =
        same == Likeness::kSure || (same == Likeness::kPerhaps && known.contains(its.received.number));
    if (!is_meant) return false;
    if (message.kind == Kind::kCancels || message.is_over || same == Likeness::kPerhaps) return true;
    if (names_rooms(message) && !message.is_update) return true;  // these are all; what is left claims anew
    std::vector<PlannedPlace>& places = its.message.planned_places;
    std::erase_if(
        places, [&](const PlannedPlace& place) { return share_a_place(place.spellings, message.taken_out); });
    if (message.planned) {
      its.message.planned = message.planned;
      its.message.is_time_unclear = false;
      its.message.within.reset();
      for (PlannedPlace& place : places) {
        place.planned = message.planned;
        place.is_time_unclear = false;
        place.within.reset();
      }
    }
    if (its.message.names_rooms || !message.taken_out.empty()) {
      its.message.places.clear();
      for (const PlannedPlace& place : places)
        its.message.places.insert(its.message.places.end(), place.spellings.begin(), place.spellings.end());
    }
    return !std::ranges::any_of(rooms_of(its.message), counts);
  };
  for (auto each = planned_claims_.begin(); each != planned_claims_.end();)
    each = is_ended(each->second) ? planned_claims_.erase(each) : std::next(each);
}

void ProcedureBook::give_claims(const ProcedureMessage& before, const ProcedureMessage& message) {
  for (Messages* const claims : {&claims_, &planned_claims_}) {
    std::vector<Kept> given;
    for (auto each = claims->begin(); each != claims->end();) {
      Kept& its = each->second;
      if (its.message.patient == message.patient || likeness(before, its.message) != Likeness::kSure) {
        ++each;
        continue;
      }
      given.push_back(std::move(its));
      each = claims->erase(each);
    }
    for (Kept& its : given) {
      add_numbers(its.message.numbers, message.numbers);
      its.message.patient = message.patient;
      its.message.data.patient_id = message.data.patient_id;
      its.message.data.patient_id_issuer = message.data.patient_id_issuer;
      const bool is_of_plan = claims == &planned_claims_;
      // Both may claim one room: neither takes the other's.
      std::string key = is_of_plan ? key_of_appointment(its.message) : key_of_placed(its);
      const auto known = claims->find(key);
      if (known == claims->end() || is_of_plan) {
        claims->insert_or_assign(std::move(key), std::move(its));
        continue;
      }
      Kept& one = known->second;
      for (const auto& [place, came] : its.since) {
        if (one.since.contains(place)) continue;
        one.since.emplace(place, came);
        one.note_way(place, its.way_to(place));
        one.message.places.push_back(place);
      }
      one.visits.insert(its.visits.begin(), its.visits.end());
    }
  }
}

bool ProcedureBook::is_in_room(const ProcedureRule& rule, const Kept& claim) const {
  return std::ranges::any_of(placed_, [&](const auto& each) {
    const Kept& kept = each.second;
    return came(rule, kept) && likeness(claim.message, kept.message) == Likeness::kSure;
  });
}

bool ProcedureBook::is_claimed(const ProcedureRule& rule, const ProcedureMessage* chosen,
                               std::optional<UtcTime> planned_until, const ProcedureMoment& at,
                               const EndedSince& ended) const {
  const auto is_chosen = [&](const ProcedureMessage& message) {
    return chosen != nullptr && likeness(message, *chosen) == Likeness::kSure;
  };
  const bool is_of_patient = std::ranges::any_of(claims_, [&](const auto& each) {
    const Kept& its = each.second;
    const std::optional<Arrival> came_in = came(rule, its);
    if (!came_in || is_chosen(its.message)) return false;
    const UtcTime since = at.by_this_clock(came_in->at);
    if (since > at.utc || at.utc - since > rule.window || is_in_room(rule, its)) return false;
    return !ended || !ended(its.message.data, since - kFurthestAhead);
  });
  if (is_of_patient || !planned_until) return is_of_patient;
  return std::ranges::any_of(planned_claims_, [&](const auto& each) {
    const Kept& its = each.second;
    if (!concerns(rule, its.message) || is_chosen(its.message)) return false;
    const auto same = appointments_.find(each.first);
    if (same != appointments_.end() && concerns(rule, same->second.message) &&
        likeness(same->second.message, its.message) == Likeness::kSure) {
      return false;
    }
    const bool is_planned_still = std::ranges::any_of(appointments_, [&](const auto& other) {
      const ProcedureMessage& message = other.second.message;
      return concerns(rule, message) && same_appointment(message, its.message) != Likeness::kNone &&
             likeness(message, its.message) == Likeness::kSure;
    });
    if (is_planned_still) return false;
    const PlannedHere here = planned_here(rule, its, at);
    UtcTime time = here.time;
    if (here.is_unclear || here.is_absent) {
      if (nearest_unclear(rule, its, at) != UtcTime::duration::zero()) return false;
      time = at.utc;
    }
    if (time > *planned_until || !is_within(time, at.utc, rule.window)) return false;
    return keeps_waiting(rule, its, time, at, ended);
  });
}

}  // namespace kiroku::recorder
