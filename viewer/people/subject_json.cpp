#include "viewer/people/subject_json.h"

#include <nlohmann/json.hpp>

#include "viewer/http/role.h"
#include "viewer/people/session.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

void put(ordered_json& into, const char* key, const std::string& text) {
  if (!text.empty()) into[key] = text;
}

}  // namespace

ordered_json subject_json(const playback::CaseSubject& subject) {
  ordered_json out = ordered_json::object();
  if (subject.time_ns) out["time_ns"] = *subject.time_ns;
  put(out, "patient", subject.patient);
  put(out, "patient_id", subject.patient_id);
  put(out, "birth_date", subject.birth_date);
  put(out, "sex", subject.sex);
  put(out, "procedure", subject.procedure);
  put(out, "procedure_code", subject.procedure_code);
  put(out, "procedure_id", subject.procedure_id);
  put(out, "planned", subject.planned);
  out["staff"] = ordered_json::array();
  for (const playback::CasePerson& person : subject.staff) {
    ordered_json one = ordered_json::object();
    put(one, "role", person.role);
    put(one, "name", person.name);
    put(one, "id", person.id);
    out["staff"].push_back(std::move(one));
  }
  put(out, "origin", subject.origin);
  put(out, "chosen", subject.chosen);
  return out;
}

std::shared_ptr<SubjectShelf> subjects_for(const Request& request) {
  return may(request.session->role(), Right::kWatch) ? request.session->subjects() : nullptr;
}

std::string_view subjects_word(const Request& request) {
  if (!may(request.session->role(), Right::kWatch)) return "no-right";
  return request.session->subjects() ? "unlocked" : "locked";
}

}  // namespace kiroku::viewer
