#include <algorithm>
#include <set>
#include <utility>

#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/procedure_matching.h"
#include "recorder/procedure/window.h"

namespace kiroku::recorder {

Doubt ProcedureBook::doubt_of_passed(const ProcedureRule& rule, std::optional<std::uint64_t> here,
                                     const ProcedureMoment& at) const {
  Doubt doubt = Doubt::kNone;
  for (const auto& [place, passed] : passed_) {
    const bool is_meant = is_meant_by(rule, place);
    if (!is_meant) continue;
    if (at.by_this_clock(passed.went.at) > at.utc) return Doubt::kLeftMeanwhile;
    if (here && passed.came.number > *here) doubt = Doubt::kMayBeGone;
  }
  return doubt;
}

std::vector<ProcedureData> ProcedureBook::list(const ProcedureRule& rule, ProcedureMoment at) const {
  std::vector<ProcedureData> all;
  std::set<std::string> placed;
  const auto is_near = [&](UtcTime time) { return is_within(at.utc, time, rule.window); };
  for (const auto& [key, kept] : placed_) {
    const std::optional<Arrival> came_in = came(rule, kept);
    if (!came_in) continue;
    const UtcTime since = at.by_this_clock(came_in->at);
    if (!is_near(since)) continue;
    const std::string& patient = kept.message.patient;
    placed.insert(patient);
    std::vector<ProcedureData> planned;
    std::vector<std::optional<UtcTime>> times;
    for (const auto& [appointment, other] : appointments_) {
      if (other.message.patient != patient || other.message.is_over) continue;
      if (!concerns(rule, other.message)) continue;
      const PlannedHere here = planned_here(rule, other, at);
      planned.push_back(data_of(other, here));
      times.emplace_back(here.time);
    }
    all.push_back(kept.message.data);
    all.back().chosen = way_into(rule, kept) == Way::kRecord
                            ? "a correction of the patient's record named the room at " + format_utc(since)
                            : "a message placed the patient in the room at " + format_utc(since);
    if (const auto chosen = nearest(times, at.utc, rule.window).index) complete(all.back(), planned[*chosen]);
  }
  for (const auto& [appointment, kept] : appointments_) {
    if (!concerns(rule, kept.message) || placed.contains(kept.message.patient)) continue;
    if (kept.message.patient.empty() && kept.message.data.patient.empty()) continue;
    const PlannedHere here = planned_here(rule, kept, at);
    const bool may_be_near =
        here.is_unclear ? nearest_unclear(rule, kept, at).has_value() : is_near(here.time);
    if (!may_be_near) continue;
    all.push_back(data_of(kept, here));
    all.back().chosen =
        "an appointment of which a message told at " + format_utc(at.by_this_clock(kept.received.at));
  }
  return all;
}

std::optional<ProcedureBook::Left> ProcedureBook::left(const ProcedureRule& rule,
                                                       const ProcedureMessage& message) const {
  std::optional<Left> last;
  bool was_here = false;
  std::optional<Arrival> from_here;
  const auto note = [&](const Left& one) {
    was_here = was_here || one.is_from_here;
    const bool is_surely_from_here = one.is_from_here && one.is_sure;
    if (is_surely_from_here && (!from_here || from_here->number < one.when.number)) from_here = one.when;
    if (!last || last->when.number < one.when.number) last = one;
  };
  const auto look_at = [&](const Kept& kept, bool is_there) {
    if (is_of_appointment(kept.message)) return;
    const Likeness alike = likeness(message, kept.message);
    if (alike == Likeness::kNone) return;
    const bool is_sure = alike == Likeness::kSure;
    // Whoever departs from a ward (A09) has left no more than that.
    const bool departs = kept.message.kind == ProcedureMessage::Kind::kDeparts &&
                         !kept.message.is_of_record && !kept.gone.empty();
    if (!is_there && (!departs || rule.locations.empty()))
      note({kept.received, rule.locations.empty(), is_sure, &kept});
    for (const auto& [place, went] : kept.gone) {
      const bool is_gone = !went.is_cancelled && !kept.since.contains(place);
      if (is_gone && is_of_room(rule, place)) note({went.when, true, is_sure, &kept});
    }
  };
  for (const auto& [key, kept] : placed_) look_at(kept, true);
  for (const auto& [key, kept] : ended_) look_at(kept, false);
  if (last) last->is_from_here = was_here;
  if (last) last->from_here = from_here;
  return last;
}

bool ProcedureBook::has_left_since(const ProcedureRule& rule, const Kept& kept,
                                   const std::optional<TimeSpan>& within, const ProcedureMoment& at,
                                   const EndedSince& ended) const {
  const std::optional<Left> gone = left(rule, kept.message);
  if (!gone || !gone->from_here) return false;
  const Arrival& booked = kept.booked ? *kept.booked : kept.received;
  if (booked.number > gone->from_here->number) return false;
  const UtcTime went = at.by_this_clock(gone->from_here->at);
  const UtcTime since = within ? within->earliest : at.by_this_clock(booked.at);
  constexpr std::chrono::hours kDay{24};
  const bool is_near = is_within(at.utc - went, std::max<std::chrono::nanoseconds>(rule.window, kDay));
  if (went < since || at.utc < went || !is_near) return false;
  // They may have been brought by mistake, or for what else is planned for them here.
  const bool has_another = std::ranges::any_of(appointments_, [&](const auto& each) {
    const Kept& other = each.second;
    return &other != &kept && other.message.patient == kept.message.patient && concerns(rule, other.message);
  });
  return !has_another && ended && ended(kept.message.data, went - kFurthestAhead);
}

bool ProcedureBook::was_short(const ProcedureRule& rule, const Left& left, const ProcedureMessage& message,
                              const ProcedureMoment& at, const EndedSince& ended) const {
  if (!left.from_here || left.from_here->number != left.when.number) return false;
  const auto there = std::ranges::find_if(passed_, [&](const auto& each) {
    return is_meant_by(rule, each.first) && each.second.went.number == left.when.number;
  });
  if (there == passed_.end()) return false;
  const ProcedureMoment &came = there->second.came.at, &went = left.when.at;
  if (went.since_boot - came.since_boot >= kShortest) return false;
  return !ended || !ended(message.data, at.by_this_clock(came) - kFurthestAhead);
}

Standing ProcedureBook::standing(const ProcedureRule& rule, const Left& left, const ProcedureMessage& message,
                                 UtcTime planned, const ProcedureMoment& at, const EndedSince& ended) const {
  const UtcTime went = at.by_this_clock(left.when.at);
  if (at.utc - went > rule.window) return Standing::kOpen;
  if (!left.is_sure || went > at.utc) return Standing::kDoubtful;
  if (planned <= went)
    return was_short(rule, left, message, at, ended) ? Standing::kDoubtful : Standing::kDone;
  if (!left.is_from_here || planned - went > kFurthestAhead) return Standing::kDoubtful;
  // It went faster than it was planned, if a case about them has ended since they came; else they were only
  // brought, as by mistake. Unless that was another one.
  if (!ended || !ended(message.data, went - kFurthestAhead)) return Standing::kDoubtful;
  const bool has_earlier = std::ranges::any_of(appointments_, [&](const auto& each) {
    const Kept& other = each.second;
    if (other.message.patient != message.patient || !concerns(rule, other.message)) return false;
    const UtcTime time = planned_here(rule, other, at).time;
    return time < planned && is_within(went - time, rule.window);
  });
  return has_earlier ? Standing::kDoubtful : Standing::kDone;
}

Standing ProcedureBook::standing(const ProcedureRule& rule, const Kept& kept, UtcTime planned,
                                 const ProcedureMoment& at, const EndedSince& ended) const {
  const std::optional<Left> gone = left(rule, kept.message);
  if (!gone) return Standing::kOpen;
  const Arrival& booked = kept.booked ? *kept.booked : kept.received;
  if (booked.number > gone->when.number) {
    // Booked anew; what is written up later is not.
    return planned + kSameMoment >= at.by_this_clock(gone->when.at) ? Standing::kOpen : Standing::kDoubtful;
  }
  if (gone->of->is_of_another_visit(kept.message) && !gone->is_from_here) return Standing::kOpen;
  return standing(rule, *gone, kept.message, planned, at, ended);
}

Standing ProcedureBook::standing(const ProcedureRule& rule, const ProcedureData& data,
                                 std::optional<UtcTime> planned, const ProcedureMoment& at,
                                 const EndedSince& ended) const {
  ProcedureMessage message;
  message.patient = data.patient_id + "\n" + data.patient_id_issuer;
  message.numbers = {{data.patient_id, data.patient_id_issuer, {}, {}}};
  message.data = data;
  message.visit = data.visit;
  if (data.patient_id.empty()) return Standing::kOpen;
  // A worklist says nothing of when it was booked; appointments do.
  bool is_over = false;
  for (const auto& [key, kept] : appointments_) {
    if (!concerns(rule, kept.message) || likeness(message, kept.message) == Likeness::kNone) continue;
    const UtcTime time = planned_here(rule, kept, at).time;
    if (!kept.message.is_over && standing(rule, kept, time, at, ended) == Standing::kOpen)
      return Standing::kOpen;
    const bool is_that_one = planned && std::chrono::abs(time - *planned) <= kFurthestAhead;
    is_over = is_over || (kept.message.is_over && is_that_one);
  }
  if (is_over) return Standing::kDone;
  if (const std::optional<Left> gone = left(rule, message)) {
    if (gone->is_from_here || !gone->of->is_of_another_visit(message)) {
      const Standing stands = standing(rule, *gone, message, planned.value_or(at.utc), at, ended);
      if (stands != Standing::kOpen) return stands;
    }
  }
  const bool is_cancelled = std::ranges::any_of(ended_, [&](const auto& each) {
    const Kept& kept = each.second;
    if (!is_of_appointment(kept.message) || !concerns(rule, kept.message)) return false;
    if (likeness(message, kept.message) == Likeness::kNone) return false;
    return !planned || !kept.message.planned || is_within(*kept.message.planned, *planned, rule.window);
  });
  return is_cancelled ? Standing::kDoubtful : Standing::kOpen;
}

bool ProcedureBook::keeps_waiting(const ProcedureRule& rule, const Kept& kept, UtcTime planned,
                                  const ProcedureMoment& at, const EndedSince& ended) const {
  const Standing stands = standing(rule, kept, planned, at, ended);
  if (stands == Standing::kDone) return false;
  if (ended && ended(kept.message.data, planned - kFurthestAhead)) return false;
  if (stands == Standing::kOpen) return true;
  const std::optional<Left> gone = left(rule, kept.message);
  const bool is_gone =
      gone && (gone->is_from_here || gone->of->message.kind == ProcedureMessage::Kind::kLeaves);
  return !is_gone || at.by_this_clock(gone->when.at) > at.utc;
}

bool ProcedureBook::is_against_plan(const ProcedureRule& rule, const Kept& here, const ProcedureMoment& at,
                                    const EndedSince& ended) const {
  std::optional<UtcTime> own, others;
  for (const auto& [appointment, kept] : appointments_) {
    if (!concerns(rule, kept.message) || is_over(kept, at)) continue;
    const PlannedHere its = planned_here(rule, kept, at);
    UtcTime time = its.time;
    if (its.is_unclear || its.is_absent) {
      if (nearest_unclear(rule, kept, at) != UtcTime::duration::zero()) continue;
      time = at.utc;
    }
    if (!is_within(time, at.utc, rule.window) || time - at.utc > kFurthestAhead) continue;
    const bool is_own = likeness(kept.message, here.message) == Likeness::kSure;
    if (!is_own && !keeps_waiting(rule, kept, time, at, ended)) continue;
    std::optional<UtcTime>& earliest = is_own ? own : others;
    if (!earliest || time < *earliest) earliest = time;
  }
  return others && (!own || *others < *own);
}

bool ProcedureBook::is_planned(const Kept& kept) const {
  return std::ranges::any_of(appointments_, [&](const auto& each) {
    return likeness(each.second.message, kept.message) == Likeness::kSure;
  });
}

UtcTime ProcedureBook::stay_of(const ProcedureRule& rule, const Kept& here, UtcTime since,
                               const ProcedureMoment& at) {
  // That they came may be told after their case was ended. A stay before this one is over where they left.
  std::optional<UtcTime> left;
  for (const auto& [place, went] : here.gone) {
    const bool is_here = rule.locations.empty() || is_of_room(rule, place);
    if (is_here && went.is_event && !went.is_cancelled)
      left = std::max(left.value_or(UtcTime{}), at.by_this_clock(went.when.at));
  }
  return left ? std::min(since, *left + kFurthestAhead)
              : std::min(since, at.utc - std::chrono::duration_cast<UtcTime::duration>(rule.window));
}

bool ProcedureBook::may_be_left_behind(const ProcedureRule& rule, const Kept& here, std::uint64_t since,
                                       const ProcedureMoment& at) const {
  if (!is_newborn(here.message.data.birth_date, at.utc)) return false;
  return std::ranges::any_of(passed_, [&](const auto& each) {
    const auto& [place, passed] = each;
    const bool is_meant = is_meant_by(rule, place);
    return is_meant && passed.went.number > since;
  });
}

ProcedureChoice ProcedureBook::choose(const ProcedureRule& rule, const ProcedureMoment& at,
                                      const EndedSince& ended) const {
  const Kept* here = nullptr;
  UtcTime here_since;
  std::vector<const Kept*> on_record;
  std::optional<std::uint64_t> here_number;
  bool is_on_record = false;  // somebody is, which brings nobody there
  for (const auto& [patient, kept] : placed_) {
    const std::optional<Arrival> came_in = came(rule, kept);
    if (!came_in) continue;
    const UtcTime since = at.by_this_clock(came_in->at);
    if (std::chrono::abs(at.utc - since) > rule.window) continue;
    if (way_into(rule, kept) == Way::kRecord) {
      is_on_record = true;
      on_record.push_back(&kept);
      continue;
    }
    if (here != nullptr) return {{}, Doubt::kSeveralThere};
    here = &kept;
    here_since = since;
    here_number = came_in->number;
  }
  if (here != nullptr && is_on_record) return {{}, Doubt::kSeveralThere};
  if (const Doubt doubt = doubt_of_passed(rule, here_number, at); doubt != Doubt::kNone) return {{}, doubt};
  const bool is_here_in_doubt = here != nullptr && here->doubt != Doubt::kNone;
  // Where every place is this room, they are nowhere else.
  if (is_here_in_doubt && !(here->doubt == Doubt::kRecordElsewhere && rule.locations.empty()))
    return {{}, here->doubt};
  if (is_lost(lost_placed_, rule, at)) return {{}, Doubt::kNotKept};
  if (here != nullptr && way_into(rule, *here) == Way::kRegistered && is_against_plan(rule, *here, at, ended))
    return {{}, Doubt::kOnlyRegistered};
  if (here != nullptr && may_be_left_behind(rule, *here, *here_number, at)) return {{}, Doubt::kNewborn};
  if (here != nullptr) {
    const bool is_registered = way_into(rule, *here) == Way::kRegistered;
    const auto until = is_registered ? std::optional(at.utc + kFurthestAhead) : std::nullopt;
    if (is_claimed(rule, &here->message, until, at, ended)) return {{}, Doubt::kNotSeenOff};
  }
  std::vector<const Kept*> planned;
  std::vector<PlannedHere> in_room;
  std::vector<std::optional<UtcTime>> times;
  std::optional<UtcTime::duration> unclear;  // the nearest that one of them may be
  const Kept* only_unclear = nullptr;        // of whoever is here
  PlannedHere only_unclear_here{};
  std::size_t unclear_count = 0;
  std::vector<const Kept*> over_since;  // the case began
  for (const auto& [appointment, kept] : appointments_) {
    if (!concerns(rule, kept.message)) continue;
    if (kept.message.is_over) {
      const bool is_near = is_within(planned_here(rule, kept, at).time, at.utc, rule.window);
      if (!is_over(kept, at) && is_near) over_since.push_back(&kept);
      continue;
    }
    const bool is_in_doubt = kept.doubt != Doubt::kNone;
    if (here != nullptr && (is_in_doubt || kept.message.patient != here->message.patient)) continue;
    const PlannedHere its = planned_here(rule, kept, at);
    // A slot of nobody, or somebody: as long as one may begin late.
    if (kept.message.patient.empty() && !is_within(its.time, at.utc, kFurthestAhead)) continue;
    const bool is_unclear = its.is_unclear || (its.is_absent && here == nullptr);
    if (is_unclear) {
      const std::optional<UtcTime::duration> nearness = nearest_unclear(rule, kept, at);
      if (!nearness) continue;
      const bool is_nearer = here == nullptr && (!unclear || *nearness < *unclear);
      if (is_nearer && !has_left_since(rule, kept, its.is_unclear ? its.within : std::nullopt, at, ended))
        unclear = nearness;
      only_unclear = &kept;
      only_unclear_here = its;
      ++unclear_count;
      continue;
    }
    planned.push_back(&kept);
    in_room.push_back(its);
    times.emplace_back(its.time);
  }
  NearestPlan plan = nearest(times, at.utc, rule.window);
  // Of whoever left since it was booked nothing is still to come: what is next counts.
  for (bool is_changed = here == nullptr; is_changed && plan.index;) {
    is_changed = false;
    for (const std::size_t each : plan.equally_near) {
      if (standing(rule, *planned[each], *times[each], at, ended) != Standing::kDone) continue;
      times[each].reset();
      is_changed = true;
    }
    if (is_changed) plan = nearest(times, at.utc, rule.window);
  }
  // Whoever is here has one, though it does not say when.
  if (here != nullptr && !plan.index && unclear_count == 1) {
    planned.push_back(only_unclear);
    in_room.push_back(only_unclear_here);
    times.emplace_back(at.utc);
    plan = nearest(times, at.utc, rule.window);
  }
  const auto chosen = plan.index;
  if (here == nullptr) {
    const bool may_be_unclear =
        unclear && (!chosen || *unclear <= std::chrono::abs(*times[*chosen] - at.utc));
    if (may_be_unclear) return {{}, Doubt::kTimeUnclear};
    if (is_lost(lost_planned_, rule, at)) return {{}, Doubt::kNotKept};
    // Whoever else may be there is not seen by what is left.
    const auto until = chosen ? std::max(at.utc, *times[*chosen]) : at.utc + kFurthestAhead;
    if (is_claimed(rule, chosen ? &planned[*chosen]->message : nullptr, until, at, ended))
      return {{}, Doubt::kNotSeenOff};
    if (!chosen) return {{}, is_on_record ? Doubt::kRecordAlone : Doubt::kNone};
    const bool is_another_there = std::ranges::any_of(on_record, [&](const Kept* each) {
      return likeness(each->message, planned[*chosen]->message) != Likeness::kSure && !is_planned(*each);
    });
    if (is_another_there) return {{}, Doubt::kRecordAgainstPlan};
    // Which of two patients it is nobody can tell.
    const bool is_anybodys = std::ranges::any_of(plan.equally_near, [&](std::size_t each) {
      return planned[each]->message.patient != planned[*chosen]->message.patient;
    });
    if (is_anybodys) return {{}, Doubt::kTwoPlanned};
    if (planned[*chosen]->doubt != Doubt::kNone) return {{}, planned[*chosen]->doubt};
    if (plan.is_far_ahead) return {{}, Doubt::kTooEarly};
    if (standing(rule, *planned[*chosen], *times[*chosen], at, ended) == Standing::kDoubtful)
      return {{}, Doubt::kLeftAlready};
    // Whose operation ended meanwhile may be whose it is.
    const bool is_anothers = std::ranges::any_of(over_since, [&](const Kept* each) {
      return likeness(each->message, planned[*chosen]->message) != Likeness::kSure;
    });
    if (is_anothers) return {{}, Doubt::kLeftMeanwhile};
    // The room may be late, and whoever was to come before may be there.
    for (std::size_t each = 0; each < times.size(); ++each) {
      const bool is_before = times[each] && *times[each] < *times[*chosen] &&
                             is_within(*times[each], at.utc, rule.window) &&
                             likeness(planned[each]->message, planned[*chosen]->message) != Likeness::kSure;
      if (is_before && keeps_waiting(rule, *planned[each], *times[each], at, ended))
        return {{}, Doubt::kEarlierOpen};
    }
  }
  const auto count = std::count_if(times.begin(), times.end(), [&](const auto& time) {
    return time && is_within(*time, at.utc, rule.window);
  });
  ProcedureData appointment;
  if (chosen) {
    appointment = data_of(*planned[*chosen], in_room[*chosen]);
    appointment.chosen =
        "the appointment nearest to the beginning, of " + std::to_string(count) + " within " +
        std::to_string(std::chrono::duration_cast<std::chrono::minutes>(rule.window).count()) + " minutes";
  }
  if (chosen) appointment.numbers = planned[*chosen]->message.numbers;
  if (here == nullptr) return {std::move(appointment), Doubt::kNone, true};
  ProcedureData found = here->message.data;
  found.numbers = here->message.numbers;
  found.chosen = "the only patient whom messages placed in the room, at " + format_utc(here_since);
  if (chosen) complete(found, appointment);
  return {std::move(found), Doubt::kNone, false, stay_of(rule, *here, here_since, at)};
}

}  // namespace kiroku::recorder
