// The study of the papers with simulated trainees who learn by what they are shown. Its results say nothing
// about people, and every record of it says so.
#pragma once

#include <functional>

#include "trainer/curriculum/learning.h"
#include "trainer/exclusion/exclusion_run.h"

namespace kiroku::trainer {

/// Source: section 6.2 of "Construction of Training Environment for Surgical Exclusion with a Basic Study of
/// Multi-finger Haptic Interaction": seven people saw stress, six did not; five days; three minutes of
/// practice, then a test without stress.
struct SimulatedStudy {
  std::size_t shown = 7, hidden = 6;  // trainees of the groups
  int sessions = 5;
  double practice_s = kPracticeSeconds;  // of a session, in as many attempts as they take
  std::size_t fingers = 3;
  std::uint32_t seed = 1;
};

/// Two groups, "stress shown" and "stress hidden" in practice. In practice a trainee (LearningTrainee) makes
/// one attempt after the other until its time is over, gives up one that fails at the place where it began,
/// and keeps what turned out better; its test is without stress. Records in the order in which they were
/// made, `made` is told each. The same study gives the same records. kiroku::UsageError for a study without
/// trainees, sessions or practice.
std::vector<ExclusionRecord> run_simulated_study(
    const ExclusionBody& body, const SimulatedStudy& study,
    const std::function<void(const ExclusionRecord&)>& made = {});

/// How the largest stress of the tests went, as Figures 9 and 10 of the paper show it: both groups by day.
Plot plot_of_study(const std::vector<ExclusionRecord>& records, const std::string& object, Measure measure);

}  // namespace kiroku::trainer
