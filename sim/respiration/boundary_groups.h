// What moves a lung where: its surface sorted by what it lies on. Pure functions, thread-safe.
//
// Source: "Simulating Lung Tumor Motion for Dynamic Tumor-tracking Irradiation": vertices of the rib cage and
// of the diaphragm are moved, the trachea is fixed, the back of the rib cage slides in one direction only.
//
// Each rule looks at a node's place and at the outward normal n of the surface there (patient coordinates: x
// left, y back, z head; "medial" is towards the patient's midline, "height" from the lung's lowest to its
// highest node).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/respiration/lung_surface.h"
#include "sim/volume/volume.h"

namespace kiroku::sim {

enum class BoundaryGroup : std::uint8_t {
  kInside,     // no node of the surface
  kFree,       // of the surface, moved and held by nothing: what faces the heart and the great vessels
  kRibCage,    // moved
  kDiaphragm,  // moved
  kTrachea,    // the hilum, where airways and vessels enter: fixed
  kBack,       // of the rib cage, in front of spine and posterior ribs: slides in one direction
};
inline constexpr std::size_t kBoundaryGroups = 6;
/// "rib_cage"; as documents and files name it.
const char* name_of(BoundaryGroup group);
/// Of those a node of the surface can have; nothing for another word.
std::optional<BoundaryGroup> boundary_group_named(std::string_view name);

using BoundaryGroups = std::vector<BoundaryGroup>;  // (|V|)
std::array<std::size_t, kBoundaryGroups> counts_of(const BoundaryGroups& groups);

/// Which lung a mesh of one lung is.
enum class LungSide : std::uint8_t { kRight, kLeft };

struct GroupRules {
  /// A single lung is told apart from a pair by being narrower than deep, and its side by its apex, which is
  /// nearer to the midline than its base; where that is wrong, it is said here.
  std::optional<LungSide> side;

  // By the surface alone.
  double diaphragm_cosine = 0.5;       // n . feet is more: within 60 degrees of straight down ...
  double diaphragm_rim_cosine = 0.25;  // ... and beside such nodes, where the dome becomes steep ...
  double diaphragm_height = 0.6;       // ... in the lower part of the lung, no lung below
  double medial_cosine = 0.5;          // n . medial is more: it faces the mediastinum
  double back_cosine = 0.5;            // n . back is more ...
  double back_depth = 0.5;             // ... in the posterior part of the lung
  double hilum_height = 0.55;          // where the hilum is on the medial surface: of the lung's height ...
  double hilum_depth = 0.55;           // ... and of its depth, from the front
  double hilum_radius = 0.1;           // of the lung's height
  // By labels.
  double reach_m = 0.04;            // how far beyond the surface a structure may be to count
  double bronchi_m = 0.03;          // so much of the windpipe's lower end belongs to the hila
  double trachea_m = 0.02;          // the hilum is this near to that end ...
  double pulmonary_vein_m = 0.005;  // ... or this near to the pulmonary veins
};

/// By geometry alone, in this order:
///  1. diaphragm: faces the feet, in the lower part of its lung, with no lung below; with what becomes steep
///  beside
///     it; of each lung the largest patch that hangs together;
///  2. trachea: faces the midline, within hilum_radius of where the hilum is;
///  3. free: the rest of what faces the midline, and what faces the back in the front of the lung;
///  4. back: faces the back;
///  5. rib cage: the rest, of each lung the largest patch; smaller ones are free.
///
/// With labels (TotalSegmentator's, task "total", version 2; those of the lungs are not needed) the structure
/// nearest to the node on the outer side of the surface says which it is: ribs, sternum and shoulder the rib
/// cage (the back where it faces the back), organs of the abdomen the diaphragm, spine, heart, vessels and
/// oesophagus none, and the hilum is what lies near windpipe and pulmonary veins. Geometry decides where none
/// is in reach.
///
/// kiroku::Error where no node of a group is found that breathing needs: rib cage or diaphragm.
BoundaryGroups find_boundary_groups(const TetMesh& mesh, const LungSurface& surface, const LabelMap* labels,
                                    const GroupRules& rules = {});

}  // namespace kiroku::sim
