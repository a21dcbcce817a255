#include "recorder/procedure/procedure_book.h"

#include <algorithm>
#include <set>
#include <utility>

#include "recorder/procedure/procedure_matching.h"

namespace kiroku::recorder {

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

void ProcedureBook::take(ProcedureMessage message, ProcedureMoment received) {
  std::vector<ProcedureMessage> one;
  one.push_back(std::move(message));
  take_all(std::move(one), received);
}

void ProcedureBook::take_all(std::vector<ProcedureMessage> messages, ProcedureMoment received) {
  using Kind = ProcedureMessage::Kind;
  if (messages.empty()) return;
  name_patients(messages);
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
  for (const ProcedureMessage& message : messages) end_claims(message);
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
  claim();
  forget_old(claims_, received);
  forget_old(planned_claims_, received);
  forget_passed(received);
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
  for (const Recorded& each : recorded_) {
    if (is_named(rule, each.room)) of_room.emplace_back(each.data, at.by_this_clock(each.at));
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

}  // namespace kiroku::recorder
