// The only file that knows CGAL.
#include "sim/meshing/tet_mesher.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Labeled_mesh_domain_3.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_constant_domain_field_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/exude_mesh_3.h>
#include <CGAL/perturb_mesh_3.h>
#include <CGAL/refine_mesh_3.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include <Eigen/LU>

#include "base/error.h"
#include "sim/meshing/voxel_parts.h"

namespace kiroku::sim {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Domain = CGAL::Labeled_mesh_domain_3<Kernel>;
using Triangulation = CGAL::Mesh_triangulation_3<Domain, CGAL::Default, CGAL::Sequential_tag>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation>;
using Criteria = CGAL::Mesh_criteria_3<Triangulation>;
using SizeField = CGAL::Mesh_constant_domain_field_3<Triangulation::Geom_traits, Domain::Index>;
namespace parameters = CGAL::parameters;

// Criteria of refinement. Angles and ratios are within what the algorithm is proved to end for (CGAL manual,
// "3D Mesh Generation", 2.3.3); a surface closer than a third of a voxel would follow the steps between
// voxels.
constexpr double kFacetAngleDeg = 25;
constexpr double kRadiusEdgeRatio = 2.5;
constexpr double kSurfaceDistancePerCell = 0.12;
constexpr double kLeastSurfaceDistancePerVoxel = 0.34;
/// To a fraction of the smallest spacing points are found on the surface.
constexpr double kSurfaceErrorPerVoxel = 0.05;
/// A region's own cells are no larger than this part of the diameter of a sphere of its volume, so that a
/// tumour in a coarse lung is more than one tetrahedron.
constexpr double kCellPerRegionDiameter = 0.5;
/// Parts below this part of a cell's edge, cubed, are not sought: they would ask for cells of their own size.
constexpr double kLeastPartPerCell = 0.5;

/// The label of greatest trilinear weight. Points are in mm along the axes of the grid, from its first voxel.
class LabelField {
 public:
  explicit LabelField(const LabelMap& map)
      : size_(map.grid.size), spacing_mm_(1000 * map.grid.spacing_m), labels_(map.labels.size()) {
    std::ranges::transform(map.labels, labels_.begin(),
                           [](std::uint16_t label) { return static_cast<std::uint8_t>(label); });
  }

  [[nodiscard]] int operator()(double x_mm, double y_mm, double z_mm) const {
    const std::array<double, 3> at{x_mm / spacing_mm_[0], y_mm / spacing_mm_[1], z_mm / spacing_mm_[2]};
    std::array<double, 3> fraction{};
    std::array<std::size_t, 3> low{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      // The outermost voxels are outside the body: so is everything beyond them.
      if (!(at[axis] > 0 && at[axis] < static_cast<double>(size_[axis]) - 1)) return 0;
      low[axis] = static_cast<std::size_t>(at[axis]);
      fraction[axis] = at[axis] - static_cast<double>(low[axis]);
    }
    const std::size_t row = size_[0], slice = size_[0] * size_[1];
    const std::uint8_t* const first = labels_.data() + low[0] + row * low[1] + slice * low[2];
    const std::array<std::uint8_t, 8> labels{
        first[0],     first[1],         first[row],         first[row + 1],
        first[slice], first[slice + 1], first[slice + row], first[slice + row + 1]};
    if (std::ranges::all_of(labels, [&](std::uint8_t label) { return label == labels[0]; })) return labels[0];
    std::array<double, 8> weight{};  // of labels[n], collected at its first mention
    for (std::size_t corner = 0; corner < 8; ++corner) {
      const double one = ((corner & 1U) != 0 ? fraction[0] : 1 - fraction[0]) *
                         ((corner & 2U) != 0 ? fraction[1] : 1 - fraction[1]) *
                         ((corner & 4U) != 0 ? fraction[2] : 1 - fraction[2]);
      weight[static_cast<std::size_t>(std::ranges::find(labels, labels[corner]) - labels.begin())] += one;
    }
    return labels[static_cast<std::size_t>(std::ranges::max_element(weight) - weight.begin())];
  }

 private:
  std::array<std::size_t, 3> size_;
  Vector3 spacing_mm_;
  std::vector<std::uint8_t> labels_;
};

/// Labels as numbers from 1, and what each stands for.
struct Renumbered {
  LabelMap map;
  std::vector<std::uint16_t> label_of;  // by number; label_of[0] is 0
};

Renumbered renumbered(const LabelMap& regions) {
  Renumbered result{cropped(regions, 1), {0}};
  std::vector<std::uint16_t> number_of(65536);
  for (const std::uint16_t label : result.map.labels) number_of[label] = 1;
  for (std::size_t label = 1; label < number_of.size(); ++label) {
    if (number_of[label] == 0) continue;
    number_of[label] = static_cast<std::uint16_t>(result.label_of.size());
    result.label_of.push_back(static_cast<std::uint16_t>(label));
  }
  number_of[0] = 0;
  if (result.label_of.size() == 1) throw Error("cannot make a mesh: no voxel belongs to the body");
  if (result.label_of.size() - 1 > TetMesher::kMostRegions) {
    throw Error("cannot make a mesh of " + std::to_string(result.label_of.size() - 1) + " regions: at most " +
                std::to_string(TetMesher::kMostRegions) + " are handled; name those that are wanted");
  }
  for (std::uint16_t& label : result.map.labels) label = number_of[label];
  return result;
}

Domain domain_of(const LabelField& field, const Grid& grid) {
  const Vector3 size(static_cast<double>(grid.size[0]), static_cast<double>(grid.size[1]),
                     static_cast<double>(grid.size[2]));
  const Vector3 high_mm = 1000 * size.cwiseProduct(grid.spacing_m);
  const Vector3 low_mm = -1000 * grid.spacing_m;
  const double error =
      kSurfaceErrorPerVoxel * 1000 * grid.spacing_m.minCoeff() / (0.5 * (high_mm - low_mm).norm());
  return Domain(
      parameters::function = [&field](const Point& at) { return field(at.x(), at.y(), at.z()); },
      parameters::bounding_object =
          CGAL::Bbox_3(low_mm.x(), low_mm.y(), low_mm.z(), high_mm.x(), high_mm.y(), high_mm.z()),
      parameters::relative_error_bound = error);
}

}  // namespace

class TetMesher::Implementation {
 public:
  explicit Implementation(const LabelMap& regions)
      : regions_(renumbered(regions)),
        parts_(parts_by_label(regions_.map).parts),
        field_(regions_.map),
        domain_(domain_of(field_, regions_.map.grid)) {
    const Vector3 spacing_mm = 1000 * regions_.map.grid.spacing_m;
    region_mm3_.resize(regions_.label_of.size());
    for (const VoxelPart& part : parts_) {
      region_mm3_[part.label] += static_cast<double>(part.voxels) * spacing_mm.prod();
    }
  }

  TetMesh refine(double cell_m, std::size_t most_nodes) {
    const double cell_mm = 1000 * cell_m;
    complex_ = Complex();
    insert_surface_points(cell_mm);
    CGAL::Mesh_error_code ended = CGAL::CGAL_MESH_3_NO_ERROR;
    CGAL::refine_mesh_3(complex_, domain_, criteria(cell_mm), parameters::no_exude(),
                        parameters::no_perturb(), parameters::no_reset_c3t3(),
                        parameters::mesh_3_options(parameters::maximal_number_of_vertices = most_nodes,
                                                   parameters::pointer_to_error_code = &ended));
    return mesh();
  }

  TetMesh optimise(double angle_deg) {
    CGAL::perturb_mesh_3(complex_, domain_, parameters::sliver_bound = angle_deg);
    CGAL::exude_mesh_3(complex_, parameters::sliver_bound = angle_deg);
    return mesh();
  }

 private:
  /// Refinement only finds surfaces that the first points are on: some of each part, where rays from its
  /// middle leave its label.
  void insert_surface_points(double cell_mm) {
    const Vector3 spacing_mm = 1000 * regions_.map.grid.spacing_m;
    const double step_mm = 0.5 * spacing_mm.minCoeff();
    const double least_mm3 = std::pow(kLeastPartPerCell * cell_mm, 3);
    std::vector<std::size_t> largest(regions_.label_of.size());
    for (const VoxelPart& part : parts_) largest[part.label] = std::max(largest[part.label], part.voxels);
    const auto construct_intersection = domain_.construct_intersection_object();
    Triangulation& triangulation = complex_.triangulation();
    for (const VoxelPart& part : parts_) {
      if (static_cast<double>(part.voxels) * spacing_mm.prod() < least_mm3 &&
          part.voxels != largest[part.label])
        continue;
      const Vector3 middle =
          Vector3(static_cast<double>(part.central[0]), static_cast<double>(part.central[1]),
                  static_cast<double>(part.central[2]))
              .cwiseProduct(spacing_mm);
      for (const Vector3& direction : directions()) {
        Vector3 inside = middle, beyond = middle;
        while (label_at(beyond) == part.label) {
          inside = beyond;
          beyond += step_mm * direction;
        }
        if (beyond == middle) continue;  // a voxel thinner than what the interpolation keeps
        const Domain::Intersection found = construct_intersection(Kernel::Segment_3(
            Point(inside.x(), inside.y(), inside.z()), Point(beyond.x(), beyond.y(), beyond.z())));
        const auto vertex = triangulation.insert(Triangulation::Weighted_point(std::get<0>(found)));
        if (vertex == Triangulation::Vertex_handle()) continue;
        complex_.set_dimension(vertex, 2);
        complex_.set_index(vertex, std::get<1>(found));
      }
    }
    if (triangulation.dimension() < 3) {
      throw Error("cannot make a mesh: the body is too thin for its voxels, less than two across");
    }
  }

  [[nodiscard]] int label_at(const Vector3& at) const { return field_(at.x(), at.y(), at.z()); }

  /// Towards the corners, faces and edges of a cube, turned a little so that no four points are in one plane.
  static std::vector<Vector3> directions() {
    const Eigen::Matrix3d turn =
        (Eigen::AngleAxisd(0.31, Vector3::UnitX()) * Eigen::AngleAxisd(0.23, Vector3::UnitY()) *
         Eigen::AngleAxisd(0.17, Vector3::UnitZ()))
            .toRotationMatrix();
    std::vector<Vector3> result;
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          if (x != 0 || y != 0 || z != 0) result.push_back(turn * Vector3(x, y, z).normalized());
        }
      }
    }
    return result;
  }

  [[nodiscard]] Criteria criteria(double cell_mm) const {
    const double least_distance_mm =
        kLeastSurfaceDistancePerVoxel * 1000 * regions_.map.grid.spacing_m.maxCoeff();
    const auto distance = [&](double size_mm) {
      return std::max(kSurfaceDistancePerCell * size_mm, least_distance_mm);
    };
    std::vector<double> size_mm(regions_.label_of.size(), cell_mm);
    for (std::size_t region = 1; region < size_mm.size(); ++region) {
      const double diameter_mm = std::cbrt(6 * region_mm3_[region] / std::numbers::pi);
      size_mm[region] = std::min(cell_mm, kCellPerRegionDiameter * diameter_mm);
    }
    SizeField cells(cell_mm), facets(cell_mm), distances(distance(cell_mm));
    for (std::size_t region = 1; region < size_mm.size(); ++region) {
      cells.set_size(size_mm[region], 3, domain_.index_from_subdomain_index(static_cast<int>(region)));
      for (std::size_t other = 0; other < region; ++other) {
        const double size = std::min(size_mm[region], size_mm[other]);
        const auto patch =
            domain_.index_from_surface_patch_index({static_cast<int>(other), static_cast<int>(region)});
        facets.set_size(size, 2, patch);
        distances.set_size(distance(size), 2, patch);
      }
    }
    return Criteria(Criteria::Facet_criteria(kFacetAngleDeg, facets, distances),
                    Criteria::Cell_criteria(kRadiusEdgeRatio, cells));
  }

  [[nodiscard]] TetMesh mesh() const {
    TetMesh result;
    const Grid& grid = regions_.map.grid;
    const bool mirrored = grid.direction.determinant() < 0;
    std::unordered_map<Triangulation::Vertex_handle, std::uint32_t, CGAL::Handle_hash_function> number_of;
    for (auto cell = complex_.cells_in_complex_begin(); cell != complex_.cells_in_complex_end(); ++cell) {
      Tetrahedron corners{};
      for (int corner = 0; corner < 4; ++corner) {
        const auto vertex = cell->vertex(corner);
        const auto [entry, is_new] =
            number_of.emplace(vertex, static_cast<std::uint32_t>(result.nodes.size()));
        if (is_new) {
          const auto& at = vertex->point().point();
          const Vector3 along_m(at.x() / 1000, at.y() / 1000, at.z() / 1000);
          result.nodes.emplace_back(grid.origin_m + grid.direction * along_m);
        }
        corners[static_cast<std::size_t>(corner)] = entry->second;
      }
      if (mirrored) std::swap(corners[2], corners[3]);
      result.tetrahedra.push_back(corners);
      result.regions.push_back(regions_.label_of[static_cast<std::size_t>(complex_.subdomain_index(cell))]);
    }
    return result;
  }

  Renumbered regions_;
  std::vector<VoxelPart> parts_;
  LabelField field_;
  Domain domain_;
  std::vector<double> region_mm3_;  // by number
  Complex complex_;
};

TetMesher::TetMesher(const LabelMap& regions) : implementation_(std::make_unique<Implementation>(regions)) {}
TetMesher::~TetMesher() = default;

TetMesh TetMesher::refine(double cell_m, std::size_t most_nodes) {
  return implementation_->refine(cell_m, most_nodes);
}
TetMesh TetMesher::optimise(double angle_deg) { return implementation_->optimise(angle_deg); }

}  // namespace kiroku::sim
