#include "recorder/procedure/procedure_data.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/foreign_json.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "recorder/procedure/window.h"

namespace kiroku::recorder {
namespace {

using nlohmann::ordered_json;

void put(ordered_json& into, const char* key, const std::string& value) {
  if (!value.empty()) into[key] = value;
}

void put(ordered_json& into, const char* key, const ordered_json& value) {
  if (!value.empty()) into[key] = value;
}

void put_name(ordered_json& into, const PersonName& name) {
  put(into, "family", name.family);
  put(into, "given", name.given);
  put(into, "name", name.as_sent);
}

}  // namespace

void complete(ProcedureData& data, const ProcedureData& more) {
  for (const auto member :
       {&ProcedureData::patient_id, &ProcedureData::patient_id_issuer, &ProcedureData::birth_date,
        &ProcedureData::sex, &ProcedureData::visit, &ProcedureData::procedure_id, &ProcedureData::accession,
        &ProcedureData::study_uid, &ProcedureData::planned, &ProcedureData::location}) {
    if ((data.*member).empty()) data.*member = more.*member;
  }
  if (data.patient.empty()) data.patient = more.patient;
  // A code and its words belong together.
  if (data.description.empty() && data.code.empty()) {
    data.description = more.description;
    data.code = more.code;
    data.coding_system = more.coding_system;
  }
  for (const StaffMember& member : more.staff) {
    if (std::find(data.staff.begin(), data.staff.end(), member) == data.staff.end())
      data.staff.push_back(member);
  }
  data.origin += "+" + more.origin;
  data.chosen += "; " + more.chosen;
}

bool may_be_same_patient(const ProcedureData& one, const ProcedureData& other) {
  const auto agree = [](const std::string& a, const std::string& b) {
    return a.starts_with(b) || b.starts_with(a);  // a day of birth may be known as its year alone
  };
  if (one.patient_id != other.patient_id || !agree(one.birth_date, other.birth_date)) return false;
  if (one.patient_id.empty()) return !one.patient.empty() && one.patient == other.patient;
  return (one.patient_id_issuer == other.patient_id_issuer || one.patient_id_issuer.empty() ||
          other.patient_id_issuer.empty());
}

Bytes subject_json(const ProcedureData& data) {
  ordered_json patient = ordered_json::object();
  put(patient, "id", data.patient_id);
  put(patient, "id_issuer", data.patient_id_issuer);
  put_name(patient, data.patient);
  put(patient, "birth_date", data.birth_date);
  put(patient, "sex", data.sex);
  put(patient, "visit", data.visit);
  ordered_json procedure = ordered_json::object();
  put(procedure, "description", data.description);
  put(procedure, "code", data.code);
  put(procedure, "coding_system", data.coding_system);
  put(procedure, "id", data.procedure_id);
  put(procedure, "accession", data.accession);
  put(procedure, "study_uid", data.study_uid);
  put(procedure, "planned", data.planned);
  put(procedure, "location", data.location);
  ordered_json staff = ordered_json::array();
  for (const StaffMember& member : data.staff) {
    ordered_json one = ordered_json::object();
    put(one, "role", member.role);
    put(one, "id", member.id);
    put_name(one, member.name);
    staff.push_back(one);
  }
  ordered_json subject = ordered_json::object();
  put(subject, "patient", patient);
  put(subject, "procedure", procedure);
  put(subject, "staff", staff);
  put(subject, "origin", data.origin);
  put(subject, "chosen", data.chosen);
  return to_bytes(subject.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n");
}

ProcedureData data_of_subject(ByteView subject) {
  ProcedureData data;
  try {
    const nlohmann::json all = parse_foreign_json(text_of(subject));
    const auto take = [&all](const char* part, const char* key, std::string& into) {
      const auto object = all.find(part);
      if (object == all.end() || !object->is_object()) return;
      const auto value = object->find(key);
      if (value != object->end() && value->is_string()) into = value->get<std::string>();
    };
    take("patient", "id", data.patient_id);
    take("patient", "id_issuer", data.patient_id_issuer);
    take("patient", "family", data.patient.family);
    take("patient", "given", data.patient.given);
    take("patient", "name", data.patient.as_sent);
    take("patient", "birth_date", data.birth_date);
    take("procedure", "description", data.description);
    take("procedure", "accession", data.accession);
    take("procedure", "study_uid", data.study_uid);
    take("procedure", "planned", data.planned);
  } catch (const std::exception&) {
    return {};  // what a person wrote may be anything
  }
  return data;
}

bool may_be_same_procedure(const ProcedureData& one, const ProcedureData& other) {
  ProcedureData same = other;
  // Two systems may write one number in two ways.
  if (may_be_one({one.patient_id, one.patient_id_issuer, {}, {}},
                 {other.patient_id, other.patient_id_issuer, {}, {}})) {
    same.patient_id = one.patient_id;
    same.patient_id_issuer = one.patient_id_issuer;
  }
  if (!may_be_same_patient(one, same)) return false;
  // As precise, and with a zone or without one, as each system writes it.
  constexpr std::size_t kToMinutes = 16;
  const std::size_t length = std::min({kToMinutes, one.planned.size(), other.planned.size()});
  if (one.planned.substr(0, length) != other.planned.substr(0, length)) return false;
  for (const auto member : {&ProcedureData::accession, &ProcedureData::study_uid}) {
    if (!(one.*member).empty() && !(other.*member).empty()) return one.*member == other.*member;
  }
  return true;
}

void add_unknown(std::vector<ProcedureData>& list, std::vector<ProcedureData> more) {
  for (ProcedureData& each : more) {
    const bool is_known = std::ranges::any_of(list, [&](const ProcedureData& other) {
      return may_be_same_patient(other, each) && other.description == each.description &&
             other.accession == each.accession;
    });
    if (!is_known) list.push_back(std::move(each));
  }
}

void order_by_plan(std::vector<ProcedureData>& list, std::size_t most) {
  std::ranges::stable_sort(list, {}, &ProcedureData::planned);
  if (list.size() > most) list.resize(most);
}

std::string key_of(const ProcedureData& data) {
  constexpr std::size_t kDigits = 32;
  ProcedureData without = data;
  without.chosen.clear();
  return crypto::to_hex(crypto::sha256(subject_json(without))).substr(0, kDigits);
}

std::string iso_date(std::string_view digits) {
  const bool is_date = (digits.size() == 8 || digits.size() == 6) &&
                       digits.find_first_not_of("0123456789") == std::string_view::npos;
  if (!is_date) return std::string(digits);
  std::string date(digits.substr(0, 4));
  for (std::size_t i = 4; i < digits.size(); i += 2) date.append("-").append(digits.substr(i, 2));
  return date;
}

std::string_view words_of(Doubt doubt) {
  switch (doubt) {
    case Doubt::kNone:
      return "";
    case Doubt::kTwoPlanned:
      return "two patients are planned equally near to its beginning, and a person must choose";
    case Doubt::kSeveralThere:
      return "messages placed several patients in the room, none of whom has left, and a person must choose";
    case Doubt::kMayBeGone:
      return "whoever came to the room last has left it, so that whoever came before may be gone, too, and a "
             "person must choose";
    case Doubt::kLeftMeanwhile:
      return "somebody has left the room since it began, and a person must choose";
    case Doubt::kToldLate:
      return "a message that came late says that the patient left or is planned no more, and a person must "
             "choose";
    case Doubt::kTwoWays:
      return "messages and worklist name two patients, and a person must choose";
    case Doubt::kTooEarly:
      return "what is planned nearest to its beginning lies more than an hour ahead, and a person must "
             "choose";
    case Doubt::kTimeUnclear:
      return "a patient may be planned now whose time is not stated or cannot be read, and a person must "
             "choose";
    case Doubt::kLeftAlready:
      return "whoever is planned nearest to its beginning has left before, or it was called off, and a "
             "person "
             "must choose";
    case Doubt::kRecordedAlready:
      return "what is planned nearest to its beginning was recorded here before, and a person must choose";
    case Doubt::kOtherVisit:
      return "a message about another visit of the patient says that they left or are elsewhere, and a "
             "person "
             "must choose";
    case Doubt::kOneNumber:
      return "messages give the patient's number to somebody of another name and birth, too, and a person "
             "must choose";
    case Doubt::kNobodyNamed:
      return "somebody left the room whom the message does not name, and a person must choose";
    case Doubt::kNotKept:
      return "messages told more of this room than is kept, or some of it cannot be read any more, and a "
             "person must choose";
    case Doubt::kOneAppointment:
      return "messages use the appointment's number for somebody or something else, too, and a person must "
             "choose";
    case Doubt::kStatusUnclear:
      return "the appointment's status does not say that it is booked, and a person must choose";
    case Doubt::kEarlierOpen:
      return "somebody who was planned before has neither been recorded nor left, and a person must choose";
    case Doubt::kRecordElsewhere:
      return "a correction of the patient's record names another place, and a person must choose";
    case Doubt::kRecordAlone:
      return "a correction of a record alone says who is in the room, and a person must choose";
    case Doubt::kOnlyRegistered:
      return "whoever is in the room was only registered there, somebody else is planned, and a person must "
             "choose";
    case Doubt::kNewborn:
      return "whoever is in the room is newborn, somebody left it since they came, and a person must choose";
    case Doubt::kRegisteredElsewhere:
      return "a registration or a change of beds names another place for whoever is in the room, and a "
             "person "
             "must choose";
    case Doubt::kRoomUnclear:
      return "a change of an appointment does not say whether it is in this room still, and a person must "
             "choose";
    case Doubt::kNotSeenOff:
      return "somebody else was in the room or planned for it before, no message says that this is over, and "
             "a "
             "person must choose";
    case Doubt::kUnnamed:
      return "an appointment that may be meant names no patient, and a person must choose";
    case Doubt::kRecordAgainstPlan:
      return "a correction of a record alone names the room for somebody, somebody else is planned, and a "
             "person must choose";
    case Doubt::kRecordedHere:
      return "a case about whoever is in the room has ended since they came, and a person must choose";
  }
  return "";
}

std::string_view words_of(Objection objection) {
  switch (objection) {
    case Objection::kNone:
    case Objection::kOver:
      return "";
    case Objection::kAnotherThere:
      return "messages or the worklist name another patient for this room now than the one whom they named "
             "for this case: see whether the case has the right patient, or the next one has come";
    case Objection::kSeveralThere:
      return "messages placed another patient in this room, too, while the case runs: see whether the case "
             "has the right patient";
    case Objection::kTakenBack:
      return "messages take back that the patient whom they named for this case came to this room, or is "
             "planned for it now: see whether the case has the right patient";
    case Objection::kOtherIdentity:
      return "messages give the patient whom they named for this case another number, name or day of birth "
             "now: see whether the case has the right patient";
  }
  return "";
}

UtcTime::duration least_distance(const std::optional<TimeSpan>& within, UtcTime at) {
  if (!within || (within->earliest <= at && at <= within->latest)) return UtcTime::duration::zero();
  return at < within->earliest ? within->earliest - at : at - within->latest;
}

NearestPlan nearest(const std::vector<std::optional<UtcTime>>& times, UtcTime at,
                    std::chrono::nanoseconds window) {
  NearestPlan found;
  const auto distance = [&](std::size_t i) { return std::chrono::abs(*times[i] - at); };
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (!times[i] || !is_within(distance(i), window) || (found.index && distance(i) > distance(*found.index)))
      continue;
    if (found.index && distance(i) < distance(*found.index)) found.equally_near.clear();
    found.index = i;
    found.equally_near.push_back(i);
  }
  found.is_far_ahead = found.index && *times[*found.index] - at > kFurthestAhead;
  return found;
}

}  // namespace kiroku::recorder
