// From findings to the verdict. Pure; thread-safe.
#pragma once

#include "archive/finding.h"
#include "archive/verifier.h"

namespace kiroku::archive {

/// The verdict that the gravest finding makes.
Verdict verdict_of(Severity worst);
/// The same of an excerpt.
Verdict verdict_of_excerpt(Severity worst);

}  // namespace kiroku::archive
