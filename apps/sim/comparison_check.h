// 'kiroku compare --verify': whether a comparison still fits its case and plan. Not thread-safe.
#pragma once

#include "apps/sim/comparison_request.h"

namespace kiroku::apps {

/// Tells what holds; the exit status of its verdict.
int verify_comparison(const ComparisonRequest& request);

}  // namespace kiroku::apps
