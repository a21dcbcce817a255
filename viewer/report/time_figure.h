// The case on one line of time: when each stream was recorded, its gaps, and the time stamps. Pure functions,
// thread-safe.
#pragma once

#include "archive/verify/report.h"
#include "viewer/report/case_facts.h"
#include "viewer/report/figure.h"
#include "viewer/report/language.h"

namespace kiroku::report {

/// `width` in points. Gaps are drawn as crossed boxes at least as wide as can be seen.
Figure time_figure(const archive::VerificationReport& verification, const CaseFacts& facts, Language language,
                   double width);

}  // namespace kiroku::report
