// The study of the papers with simulated trainees: proves that it runs from sessions to a t-test. Its results
// say nothing about people, and every record of it says so.
#pragma once

#include <functional>

#include "trainer/curriculum/learning.h"
#include "trainer/exclusion/exclusion_run.h"

namespace kiroku::trainer {

struct SimulatedStudy {
  std::size_t trainees_a_group = 6;
  int sessions = 5;
  std::size_t fingers = 3;
  std::uint32_t seed = 1;
};

/// Two groups, "stress shown" and "stress hidden" in practice; each session is one attempt of practice and
/// one test without stress. Records in the order in which they were made, `made` is told each. The same study
/// gives the same records. kiroku::UsageError for a study without trainees or sessions.
std::vector<ExclusionRecord> run_simulated_study(
    const ExclusionBody& body, const SimulatedStudy& study,
    const std::function<void(const ExclusionRecord&)>& made = {});

}  // namespace kiroku::trainer
