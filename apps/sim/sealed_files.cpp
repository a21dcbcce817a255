#include "apps/sim/sealed_files.h"

#include <algorithm>
#include <string>

#include "apps/common/step_line.h"
#include "archive/format/file_reading.h"
#include "archive/format/limits.h"
#include "base/error.h"
#include "sim/plan/plan_files.h"
#include "sim/volume/image_file.h"

namespace kiroku::apps {

namespace fs = std::filesystem;

bool KnownHashes::is(const SealedFile& listed, const fs::path& path) {
  std::error_code unknown;
  if (!fs::is_regular_file(path, unknown)) return hashed("", "", path).sha256 == listed.sha256;  // says why
  const fs::path real = fs::canonical(path, unknown);
  if (unknown) throw IoError("read", path, unknown.value());
  const archive::ReadableFile file = archive::real_reading().open_to_read(real);
  if (file.size() != listed.bytes) return false;
  if (file.hole_bytes() > archive::kMostBytesInHoles) {
    throw Error("cannot check " + path.string() +
                ": more than 1 GiB of it is a hole, which can be as long as one likes");
  }
  const auto inode = file.shared_inode();
  const std::string key =
      inode ? std::to_string(inode->first) + ":" + std::to_string(inode->second) : real.string();
  const auto known = by_file_.find(key);
  if (known != by_file_.end()) return known->second == listed.sha256;
  return by_file_.emplace(key, hashed("", "", real).sha256).first->second == listed.sha256;
}

PlanSeal seal_of_plan(const fs::path& plan_file, const std::string& plan_name) {
  PlanSeal seal{plan_name, {}};
  StepLine line;
  for (const sim::PlanFile& file : sim::files_of_plan(plan_file, sim::data_file_of)) {
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
  KnownHashes hashes;
  for (const SealedFile& file : files) {
    try {
      if (hashes.is(file, folder / file.name)) {
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
    for (const sim::PlanFile& file : sim::files_of_plan(folder / files.front().name, sim::data_file_of)) {
      if (std::ranges::find(files, file.name, &SealedFile::name) != files.end()) continue;
      // Lists of earlier versions lack what a header names.
      checks.push_back(file.header.empty()
                           ? Check{"files", Answer::kDiffers,
                                   file.name + " was not there when the plan was " + as_they_were}
                           : Check{"files", Answer::kUnknown,
                                   file.name + ", which holds the voxels of " + file.header +
                                       ", is not listed: whether it is as it was when the plan was " +
                                       as_they_were + " cannot be told"});
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
