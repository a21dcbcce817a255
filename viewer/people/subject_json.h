// Subjects of cases as the API says them, to who may see them alone. Functions; thread-safe.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "viewer/http/request.h"
#include "viewer/people/subject_shelf.h"

namespace kiroku::viewer {

/// {"time_ns","patient","patient_id",…}: openapi.json, "Subject". What is not known is left out.
nlohmann::ordered_json subject_json(const playback::CaseSubject& subject);

/// Who may watch recordings may see whom they are of: the shelf of the request's session; null for whoever
/// has not unlocked, and for roles that see no recordings whatever they hold.
std::shared_ptr<SubjectShelf> subjects_for(const Request& request);
/// Why subjects_for() is null, as the API says it: "locked" or "no-right"; else "unlocked".
std::string_view subjects_word(const Request& request);

}  // namespace kiroku::viewer
