// Reading a plan for a person at a terminal. Not thread-safe.
#pragma once

#include <optional>
#include <string>

#include "sim/plan/plan.h"

namespace kiroku::apps {

/// The plan, its mesh made where it has a recipe, or nothing once all its errors are told: on standard error,
/// or for machines as one JSON object. Warnings are told to people only. kiroku::UsageError for a breathing
/// lung.
std::optional<sim::Plan> read_plan_and_tell(const std::string& file, bool json);

/// Of all steps.
double duration_s(const sim::Plan& plan);

}  // namespace kiroku::apps
