#include "apps/sim/sealed_files.h"

#include <algorithm>

#include "apps/common/step_line.h"
#include "base/error.h"
#include "sim/plan/plan_files.h"

namespace kiroku::apps {

namespace fs = std::filesystem;

PlanSeal seal_of_plan(const fs::path& plan_file, const std::string& plan_name) {
  PlanSeal seal{plan_name, {}};
  StepLine line;
  for (const sim::PlanFile& file : sim::files_of_plan(plan_file)) {
    line.show("hashing " + file.name);
    seal.files.push_back(hashed(file.role, file.name, file.path));
  }
  return seal;
}

std::vector<Check> check_sealed_files(const std::vector<SealedFile>& files, const fs::path& folder,
                                      const std::string& as_they_were) {
  using Answer = Check::Answer;
  std::vector<Check> checks;
  std::size_t same = 0;
  for (const SealedFile& file : files) {
    try {
      const SealedFile now = hashed(file.role, file.name, folder / file.name);
      if (now.sha256 == file.sha256) {
        ++same;
      } else {
        checks.push_back({"files", Answer::kDiffers, file.name + " is not what was " + as_they_were});
      }
    } catch (const Error& error) {
      checks.push_back({"files", Answer::kUnknown, error.what()});
    }
  }
  if (checks.empty())
    checks.push_back(
        {"files", Answer::kHolds, "all " + std::to_string(same) + " are as they were " + as_they_were});
  // A picture added to a volume changes what is planned on, too. What is no file was told above.
  std::error_code unknown;
  if (!fs::is_regular_file(folder / files.front().name, unknown)) return checks;
  try {
    for (const sim::PlanFile& file : sim::files_of_plan(folder / files.front().name)) {
      if (std::ranges::find(files, file.name, &SealedFile::name) == files.end())
        checks.push_back(
            {"files", Answer::kDiffers, file.name + " was not there when the plan was " + as_they_were});
    }
  } catch (const Error& error) {
    // Where something above is not as it was, that says why. Elsewhere these files are no plan.
    const bool all_hold =
        std::ranges::all_of(checks, [](const Check& check) { return check.answer == Answer::kHolds; });
    if (all_hold)
      checks.push_back(
          {"files", Answer::kUnknown,
           std::string("whether they are all that the plan is made of cannot be told: ") + error.what()});
  }
  return checks;
}

}  // namespace kiroku::apps
