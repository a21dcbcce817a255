// From findings to the verdict. Pure; thread-safe.
#pragma once

#include "archive/verify/finding.h"
#include "archive/verify/report.h"

namespace kiroku::archive {

/// The verdict that the gravest finding makes.
Verdict verdict_of(Severity worst);
/// The same of an excerpt.
Verdict verdict_of_excerpt(Severity worst);

}  // namespace kiroku::archive
