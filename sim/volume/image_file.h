// NIfTI, NRRD and MetaImage files, read by ITK. Thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/volume/grid.h"

namespace kiroku::sim {

struct ImageFile {
  Grid grid;
  /// (grid.voxels()), after the file's own slope and intercept; may hold what is not finite.
  std::vector<float> values;
  std::string format;  // "NIfTI"
  /// The file says how it lies in the patient; where it does not, axes are taken for the patient's own.
  bool placed = true;
  std::vector<std::string> findings;  // what a person should know besides, one sentence each
};

/// Whether the ending is one of .nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd.
bool is_image_file(const std::filesystem::path& file);

/// The file that holds its voxels, from its folder on, as read_image_file() finds it: nothing where it holds
/// them itself, and for other endings. kiroku::Error for a header that cannot be read, and for one that names
/// several files, or one by its whole path.
std::optional<std::string> data_file_of(const std::filesystem::path& file);

/// kiroku::Error with the file's name for what is damaged, cut off, not three-dimensional, of several values
/// a voxel, or sheared, for one that contradicts itself in how it lies in the patient, and for a unit that is
/// not known; kiroku::UsageError for another ending.
ImageFile read_image_file(const std::filesystem::path& file);

}  // namespace kiroku::sim
