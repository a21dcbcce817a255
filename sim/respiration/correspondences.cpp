#include "sim/respiration/correspondences.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>

#include "base/error.h"
#include "sim/fem/element.h"
#include "sim/mesh/length_unit.h"
#include "sim/mesh/mesh_topology.h"
#include "sim/model/body_model.h"
#include "sim/respiration/flat_elements.h"
#include "sim/respiration/number_table.h"

namespace kiroku::sim {
namespace {

// Found on held-out correspondences (docs/explanation/respiration.md).
constexpr double kSmoothM = 0.0035;  // L
constexpr double kAgreesM = 0.004;   // at this distance a place has a quarter of its weight
constexpr double kStartM = 0.04;     // the same in the first round

/// What holds two elements at an inner face together: the jump of the deformation gradient across it is that
/// of one derivative, along the normal, as the motion itself does not jump.
struct Hinge {
  std::array<std::uint32_t, 5> nodes{};
  Eigen::Matrix<double, 5, 1> jump = Eigen::Matrix<double, 5, 1>::Zero();  // of the derivative, 1/m
  double weight_m = 0;                                                     // A / h
  std::array<std::uint32_t, 2> elements{};
};

std::vector<Hinge> hinges_of(const TetMesh& mesh) {
  const Faces faces = faces_of(mesh);
  std::vector<Hinge> hinges;
  for (const auto& [a, b] : faces.between) {
    const Tetrahedron &first = mesh.tetrahedra[a], &second = mesh.tetrahedra[b];
    const LinearElement one = element_of(mesh, a), other = element_of(mesh, b);
    Hinge hinge;
    hinge.elements = {a, b};
    std::copy(first.begin(), first.end(), hinge.nodes.begin());
    std::size_t alone = 0;
    for (std::size_t corner = 0; corner < 4; ++corner) {
      if (std::ranges::find(first, second[corner]) == first.end()) hinge.nodes[4] = second[corner];
      if (std::ranges::find(second, first[corner]) == second.end()) alone = corner;
    }
    const auto& face = kFaceCorners[alone];
    const Vector3 area = (mesh.nodes[first[face[1]]] - mesh.nodes[first[face[0]]])
                             .cross(mesh.nodes[first[face[2]]] - mesh.nodes[first[face[0]]]) /
                         2;
    const Vector3 normal = area.normalized();
    Vector3 apart = Vector3::Zero();
    for (std::size_t corner = 0; corner < 4; ++corner)
      apart += (mesh.nodes[second[corner]] - mesh.nodes[first[corner]]) / 4;
    hinge.weight_m = area.norm() / apart.norm();
    for (Eigen::Index corner = 0; corner < 4; ++corner) {
      hinge.jump[corner] -= one.gradients.row(corner).dot(normal);
      const auto node = std::ranges::find(hinge.nodes, second[static_cast<std::size_t>(corner)]);
      hinge.jump[node - hinge.nodes.begin()] += other.gradients.row(corner).dot(normal);
    }
    hinges.push_back(hinge);
  }
  return hinges;
}

/// The motion, for weights that are given.
class SmoothMotion {
 public:
  SmoothMotion(const TetMesh& mesh, const std::vector<LocatedPoint>& points)
      : mesh_(mesh), points_(points), hinges_(hinges_of(mesh)), stiffening_(mesh.tetrahedra.size(), 1) {
    for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) volume_m3_ += signed_volume_m3(mesh, t);
  }

  /// Where nothing is asked for, `near_m` decides.
  [[nodiscard]] std::vector<Vector3> solve(const std::vector<Vector3>& wanted_m,
                                           const std::vector<double>& weights,
                                           const std::vector<Vector3>& near_m) {
    constexpr double kStay = 1e-6;
    const auto nodes = static_cast<Eigen::Index>(mesh_.nodes.size());
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(nodes, 3);
    const auto add = [&](std::uint32_t row, std::uint32_t column, double value) {
      if (row >= column)
        entries.emplace_back(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column), value);
    };
    for (std::uint32_t node = 0; node < mesh_.nodes.size(); ++node) {
      add(node, node, kStay);
      right.row(node) += kStay * near_m[node].transpose();
    }
    const double density_m3 = static_cast<double>(points_.size()) / volume_m3_;
    const double smoothness = density_m3 * std::pow(kSmoothM, 4);
    for (const Hinge& hinge : hinges_) {
      const double stiff = smoothness * hinge.weight_m *
                           std::max(stiffening_[hinge.elements[0]], stiffening_[hinge.elements[1]]);
      for (std::size_t i = 0; i < 5; ++i) {
        for (std::size_t j = 0; j < 5; ++j) {
          add(hinge.nodes[i], hinge.nodes[j],
              stiff * hinge.jump[static_cast<Eigen::Index>(i)] * hinge.jump[static_cast<Eigen::Index>(j)]);
        }
      }
    }
    for (std::size_t p = 0; p < points_.size(); ++p) {
      const MeshPoint& point = points_[p].point;
      for (std::size_t i = 0; i < 4; ++i) {
        right.row(point.nodes[i]) += weights[p] * point.weights[i] * wanted_m[p].transpose();
        for (std::size_t j = 0; j < 4; ++j)
          add(point.nodes[i], point.nodes[j], weights[p] * point.weights[i] * point.weights[j]);
      }
    }
    Eigen::SparseMatrix<double> matrix(nodes, nodes);
    matrix.setFromTriplets(entries.begin(), entries.end());
    if (!analysed_) {
      factor_.analyzePattern(matrix);
      analysed_ = true;
    }
    factor_.factorize(matrix);
    if (factor_.info() != Eigen::Success) throw Error("the correspondences do not determine a motion");
    const Eigen::MatrixXd found = factor_.solve(right);
    std::vector<Vector3> places_m;
    for (Eigen::Index node = 0; node < nodes; ++node) places_m.emplace_back(found.row(node).transpose());
    return places_m;
  }

  /// Binds the elements that are flat or inside out to their neighbours; whether there are any.
  bool stiffen_flat_ones(const std::vector<Vector3>& places_m) {
    return stiffen_flat_elements(mesh_, places_m, stiffening_);
  }

 private:
  const TetMesh& mesh_;
  const std::vector<LocatedPoint>& points_;
  std::vector<Hinge> hinges_;
  std::vector<double> stiffening_;  // (|T|), factors
  double volume_m3_ = 0;
  bool analysed_ = false;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
};

/// Geman and McClure's, of distances to `wanted_m`.
std::vector<double> agreement(const std::vector<LocatedPoint>& points, const std::vector<Vector3>& wanted_m,
                              const std::vector<Vector3>& places_m, double scale_m) {
  std::vector<double> weights;
  for (std::size_t p = 0; p < points.size(); ++p) {
    const double part = (points[p].point.mean(places_m) - wanted_m[p]).squaredNorm() / (scale_m * scale_m);
    weights.push_back(1 / ((1 + part) * (1 + part)));
  }
  return weights;
}

}  // namespace

Correspondences parse_correspondences(std::string_view text, const std::string& name) {
  constexpr std::size_t kColumns = 6;
  const NumberTable table = NumberTable::parse(text, name);
  if (table.columns() != kColumns) {
    throw Error("cannot use " + name + ": it has " + std::to_string(table.columns()) +
                " columns where six are expected: x, y, z in the first CT and x, y, z in the second, mm");
  }
  if (table.nameless())
    throw Error("cannot use " + name + ": its first line holds numbers; it must name the columns");
  if (table.rows() == 0) throw Error("cannot use " + name + ": it holds no correspondence");
  Correspondences read;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto place = [&](std::size_t from) {
      return Vector3(Vector3(table.at(row, from), table.at(row, from + 1), table.at(row, from + 2)) /
                     kMmPerM);
    };
    read.first_m.push_back(place(0));
    read.second_m.push_back(place(3));
  }
  return read;
}

Correspondences read_correspondences(const std::vector<std::filesystem::path>& files) {
  Correspondences all;
  for (const std::filesystem::path& file : files) {
    const Correspondences read = parse_correspondences(read_document(file), file.string());
    all.first_m.insert(all.first_m.end(), read.first_m.begin(), read.first_m.end());
    all.second_m.insert(all.second_m.end(), read.second_m.begin(), read.second_m.end());
  }
  return all;
}

CorrespondenceFit follow_correspondences(const TetMesh& mesh, const Correspondences& given,
                                         const std::vector<Vector3>& near_m) {
  constexpr int kRounds = 14, kMostStiffenings = 12;
  constexpr double kQuarter = 0.25;
  const MeshLocator locator(mesh);
  CorrespondenceFit fit;
  fit.use.given = given.first_m.size();
  std::vector<LocatedPoint> points;
  std::vector<Vector3> wanted_m;
  for (std::size_t i = 0; i < given.first_m.size(); ++i) {
    const LocatedPoint located = locator.locate(given.first_m[i]);
    if (located.outside_m > kCorrespondenceReachM) {
      ++fit.use.outside;
      continue;
    }
    points.push_back(located);
    wanted_m.push_back(given.second_m[i]);
  }
  if (2 * points.size() < fit.use.given || points.empty()) {
    throw Error("only " + std::to_string(points.size()) + " of " + std::to_string(fit.use.given) +
                " correspondences are in the lung: their first three columns must be in the patient "
                "coordinates of its CT, mm (left, back, head)");
  }
  SmoothMotion motion(mesh, points);
  fit.places_m = near_m;
  double scale_m = kStartM;
  for (int round = 0; round < kRounds; ++round) {
    fit.places_m = motion.solve(wanted_m, agreement(points, wanted_m, fit.places_m, scale_m), near_m);
    constexpr double kFiner = 0.8;
    scale_m = std::max(kAgreesM, kFiner * scale_m);
  }
  const std::vector<double> weights = agreement(points, wanted_m, fit.places_m, kAgreesM);
  for (int round = 0; round < kMostStiffenings && motion.stiffen_flat_ones(fit.places_m); ++round)
    fit.places_m = motion.solve(wanted_m, weights, near_m);

  std::vector<double> left_m;
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (weights[p] < kQuarter) {
      ++fit.use.refused;
      continue;
    }
    fit.agreed.push_back(points[p]);
    left_m.push_back((points[p].point.mean(fit.places_m) - wanted_m[p]).norm());
  }
  fit.use.left_m = spread_of(left_m);
  if (2 * left_m.size() < points.size()) {
    throw Error(
        "only " + std::to_string(left_m.size()) + " of " + std::to_string(points.size()) +
        " correspondences agree with each other: are both columns' coordinates those of their own CT, "
        "and both CTs of the same patient?");
  }
  return fit;
}

}  // namespace kiroku::sim
