#include "sim/respiration/boundary_groups.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"

namespace kiroku::sim {
namespace {

constexpr std::array<std::string_view, kBoundaryGroups> kNames{"inside",    "free",    "rib_cage",
                                                               "diaphragm", "trachea", "back"};

/// What a label of TotalSegmentator (task "total", version 2) says of the lung's surface beside it.
enum class Structure : std::uint8_t { kNone, kRibs, kAbdomen, kMediastinum, kTrachea, kPulmonaryVein };
constexpr std::size_t kStructures = 6;

Structure structure_of(std::uint16_t label) {
  const auto within = [&](std::uint16_t first, std::uint16_t last) {
    return label >= first && label <= last;
  };
  if (label == 16) return Structure::kTrachea;
  if (label == 53) return Structure::kPulmonaryVein;
  if (within(92, 117) || within(69, 74)) return Structure::kRibs;  // with sternum, cartilage; shoulder
  if (within(1, 9) || within(18, 24))
    return Structure::kAbdomen;  // spleen to adrenal glands; bowel to kidney cysts
  if (label == 15 || label == 17 || within(25, 63) || label == 79)
    return Structure::kMediastinum;  // spine, heart
  return Structure::kNone;
}

constexpr auto kTracheaNumber = static_cast<std::uint16_t>(Structure::kTrachea);

template <typename Visit>
void for_each_labelled(LabelMap& map, Visit visit) {
  std::size_t offset = 0;
  for (std::size_t k = 0; k < map.grid.size[2]; ++k) {
    for (std::size_t j = 0; j < map.grid.size[1]; ++j) {
      for (std::size_t i = 0; i < map.grid.size[0]; ++i, ++offset) {
        if (map.labels[offset] == 0) continue;
        const Vector3 index(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
        visit(map.labels[offset], map.grid.patient_m(index));
      }
    }
  }
}

/// A coarse copy of the labels: what lies beyond the surface is looked for in a few centimetres around. Of
/// the windpipe only the lower end, where it parts, is kTrachea: above it lies beside the lungs and holds
/// none.
LabelMap structures_of(const LabelMap& labels, double bronchi_m) {
  constexpr double kCellM = 0.003;
  Grid grid = labels.grid;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    const double extent_m = static_cast<double>(grid.size[axis] - 1) * grid.spacing_m[a];
    if (grid.spacing_m[a] >= kCellM) continue;
    grid.spacing_m[a] = kCellM;
    grid.size[axis] = static_cast<std::size_t>(extent_m / kCellM) + 1;
  }
  LabelMap coarse = resampled(labels, grid);
  double lowest_m = std::numeric_limits<double>::infinity();
  for_each_labelled(coarse, [&](std::uint16_t& label, const Vector3& place_m) {
    label = static_cast<std::uint16_t>(structure_of(label));
    if (label == kTracheaNumber) lowest_m = std::min(lowest_m, place_m.z());
  });
  for_each_labelled(coarse, [&](std::uint16_t& label, const Vector3& place_m) {
    if (label == kTracheaNumber && place_m.z() > lowest_m + bronchi_m)
      label = static_cast<std::uint16_t>(Structure::kMediastinum);
  });
  return coarse;
}

using Distances = std::array<double, kStructures>;  // to the nearest of each, infinite where none is in reach

/// On the outer side of the surface: within 60 degrees of the normal; windpipe and pulmonary veins all
/// around.
Distances distances_at(const LabelMap& structures, const Vector3& place_m, const Vector3& normal,
                       double reach_m) {
  Distances nearest;
  nearest.fill(std::numeric_limits<double>::infinity());
  const Grid& grid = structures.grid;
  const Vector3 centre = grid.index(place_m);
  std::array<std::size_t, 3> from{}, to{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    const double reach = reach_m / grid.spacing_m[a], last = static_cast<double>(grid.size[axis]);
    from[axis] = static_cast<std::size_t>(std::clamp(std::ceil(centre[a] - reach), 0.0, last));
    to[axis] = static_cast<std::size_t>(std::clamp(std::floor(centre[a] + reach) + 1, 0.0, last));
  }
  for (std::size_t k = from[2]; k < to[2]; ++k) {
    for (std::size_t j = from[1]; j < to[1]; ++j) {
      for (std::size_t i = from[0]; i < to[0]; ++i) {
        const std::uint16_t structure = structures.labels[grid.offset(i, j, k)];
        if (structure == 0) continue;
        const Vector3 arm_m =
            grid.patient_m({static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)}) -
            place_m;
        const double distance_m = arm_m.norm();
        if (!(distance_m <= reach_m) || distance_m >= nearest[structure]) continue;
        const bool anywhere = structure >= kTracheaNumber;
        if (anywhere || arm_m.dot(normal) >= 0.5 * distance_m) nearest[structure] = distance_m;
      }
    }
  }
  return nearest;
}

/// A lung, or what is taken for one.
struct Lung {
  double medial = 1;  // the sign of x towards the midline
  Vector3 least = Vector3::Constant(std::numeric_limits<double>::infinity());
  Vector3 greatest = -least;
  [[nodiscard]] double height(const Vector3& at) const {
    return (at.z() - least.z()) / (greatest.z() - least.z());
  }
  [[nodiscard]] double depth(const Vector3& at) const {
    return (at.y() - least.y()) / (greatest.y() - least.y());
  }
  [[nodiscard]] double height_m() const { return greatest.z() - least.z(); }
};

/// Which lung each node of the surface belongs to.
struct Lungs {
  std::vector<Lung> lungs;
  std::vector<std::size_t> of_row;
};

LungSide side_by_apex(const TetMesh& mesh, const LungSurface& surface, const Extent& extent) {
  const double height_m = extent.greatest.z() - extent.least.z();
  double apex = 0, base = 0;
  std::size_t apex_nodes = 0, base_nodes = 0;
  for (const std::uint32_t node : surface.nodes) {
    const Vector3& at = mesh.nodes[node];
    if (at.z() > extent.greatest.z() - 0.1 * height_m) {
      apex += at.x();
      ++apex_nodes;
    } else if (at.z() < extent.least.z() + 0.5 * height_m) {
      base += at.x();
      ++base_nodes;
    }
  }
  // The right lung is where x is less; its midline where x is greater.
  return apex * static_cast<double>(base_nodes) >= base * static_cast<double>(apex_nodes) ? LungSide::kRight
                                                                                          : LungSide::kLeft;
}

Lungs lungs_of(const TetMesh& mesh, const LungSurface& surface, std::optional<LungSide> side) {
  const Extent extent = extent_of(mesh);
  const Vector3 size = extent.greatest - extent.least;
  Lungs found;
  found.of_row.assign(surface.nodes.size(), 0);
  if (side || size.x() < size.y()) {
    const LungSide which = side ? *side : side_by_apex(mesh, surface, extent);
    found.lungs.resize(1);
    found.lungs[0].medial = which == LungSide::kRight ? 1 : -1;
  } else {
    // Both, whether they touch or not: what is right of the middle, and what is left of it.
    found.lungs.resize(2);
    found.lungs[1].medial = -1;
    const double middle = (extent.least.x() + extent.greatest.x()) / 2;
    for (std::size_t row = 0; row < surface.nodes.size(); ++row)
      found.of_row[row] = mesh.nodes[surface.nodes[row]].x() < middle ? 0 : 1;
  }
  for (std::size_t row = 0; row < surface.nodes.size(); ++row) {
    Lung& lung = found.lungs[found.of_row[row]];
    lung.least = lung.least.cwiseMin(mesh.nodes[surface.nodes[row]]);
    lung.greatest = lung.greatest.cwiseMax(mesh.nodes[surface.nodes[row]]);
  }
  return found;
}

/// Whether a face of the surface lies straight below the node.
bool lung_below(const TetMesh& mesh, const LungSurface& surface, std::uint32_t row) {
  const Vector3& at = mesh.nodes[surface.nodes[row]];
  for (const auto& face : surface.faces) {
    if (face[0] == row || face[1] == row || face[2] == row) continue;
    const Vector3 a = mesh.nodes[surface.nodes[face[0]]] - at, b = mesh.nodes[surface.nodes[face[1]]] - at,
                  c = mesh.nodes[surface.nodes[face[2]]] - at;
    // Barycentric coordinates of the node in the face, both seen from below.
    const double of_c = a.x() * b.y() - a.y() * b.x(), of_a = b.x() * c.y() - b.y() * c.x(),
                 of_b = c.x() * a.y() - c.y() * a.x();
    const bool inside = (of_a >= 0 && of_b >= 0 && of_c >= 0) || (of_a <= 0 && of_b <= 0 && of_c <= 0);
    const double sum = of_a + of_b + of_c;
    if (inside && sum != 0 && (of_a * a.z() + of_b * b.z() + of_c * c.z()) / sum < 0) return true;
  }
  return false;
}

/// Keeps of a group the largest patch of each lung, by area; the rest becomes kFree.
void keep_largest_patches(const LungSurface& surface, const Lungs& lungs, BoundaryGroup group,
                          std::vector<BoundaryGroup>& of_row) {
  std::vector<std::uint32_t> patch_of(surface.nodes.size(), 0), pending;
  std::vector<double> areas_m2{0};
  std::vector<std::size_t> lung_of{0};
  for (std::uint32_t start = 0; start < of_row.size(); ++start) {
    if (of_row[start] != group || patch_of[start] != 0) continue;
    const auto patch = static_cast<std::uint32_t>(areas_m2.size());
    areas_m2.push_back(0);
    lung_of.push_back(lungs.of_row[start]);
    patch_of[start] = patch;
    pending.assign(1, start);
    while (!pending.empty()) {
      const std::uint32_t row = pending.back();
      pending.pop_back();
      areas_m2[patch] += surface.areas_m2[row];
      for (const std::uint32_t beside : surface.neighbours[row]) {
        if (of_row[beside] != group || patch_of[beside] != 0 || lungs.of_row[beside] != lungs.of_row[row])
          continue;
        patch_of[beside] = patch;
        pending.push_back(beside);
      }
    }
  }
  std::vector<std::uint32_t> kept(lungs.lungs.size(), 0);
  for (std::uint32_t patch = 1; patch < areas_m2.size(); ++patch) {
    std::uint32_t& best = kept[lung_of[patch]];
    if (best == 0 || areas_m2[patch] > areas_m2[best]) best = patch;
  }
  for (std::size_t row = 0; row < of_row.size(); ++row) {
    if (patch_of[row] != 0 && patch_of[row] != kept[lungs.of_row[row]]) of_row[row] = BoundaryGroup::kFree;
  }
}

class Sorting {
 public:
  Sorting(const TetMesh& mesh, const LungSurface& surface, const LabelMap* labels, const GroupRules& rules)
      : mesh_(mesh), surface_(surface), rules_(rules), lungs_(lungs_of(mesh, surface, rules.side)) {
    if (labels != nullptr) {
      const LabelMap structures = structures_of(*labels, rules.bronchi_m);
      distances_.reserve(surface.nodes.size());
      for (std::size_t row = 0; row < surface.nodes.size(); ++row)
        distances_.push_back(distances_at(structures, place(row), surface.normals[row], rules.reach_m));
    }
  }

  std::vector<BoundaryGroup> run() {
    std::vector<BoundaryGroup> of_row(surface_.nodes.size(), BoundaryGroup::kFree);
    for (std::uint32_t row = 0; row < of_row.size(); ++row) {
      if (on_diaphragm(row)) of_row[row] = BoundaryGroup::kDiaphragm;
    }
    grow_diaphragm(of_row);
    keep_largest_patches(surface_, lungs_, BoundaryGroup::kDiaphragm, of_row);
    const std::vector<Vector3> hila = hila_m();
    for (std::uint32_t row = 0; row < of_row.size(); ++row) {
      if (of_row[row] == BoundaryGroup::kDiaphragm) continue;
      if (faces_mediastinum(row)) {
        if (at_hilum(row, hila)) of_row[row] = BoundaryGroup::kTrachea;
        continue;
      }
      if (surface_.normals[row].y() <= rules_.back_cosine) {
        of_row[row] = BoundaryGroup::kRibCage;
      } else if (lung(row).depth(place(row)) > rules_.back_depth) {
        of_row[row] = BoundaryGroup::kBack;
      }
    }
    keep_largest_patches(surface_, lungs_, BoundaryGroup::kRibCage, of_row);
    return of_row;
  }

 private:
  [[nodiscard]] const Vector3& place(std::size_t row) const { return mesh_.nodes[surface_.nodes[row]]; }
  [[nodiscard]] const Lung& lung(std::size_t row) const { return lungs_.lungs[lungs_.of_row[row]]; }
  [[nodiscard]] double medial_cosine(std::size_t row) const {
    return surface_.normals[row].x() * lung(row).medial;
  }

  [[nodiscard]] double distance(std::size_t row, Structure structure) const {
    return distances_[row][static_cast<std::size_t>(structure)];
  }
  /// By labels; kNone without them, or where none is in reach.
  [[nodiscard]] Structure beyond(std::size_t row) const {
    Structure nearest = Structure::kNone;
    double least = std::numeric_limits<double>::infinity();
    for (const Structure structure : {Structure::kRibs, Structure::kAbdomen, Structure::kMediastinum}) {
      if (distances_.empty() || !(distance(row, structure) < least)) continue;
      least = distance(row, structure);
      nearest = structure;
    }
    return nearest;
  }

  [[nodiscard]] bool on_diaphragm(std::uint32_t row) const {
    const Structure structure = beyond(row);
    if (structure != Structure::kNone) return structure == Structure::kAbdomen;
    return may_be_diaphragm(row, rules_.diaphragm_cosine);
  }
  [[nodiscard]] bool may_be_diaphragm(std::uint32_t row, double cosine) const {
    return -surface_.normals[row].z() > cosine && lung(row).height(place(row)) < rules_.diaphragm_height &&
           !lung_below(mesh_, surface_, row);
  }
  /// Where no label says otherwise.
  void grow_diaphragm(std::vector<BoundaryGroup>& of_row) const {
    std::vector<std::uint32_t> pending;
    for (std::uint32_t row = 0; row < of_row.size(); ++row) {
      if (of_row[row] == BoundaryGroup::kDiaphragm) pending.push_back(row);
    }
    while (!pending.empty()) {
      const std::uint32_t row = pending.back();
      pending.pop_back();
      for (const std::uint32_t beside : surface_.neighbours[row]) {
        if (of_row[beside] == BoundaryGroup::kDiaphragm || beyond(beside) != Structure::kNone ||
            medial_cosine(beside) > rules_.medial_cosine ||
            !may_be_diaphragm(beside, rules_.diaphragm_rim_cosine))
          continue;
        of_row[beside] = BoundaryGroup::kDiaphragm;
        pending.push_back(beside);
      }
    }
  }
  [[nodiscard]] bool faces_mediastinum(std::size_t row) const {
    const Structure structure = beyond(row);
    if (structure == Structure::kRibs) return false;
    if (structure == Structure::kMediastinum) return surface_.normals[row].y() <= rules_.back_cosine;
    return medial_cosine(row) > rules_.medial_cosine;
  }

  /// Of each lung without labels: the place on its medial surface that is nearest to where a hilum is.
  [[nodiscard]] std::vector<Vector3> hila_m() const {
    std::vector<Vector3> hila(lungs_.lungs.size(), Vector3::Zero());
    std::vector<double> least(lungs_.lungs.size(), std::numeric_limits<double>::infinity());
    for (std::size_t row = 0; row < surface_.nodes.size(); ++row) {
      if (!(medial_cosine(row) > rules_.medial_cosine)) continue;
      const Lung& of = lung(row);
      const double off =
          std::hypot(of.height(place(row)) - rules_.hilum_height, of.depth(place(row)) - rules_.hilum_depth);
      if (off >= least[lungs_.of_row[row]]) continue;
      least[lungs_.of_row[row]] = off;
      hila[lungs_.of_row[row]] = place(row);
    }
    return hila;
  }
  [[nodiscard]] bool at_hilum(std::size_t row, const std::vector<Vector3>& hila) const {
    if (!distances_.empty()) {
      return distance(row, Structure::kTrachea) < rules_.trachea_m ||
             distance(row, Structure::kPulmonaryVein) < rules_.pulmonary_vein_m;
    }
    return (place(row) - hila[lungs_.of_row[row]]).norm() < rules_.hilum_radius * lung(row).height_m();
  }

  const TetMesh& mesh_;
  const LungSurface& surface_;
  const GroupRules& rules_;
  Lungs lungs_;
  std::vector<Distances> distances_;  // of each row; none without labels
};

}  // namespace

const char* name_of(BoundaryGroup group) { return kNames[static_cast<std::size_t>(group)].data(); }

std::optional<BoundaryGroup> boundary_group_named(std::string_view name) {
  const auto found = std::find(kNames.begin() + 1, kNames.end(), name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<BoundaryGroup>(found - kNames.begin());
}

std::array<std::size_t, kBoundaryGroups> counts_of(const BoundaryGroups& groups) {
  std::array<std::size_t, kBoundaryGroups> counts{};
  for (const BoundaryGroup group : groups) ++counts[static_cast<std::size_t>(group)];
  return counts;
}

BoundaryGroups find_boundary_groups(const TetMesh& mesh, const LungSurface& surface, const LabelMap* labels,
                                    const GroupRules& rules) {
  const std::vector<BoundaryGroup> of_row = Sorting(mesh, surface, labels, rules).run();
  BoundaryGroups groups(mesh.nodes.size(), BoundaryGroup::kInside);
  for (std::size_t row = 0; row < of_row.size(); ++row) groups[surface.nodes[row]] = of_row[row];
  for (const BoundaryGroup needed : {BoundaryGroup::kRibCage, BoundaryGroup::kDiaphragm}) {
    if (std::ranges::count(groups, needed) > 0) continue;
    throw Error(
        std::string("no part of the surface is taken for the ") +
        (needed == BoundaryGroup::kRibCage ? "rib cage" : "diaphragm") +
        ": the mesh must be a lung in patient coordinates (x to the left, y to the back, z to the head)");
  }
  return groups;
}

}  // namespace kiroku::sim
