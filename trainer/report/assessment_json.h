// Questionnaires and checklists as the page and a sealed case tell them. Pure functions, thread-safe.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "trainer/assessment/assessment.h"

namespace kiroku::trainer {

/// {"answers": {"organ-feel": 1, "useful": 2, "stress-helps": null}, "comment": "", "by": "anna"}
nlohmann::ordered_json questionnaire_json(const Questionnaire& questionnaire);
/// {"items": {"looks-first": "done", ...}, "global_rating": 4, "examiner": "Dr Sato", "by": "root"}
nlohmann::ordered_json checklist_json(const Checklist& checklist);

/// Of the same form, without "by". kiroku::UsageError that names the field where it is of another form or not
/// sound (require_sound()).
Questionnaire questionnaire_of(const nlohmann::json& told);
Checklist checklist_of(const nlohmann::json& told);

}  // namespace kiroku::trainer
