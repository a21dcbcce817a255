#include <algorithm>
#include <utility>

#include "base/ascii.h"
#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/procedure_matching.h"

namespace kiroku::recorder {

/// It may be whoever is in a place that it names.
void ProcedureBook::leave_unnamed(const ProcedureMessage& message) {
  ++strangers_left_;
  for (auto& [patient, kept] : placed_) {
    if (share_a_place(message.places, kept.message.places)) kept.doubt = Doubt::kNobodyNamed;
  }
}

void ProcedureBook::pass(const std::string& place, const Arrival& came, const Arrival& went) {
  note_change(place, went);
  const auto [known, added] = passed_.try_emplace(lower_case(place), Passed{came, went});
  if (added) return;
  if (known->second.came.number < came.number) known->second.came = came;
  if (known->second.went.number < went.number) known->second.went = went;
}

void ProcedureBook::pass(const Kept& gone, const Arrival& went) {
  pass("", gone.received, went);
  for (const auto& [place, came] : gone.since) pass(place, came, went);
}

void ProcedureBook::leave(ProcedureMessage message, const Arrival& received) {
  const std::vector<std::string> known = known_as(message, false);
  const bool leaves = message.kind == ProcedureMessage::Kind::kLeaves;
  if (known.empty() && leaves && has_left(message) != Likeness::kSure) ++strangers_left_;
  bool is_gone = leaves, is_still_there = false;
  const bool is_visit_known = std::ranges::any_of(known, [&](const std::string& patient) {
    return placed_.find(patient)->second.has_visit(message.visit);
  });
  Kept ended{received, {}};
  std::map<std::string, Went>& gone = ended.gone;
  for (const std::string& patient : known) {
    const auto found = placed_.find(patient);
    Kept& kept = found->second;
    const bool share = share_a_place(message.places, kept.message.places);
    // Whoever is seen off elsewhere, late, is where they came since.
    if (!leaves && !message.places.empty() && !share) continue;
    // Nor is anybody seen off by half a number and another name.
    if (likeness(message, kept.message) != Likeness::kSure &&
        is_another_name(message.data.patient, kept.message.data.patient)) {
      kept.doubt = Doubt::kOneNumber;
      is_still_there = true;
      continue;
    }
    // Whoever is discharged from another visit is where this one has them, as far as that goes.
    if (kept.is_of_another_visit(message) && (message.is_of_record || !share)) {
      if (leaves && !is_visit_known) kept.doubt = Doubt::kOtherVisit;
      is_still_there = true;
      continue;
    }
    if (may_leave_another_stay(kept, message)) {
      kept.doubt = Doubt::kOtherVisit;
      is_still_there = true;
      note_change("", received);
      for (const auto& [place, came] : kept.since) note_change(place, received);
      continue;
    }
    pass(kept, received);
    add_numbers(message.numbers, kept.message.numbers);
    if (message.data.birth_date.empty()) message.data.birth_date = kept.message.data.birth_date;
    if (message.data.patient.empty()) message.data.patient = kept.message.data.patient;
    if (message.visit.empty()) message.visit = kept.message.visit;
    ended.visits.insert(kept.visits.begin(), kept.visits.end());
    gone.insert(kept.gone.begin(), kept.gone.end());
    for (const auto& [place, came] : kept.since) gone.insert_or_assign(place, Went{received, true});
    placed_.erase(found);
    is_gone = true;
  }
  if (!is_gone || is_still_there) return;
  gone.merge(take_back(message));
  leave_identity(message);
  const std::string key = key_of_ended(message);
  ended.note_visit(message);
  ended.message = std::move(message);
  ended_.insert_or_assign(key, std::move(ended));
}

std::map<std::string, ProcedureBook::Went> ProcedureBook::take_back(const ProcedureMessage& message) {
  std::map<std::string, Went> gone;
  std::erase_if(ended_, [&](const auto& each) {
    const Kept& kept = each.second;
    if (is_of_appointment(kept.message) || likeness(message, kept.message) != Likeness::kSure) return false;
    for (const auto& [place, went] : kept.gone) {
      const auto [known, added] = gone.try_emplace(place, went);
      if (!added && known->second.when.number < went.when.number) known->second = went;
    }
    return true;
  });
  return gone;
}

void ProcedureBook::place(ProcedureMessage message, const Arrival& received, bool is_in_doubt) {
  auto known = of_visit(message);
  const auto others = known == placed_.end() ? known_as(message, true) : std::vector<std::string>();
  if (others.size() == 1) {
    // By another form of their number: they have not come as somebody else.
    known = placed_.find(others.front());
    message.patient = known->second.message.patient;
    message.data.patient_id = known->second.message.data.patient_id;
    message.data.patient_id_issuer = known->second.message.data.patient_id_issuer;
  }
  bool says_where = message.kind == ProcedureMessage::Kind::kPlaces && !message.places.empty();
  Doubt doubt = is_in_doubt ? Doubt::kToldLate : Doubt::kNone;
  std::map<std::string, Went> went_with_visits;
  const bool is_of_another = known != placed_.end() && says_where && !message.is_of_any_visit &&
                             known->second.is_of_another_visit(message) &&
                             !share_a_place(message.places, known->second.message.places);
  if (is_of_another) {
    // A record of another visit says nothing of now.
    if (!message.moves) return;
    set_aside(known, received);
    known = placed_.end();
  } else if (message.moves && !message.registers && says_where &&
             (message.visit.empty() || message.is_of_any_visit)) {
    went_with_visits = drop_set_aside(message.patient, received);
    known = placed_.find(message.patient);
    if (known != placed_.end()) known->second.gone.merge(went_with_visits);
  }
  if (known == placed_.end()) {
    // A change of somebody's address, or a record that is begun, brings nobody into the room. Where every
    // message is about one room, an event of arriving does without a place.
    if (!says_where && !message.moves) return;
    // A correction of the record of somebody who left names the place where they were.
    const Likeness had_left = message.moves ? Likeness::kNone : has_left(message);
    if (had_left == Likeness::kSure) return;
    if (had_left == Likeness::kPerhaps) doubt = Doubt::kLeftAlready;
    const std::optional<UtcTime> moved = message.moves ? message.happened : std::nullopt;
    Kept kept{received, std::move(message), {}, doubt, moved};
    kept.gone = take_back(kept.message);
    kept.gone.merge(went_with_visits);
    if (doubt == Doubt::kNone && is_before_leaving(kept.message, kept)) kept.doubt = Doubt::kToldLate;
    if (kept.message.places.empty()) kept.note_way("", way_of(kept.message));
    kept.note_visit(kept.message);
    note_change("", received);
    for (const std::string& place : kept.message.places) {
      kept.since.emplace(place, received);
      kept.note_way(place, way_of(kept.message));
      note_change(place, received);
    }
    const bool arrives = kept.message.moves;
    const std::string key = key_of_placed(kept);
    const auto added = placed_.insert_or_assign(key, std::move(kept)).first;
    if (arrives && says_where) join_visits(added, received);
    return;
  }
  Kept& kept = known->second;
  add_numbers(message.numbers, kept.message.numbers);
  const bool stays = message.moves && says_where && !takes_away(kept, message);
  const bool arrives = message.moves && !stays && (says_where || kept.message.places.empty());
  const bool is_old_news = stays && message.sender == kept.message.sender && message.happened && kept.moved &&
                           *message.happened + kSameMoment < *kept.moved;
  if (is_old_news) says_where = false;
  if (says_where && !arrives && !stays) says_where = leave_out_gone(message, kept);
  if (says_where && arrives && is_before_leaving(message, kept)) doubt = Doubt::kToldLate;
  const std::vector<std::string> named = message.places;
  if (says_where && !arrives && keep_places(message, kept) && doubt == Doubt::kNone &&
      kept.doubt == Doubt::kNone)
    doubt = stays ? Doubt::kRegisteredElsewhere : Doubt::kRecordElsewhere;
  // Whoever only sends other facts (A08, A31) of somebody who was there before does not say that they came
  // anew, after whoever came since.
  bool comes = arrives;
  if (says_where) {
    std::map<std::string, Arrival> since;
    std::map<std::string, Way> ways;
    for (const std::string& place : message.places) {
      const auto before = kept.since.find(place);
      const bool was_there = before != kept.since.end();
      // Where somebody came they are not less surely for what is registered, or on record.
      const Way way = std::max(way_of(message), was_there ? kept.way_to(place) : Way::kRecord);
      if (way != Way::kMoved) ways.emplace(place, way);
      if (was_there && std::ranges::find(named, place) == named.end()) {
        since.emplace(place, before->second);
        continue;
      }
      const bool other_came = was_there && somebody_else_came(message.patient, place, before->second);
      // Whoever is announced once more where they are (A02 behind A10, a message sent again) changed nothing.
      if (!was_there || (arrives && other_came)) note_change(place, received);
      const bool is_no_news = !arrives && other_came;
      since.emplace(place, is_no_news ? before->second : received);
      comes = comes || !is_no_news;
    }
    for (const auto& [place, came] : kept.since) {
      if (since.contains(place)) continue;
      // Of whoever never was there nobody else's being there is in doubt.
      if (message.cancels_move) {
        note_change(place, received);
      } else {
        pass(place, came, received);
      }
      const Went went{received, arrives, message.cancels_move};
      // Whoever was there by mistake alone has not left it since they were there before.
      if (message.cancels_move) {
        kept.gone.try_emplace(place, went).first->second.is_event = true;
      } else {
        kept.gone.insert_or_assign(place, went);
      }
    }
    kept.since = std::move(since);
    kept.ways = std::move(ways);
    kept.note_visit(message);
    if (message.visit.empty()) message.visit = kept.message.visit;
  } else {
    if (arrives && !kept.moved) note_change("", received);
    if (arrives && kept.since.empty()) kept.note_way("", std::max(way_of(message), kept.way_to("")));
    message.places = kept.message.places;
    message.data.location = kept.message.data.location;
    message.visit = kept.message.visit;
    if (!kept.message.data.visit.empty()) message.data.visit = kept.message.data.visit;
  }
  if (comes) kept.received = received;
  if (arrives) kept.moved = message.happened;
  if (!arrives) message.kept_bed = kept.message.kept_bed;
  if (!arrives || message.account.empty()) message.account = kept.message.account;
  // Only who is said to have come anew is there for sure again.
  kept.doubt = doubt != Doubt::kNone ? doubt : arrives ? Doubt::kNone : kept.doubt;
  kept.message = std::move(message);
  if (arrives && says_where) join_visits(known, received);
}

void ProcedureBook::join_visits(Messages::iterator arrived, const Arrival& received) {
  Kept& kept = arrived->second;
  std::erase_if(placed_, [&](const auto& each) {
    const Kept& other = each.second;
    const bool is_same = &other != &kept && other.message.patient == kept.message.patient &&
                         share_a_place(other.message.places, kept.message.places);
    if (!is_same) return false;
    for (const auto& [place, came] : other.since) {
      if (kept.since.contains(place)) kept.note_way(place, std::max(kept.way_to(place), other.way_to(place)));
    }
    // Whoever was set aside was there before the other came.
    const bool is_newer = other.apart.empty();
    for (const auto& [sender, visit] : other.visits) {
      if (is_newer && sender != kept.message.sender) {
        kept.visits.insert_or_assign(sender, visit);
      } else {
        kept.visits.emplace(sender, visit);
      }
    }
    kept.gone.insert(other.gone.begin(), other.gone.end());
    leave_behind(other, received, kept);
    return true;
  });
  // Nobody else of that patient is there any more: they are no other visit's.
  if (kept.apart.empty() || placed_.contains(kept.message.patient)) return;
  auto alone = placed_.extract(arrived);
  alone.mapped().apart.clear();
  alone.key() = key_of_placed(alone.mapped());
  placed_.insert(std::move(alone));
}

void ProcedureBook::leave_behind(const Kept& other, const Arrival& received, Kept& kept) {
  for (const auto& [place, came] : other.since) {
    if (kept.since.contains(place)) continue;
    pass(place, came, received);
    kept.gone.insert_or_assign(place, Went{received, true});
  }
}

ProcedureBook::Messages::iterator ProcedureBook::of_visit(const ProcedureMessage& message) {
  const auto known = placed_.find(message.patient);
  if (known != placed_.end() && !known->second.is_of_another_visit(message)) return known;
  // Also where another visit set that one aside, and is over.
  const auto same = std::ranges::find_if(placed_, [&](const auto& each) {
    return each.second.message.patient == message.patient && !message.visit.empty() &&
           each.second.has_visit(message.visit);
  });
  return same == placed_.end() ? known : same;
}

void ProcedureBook::set_aside(Messages::iterator known, const Arrival& received) {
  Kept aside = std::move(placed_.extract(known).mapped());
  if (aside.doubt == Doubt::kNone) aside.doubt = Doubt::kOtherVisit;
  aside.apart = "\nvisit\n" + aside.message.visit;
  for (const auto& [place, came] : aside.since) note_change(place, received);
  const std::string key = key_of_placed(aside);
  placed_.insert_or_assign(key, std::move(aside));
}

std::map<std::string, ProcedureBook::Went> ProcedureBook::drop_set_aside(const std::string& patient,
                                                                         const Arrival& received) {
  std::map<std::string, Went> gone;
  std::erase_if(placed_, [&](const auto& each) {
    const bool is_meant = !each.second.apart.empty() && each.second.message.patient == patient;
    if (!is_meant) return false;
    pass(each.second, received);
    gone.insert(each.second.gone.begin(), each.second.gone.end());
    for (const auto& [place, came] : each.second.since) gone.insert_or_assign(place, Went{received, true});
    return true;
  });
  return gone;
}

bool ProcedureBook::leave_out_gone(ProcedureMessage& message, const Kept& kept) {
  std::vector<std::string> here;
  for (const std::string_view whole : whole_places(message.places)) {
    const std::string place(whole);
    const auto gone = kept.gone.find(place);
    if (gone == kept.gone.end() || !gone->second.is_event || kept.since.contains(place))
      here.push_back(place);
  }
  std::erase_if(message.places, [&](const std::string& place) {
    return std::ranges::none_of(here, [&](const std::string& whole) {
      return ("^" + whole + "^").find("^" + place + "^") != std::string::npos;
    });
  });
  return !here.empty();
}

bool ProcedureBook::keep_places(ProcedureMessage& message, const Kept& kept) {
  std::vector<std::string> by_event;
  for (const auto& [place, came] : kept.since) {
    if (kept.way_to(place) != Way::kRecord) by_event.push_back(place);
  }
  if (by_event.empty()) return false;
  const bool is_elsewhere = !share_a_place(message.places, by_event);
  if (is_elsewhere) message.data.location = kept.message.data.location;
  for (std::string& place : by_event) {
    if (std::ranges::find(message.places, place) == message.places.end())
      message.places.push_back(std::move(place));
  }
  return is_elsewhere;
}

bool ProcedureBook::takes_away(const Kept& kept, const ProcedureMessage& message) {
  std::vector<std::string> by_move;
  for (const auto& [place, came] : kept.since) {
    if (kept.way_to(place) == Way::kMoved) by_move.push_back(place);
  }
  if (by_move.empty() || share_a_place(message.places, by_move)) return true;
  if (message.registers || message.cancels_departing) return false;
  const bool is_on_loan = !kept.message.kept_bed.empty();  // from the bed that is kept
  if (message.cancels_move)
    return message.prior.empty() ? !is_on_loan : share_a_place(message.prior, by_move);
  return !(message.swaps_beds && is_on_loan && message.kept_bed.empty());
}

bool ProcedureBook::may_leave_another_stay(const Kept& kept, const ProcedureMessage& message) {
  const bool is_by_one_clock = message.sender == kept.message.sender && kept.moved;
  if (message.discharged && is_by_one_clock && *message.discharged + kSameMoment < *kept.moved) return true;
  if (message.kind != ProcedureMessage::Kind::kLeaves || kept.since.empty()) return false;
  const bool is_here = share_a_place(message.places, kept.message.places) ||
                       share_a_place(message.places, kept.message.kept_bed);
  if (is_here) return false;
  const bool is_own_visit = !message.visit.empty() && kept.has_visit(message.visit);
  if (is_own_visit) return false;
  return !message.places.empty() || are_two_accounts(message, kept.message);
}

bool ProcedureBook::is_before_leaving(const ProcedureMessage& message, const Kept& kept) {
  if (!message.moves || !message.happened) return false;
  return std::ranges::any_of(message.places, [&](const std::string& place) {
    const auto gone = kept.gone.find(place);
    if (gone == kept.gone.end() || kept.since.contains(place)) return false;
    const Went& went = gone->second;
    return went.is_event && !went.is_cancelled && went.when.sender != message.sender && went.when.happened &&
           *message.happened + kSameMoment < *went.when.happened;
  });
}

bool ProcedureBook::somebody_else_came(const std::string& patient, const std::string& place,
                                       const Arrival& since) const {
  return std::ranges::any_of(placed_, [&](const auto& other) {
    const auto there = other.second.since.find(place);
    return other.first != patient && there != other.second.since.end() && there->second.number > since.number;
  });
}

std::optional<ProcedureBook::Arrival> ProcedureBook::came(const ProcedureRule& rule, const Kept& kept) {
  if (rule.locations.empty()) return kept.received;
  std::optional<Arrival> last;
  for (const auto& [place, since] : kept.since) {
    if (is_of_room(rule, place) && (!last || last->number < since.number)) last = since;
  }
  return last;
}

ProcedureBook::Way ProcedureBook::way_into(const ProcedureRule& rule, const Kept& kept) {
  if (kept.since.empty()) return kept.way_to("");
  Way surest = Way::kRecord;
  for (const auto& [place, came] : kept.since) {
    if (rule.locations.empty() || is_of_room(rule, place)) surest = std::max(surest, kept.way_to(place));
  }
  return surest;
}

}  // namespace kiroku::recorder
