#include "trainer/objects/organ_object.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "sim/meshing/organ_mesher.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

constexpr double kHalfLengthMetres = 0.1, kHalfWidthMetres = 0.06, kFixedShareOfOrgan = 0.075,
                 kVoxelMetres = 0.002;
constexpr double kLiverHalfThicknessMetres = 0.015, kLungHalfThicknessMetres = 0.022,
                 kVesselRadiusMetres = 0.0115;
constexpr sim::Rgb kLiverColour{150, 62, 52}, kLungColour{214, 150, 148}, kVesselColour{168, 58, 70};
constexpr double kGrooveMetres = 0.033, kGrooveDepthMetres = 0.008, kGrooveWidthMetres = 0.006;

/// Of the sheet's rounded section: 0 in the middle, 1 on its border.
double section(double y, double z, double half_thickness_m) {
  const double across = std::pow(std::abs(y) / kHalfWidthMetres, 4), up = z / half_thickness_m;
  return across + up * up;
}

std::uint16_t liver(const Vector3& p) {
  const double from_groove = std::abs(std::abs(p.x()) - kGrooveMetres) / kGrooveWidthMetres;
  const double groove_m = kGrooveDepthMetres * std::exp(-from_groove * from_groove);
  const double upper_m = kLiverHalfThicknessMetres - (p.z() > 0 ? groove_m : 0);
  if (section(p.y(), p.z(), upper_m) > 1) return 0;
  return p.x() < -kGrooveMetres ? 1 : p.x() < kGrooveMetres ? 2 : 3;
}

/// Within a rod from a to b whose radius goes from one to the other.
bool within_rod(const Vector3& p, const Vector3& a, const Vector3& b, double radius_a_m, double radius_b_m) {
  const Vector3 along = b - a;
  const double share = std::clamp((p - a).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (p - a - share * along).norm() < radius_a_m + share * (radius_b_m - radius_a_m);
}

std::uint16_t lung(const Vector3& p) {
  if (section(p.y(), p.z(), kLungHalfThicknessMetres) > 1) return 0;
  const Vector3 root(-0.11, 0.01, 0.004), fork(-0.02, 0.008, 0.002);
  if (within_rod(p, root, fork, 0.009, 0.007) || within_rod(p, fork, {0.06, 0.035, 0}, 0.007, 0.0045) ||
      within_rod(p, fork, {0.06, -0.02, 0}, 0.007, 0.0045))
    return 2;
  if (within_rod(p, {-0.11, -0.018, 0.002}, {-0.01, -0.022, 0}, 0.006, 0.0045)) return 3;
  return 1;
}

std::uint16_t vessels(const Vector3& p) {
  for (const bool is_aorta : {false, true}) {
    const double from_axis = p.y() - (is_aorta ? kVesselRadiusMetres : -kVesselRadiusMetres);
    if (std::hypot(from_axis, p.z()) < kVesselRadiusMetres) return is_aorta ? 2 : 1;
  }
  // What joins them fills the gap where they touch.
  return std::abs(p.y()) < kVesselRadiusMetres / 2 && std::abs(p.z()) < kVesselRadiusMetres / 2 ? 3 : 0;
}

/// What is where: 0 for nothing, else a region.
std::uint16_t region_at(ObjectKind kind, const Vector3& p) {
  switch (kind) {
    case ObjectKind::kLiver:
      return liver(p);
    case ObjectKind::kLung:
      return lung(p);
    case ObjectKind::kVessels:
      break;
  }
  return vessels(p);
}

sim::Materials materials_of(ObjectKind kind) {
  const auto of = [](double first_pa, double second_pa, double third_pa) {
    return sim::Materials{
        {1, {first_pa, 0.4, 1000}}, {2, {second_pa, 0.4, 1000}}, {3, {third_pa, 0.4, 1000}}};
  };
  switch (kind) {
    case ObjectKind::kLiver:
      return of(0.3e6, 0.3e6, 0.3e6);
    case ObjectKind::kLung:
      return of(0.1e6, 1e6, 1e6);
    case ObjectKind::kVessels:
      break;
  }
  return of(0.1e6, 0.3e6, 0.05e6);
}

sim::Rgb colour_of(ObjectKind kind) {
  return kind == ObjectKind::kLiver ? kLiverColour : kind == ObjectKind::kLung ? kLungColour : kVesselColour;
}

}  // namespace

ObjectKind object_kind(const std::string& name) {
  if (name == "a") return ObjectKind::kLiver;
  if (name == "b") return ObjectKind::kLung;
  if (name == "c") return ObjectKind::kVessels;
  throw UsageError(
      "'" + name +
      "' is no object: it must be a (like a liver), b (like a lung) or c (great vein and aorta)");
}

std::string name_of(ObjectKind kind) {
  return kind == ObjectKind::kLiver ? "a" : kind == ObjectKind::kLung ? "b" : "c";
}

double half_thickness_m(ObjectKind kind) {
  return kind == ObjectKind::kLiver  ? kLiverHalfThicknessMetres
         : kind == ObjectKind::kLung ? kLungHalfThicknessMetres
                                     : kVesselRadiusMetres;
}

double half_width_m(ObjectKind kind) {
  return kind == ObjectKind::kVessels ? 2 * kVesselRadiusMetres : kHalfWidthMetres;
}

OrganObject make_object(ObjectKind kind, std::size_t vertices,
                        const std::function<void(const std::string&)>& step) {
  if (vertices < kLeastObjectNodes || vertices > kMostObjectNodes) {
    throw UsageError("an object has " + std::to_string(kLeastObjectNodes) + " to " +
                     std::to_string(kMostObjectNodes) + " vertices, not " + std::to_string(vertices));
  }
  OrganObject object;
  object.name = name_of(kind);
  object.tissue = colour_of(kind);
  sim::LabelMap labels;
  // A layer of air around y and z; along x the object ends with the voxels, in flat faces.
  const Vector3 half_m(kHalfLengthMetres, half_width_m(kind) + 2 * kVoxelMetres,
                       half_thickness_m(kind) + 2 * kVoxelMetres);
  for (std::size_t axis = 0; axis < 3; ++axis)
    labels.grid.size[axis] =
        static_cast<std::size_t>(std::lround(2 * half_m[static_cast<Eigen::Index>(axis)] / kVoxelMetres)) + 1;
  labels.grid.spacing_m.setConstant(kVoxelMetres);
  labels.grid.origin_m = -half_m;
  labels.labels.reserve(labels.grid.voxels());
  for (std::size_t k = 0; k < labels.grid.size[2]; ++k) {
    for (std::size_t j = 0; j < labels.grid.size[1]; ++j) {
      for (std::size_t i = 0; i < labels.grid.size[0]; ++i) {
        const Vector3 index(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
        labels.labels.push_back(region_at(kind, labels.grid.patient_m(index)));
      }
    }
  }
  object.mesh = sim::make_organ_mesh(labels, {vertices, 1}, step).mesh;
  object.materials = materials_of(kind);
  object.constraints = sim::Constraints(object.mesh.nodes.size());
  const double free_m = kHalfLengthMetres * (1 - 2 * kFixedShareOfOrgan);
  for (std::size_t node = 0; node < object.mesh.nodes.size(); ++node) {
    if (std::abs(object.mesh.nodes[node].x()) >= free_m)
      object.constraints.prescribe(node, Vector3::Zero(), "the object's ends");
  }
  return object;
}

}  // namespace kiroku::trainer
