#include "viewer/playback/case_subject.h"

#include <algorithm>
#include <initializer_list>

#include <nlohmann/json.hpp>

#include "archive/format/case_folder.h"
#include "base/ascii.h"
#include "base/error.h"
#include "base/foreign_json.h"
#include "crypto/age_file.h"
#include "crypto/hash.h"
#include "viewer/playback/case_events.h"

namespace kiroku::playback {
namespace {

using nlohmann::json;

constexpr std::size_t kLargestSubject = std::size_t{16} << 20;
/// What a person gives may be nested; what is deeper than this is not searched.
constexpr int kDeepest = 8;

std::string text_of_key(const json& object, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    const auto found = object.find(key);
    if (found == object.end()) continue;
    if (found->is_string() && !found->get_ref<const std::string&>().empty()) return found->get<std::string>();
    if (found->is_number_integer()) return found->dump();
  }
  return {};
}

/// "Yamada Tarou / 山田 太郎" of "Yamada^Tarou=山田^太郎" (HL7 XPN, DICOM PN): components by '^', scripts by
/// '='.
std::string plain_name(const std::string& as_sent) {
  std::string out;
  bool wants_space = false;
  for (const char c : as_sent) {
    if (c == '=') {
      if (!out.empty() && !out.ends_with(" / ")) out += " / ";
      wants_space = false;
    } else if (c == '^') {
      wants_space = !out.empty() && !out.ends_with(" / ");
    } else {
      if (wants_space) out += ' ';
      wants_space = false;
      out += c;
    }
  }
  while (out.ends_with(' ') || out.ends_with('/')) out.pop_back();
  return out;
}

/// Of a person as format 1 writes one, or as somebody wrote it by hand: a text, or an object.
std::string name_of(const json& person) {
  if (person.is_string()) return plain_name(person.get<std::string>());
  if (!person.is_object()) return {};
  if (const std::string as_sent = text_of_key(person, {"name"}); !as_sent.empty()) return plain_name(as_sent);
  const std::string family = text_of_key(person, {"family"}), given = text_of_key(person, {"given"});
  return family + (family.empty() || given.empty() ? "" : " ") + given;
}

void add_person(std::vector<CasePerson>& staff, const json& person) {
  CasePerson one{person.is_object() ? text_of_key(person, {"role"}) : std::string(), name_of(person),
                 person.is_object() ? text_of_key(person, {"id"}) : std::string()};
  if (!one.name.empty() || !one.id.empty()) staff.push_back(std::move(one));
}

void read_patient(CaseSubject& subject, const json& patient) {
  subject.patient = name_of(patient);
  if (!patient.is_object()) return;
  subject.patient_id = text_of_key(patient, {"id"});
  subject.birth_date = text_of_key(patient, {"birth_date"});
  subject.sex = text_of_key(patient, {"sex"});
}

void read_procedure(CaseSubject& subject, const json& procedure) {
  if (procedure.is_string()) subject.procedure = procedure.get<std::string>();
  if (!procedure.is_object()) return;
  subject.procedure = text_of_key(procedure, {"description", "name"});
  subject.procedure_code = text_of_key(procedure, {"code"});
  subject.procedure_id = text_of_key(procedure, {"id"});
  subject.planned = text_of_key(procedure, {"planned"});
}

void read_staff(CaseSubject& subject, const json& staff) {
  if (staff.is_array()) {
    for (const json& person : staff) add_person(subject.staff, person);
  } else if (staff.is_object() && !staff.contains("name")) {
    // {"surgeon": "Dr. Sato"}
    for (const auto& [role, person] : staff.items()) {
      const std::size_t before = subject.staff.size();
      add_person(subject.staff, person);
      if (subject.staff.size() > before && subject.staff.back().role.empty())
        subject.staff.back().role = role;
    }
  } else {
    add_person(subject.staff, staff);
  }
}

void gather_texts(const json& value, int depth, std::string& into) {
  if (depth > kDeepest) return;
  if (value.is_string()) into += value.get_ref<const std::string&>() + "\n";
  if (value.is_number()) into += value.dump() + "\n";
  if (!value.is_structured()) return;
  for (const json& each : value) gather_texts(each, depth + 1, into);
}

CaseSubject read_object(const json& object) {
  CaseSubject subject;
  if (const auto found = object.find("patient"); found != object.end()) read_patient(subject, *found);
  if (const auto found = object.find("procedure"); found != object.end()) read_procedure(subject, *found);
  if (const auto found = object.find("staff"); found != object.end()) read_staff(subject, *found);
  if (const auto training = object.find("training"); training != object.end() && training->is_object()) {
    const std::string trainee = text_of_key(*training, {"trainee"});
    if (!trainee.empty()) subject.staff.push_back({"trainee", trainee, {}});
  }
  subject.origin = text_of_key(object, {"origin"});
  subject.chosen = text_of_key(object, {"chosen"});
  std::string texts;
  gather_texts(object, 0, texts);
  texts += subject.patient + "\n";
  for (const CasePerson& person : subject.staff) texts += person.name + "\n";
  subject.searchable = lower_case(texts);
  return subject;
}

std::optional<CaseSubject> read_file(const CaseMedia& media) {
  const std::optional<archive::FileReference>& stated = media.recording().opening().subject;
  if (!stated) return {};
  const archive::CaseFolder folder = archive::CaseFolder::open(media.recording().folder());
  const archive::FileOpening opening = folder.open_file(stated->file);
  const std::optional<std::string> sealed =
      opening.file ? archive::read_small(*opening.file, kLargestSubject) : std::nullopt;
  if (!sealed) throw Error(stated->file + " cannot be read: who was operated on is not known");
  if (sealed->size() != stated->bytes || crypto::sha256(bytes_of(*sealed)) != stated->sha256) {
    throw Error(stated->file + " is not what the ledger says: it was changed, and is not shown");
  }
  Bytes plain = crypto::unseal_bytes(bytes_of(*sealed), media.identities());
  std::optional<CaseSubject> subject = read_subject(text_of(plain));
  crypto::zeroise(plain);
  if (!subject) throw Error(stated->file + " holds no JSON object");
  return subject;
}

}  // namespace

std::optional<CaseSubject> read_subject(std::string_view text) {
  const json object = parse_foreign_json(text);
  if (!object.is_object()) return {};
  return read_object(object);
}

std::vector<CaseSubject> subjects_of(const CaseMedia& media) {
  std::vector<CaseSubject> subjects;
  for_each_event(media, [&](const json& event) {
    const auto kind = event.find("kind");
    const auto about = event.find("subject");
    if (kind == event.end() || *kind != "subject" || about == event.end() || !about->is_object()) return;
    subjects.push_back(read_object(*about));
    const auto time = event.find("time_ns");
    subjects.back().time_ns =
        time != event.end() && time->is_number_integer() ? time->get<std::int64_t>() : std::int64_t{0};
  });
  std::ranges::stable_sort(subjects, {}, &CaseSubject::time_ns);
  if (std::optional<CaseSubject> first = read_file(media))
    subjects.insert(subjects.begin(), std::move(*first));
  return subjects;
}

}  // namespace kiroku::playback
