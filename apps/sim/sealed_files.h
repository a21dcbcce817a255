// The files of a plan, hashed: as a seal lists them, and whether they still are what it lists. Not
// thread-safe.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "apps/kiroku/plan_seal.h"
#include "apps/kiroku/stamped_file.h"

namespace kiroku::apps {

/// Whoever wrote a list chose its names: each file is read once, under however many names, and only where it
/// is as long as it should be. A hole takes no room on the disk and can be as long as one likes.
class KnownHashes {
 public:
  /// Whether the file is the one listed. kiroku::Error for what cannot be read.
  bool is(const SealedFile& listed, const std::filesystem::path& path);

 private:
  std::map<std::string, crypto::Sha256Digest> by_file_;
};

/// The seal that the plan has as its files are now. kiroku::Error for files that are not there.
PlanSeal seal_of_plan(const std::filesystem::path& plan_file, const std::string& plan_name);

/// Whether the files below `folder` are those listed, the plan's own first, and no others belong to it now.
/// `as_they_were` says what was done with them when they were listed: "sealed", or "compared" of those that
/// nobody sealed.
std::vector<Check> check_sealed_files(const std::vector<SealedFile>& files,
                                      const std::filesystem::path& folder,
                                      const std::string& as_they_were = "sealed");

}  // namespace kiroku::apps
