// The case on one line of time: when each stream was recorded, its gaps, and the time stamps. Pure functions,
// thread-safe.
#pragma once

#include <cstddef>

#include "archive/verify/report.h"
#include "viewer/report/case_facts.h"
#include "viewer/report/figure.h"
#include "viewer/report/language.h"

namespace kiroku::report {

/// So many streams stand on a page beside their caption: more than a room has. A ledger may name 256.
inline constexpr std::size_t kMostStreamsDrawn = 32;

/// On the case's clock, from its beginning; of an excerpt its time alone. `width` in points. Of the first
/// kMostStreamsDrawn streams, and of time stamps those that hold. Gaps are drawn as crossed boxes at least as
/// wide as can be seen.
Figure time_figure(const archive::VerificationReport& verification, const CaseFacts& facts, Language language,
                   double width);

}  // namespace kiroku::report
