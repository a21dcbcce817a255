// 'kiroku compare': making a comparison, from the case and the plan to what is kept or written. Not
// thread-safe.
#pragma once

#include "apps/sim/comparison_request.h"

namespace kiroku::apps {

/// Tells what was made; the exit status. kiroku::Error in a sentence for what cannot be.
int make_comparison(const ComparisonRequest& request);

}  // namespace kiroku::apps
