#include "recorder/procedure/procedure_book.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <set>
#include <utility>

#include "base/ascii.h"

namespace kiroku::recorder {
namespace {

bool is_of_room(const ProcedureRule& rule, const std::string& place) {
  return std::ranges::any_of(rule.locations,
                             [&](const std::string& location) { return same_but_for_case(place, location); });
}

bool concerns(const ProcedureRule& rule, const ProcedureMessage& message) {
  return rule.locations.empty() || std::ranges::any_of(message.places, [&](const std::string& place) {
           return is_of_room(rule, place);
         });
}

/// What is not a part of another one of them: "SURGERY^OR1", not "OR1".
std::vector<std::string_view> whole_places(const std::vector<std::string>& places) {
  std::vector<std::string_view> whole;
  for (const std::string& place : places) {
    const bool is_part = std::ranges::any_of(places, [&](const std::string& other) {
      return other.size() > place.size() && ("^" + other + "^").find("^" + place + "^") != std::string::npos;
    });
    if (!is_part) whole.emplace_back(place);
  }
  return whole;
}

/// Whether a place of the one is a place of the other, as whole as it is written in one of them.
bool share_a_place(const std::vector<std::string>& one, const std::vector<std::string>& other) {
  const auto has_any = [](const std::vector<std::string>& places, std::string_view whole) {
    return std::ranges::any_of(places,
                               [&](const std::string& place) { return same_but_for_case(place, whole); });
  };
  return std::ranges::any_of(whole_places(one), [&](auto whole) { return has_any(other, whole); }) ||
         std::ranges::any_of(whole_places(other), [&](auto whole) { return has_any(one, whole); });
}

bool is_of_appointment(const ProcedureMessage& message) {
  return message.kind == ProcedureMessage::Kind::kAppointment ||
         message.kind == ProcedureMessage::Kind::kCancels;
}

/// As a message that named the patient by the earlier number.
ProcedureMessage before_merging(const ProcedureMessage& merging) {
  ProcedureMessage before;
  before.patient = merging.replaces;
  before.numbers = merging.replaced_numbers;
  before.data.patient = merging.data.patient;
  before.data.birth_date = merging.data.birth_date;
  return before;
}

/// What is kept of a message only to know its patient again.
void leave_identity(ProcedureMessage& message) {
  ProcedureData data;
  data.patient_id = message.data.patient_id;
  data.patient_id_issuer = message.data.patient_id_issuer;
  data.patient = message.data.patient;
  data.birth_date = message.data.birth_date;
  message.data = std::move(data);
  message.places.clear();
  message.planned_places.clear();
}

}  // namespace

ProcedureBook::Likeness ProcedureBook::likeness(const ProcedureMessage& one, const ProcedureMessage& other) {
  if (one.patient == other.patient) return Likeness::kSure;
  if (!share_a_number(one.numbers, other.numbers)) return Likeness::kNone;
  const std::string &born = one.data.birth_date, &others = other.data.birth_date;
  if (!born.starts_with(others) && !others.starts_with(born)) return Likeness::kNone;
  const bool same_birth = !born.empty() && !others.empty();
  const bool same_name = !one.data.patient.empty() && one.data.patient == other.data.patient;
  return same_birth || same_name ? Likeness::kSure : Likeness::kPerhaps;
}

void ProcedureBook::take(ProcedureMessage message, ProcedureMoment received) {
  std::vector<ProcedureMessage> one;
  one.push_back(std::move(message));
  take_all(std::move(one), received);
}

void ProcedureBook::take_all(std::vector<ProcedureMessage> messages, ProcedureMoment received) {
  using Kind = ProcedureMessage::Kind;
  if (messages.empty()) return;
  watch_clock(messages.front(), received);
  const Arrival arrival = arrival_of(messages.front(), received);
  for (ProcedureMessage& message : messages) {
    const bool is_merging = !message.replaces.empty();
    const ProcedureMessage as_told = is_merging ? message : ProcedureMessage();
    resolve(message);
    // Whoever was merged the other way round before goes by this number from now on.
    if (is_merging && message.patient == message.replaces) message = as_told;
    if (is_merging) rename(message, arrival);  // however late: it stays so
    message.replaces.clear();
    message.replaced_numbers.clear();
  }
  for (const ProcedureMessage& message : messages) {
    if (message.kind == Kind::kLeaves || message.kind == Kind::kDeparts) {
      for (const std::string& place : message.places) note_change(place, arrival);
    }
    if (message.kind == Kind::kAppointment && message.is_over) note_end(message, arrival);
  }
  // Who is meant is settled: now it can be told what comes late.
  std::set<std::string> in_doubt;
  std::erase_if(messages, [&](const ProcedureMessage& each) {
    const Likeness late = lateness(each);
    if (late == Likeness::kNone) return false;
    const bool stays =
        late == Likeness::kPerhaps && (each.kind == Kind::kPlaces || each.kind == Kind::kFacts);
    if (stays) {
      in_doubt.insert(each.patient);
    } else {
      doubt(each, arrival);
    }
    return !stays;
  });
  // An appointment that was another patient's before is theirs no more.
  take_out_appointment(messages);
  for (ProcedureMessage& message : messages) {
    switch (message.kind) {
      case Kind::kPlaces:
      case Kind::kFacts: {
        const bool is_in_doubt = in_doubt.contains(message.patient);
        place(std::move(message), arrival, is_in_doubt);
        break;
      }
      case Kind::kLeaves:
      case Kind::kDeparts:
        leave(std::move(message), arrival);
        break;
      case Kind::kAppointment: {
        const std::string key = key_of_appointment(message);
        ended_.erase("\n" + key);  // key_of_ended()
        appointments_.insert_or_assign(key, Kept{arrival, std::move(message)});
        break;
      }
      case Kind::kCancels: {
        const std::string key = key_of_ended(message);
        message.data = {};
        message.planned_places.clear();
        ended_.insert_or_assign(key, Kept{arrival, std::move(message)});
        break;
      }
      case Kind::kNothing:
        break;
    }
  }
  forget_old(placed_, received);
  forget_old(appointments_, received);
  forget_old(ended_, received);
  forget_old(merged_, received);
  forget_passed(received);
}

template <typename Use>
void ProcedureBook::with_each_arrival(const Use& use) {
  for (Messages* const messages : {&placed_, &appointments_, &ended_, &merged_}) {
    for (auto& [key, kept] : *messages) {
      use(kept.received);
      for (auto& [place, since] : kept.since) use(since);
    }
  }
  for (auto& [place, passed] : passed_) {
    use(passed.came);
    use(passed.went);
  }
}

/// What a sender tells by a clock that was set back is not from before for longer than kLongestBehind.
void ProcedureBook::watch_clock(const ProcedureMessage& message, const ProcedureMoment& received) {
  if (!message.told) return;
  if (clocks_.size() >= kMostSenders && !clocks_.contains(message.sender)) clocks_.clear();
  SenderClock& clock = clocks_.try_emplace(message.sender, SenderClock{*message.told}).first->second;
  if (*message.told + kSameMoment >= clock.newest) {
    clock = {std::max(clock.newest, *message.told)};
    return;
  }
  if (!clock.behind_since) clock.behind_since = received.since_boot;
  if (received.since_boot - *clock.behind_since < kLongestBehind) return;
  clock = {*message.told};
  with_each_arrival([&](Arrival& each) {
    if (each.sender == message.sender) each.happened.reset();
  });
  for (Messages* const messages : {&placed_, &appointments_, &ended_}) {
    for (auto& [key, kept] : *messages) {
      if (kept.message.sender != message.sender) continue;
      kept.message.told.reset();
      kept.moved.reset();
    }
  }
}

ProcedureBook::Arrival ProcedureBook::arrival_of(const ProcedureMessage& message,
                                                 const ProcedureMoment& received) {
  Arrival arrival{++arrivals_, received, message.sender, message.happened};
  if (!message.happened) return arrival;
  std::optional<Arrival> next;  // the first of what happened after it
  with_each_arrival([&](const Arrival& each) {
    const bool is_later =
        each.sender == message.sender && each.happened && *each.happened - *message.happened > kSameMoment;
    if (is_later && (!next || each.number < next->number)) next = each;
  });
  if (!next) return arrival;
  // What a sender calls centuries is none of this clock's.
  const auto earlier = std::min<UtcTime::duration>(*next->happened - *message.happened, kLongestBefore);
  arrival.number = next->number;
  arrival.at = {
      std::max(next->at.utc - earlier, received.utc - kLongestBefore),
      std::max<Clock::Duration>(next->at.since_boot - earlier, received.since_boot - kLongestBefore)};
  with_each_arrival([&](Arrival& each) { each.number += each.number >= arrival.number ? 1U : 0U; });
  return arrival;
}

ProcedureBook::Likeness ProcedureBook::lateness(const ProcedureMessage& message) const {
  if (!message.told) return Likeness::kNone;
  bool is_known = false, is_late = false, is_perhaps = false;
  for (const Messages* const messages : {&placed_, &appointments_, &ended_}) {
    for (const auto& [key, kept] : *messages) {
      const ProcedureMessage& known = kept.message;
      if (is_of_appointment(known) != is_of_appointment(message)) continue;
      const bool is_same_appointment = is_of_appointment(message) && same_appointment(known, message);
      const Likeness alike = is_same_appointment          ? Likeness::kSure
                             : is_of_appointment(message) ? Likeness::kNone
                                                          : likeness(known, message);
      const bool is_newer =
          known.sender == message.sender && known.told && *known.told - *message.told > kSameMoment;
      is_known = is_known || alike == Likeness::kSure;
      is_late = is_late || (is_newer && alike == Likeness::kSure);
      is_perhaps = is_perhaps || (is_newer && alike == Likeness::kPerhaps);
    }
  }
  if (is_late) return Likeness::kSure;
  return is_perhaps && !is_known ? Likeness::kPerhaps : Likeness::kNone;
}

void ProcedureBook::doubt(const ProcedureMessage& message, const Arrival& received) {
  using Kind = ProcedureMessage::Kind;
  bool is_news = false;
  if (is_of_appointment(message)) {
    if (message.kind != Kind::kCancels && !message.is_over) return;
    for (auto& [key, kept] : appointments_) {
      if (!same_appointment(kept.message, message)) continue;
      kept.is_in_doubt = is_news = true;
    }
  } else if (message.kind == Kind::kLeaves || message.kind == Kind::kDeparts || message.moves) {
    for (const std::string& patient : known_as(message, false)) {
      Kept& kept = placed_.find(patient)->second;
      const bool is_elsewhere =
          !message.places.empty() && !share_a_place(message.places, kept.message.places);
      if (message.kind == Kind::kDeparts && is_elsewhere) continue;
      // A move before they came is how they came.
      const bool is_since = message.happened && (!kept.moved || *message.happened > *kept.moved);
      if (message.kind == Kind::kPlaces && (!is_elsewhere || !is_since)) continue;
      kept.is_in_doubt = is_news = true;
      note_change("", received);
      for (const auto& [place, came] : kept.since) note_change(place, received);
    }
  }
  if (is_news) ++ended_late_;
}

void ProcedureBook::note_change(const std::string& place, const Arrival& when) {
  for (const std::string& each : {lower_case(place), std::string()}) {
    const auto [known, added] = changes_.try_emplace(each, when.at);
    if (!added && known->second.since_boot < when.at.since_boot) known->second = when.at;
  }
}

void ProcedureBook::note_end(const ProcedureMessage& over, const Arrival& when) {
  for (const std::string& place : over.places) {
    if (!is_there_another(over.patient, place)) note_change(place, when);
  }
}

bool ProcedureBook::is_there_another(const std::string& patient, const std::string& place) const {
  return std::ranges::any_of(placed_, [&](const auto& other) {
    return other.first != patient && std::ranges::any_of(other.second.since, [&](const auto& came) {
             return same_but_for_case(came.first, place);
           });
  });
}

std::optional<ProcedureMoment> ProcedureBook::changed(const ProcedureRule& rule) const {
  std::optional<ProcedureMoment> last;
  for (const auto& [place, at] : changes_) {
    const bool is_meant = rule.locations.empty() ? place.empty() : !place.empty() && is_of_room(rule, place);
    if (is_meant && (!last || last->since_boot < at.since_boot)) last = at;
  }
  return last;
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

Doubt ProcedureBook::doubt_of_passed(const ProcedureRule& rule, std::optional<std::uint64_t> here,
                                     const ProcedureMoment& at) const {
  Doubt doubt = Doubt::kNone;
  for (const auto& [place, passed] : passed_) {
    const bool is_meant = rule.locations.empty() ? place.empty() : !place.empty() && is_of_room(rule, place);
    if (!is_meant) continue;
    if (at.by_this_clock(passed.went.at) > at.utc) return Doubt::kLeftMeanwhile;
    if (here && passed.came.number > *here) doubt = Doubt::kMayBeGone;
  }
  return doubt;
}

std::vector<std::string> ProcedureBook::known_as(const ProcedureMessage& message, bool surely) const {
  std::vector<std::string> sure, perhaps;
  for (const auto& [patient, kept] : placed_) {
    const Likeness alike = likeness(message, kept.message);
    if (alike == Likeness::kSure) sure.push_back(patient);
    if (alike == Likeness::kPerhaps) perhaps.push_back(patient);
  }
  if (sure.empty()) return perhaps.size() == 1 && !surely ? perhaps : sure;
  // Somebody may be there by two forms of a number. Whoever is another patient is not meant.
  const auto exact = placed_.find(message.patient);
  const ProcedureMessage& first =
      (exact == placed_.end() ? placed_.find(sure.front()) : exact)->second.message;
  const auto others = std::erase_if(sure, [&](const std::string& each) {
    return likeness(first, placed_.find(each)->second.message) != Likeness::kSure;
  });
  return others > 0 && exact == placed_.end() ? std::vector<std::string>() : sure;
}

void ProcedureBook::leave(ProcedureMessage message, const Arrival& received) {
  const std::vector<std::string> known = known_as(message, false);
  const bool leaves = message.kind == ProcedureMessage::Kind::kLeaves;
  if (known.empty() && leaves && !ended_.contains(message.patient)) ++strangers_left_;
  bool is_gone = leaves;
  for (const std::string& patient : known) {
    const auto found = placed_.find(patient);
    // Whoever is seen off elsewhere, late, is where they came since.
    const bool is_elsewhere =
        !leaves && !message.places.empty() && !share_a_place(message.places, found->second.message.places);
    if (is_elsewhere) continue;
    pass(found->second, received);
    add_numbers(message.numbers, found->second.message.numbers);
    placed_.erase(found);
    is_gone = true;
  }
  if (!is_gone) return;
  leave_identity(message);
  const std::string key = key_of_ended(message);
  ended_.insert_or_assign(key, Kept{received, std::move(message)});
}

void ProcedureBook::place(ProcedureMessage message, const Arrival& received, bool is_in_doubt) {
  auto known = placed_.find(message.patient);
  const auto others = known == placed_.end() ? known_as(message, true) : std::vector<std::string>();
  if (others.size() == 1) {
    // By another form of their number: they have not come as somebody else.
    known = placed_.find(others.front());
    message.patient = known->first;
    message.data.patient_id = known->second.message.data.patient_id;
    message.data.patient_id_issuer = known->second.message.data.patient_id_issuer;
  }
  const bool says_where = message.kind == ProcedureMessage::Kind::kPlaces && !message.places.empty();
  if (known == placed_.end()) {
    // A change of somebody's address, or a record that is begun, brings nobody into the room. Where every
    // message is about one room, an event of arriving does without a place.
    if (!says_where && !message.moves) return;
    ended_.erase(message.patient);
    const std::optional<UtcTime> moved = message.moves ? message.happened : std::nullopt;
    Kept kept{received, std::move(message), {}, is_in_doubt, moved};
    note_change("", received);
    for (const std::string& place : kept.message.places) {
      kept.since.emplace(place, received);
      note_change(place, received);
    }
    const std::string patient = kept.message.patient;
    placed_.emplace(patient, std::move(kept));
    return;
  }
  Kept& kept = known->second;
  add_numbers(message.numbers, kept.message.numbers);
  const bool arrives = message.moves && (says_where || kept.message.places.empty());
  // Whoever only sends other facts (A08, A31) of somebody who was there before does not say that they came
  // anew, after whoever came since.
  bool comes = arrives;
  if (says_where) {
    std::map<std::string, Arrival> since;
    for (const std::string& place : message.places) {
      const auto before = kept.since.find(place);
      const bool was_there = before != kept.since.end();
      const bool other_came = was_there && somebody_else_came(message.patient, place, before->second);
      // Whoever is announced once more where they are (A02 behind A10, a message sent again) changed nothing.
      if (!was_there || (arrives && other_came)) note_change(place, received);
      const bool stays = !arrives && other_came;
      since.emplace(place, stays ? before->second : received);
      comes = comes || !stays;
    }
    for (const auto& [place, came] : kept.since) {
      if (!since.contains(place)) pass(place, came, received);
    }
    kept.since = std::move(since);
  } else {
    if (arrives && !kept.moved) note_change("", received);
    message.places = kept.message.places;
    message.data.location = kept.message.data.location;
  }
  if (comes) kept.received = received;
  if (arrives) kept.moved = message.happened;
  // Only who is said to have come anew is there for sure again.
  kept.is_in_doubt = is_in_doubt || (kept.is_in_doubt && !arrives);
  kept.message = std::move(message);
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

void ProcedureBook::resolve(ProcedureMessage& message) const {
  if (message.patient.empty()) return;
  for (std::size_t left = kMostNumbers; left > 0; --left) {
    const auto merged = std::ranges::find_if(merged_, [&](const auto& each) {
      const ProcedureMessage& merging = each.second.message;
      return merging.patient != message.patient &&
             likeness(before_merging(merging), message) == Likeness::kSure;
    });
    if (merged == merged_.end()) return;
    const ProcedureMessage& merging = merged->second.message;
    message.patient = merging.patient;
    message.data.patient_id = merging.data.patient_id;
    message.data.patient_id_issuer = merging.data.patient_id_issuer;
    add_numbers(message.numbers, merging.numbers);
  }
}

/// What is known of a patient by an earlier number is of the new one from then on.
void ProcedureBook::rename(ProcedureMessage& message, const Arrival& received) {
  if (message.replaces == message.patient) return;
  const ProcedureMessage before = before_merging(message);
  ProcedureMessage merging = message;
  add_numbers(message.numbers, message.replaced_numbers);  // some go on naming them so
  const auto give = [&message](ProcedureMessage& to) {
    add_numbers(to.numbers, message.numbers);
    to.patient = message.patient;
    to.data.patient_id = message.data.patient_id;
    to.data.patient_id_issuer = message.data.patient_id_issuer;
  };
  // Of whom that is not sure nothing is renamed: it would be another patient's record.
  for (const std::string& patient : known_as(before, true)) {
    if (patient == message.patient) continue;
    Kept one = std::move(placed_.extract(patient).mapped());
    add_numbers(message.numbers, one.message.numbers);
    if (const auto known = placed_.find(message.patient); known != placed_.end()) {
      add_numbers(message.numbers, known->second.message.numbers);
      // They are where they came last, and were where they came before.
      if (known->second.received.number > one.received.number) std::swap(known->second, one);
      for (const auto& [place, came] : known->second.since) {
        if (!one.since.contains(place)) pass(place, came, received);
      }
      one.is_in_doubt = one.is_in_doubt || known->second.is_in_doubt;
    }
    give(one.message);
    placed_.insert_or_assign(message.patient, std::move(one));
  }
  std::vector<Kept> moved;
  std::erase_if(appointments_, [&](auto& each) {
    const ProcedureMessage& other = each.second.message;
    if (other.patient == message.patient || likeness(before, other) != Likeness::kSure) return false;
    moved.push_back(std::move(each.second));
    return true;
  });
  for (Kept& each : moved) {
    give(each.message);
    const std::string key = key_of_appointment(each.message);
    appointments_.insert_or_assign(key, std::move(each));
  }
  // Messages that name them as before may come for days.
  merged_.erase(message.patient);
  merging.kind = ProcedureMessage::Kind::kFacts;
  leave_identity(merging);
  const std::string earlier = merging.replaces;
  merged_.insert_or_assign(earlier, Kept{received, std::move(merging)});
}

/// Whatever `by` changes or cancels; what it was called before, it is called still.
void ProcedureBook::take_out_appointment(std::vector<ProcedureMessage>& by) {
  std::erase_if(appointments_, [&](const auto& each) {
    const ProcedureMessage& before = each.second.message;
    const bool is_meant = std::ranges::any_of(by, [&](const ProcedureMessage& message) {
      return is_of_appointment(message) && same_appointment(message, before);
    });
    for (ProcedureMessage& message : by) {
      if (is_meant && message.placer.empty()) message.placer = before.placer;
      if (is_meant && message.filler.empty()) message.filler = before.filler;
    }
    return is_meant;
  });
}

UtcTime ProcedureBook::planned_last(const Kept& kept, const ProcedureMoment& at) {
  UtcTime last = planned(kept, at);
  for (const PlannedPlace& place : kept.message.planned_places)
    last = std::max(last, place.planned.value_or(last));
  return last;
}

ProcedureBook::PlannedHere ProcedureBook::planned_here(const ProcedureRule& rule, const Kept& kept,
                                                       const ProcedureMoment& at) {
  std::optional<PlannedHere> here;
  for (const PlannedPlace& place : kept.message.planned_places) {
    const bool is_here = rule.locations.empty() || std::ranges::any_of(place.spellings, [&](const auto& one) {
                           return is_of_room(rule, one);
                         });
    if (!is_here) continue;
    const PlannedHere found{place.planned.value_or(planned(kept, at)), &place, place.is_time_unclear};
    const bool is_unclear = found.is_unclear || (here && here->is_unclear);
    if (!here || std::chrono::abs(found.time - at.utc) < std::chrono::abs(here->time - at.utc)) here = found;
    here->is_unclear = is_unclear;
  }
  return here.value_or(PlannedHere{planned(kept, at)});
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

void ProcedureBook::forget_old(Messages& messages, const ProcedureMoment& now) {
  const auto newest = [&now](const Kept& kept) {
    return std::max(now.by_this_clock(kept.received.at), planned_last(kept, now));
  };
  std::erase_if(messages, [&](const auto& each) { return now.utc - newest(each.second) > kLongestWindow; });
  while (messages.size() > kMostKept) {
    messages.erase(std::min_element(messages.begin(), messages.end(), [](const auto& a, const auto& b) {
      return a.second.received.number < b.second.received.number;
    }));
  }
}

void ProcedureBook::forget_passed(const ProcedureMoment& now) {
  std::erase_if(changes_,
                [&](const auto& each) { return now.since_boot - each.second.since_boot > kLongestWindow; });
  while (changes_.size() > kMostKept) {
    changes_.erase(
        std::ranges::min_element(changes_, {}, [](const auto& each) { return each.second.since_boot; }));
  }
  std::erase_if(passed_, [&](const auto& each) {
    return now.utc - now.by_this_clock(each.second.went.at) > kLongestWindow;
  });
  while (passed_.size() > kMostKept) {
    passed_.erase(
        std::ranges::min_element(passed_, {}, [](const auto& each) { return each.second.went.number; }));
  }
}

std::vector<ProcedureData> ProcedureBook::list(const ProcedureRule& rule, ProcedureMoment at) const {
  std::vector<ProcedureData> all;
  std::set<std::string> placed;
  const auto is_near = [&](UtcTime time) { return std::chrono::abs(at.utc - time) <= rule.window; };
  for (const auto& [patient, kept] : placed_) {
    const std::optional<Arrival> came_in = came(rule, kept);
    if (!came_in) continue;
    const UtcTime since = at.by_this_clock(came_in->at);
    if (!is_near(since)) continue;
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
    all.back().chosen = "a message placed the patient in the room at " + format_utc(since);
    if (const auto chosen = nearest(times, at.utc, rule.window).index) complete(all.back(), planned[*chosen]);
  }
  for (const auto& [appointment, kept] : appointments_) {
    if (!concerns(rule, kept.message) || placed.contains(kept.message.patient)) continue;
    const PlannedHere here = planned_here(rule, kept, at);
    if (!is_near(here.time) && !here.is_unclear) continue;
    all.push_back(data_of(kept, here));
    all.back().chosen =
        "an appointment of which a message told at " + format_utc(at.by_this_clock(kept.received.at));
  }
  return all;
}

ProcedureChoice ProcedureBook::choose(const ProcedureRule& rule, const ProcedureMoment& at) const {
  const Kept* here = nullptr;
  UtcTime here_since;
  std::optional<std::uint64_t> here_number;
  for (const auto& [patient, kept] : placed_) {
    const std::optional<Arrival> came_in = came(rule, kept);
    if (!came_in) continue;
    const UtcTime since = at.by_this_clock(came_in->at);
    if (std::chrono::abs(at.utc - since) > rule.window) continue;
    if (here != nullptr) return {{}, Doubt::kSeveralThere};
    here = &kept;
    here_since = since;
    here_number = came_in->number;
  }
  if (const Doubt doubt = doubt_of_passed(rule, here_number, at); doubt != Doubt::kNone) return {{}, doubt};
  if (here != nullptr && here->is_in_doubt) return {{}, Doubt::kToldLate};
  std::vector<const Kept*> planned;
  std::vector<PlannedHere> in_room;
  std::vector<std::optional<UtcTime>> times;
  bool is_unclear = false;
  for (const auto& [appointment, kept] : appointments_) {
    if (!concerns(rule, kept.message) || kept.message.is_over) continue;
    if (here != nullptr && (kept.is_in_doubt || kept.message.patient != here->message.patient)) continue;
    const PlannedHere its = planned_here(rule, kept, at);
    // It may be planned for now, or not.
    const bool may_be_near = std::chrono::abs(planned_last(kept, at) - at.utc) <= rule.window ||
                             std::chrono::abs(ProcedureBook::planned(kept, at) - at.utc) <= rule.window;
    is_unclear = is_unclear || (its.is_unclear && may_be_near);
    if (here != nullptr && its.is_unclear) continue;
    planned.push_back(&kept);
    in_room.push_back(its);
    times.emplace_back(its.time);
  }
  if (here == nullptr && is_unclear) return {{}, Doubt::kTimeUnclear};
  const NearestPlan plan = nearest(times, at.utc, rule.window);
  const auto chosen = plan.index;
  if (here == nullptr) {
    if (!chosen) return {};
    // Which of two patients it is nobody can tell.
    const bool is_anybodys = std::ranges::any_of(plan.equally_near, [&](std::size_t each) {
      return planned[each]->message.patient != planned[*chosen]->message.patient;
    });
    if (is_anybodys) return {{}, Doubt::kTwoPlanned};
    if (planned[*chosen]->is_in_doubt) return {{}, Doubt::kToldLate};
    if (plan.is_far_ahead) return {{}, Doubt::kTooEarly};
  }
  const auto count = std::count_if(times.begin(), times.end(), [&](const auto& time) {
    return std::chrono::abs(*time - at.utc) <= rule.window;
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
  return {std::move(found)};
}

}  // namespace kiroku::recorder
