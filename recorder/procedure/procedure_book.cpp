#include "recorder/procedure/procedure_book.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <set>
#include <utility>

#include "base/ascii.h"
#include "recorder/procedure/window.h"

namespace kiroku::recorder {
namespace {

bool is_of_room(const ProcedureRule& rule, const std::string& place) {
  return std::ranges::any_of(rule.locations,
                             [&](const std::string& location) { return same_but_for_case(place, location); });
}

/// Of what is kept by place: "" is of all places together.
bool is_meant_by(const ProcedureRule& rule, const std::string& place) {
  return rule.locations.empty() ? place.empty() : !place.empty() && is_of_room(rule, place);
}

/// By which a room is known again by the process that starts next.
std::string name_of_room(const ProcedureRule& rule) {
  std::set<std::string> locations;
  for (const std::string& each : rule.locations) locations.insert(lower_case(each));
  std::string name;
  for (const std::string& each : locations) name += each + "\n";
  return name;
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

/// Both are stated, and differ.
bool are_two_visits(const ProcedureMessage& one, const ProcedureMessage& other) {
  return !one.visit.empty() && !other.visit.empty() && !read_alike(one.visit, other.visit);
}

/// Not another one for a name that is written in another way.
bool is_another_name(const PersonName& one, const PersonName& other) {
  if (one.empty() || other.empty()) return false;
  const std::string given = lower_case(one.given), others = lower_case(other.given);
  return !same_but_for_case(one.family, other.family) ||
         (!given.starts_with(others) && !others.starts_with(given));
}

/// Born within so many days; of a year or month alone nobody knows.
bool is_newborn(const std::string& birth_date, UtcTime at) {
  constexpr std::chrono::hours kNewborn{3 * 24};
  constexpr std::size_t kWhole = 10;
  const std::optional<UtcTime> born =
      birth_date.size() == kWhole ? parse_utc(birth_date + "T00:00:00Z") : std::nullopt;
  return born && is_within(*born, at, kNewborn);
}

bool is_of_appointment(const ProcedureMessage& message) {
  return message.kind == ProcedureMessage::Kind::kAppointment ||
         message.kind == ProcedureMessage::Kind::kCancels;
}

/// It corrects what is known of somebody, and is no event of theirs.
bool is_record(const ProcedureMessage& message) { return message.is_of_record || message.corrects; }

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

ProcedureBook::Way ProcedureBook::Kept::way_to(const std::string& place) const {
  const auto known = ways.find(place);
  return known == ways.end() ? Way::kMoved : known->second;
}

void ProcedureBook::Kept::note_way(const std::string& place, Way way) {
  if (way == Way::kMoved) {
    ways.erase(place);
  } else {
    ways.insert_or_assign(place, way);
  }
}

void ProcedureBook::Kept::note_visit(const ProcedureMessage& by) {
  if (by.visit.empty() || by.visit.size() > kLongestNumber) return;
  if (visits.size() >= kMostSenders && !visits.contains(by.sender)) visits.erase(visits.begin());
  visits.insert_or_assign(by.sender, by.visit);
}

bool ProcedureBook::Kept::has_visit(const std::string& visit) const {
  return std::ranges::any_of(visits, [&](const auto& each) { return read_alike(each.second, visit); });
}

bool ProcedureBook::Kept::is_of_another_visit(const ProcedureMessage& other) const {
  return !other.visit.empty() && !visits.empty() && !has_visit(other.visit);
}

ProcedureBook::Likeness ProcedureBook::likeness(const ProcedureMessage& one, const ProcedureMessage& other) {
  const bool is_same_number = one.patient == other.patient;
  if (!is_same_number && !share_a_number(one.numbers, other.numbers)) return Likeness::kNone;
  const std::string &born = one.data.birth_date, &others = other.data.birth_date;
  const bool births_differ = !born.starts_with(others) && !others.starts_with(born);
  const bool has_issuer = !one.data.patient_id_issuer.empty() || !other.data.patient_id_issuer.empty();
  const bool is_apart = !has_issuer && one.data.patient_id == other.data.patient_id &&
                        !one.facility.empty() && !other.facility.empty() &&
                        !same_but_for_case(one.facility, other.facility);
  if (!is_same_number && births_differ) return Likeness::kNone;
  if (births_differ && is_another_name(one.data.patient, other.data.patient)) {
    // Whoever was not known by name is, as the record of their own system says, or as it says where they are.
    const bool is_there = (one.is_of_record || other.is_of_record) && share_a_place(one.places, other.places);
    const bool is_corrected = has_issuer && !one.sender.empty() && one.sender == other.sender &&
                              !are_two_visits(one, other) && (is_record(one) || is_there);
    return is_corrected ? Likeness::kSure : Likeness::kPerhaps;
  }
  const bool same_birth = !births_differ && !born.empty() && !others.empty();
  // Another system's number without an issuer, and another name, are hardly of the same patient.
  const bool has_two_senders = !one.sender.empty() && !other.sender.empty() && one.sender != other.sender;
  const bool is_perhaps_another =
      !has_issuer && has_two_senders && !same_birth && is_another_name(one.data.patient, other.data.patient);
  if (is_same_number && is_perhaps_another) return Likeness::kPerhaps;
  if (is_same_number && !is_apart) return Likeness::kSure;
  const bool same_name = !one.data.patient.empty() && one.data.patient == other.data.patient;
  if (same_birth || same_name) return Likeness::kSure;
  return is_apart && !is_same_number ? Likeness::kNone : Likeness::kPerhaps;
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
    tell_apart(message, arrival);
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
  const TakenOut before = take_out_appointment(messages);
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
      case Kind::kAppointment:
        keep_appointment(std::move(message), arrival, before);
        break;
      case Kind::kCancels:
        keep_cancelled(std::move(message), arrival);
        break;
      case Kind::kNothing:
        if (message.leaves_unnamed) leave_unnamed(message);
        break;
    }
  }
  forget_old(placed_, received);
  forget_old(appointments_, received);
  forget_old(ended_, received);
  forget_old(merged_, received);
  forget_passed(received);
}

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

/// It may be whoever is in a place that it names.
void ProcedureBook::leave_unnamed(const ProcedureMessage& message) {
  ++strangers_left_;
  for (auto& [patient, kept] : placed_) {
    if (share_a_place(message.places, kept.message.places)) kept.doubt = Doubt::kNobodyNamed;
  }
}

void ProcedureBook::tell_apart(ProcedureMessage& message, const Arrival& received) {
  if (message.patient.empty()) return;
  const auto known = placed_.find(message.patient);
  if (known != placed_.end() && likeness(message, known->second.message) == Likeness::kSure) return;
  bool is_another = false;
  for (Messages* const messages : {&placed_, &appointments_, &ended_}) {
    for (auto& [key, kept] : *messages) {
      if (kept.message.patient != message.patient || likeness(message, kept.message) != Likeness::kPerhaps)
        continue;
      is_another = true;
      // Who is meant by the number when somebody left, or came elsewhere, nobody can tell.
      if (messages != &placed_ || is_of_appointment(message)) continue;
      kept.doubt = Doubt::kOneNumber;
      note_change("", received);
      for (const auto& [place, came] : kept.since) note_change(place, received);
    }
  }
  if (is_another) message.patient += "\n" + message.data.birth_date + "\n" + lower_case(message.facility);
}

template <typename Use>
void ProcedureBook::with_each_arrival(const Use& use) {
  for (Messages* const messages : {&placed_, &appointments_, &ended_, &merged_}) {
    for (auto& [key, kept] : *messages) {
      use(kept.received);
      for (auto& [place, since] : kept.since) use(since);
      for (auto& [place, went] : kept.gone) use(went.when);
      if (kept.booked) use(*kept.booked);
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
      Likeness alike =
          is_of_appointment(message) ? same_appointment(message, known) : likeness(message, known);
      // Of another appointment of the number it is no earlier news.
      if (is_of_appointment(message) && alike == Likeness::kPerhaps) alike = Likeness::kNone;
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

ProcedureBook::Likeness ProcedureBook::same_appointment(const ProcedureMessage& one,
                                                        const ProcedureMessage& other) {
  const std::optional<bool> is_one_number = same_number_of_appointment(one, other);
  if (is_one_number && !*is_one_number) return Likeness::kNone;
  const bool names_nobody = one.patient.empty() || other.patient.empty();
  const Likeness alike = names_nobody ? Likeness::kSure : likeness(one, other);
  if (is_one_number) return alike == Likeness::kNone ? Likeness::kPerhaps : Likeness::kSure;
  return alike == Likeness::kNone ? Likeness::kNone : Likeness::kPerhaps;
}

void ProcedureBook::doubt(const ProcedureMessage& message, const Arrival& received) {
  using Kind = ProcedureMessage::Kind;
  bool is_news = false;
  if (is_of_appointment(message)) {
    if (message.kind != Kind::kCancels && !message.is_over) return;
    for (auto& [key, kept] : appointments_) {
      if (same_appointment(message, kept.message) == Likeness::kNone) continue;
      kept.doubt = Doubt::kToldLate;
      is_news = true;
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
      kept.doubt = Doubt::kToldLate;
      is_news = true;
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
  for (const std::string& place : rooms_of(over)) {
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

void ProcedureBook::note_recorded(const ProcedureRule& rule, const ProcedureData& data,
                                  const ProcedureMoment& at) {
  std::erase_if(recorded_,
                [&](const Recorded& each) { return at.since_boot - each.at.since_boot > kLongestWindow; });
  if (recorded_.size() >= kMostKept) recorded_.erase(recorded_.begin());
  recorded_.push_back({name_of_room(rule), data, at});
}

std::vector<std::pair<ProcedureData, UtcTime>> ProcedureBook::recorded(const ProcedureRule& rule,
                                                                       const ProcedureMoment& at) const {
  std::vector<std::pair<ProcedureData, UtcTime>> of_room;
  const std::string room = name_of_room(rule);
  for (const Recorded& each : recorded_) {
    if (each.room == room) of_room.emplace_back(each.data, at.by_this_clock(each.at));
  }
  return of_room;
}

std::optional<ProcedureMoment> ProcedureBook::changed(const ProcedureRule& rule) const {
  std::optional<ProcedureMoment> last;
  for (const auto& [place, at] : changes_) {
    const bool is_meant = is_meant_by(rule, place);
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
    const bool is_meant = is_meant_by(rule, place);
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

ProcedureBook::Likeness ProcedureBook::has_left(const ProcedureMessage& message) const {
  Likeness most = Likeness::kNone;
  for (const auto& [key, kept] : ended_) {
    if (is_of_appointment(kept.message) || kept.is_of_another_visit(message)) continue;
    most = std::max(most, likeness(message, kept.message));
  }
  return most;
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
  } else if (message.moves && says_where && (message.visit.empty() || message.is_of_any_visit)) {
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
  const bool arrives = message.moves && (says_where || kept.message.places.empty());
  if (says_where && !arrives) says_where = leave_out_gone(message, kept);
  if (says_where && arrives && is_before_leaving(message, kept)) doubt = Doubt::kToldLate;
  const std::vector<std::string> named = message.places;
  if (says_where && !arrives && keep_places(message, kept) && doubt == Doubt::kNone &&
      kept.doubt == Doubt::kNone)
    doubt = Doubt::kRecordElsewhere;
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
      const bool stays = !arrives && other_came;
      since.emplace(place, stays ? before->second : received);
      comes = comes || !stays;
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
      // They are where an event brought them last, and were where they came before. A record moves nobody.
      const auto rank = [](const Kept& each) {
        const bool by_event = std::ranges::any_of(
            each.since, [&](const auto& came) { return each.way_to(came.first) != Way::kRecord; });
        return std::pair(by_event || (each.since.empty() && each.message.moves), each.received.number);
      };
      if (rank(known->second) > rank(one)) std::swap(known->second, one);
      for (const auto& [place, came] : known->second.since) {
        if (one.since.contains(place)) {
          one.note_way(place, std::max(one.way_to(place), known->second.way_to(place)));
        } else {
          pass(place, came, received);
        }
      }
      if (one.doubt == Doubt::kNone) one.doubt = known->second.doubt;
      one.gone.insert(known->second.gone.begin(), known->second.gone.end());
      one.visits.insert(known->second.visits.begin(), known->second.visits.end());
    }
    give(one.message);
    one.apart.clear();
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

bool ProcedureBook::is_watched(const std::string& place) const {
  return std::ranges::any_of(
      rules_, [&](const ProcedureRule& rule) { return rule.locations.empty() || is_of_room(rule, place); });
}

bool ProcedureBook::is_watched(const Kept& kept) const {
  const auto is_place = [this](const std::string& place) { return is_watched(place); };
  const auto is_key = [this](const auto& each) { return is_watched(each.first); };
  const auto is_here = [&](const Kept& one) {
    return std::ranges::any_of(one.message.places, is_place) || std::ranges::any_of(one.since, is_key) ||
           std::ranges::any_of(one.gone, is_key);
  };
  if (is_here(kept)) return true;
  const auto patient = placed_.find(kept.message.patient);
  return patient != placed_.end() && &patient->second != &kept && is_here(patient->second);
}

void ProcedureBook::lose(LostPlaces& places, const Kept& kept, const ProcedureMoment& first,
                         const ProcedureMoment& last) {
  std::set<std::string> lost;
  for (const std::string& place : kept.message.places) lost.insert(lower_case(place));
  for (const auto& [place, went] : kept.gone) lost.insert(lower_case(place));
  lost.insert("");  // of all places together
  bool is_news = rules_.empty();
  for (const std::string& place : lost) {
    if (!rules_.empty() && !is_watched(place)) continue;
    is_news = true;
    const std::string key = key_of_lost(place, first);
    auto known = places.find(key);
    if (known == places.end() && places.size() >= kMostKept) {
      // Of more days than are kept those of one place become one.
      known =
          std::ranges::find_if(places, [&](const auto& each) { return place_of_lost(each.first) == place; });
      if (known == places.end()) make_room(places);
    }
    if (known == places.end()) {
      places.emplace(key, Lost{first, last});
      continue;
    }
    widen(known->second, {first, last});
  }
  if (is_news) ++not_kept_;
}

void ProcedureBook::widen(Lost& lost, const Lost& by) {
  if (by.first.since_boot < lost.first.since_boot) lost.first = by.first;
  if (by.last.since_boot > lost.last.since_boot) lost.last = by.last;
}

// Of more places than are kept it would be forgotten that something was: then nobody is in doubt.
void ProcedureBook::make_room(LostPlaces& places) {
  const auto same = std::ranges::adjacent_find(places, [](const auto& one, const auto& other) {
    return place_of_lost(one.first) == place_of_lost(other.first);
  });
  if (same != places.end()) {
    const auto next = std::next(same);
    widen(same->second, next->second);
    places.erase(next);
    return;
  }
  const auto is_any = [](const auto& each) { return place_of_lost(each.first) == kAnyPlace; };
  const auto take_one = [&] {
    const auto one = std::ranges::find_if(
        places, [&](const auto& each) { return !place_of_lost(each.first).empty() && !is_any(each); });
    const Lost lost = one->second;
    places.erase(one);
    return lost;
  };
  Lost lost = take_one();
  if (const auto any = std::ranges::find_if(places, is_any); any != places.end()) {
    widen(any->second, lost);
  } else {
    widen(lost, take_one());
    places.emplace(key_of_lost(std::string(kAnyPlace), lost.first), lost);
  }
}

std::string ProcedureBook::key_of_lost(const std::string& place, const ProcedureMoment& first) {
  return place + "\n" + std::to_string(std::chrono::floor<std::chrono::days>(first.since_boot).count());
}
std::string ProcedureBook::place_of_lost(const std::string& key) { return key.substr(0, key.rfind('\n')); }

void ProcedureBook::lose(const Messages& messages, const Kept& kept, const ProcedureMoment& now) {
  if (&messages == &merged_) return;
  if (&messages == &placed_) {
    lose(lost_placed_, kept, kept.received.at, kept.received.at);
    return;
  }
  const ProcedureMoment& told = kept.received.at;
  if (&messages == &ended_) {
    lose(lost_planned_, kept, told, now);
    return;
  }
  // Further than what arithmetic of times holds nobody plans.
  constexpr std::chrono::hours kFurthest{24 * 3650};
  const auto moment = [&](UtcTime time) {
    const auto from_now = std::clamp<UtcTime::duration>(time - now.utc, -kLongestBefore, kFurthest);
    return ProcedureMoment{now.utc + from_now, now.since_boot + from_now};
  };
  const bool is_unclear = kept.message.is_time_unclear && !kept.message.planned;
  const UtcTime first = is_unclear ? now.utc : planned(kept, now);
  lose(lost_planned_, kept, moment(first), moment(std::max(first, planned_last(kept, now))));
}

bool ProcedureBook::is_lost(const LostPlaces& places, const ProcedureRule& rule,
                            const ProcedureMoment& at) const {
  return std::ranges::any_of(places, [&](const auto& each) {
    const auto& [key, lost] = each;
    const std::string place = place_of_lost(key);
    const bool is_meant = place == kAnyPlace || is_meant_by(rule, place);
    return is_meant && at.by_this_clock(lost.first) - rule.window <= at.utc &&
           at.utc <= at.by_this_clock(lost.last) + rule.window;
  });
}

/// Whoever sends messages makes as many places and visits of one patient as they like.
void ProcedureBook::bound(Kept& kept, const ProcedureMoment& now) {
  while (kept.gone.size() > kMostPlacesBefore) {
    const auto oldest = std::ranges::min_element(kept.gone, {}, [&](const auto& each) {
      return std::pair(is_watched(each.first), each.second.when.number);
    });
    if (is_watched(oldest->first)) {
      // That they were there may be why what is planned for them there is over.
      Kept there{kept.received, {}};
      there.message.places = {oldest->first};
      lose(lost_planned_, there, oldest->second.when.at, now);
    }
    kept.gone.erase(oldest);
  }
  for (auto each = kept.visits.begin(); kept.visits.size() > kMostSenders;) {
    each = each->first == kept.message.sender ? std::next(each) : kept.visits.erase(each);
  }
}

void ProcedureBook::forget_old(Messages& messages, const ProcedureMoment& now) {
  for (auto& [key, kept] : messages) bound(kept, now);
  const auto newest = [&now](const Kept& kept) {
    return std::max(now.by_this_clock(kept.received.at), planned_last(kept, now));
  };
  std::erase_if(messages, [&](const auto& each) { return now.utc - newest(each.second) > kLongestWindow; });
  while (messages.size() > kMostKept) {
    // Of those that concern no watched room, the oldest; of none, the oldest of all. Of appointments those
    // that are planned furthest from now: the next ones were often booked first.
    auto oldest = messages.end(), oldest_of_all = messages.end();
    const bool is_of_plans = &messages == &appointments_;
    const auto is_older = [&](auto one, auto than) {
      if (than == messages.end()) return true;
      const auto distance = [&](const Kept& kept) {
        return std::chrono::abs(planned_last(kept, now) - now.utc);
      };
      if (is_of_plans && distance(one->second) != distance(than->second))
        return distance(one->second) > distance(than->second);
      return one->second.received.number < than->second.received.number;
    };
    for (auto each = messages.begin(); each != messages.end(); ++each) {
      if (is_older(each, oldest_of_all)) oldest_of_all = each;
      if (is_older(each, oldest) && !is_watched(each->second)) oldest = each;
    }
    const auto forgotten = oldest == messages.end() ? oldest_of_all : oldest;
    if (rules_.empty() || oldest == messages.end()) lose(messages, forgotten->second, now);
    messages.erase(forgotten);
  }
}

void ProcedureBook::forget_passed(const ProcedureMoment& now) {
  // Those of no watched room before others.
  const auto forget_oldest = [this](auto& of_places, const auto& age) {
    while (of_places.size() > kMostKept) {
      of_places.erase(std::ranges::min_element(of_places, {}, [&](const auto& each) {
        return std::pair(each.first.empty() || is_watched(each.first), age(each.second));
      }));
    }
  };
  std::erase_if(changes_,
                [&](const auto& each) { return now.since_boot - each.second.since_boot > kLongestWindow; });
  forget_oldest(changes_, [](const ProcedureMoment& at) { return at.since_boot; });
  std::erase_if(passed_, [&](const auto& each) {
    return now.utc - now.by_this_clock(each.second.went.at) > kLongestWindow;
  });
  forget_oldest(passed_, [](const Passed& passed) { return passed.went.number; });
  for (LostPlaces* const places : {&lost_placed_, &lost_planned_}) {
    std::erase_if(*places, [&](const auto& each) {
      return now.since_boot - each.second.last.since_boot > kLongestWindow;
    });
  }
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
  std::optional<std::uint64_t> here_number;
  bool is_on_record = false;  // somebody is, which brings nobody there
  for (const auto& [patient, kept] : placed_) {
    const std::optional<Arrival> came_in = came(rule, kept);
    if (!came_in) continue;
    const UtcTime since = at.by_this_clock(came_in->at);
    if (std::chrono::abs(at.utc - since) > rule.window) continue;
    if (way_into(rule, kept) == Way::kRecord) {
      is_on_record = true;
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
    if (!chosen) return {{}, is_on_record ? Doubt::kRecordAlone : Doubt::kNone};
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
  return {std::move(found)};
}

}  // namespace kiroku::recorder
