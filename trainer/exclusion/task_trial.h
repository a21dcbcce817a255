// Whether a task can be finished at all, as far as a simulated trainee can tell. Pure functions, thread-safe.
#pragma once

#include <span>
#include <string>

#include "trainer/exclusion/exclusion_body.h"

namespace kiroku::trainer {

/// Lets a simulated trainee, who is shown no stress, try the task with each of these numbers of fingers until
/// it finishes it. Empty where it did; else a sentence that perhaps nobody can, with how much of the line
/// came into sight. No proof: a person may find a place that it does not try. Takes a second or two where the
/// first try succeeds, up to half a minute for each that does not. The same body gives the same sentence.
std::string doubt_about(const ExclusionBody& body, std::span<const std::size_t> fingers);

}  // namespace kiroku::trainer
