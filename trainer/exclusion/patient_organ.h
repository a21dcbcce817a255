// An organ of a CT as something to push aside: a document that names its mesh, what it is made of, and what
// of the task is not to follow the rules (docs/explanation/training.md, "Organs of a CT"). Thread-safe.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "trainer/exclusion/organ_task.h"

namespace kiroku::trainer {

struct PatientOrgan {
  OrganObject object;
  ExclusionTask task;
  std::vector<std::string> warnings;  // what is odd, a sentence each
};

/// `step` is told what is done next; may be empty. kiroku::Error with the file and the path of a value for
/// what is no such document, what its mesh and materials are refused for, and of organ_task();
/// kiroku::UsageError for a mesh of fewer than kLeastObjectNodes or more than kMostObjectNodes.
PatientOrgan read_patient_organ(const std::filesystem::path& file,
                                const std::function<void(const std::string&)>& step = {});

/// kiroku::Error with the rate that measured_force_rate_hz() gave where it is below the 1 kHz that a hand
/// needs.
void require_haptic_rate(const ExclusionBody& body, std::size_t fingers, double measured_hz);

}  // namespace kiroku::trainer
