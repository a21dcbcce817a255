// Which CT a comparison shows, and whose it is. Not thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "apps/sim/comparison_request.h"
#include "apps/sim/patient_of_material.h"
#include "apps/sim/plan_at_hand.h"
#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "viewer/kept/provenance.h"

namespace kiroku::apps {

/// The plan's own, or the one asked for where the plan has none; nothing where there is neither.
/// kiroku::UsageError where another one is asked for than the plan has: a seal states the CT by its hash, and
/// another one beside the recording would be taken for what was planned on.
std::optional<compare::ComparedCt> compared_ct(const ComparisonRequest& request, const FilesAtHand& at_hand);

/// The patients' numbers that the CT and the case state. Empty where none is known: the CT is no DICOM,
/// nothing is sealed in the case or the identities do not open it. `ct_of_plan`: empty where it names none.
struct PatientNumbers {
  PatientIds ct, of_case;
};
PatientNumbers patient_numbers(const ComparisonRequest& request, const std::filesystem::path& ct_of_plan,
                               const archive::CaseReader& recording, const crypto::AgeIdentities& identities);

}  // namespace kiroku::apps
