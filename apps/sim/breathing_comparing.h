// 'kiroku compare' of a lung that breathes with a case's fluoroscopy.
#pragma once

#include "apps/sim/comparison_request.h"

namespace kiroku::apps {

/// Case and plan are named, and the plan is a lung that breathes. Writes the document, tells what was found,
/// and returns the exit status. kiroku::UsageError for options of operations alone, and where CT, geometry or
/// output are not said; as find_case_fluoroscopy(), read_case_fluoroscopy() and viewer::compare_breathing().
int make_breathing_comparison(const ComparisonRequest& request);

}  // namespace kiroku::apps
