// How a mesh is made from a CT, as commands and plans say it.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sim/meshing/body_regions.h"
#include "sim/meshing/organ_mesher.h"
#include "sim/model/body_model.h"

namespace kiroku::sim {

struct MeshRecipe {
  std::filesystem::path volume;
  VolumeOptions reading;
  // What of the volume: a threshold, or labels (an organ and regions of them, or each label), or neither for
  // the lungs, which are found by their air.
  std::optional<HuInterval> threshold;
  std::optional<std::filesystem::path> labels;
  std::optional<std::string> organ;  // of known_organs()
  std::vector<RegionLabels> regions;
  std::optional<std::filesystem::path> contours;  // LIDC's XML: the region "tumour"
  // What MeshRequest says where they are absent; pieces: those of the organ.
  std::optional<std::size_t> nodes, pieces;
};

struct RecipeMesh {
  OrganMesh made;
  std::map<std::int32_t, std::string> region_names;
  VolumeFile volume;                  // without its voxels
  HuRange hu;                         // of the volume
  std::vector<std::string> findings;  // of the volume, the mesh and its regions, one sentence each
};

/// Same recipe and files, same mesh, to the bit. `step` is told what is done next; may be empty.
/// kiroku::UsageError for a recipe that does not say what to mesh; what read_volume(), read_label_map(),
/// read_contours() and make_organ_mesh() throw.
RecipeMesh make_mesh(const MeshRecipe& recipe, const std::function<void(const std::string&)>& step = {});

/// Makes the mesh of a document whose "mesh" is a recipe: {"organ": "liver", "labels": "organs.nii.gz",
/// "regions": {"vessels": [64]}, "contours": "069.xml", "threshold": [-100, 300], "vertices": 5000,
/// "pieces": 1, "series": "3192", "resample": true}. Files are sought beside the document; its "volume" is
/// the CT.
MeshMaker recipe_mesh_maker(const std::function<void(const std::string&)>& step = {});

}  // namespace kiroku::sim
