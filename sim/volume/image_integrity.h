// Whether an image file holds all the voxels that its header says. ITK does not tell: niftilib fills what is
// missing with zeros and turns what is no number into zero, MetaIO leaves it as it is. Zero is water.
// Thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "sim/volume/nifti_header.h"

namespace kiroku::sim {

/// Reads on through a .nii or .nii.gz file, whose header was read. The voxels, ascending, that are no finite
/// numbers. kiroku::Error where it is cut off, or its compression is damaged.
std::vector<std::size_t> check_nifti(const GzipFile& stream, const NiftiHeader& header,
                                     const std::string& file, std::size_t voxels);

/// kiroku::Error where the data of a MetaImage file (.mha, .mhd with one data file) are shorter than `bytes`,
/// or than they say themselves where they are compressed.
void check_meta_image(const std::string& file, std::size_t bytes);

}  // namespace kiroku::sim
