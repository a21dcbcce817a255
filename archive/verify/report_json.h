// What verification found, for machines. Pure functions; thread-safe.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "archive/verify/report.h"

namespace kiroku::archive {

/// {"case", "verdict", "time", "outside_entries", "device", "opened", "closed", counts, "excerpt": {…},
/// "contents", "evidence", "witnesses": {…}, "streams": […], "brackets": […], "findings": [{"code",
/// "severity", "file", "of" ("log": about the log beside the case), "entry", "offset", "text"}]}; what does
/// not apply is null. "excerpt" is ExcerptReport;
/// what the excerpt says of its own making, which nothing proves, is below "stated" there.
nlohmann::ordered_json report_json(const VerificationReport& report);

/// [{"witness", "cosigned", "invalid", "time_s" of a valid one}].
nlohmann::ordered_json cosigners_json(const crypto::WitnessedNote& note);

/// "note", "gap", "unproven", "incomplete", "tampered".
std::string severity_name(Severity severity);

}  // namespace kiroku::archive
