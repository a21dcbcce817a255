#include <algorithm>
#include <utility>

#include "base/ascii.h"
#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/procedure_matching.h"

namespace kiroku::recorder {
namespace {

/// Not a name that is spelled in another way alone, nor a day of birth of which less is known.
bool is_another_identity(const ProcedureData& one, const ProcedureData& other) {
  const std::string &born = one.birth_date, &others = other.birth_date;
  if (!born.starts_with(others) && !others.starts_with(born)) return true;
  if (one.patient.empty() || other.patient.empty()) return false;
  const std::string given = lower_case(one.patient.given), as_well = lower_case(other.patient.given);
  return !same_but_for_case(one.patient.family, other.patient.family) && !given.starts_with(as_well) &&
         !as_well.starts_with(given);
}

}  // namespace

Objection ProcedureBook::objection(const ProcedureRule& rule, const ProcedureChoice& taken,
                                   const ProcedureMoment& begun) const {
  if (!taken.data) return Objection::kNone;
  const ProcedureData& about = *taken.data;
  ProcedureMessage own;
  own.patient = about.patient_id + "\n" + about.patient_id_issuer;
  own.numbers = about.numbers;
  if (!about.patient_id.empty())
    add_numbers(own.numbers, {{about.patient_id, about.patient_id_issuer, {}, {}}});
  own.data = about;
  ProcedureMessage merged = own;
  resolve(merged);
  const auto alike = [&](const Kept& kept) {
    return std::max(likeness(own, kept.message), likeness(merged, kept.message));
  };
  const auto is_since = [&](const Arrival& when) { return begun.by_this_clock(when.at) >= begun.utc; };

  bool is_another_there = false, is_another_said = false, is_there = false, is_elsewhere = false,
       has_left = false;
  bool is_called_off = false, is_renamed = merged.patient != own.patient;
  for (const auto& [key, kept] : placed_) {
    const std::optional<Arrival> came_in = came(rule, kept);
    const Likeness likeness_of_it = alike(kept);
    if (likeness_of_it == Likeness::kNone) {
      // Whoever is next may be registered there ahead of time.
      const bool is_near = came_in && begun.utc - begun.by_this_clock(came_in->at) <= rule.window;
      if (!is_near) continue;
      const bool was_moved = way_into(rule, kept) == Way::kMoved;
      is_another_there = is_another_there || was_moved;
      is_another_said = is_another_said || (!was_moved && !is_planned(kept));
      continue;
    }
    if (came_in) {
      is_there = true;
      if (kept.doubt == Doubt::kOneNumber || is_another_identity(about, kept.message.data)) is_renamed = true;
    }
    if (likeness_of_it != Likeness::kSure) continue;
    is_elsewhere = is_elsewhere || !came_in;
    for (const auto& [place, went] : kept.gone) {
      if (!is_of_room(rule, place) || !is_since(went.when)) continue;
      (went.is_cancelled ? is_called_off : has_left) = true;
    }
  }
  for (const auto& [key, kept] : ended_) {
    if (alike(kept) != Likeness::kSure || !is_since(kept.received)) continue;
    if (!is_of_appointment(kept.message)) {
      (kept.message.takes_back ? is_called_off : has_left) = true;
    }
  }
  bool is_planned_now = false, is_done = false;
  for (const auto& [key, kept] : appointments_) {
    if (alike(kept) != Likeness::kSure || !concerns(rule, kept.message)) continue;
    if (kept.message.is_over) {
      is_done = is_done || is_since(kept.received);
      continue;
    }
    // Its number is somebody else's now.
    if (kept.doubt == Doubt::kOneAppointment) continue;
    const PlannedHere its = planned_here(rule, kept, begun);
    if (its.is_unclear || its.is_absent || its.time - begun.utc <= kFurthestAhead) is_planned_now = true;
    if (taken.is_by_plan && is_another_identity(about, kept.message.data)) is_renamed = true;
  }

  // Plans that come by a worklist do not say here that somebody who is registered is the next one.
  const bool is_by_messages = about.origin.starts_with("hl7");
  is_another_there = is_another_there || (is_another_said && !is_there && is_by_messages);
  if (is_another_there) return is_there ? Objection::kSeveralThere : Objection::kAnotherThere;
  if (has_left || is_done) return Objection::kOver;
  if (is_renamed) return Objection::kOtherIdentity;
  if (is_there) return Objection::kNone;
  // Nothing but a move that is taken back takes anybody from where an event brought them without a trace.
  if (is_called_off || (!taken.is_by_plan && is_elsewhere)) return Objection::kTakenBack;
  if (!taken.is_by_plan || !is_by_messages || is_planned_now) return Objection::kNone;
  return is_lost(lost_planned_, rule, begun) ? Objection::kNone : Objection::kTakenBack;
}

}  // namespace kiroku::recorder
