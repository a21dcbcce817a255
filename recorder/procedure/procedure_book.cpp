#include "recorder/procedure/procedure_book.h"

#include <algorithm>
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

}  // namespace

void ProcedureBook::take(ProcedureMessage message, ProcedureMoment received) {
  std::vector<ProcedureMessage> one;
  one.push_back(std::move(message));
  take_all(std::move(one), received);
}

void ProcedureBook::take_all(std::vector<ProcedureMessage> messages, ProcedureMoment received) {
  using Kind = ProcedureMessage::Kind;
  const Arrival arrival{++arrivals_, received};
  // An appointment that was another patient's before is theirs no more.
  for (const ProcedureMessage& each : messages) {
    if (each.kind == Kind::kAppointment || each.kind == Kind::kCancels) cancel(each.appointment);
  }
  for (ProcedureMessage& message : messages) {
    if (!message.replaces.empty()) rename(message);
    switch (message.kind) {
      case Kind::kPlaces:
      case Kind::kFacts:
        place(std::move(message), arrival);
        break;
      case Kind::kLeaves:
        placed_.erase(message.patient);
        break;
      case Kind::kAppointment: {
        const std::string key = key_of_appointment(message);
        appointments_.insert_or_assign(key, Kept{arrival, std::move(message)});
        break;
      }
      case Kind::kCancels:
      case Kind::kNothing:
        break;
    }
  }
  forget_old(placed_, received);
  forget_old(appointments_, received);
}

void ProcedureBook::place(ProcedureMessage message, const Arrival& received) {
  const auto known = placed_.find(message.patient);
  const bool says_where = message.kind == ProcedureMessage::Kind::kPlaces && !message.places.empty();
  if (known == placed_.end()) {
    // A change of somebody's address, or a record that is begun, brings nobody into the room. Where every
    // message is about one room, an event of arriving does without a place.
    if (!says_where && !message.moves) return;
    Kept kept{received, std::move(message)};
    for (const std::string& place : kept.message.places) kept.since.emplace(place, received);
    const std::string patient = kept.message.patient;
    placed_.emplace(patient, std::move(kept));
    return;
  }
  Kept& kept = known->second;
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
void ProcedureBook::rename(const ProcedureMessage& message) {
  const auto give = [&message](ProcedureMessage& to) {
    to.patient = message.patient;
    to.data.patient_id = message.data.patient_id;
    to.data.patient_id_issuer = message.data.patient_id_issuer;
  };
  if (auto node = placed_.extract(message.replaces)) {
    const auto known = placed_.find(message.patient);
    if (known == placed_.end() || known->second.received.number < node.mapped().received.number) {
      give(node.mapped().message);
      placed_.insert_or_assign(message.patient, std::move(node.mapped()));
    }
  }
  std::vector<Kept> moved;
  std::erase_if(appointments_, [&](auto& each) {
    if (each.second.message.patient != message.replaces) return false;
    moved.push_back(std::move(each.second));
    return true;
  });
  for (Kept& each : moved) {
    give(each.message);
    const std::string key = key_of_appointment(each.message);
    appointments_.insert_or_assign(key, std::move(each));
  }
}

void ProcedureBook::cancel(const std::string& appointment) {
  std::erase_if(appointments_,
                [&](const auto& each) { return each.second.message.appointment == appointment; });
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
      if (other.message.patient != patient || !concerns(rule, other.message)) continue;
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
    if (!concerns(rule, kept.message)) continue;
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
  if (is_anybodys) return {{}, true};
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
    return {appointment};
  }
  ProcedureData found = here->message.data;
  found.chosen = "the patient whom a message placed in the room last, at " + format_utc(here_since);
  if (chosen) complete(found, appointment);
  return {found};
}

}  // namespace kiroku::recorder
