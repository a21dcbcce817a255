// The files that a plan is made of. Thread-safe but for files that others change meanwhile.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace kiroku::sim {

struct PlanFile {
  std::string role;  // "plan", "mesh", "volume", "labels", "contours", "trace"
  std::string name;  // from the plan's folder on, with '/'
  std::filesystem::path path;
  std::string header;  // of a file with voxels alone: the name of the file that names it
};

/// The file that holds a volume's voxels, from the volume's folder on (sim/volume/image_file.h): whoever
/// reads volumes knows.
using DataFileOf = std::function<std::optional<std::string>(const std::filesystem::path& file)>;

enum class PlanKind {
  kSteps,      // an operation, step by step (sim/plan/plan.h)
  kBreathing,  // a lung that breathes (sim/respiration/breathing_model.h)
};
/// By what the document has: what is none of both counts as an operation, whose reader says what is wrong.
PlanKind kind_of_plan(const std::filesystem::path& plan);

/// The plan itself, then what it names: a mesh or what its recipe takes, and the volume, or a breathing
/// lung's labels and trace; of a folder every file in it and below, in the order of their names; of a file
/// that has its voxels in another one that one, too. kiroku::IoError, and kiroku::Error for a plan that is no
/// JSON object or names what is not there, and as `data_file_of`.
std::vector<PlanFile> files_of_plan(const std::filesystem::path& plan, const DataFileOf& data_file_of);
/// The files of a CT that no plan names, likewise; their names begin with its own. kiroku::IoError, and as
/// `data_file_of`.
std::vector<PlanFile> files_of_volume(const std::filesystem::path& volume, const DataFileOf& data_file_of);

}  // namespace kiroku::sim
