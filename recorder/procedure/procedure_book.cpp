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

enum class Likeness { kNone, kPerhaps, kSure };

/// Whether two messages name one patient, by other forms of a number or by other numbers.
Likeness likeness(const ProcedureMessage& one, const ProcedureMessage& other) {
  if (one.patient == other.patient) return Likeness::kSure;
  if (!share_a_number(one.numbers, other.numbers)) return Likeness::kNone;
  const std::string &born = one.data.birth_date, &others = other.data.birth_date;
  if (!born.starts_with(others) && !others.starts_with(born)) return Likeness::kNone;
  const bool same_birth = !born.empty() && !others.empty();
  const bool same_name = !one.data.patient.empty() && one.data.patient == other.data.patient;
  return same_birth || same_name ? Likeness::kSure : Likeness::kPerhaps;
}

}  // namespace

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
    if (!message.replaces.empty()) rename(message);  // however late: it stays so
  }
  std::erase_if(messages, [&](const ProcedureMessage& each) { return is_outdated(each); });
  // An appointment that was another patient's before is theirs no more.
  take_out_appointment(messages);
  for (ProcedureMessage& message : messages) {
    switch (message.kind) {
      case Kind::kPlaces:
      case Kind::kFacts:
        place(std::move(message), arrival);
        break;
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
}

template <typename Use>
void ProcedureBook::with_each_arrival(const Use& use) {
  for (Messages* const messages : {&placed_, &appointments_, &ended_}) {
    for (auto& [key, kept] : *messages) {
      use(kept.received);
      for (auto& [place, since] : kept.since) use(since);
    }
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
      if (kept.message.sender == message.sender) kept.message.told.reset();
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

bool ProcedureBook::is_outdated(const ProcedureMessage& message) const {
  if (!message.told) return false;
  const auto is_newer = [&](const ProcedureMessage& known) {
    return known.sender == message.sender && known.told && *known.told - *message.told > kSameMoment;
  };
  return std::ranges::any_of(std::array{&placed_, &appointments_, &ended_}, [&](const Messages* messages) {
    return std::ranges::any_of(*messages, [&](const auto& each) {
      const ProcedureMessage& known = each.second.message;
      if (is_of_appointment(known) != is_of_appointment(message) || !is_newer(known)) return false;
      return is_of_appointment(message) ? same_appointment(known, message) : known.patient == message.patient;
    });
  });
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
    placed_.erase(found);
    is_gone = true;
  }
  if (!is_gone) return;
  message.data = {};
  const std::string key = key_of_ended(message);
  ended_.insert_or_assign(key, Kept{received, std::move(message)});
}

void ProcedureBook::place(ProcedureMessage message, const Arrival& received) {
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
    Kept kept{received, std::move(message)};
    for (const std::string& place : kept.message.places) kept.since.emplace(place, received);
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
      const bool stays = !arrives && before != kept.since.end() &&
                         somebody_else_came(message.patient, place, before->second);
      since.emplace(place, stays ? before->second : received);
      comes = comes || !stays;
    }
    kept.since = std::move(since);
  } else {
    message.places = kept.message.places;
    message.data.location = kept.message.data.location;
  }
  if (comes) kept.received = received;
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

/// What is known of a patient by an earlier number is of the new one from then on.
void ProcedureBook::rename(ProcedureMessage& message) {
  ProcedureMessage before;
  before.patient = message.replaces;
  before.numbers = message.replaced_numbers;
  before.data.patient = message.data.patient;
  before.data.birth_date = message.data.birth_date;
  add_numbers(message.numbers, message.replaced_numbers);  // some go on naming them so
  const auto give = [&message](ProcedureMessage& to) {
    add_numbers(to.numbers, message.numbers);
    to.patient = message.patient;
    to.data.patient_id = message.data.patient_id;
    to.data.patient_id_issuer = message.data.patient_id_issuer;
  };
  for (const std::string& patient : known_as(before, false)) {
    if (patient == message.patient) continue;
    auto node = placed_.extract(patient);
    add_numbers(message.numbers, node.mapped().message.numbers);
    const auto known = placed_.find(message.patient);
    if (known == placed_.end() || known->second.received.number < node.mapped().received.number) {
      give(node.mapped().message);
      placed_.insert_or_assign(message.patient, std::move(node.mapped()));
    }
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

void ProcedureBook::forget_old(Messages& messages, const ProcedureMoment& now) {
  const auto newest = [&now](const Kept& kept) {
    return std::max(now.by_this_clock(kept.received.at), planned(kept, now));
  };
  std::erase_if(messages, [&](const auto& each) { return now.utc - newest(each.second) > kLongestWindow; });
  while (messages.size() > kMostKept) {
    messages.erase(std::min_element(messages.begin(), messages.end(), [](const auto& a, const auto& b) {
      return a.second.received.number < b.second.received.number;
    }));
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
    std::vector<const ProcedureMessage*> planned;
    std::vector<std::optional<UtcTime>> times;
    for (const auto& [appointment, other] : appointments_) {
      if (other.message.patient != patient || other.message.is_over) continue;
      if (!concerns(rule, other.message)) continue;
      planned.push_back(&other.message);
      times.emplace_back(ProcedureBook::planned(other, at));
    }
    all.push_back(kept.message.data);
    all.back().chosen = "a message placed the patient in the room at " + format_utc(since);
    if (const auto chosen = nearest(times, at.utc, rule.window).index)
      complete(all.back(), planned[*chosen]->data);
  }
  for (const auto& [appointment, kept] : appointments_) {
    if (!concerns(rule, kept.message) || placed.contains(kept.message.patient)) continue;
    if (!is_near(planned(kept, at))) continue;
    all.push_back(kept.message.data);
    all.back().chosen =
        "an appointment of which a message told at " + format_utc(at.by_this_clock(kept.received.at));
  }
  return all;
}

std::optional<ProcedureData> ProcedureBook::find(const ProcedureRule& rule, ProcedureMoment at) const {
  return choose(rule, at).data;
}

ProcedureBook::Choice ProcedureBook::choose(const ProcedureRule& rule, const ProcedureMoment& at) const {
  const Kept* here = nullptr;
  UtcTime here_since;
  std::uint64_t newest = 0;
  for (const auto& [patient, kept] : placed_) {
    const std::optional<Arrival> came_in = came(rule, kept);
    if (!came_in || newest > came_in->number) continue;
    const UtcTime since = at.by_this_clock(came_in->at);
    if (std::chrono::abs(at.utc - since) > rule.window) continue;
    here = &kept;
    here_since = since;
    newest = came_in->number;
  }
  std::vector<const ProcedureMessage*> planned;
  std::vector<std::optional<UtcTime>> times;
  for (const auto& [appointment, kept] : appointments_) {
    if (!concerns(rule, kept.message) || kept.message.is_over) continue;
    if (here != nullptr && kept.message.patient != here->message.patient) continue;
    planned.push_back(&kept.message);
    times.emplace_back(ProcedureBook::planned(kept, at));
  }
  const NearestPlan plan = nearest(times, at.utc, rule.window);
  const auto chosen = plan.index;
  if (here == nullptr && !chosen) return {};
  // Which of two patients it is nobody can tell: a person chooses.
  const bool is_anybodys = here == nullptr && std::ranges::any_of(plan.equally_near, [&](std::size_t each) {
                             return planned[each]->patient != planned[*chosen]->patient;
                           });
  if (is_anybodys) return {{}, true, false};
  if (here == nullptr && plan.is_far_ahead) return {{}, false, true};
  const auto count = std::count_if(times.begin(), times.end(), [&](const auto& time) {
    return std::chrono::abs(*time - at.utc) <= rule.window;
  });
  ProcedureData appointment;
  if (chosen) {
    appointment = planned[*chosen]->data;
    appointment.chosen =
        "the appointment nearest to the beginning, of " + std::to_string(count) + " within " +
        std::to_string(std::chrono::duration_cast<std::chrono::minutes>(rule.window).count()) + " minutes";
  }
  if (here == nullptr) {
    appointment.chosen_by_plan = times[*chosen];
    return {appointment, false, false};
  }
  ProcedureData found = here->message.data;
  found.chosen = "the patient whom a message placed in the room last, at " + format_utc(here_since);
  if (chosen) complete(found, appointment);
  return {found, false, false};
}

}  // namespace kiroku::recorder
