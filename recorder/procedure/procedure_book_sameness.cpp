#include <algorithm>
#include <utility>

#include "base/ascii.h"
#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/procedure_matching.h"

namespace kiroku::recorder {

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

ProcedureBook::Likeness ProcedureBook::same_appointment(const ProcedureMessage& one,
                                                        const ProcedureMessage& other) {
  const std::optional<bool> is_one_number = same_number_of_appointment(one, other);
  if (is_one_number && !*is_one_number) return Likeness::kNone;
  const bool names_nobody = one.patient.empty() || other.patient.empty();
  const Likeness alike = names_nobody ? Likeness::kSure : likeness(one, other);
  if (is_one_number) return alike == Likeness::kNone ? Likeness::kPerhaps : Likeness::kSure;
  return alike == Likeness::kNone ? Likeness::kNone : Likeness::kPerhaps;
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

ProcedureBook::Likeness ProcedureBook::has_left(const ProcedureMessage& message) const {
  Likeness most = Likeness::kNone;
  for (const auto& [key, kept] : ended_) {
    if (is_of_appointment(kept.message) || kept.is_of_another_visit(message)) continue;
    most = std::max(most, likeness(message, kept.message));
  }
  return most;
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
      // They are where they went last, and were where they came before. Neither a registration nor a record
      // moves anybody from there.
      const auto way_of_coming = [](const Kept& each) {
        if (each.since.empty()) return each.message.moves ? each.way_to("") : Way::kRecord;
        Way surest = Way::kRecord;
        for (const auto& [place, came] : each.since) surest = std::max(surest, each.way_to(place));
        return surest;
      };
      const auto rank = [&](const Kept& each) {
        return std::pair(way_of_coming(each), each.received.number);
      };
      if (rank(known->second) > rank(one)) std::swap(known->second, one);
      const Kept& other = known->second;
      const bool is_registered_since = way_of_coming(other) == Way::kRegistered &&
                                       other.received.number > one.received.number &&
                                       !share_a_place(other.message.places, one.message.places);
      if (is_registered_since && one.doubt == Doubt::kNone) one.doubt = Doubt::kRegisteredElsewhere;
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
  give_claims(before, message);
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

}  // namespace kiroku::recorder
