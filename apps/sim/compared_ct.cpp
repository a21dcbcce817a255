#include "apps/sim/compared_ct.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include "apps/sim/sealed_files.h"
#include "base/error.h"
#include "sim/plan/plan_files.h"
#include "sim/volume/image_file.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

/// Names do not count: a CT may lie elsewhere, under another name.
std::vector<crypto::Sha256Digest> hashes_of_volume(const std::vector<SealedFile>& files) {
  std::vector<crypto::Sha256Digest> hashes;
  for (const SealedFile& file : files) {
    if (file.role == "volume") hashes.push_back(file.sha256);
  }
  std::ranges::sort(hashes);
  return hashes;
}

}  // namespace

std::optional<compare::ComparedCt> compared_ct(const ComparisonRequest& request, const FilesAtHand& at_hand) {
  compare::ComparedCt ct;
  ct.series = request.series.value_or("");
  const std::vector<crypto::Sha256Digest> of_plan = hashes_of_volume(at_hand.files.files);
  if (!request.volume) return of_plan.empty() ? std::nullopt : std::optional(std::move(ct));
  std::vector<SealedFile> asked;
  for (const sim::PlanFile& file : sim::files_of_volume(*request.volume, sim::data_file_of))
    asked.push_back(hashed(file.role, file.name, file.path));
  if (hashes_of_volume(asked) == of_plan) return ct;
  if (!of_plan.empty()) {
    throw UsageError(*request.volume +
                     " is another CT than the plan's: beside the recording it would be taken for what was "
                     "planned on; leave --volume out");
  }
  ct.of_plan = false;
  for (const SealedFile& file : asked) ct.files.push_back({file.role, file.name, file.bytes, file.sha256});
  return ct;
}

PatientNumbers patient_numbers(const ComparisonRequest& request, const fs::path& ct_of_plan,
                               const archive::CaseReader& recording,
                               const crypto::AgeIdentities& identities) {
  PatientNumbers numbers;
  const fs::path ct = request.volume ? fs::path(*request.volume) : ct_of_plan;
  try {
    if (!ct.empty()) numbers.ct = patients_of_ct(ct, request.series.value_or(""));
  } catch (const Error&) {
    // A CT that cannot be read is told where it is read.
  }
  // Read for this alone: a case beside a plan without a DICOM CT gives nothing of its patient away.
  if (!numbers.ct.empty()) numbers.of_case = patients_of_case(recording, identities);
  return numbers;
}

}  // namespace kiroku::apps
