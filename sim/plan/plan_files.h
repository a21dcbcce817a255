// The files that a plan is made of. Thread-safe but for files that others change meanwhile.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace kiroku::sim {

struct PlanFile {
  std::string role;  // "plan", "mesh", "volume", "labels", "contours"
  std::string name;  // from the plan's folder on, with '/'
  std::filesystem::path path;
};

/// The plan itself, then what it names: a mesh or what its recipe takes, and the volume; of a folder every
/// file in it and below, in the order of their names. kiroku::IoError, and kiroku::Error for a plan that is
/// no JSON object or names what is not there.
std::vector<PlanFile> files_of_plan(const std::filesystem::path& plan);

}  // namespace kiroku::sim
