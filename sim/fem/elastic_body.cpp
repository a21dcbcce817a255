#include "sim/fem/elastic_body.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/fem/elimination_order.h"
#include "sim/fem/rigid_motion.h"
#include "sim/mesh/mesh_check.h"

namespace kiroku::sim {
namespace {

constexpr double kLargestElasticResidual = 1e-9;

Eigen::Matrix<double, 4, 3> displacements_of(const Tetrahedron& corners,
                                             const Eigen::VectorXd& displacement_m) {
  Eigen::Matrix<double, 4, 3> rows;
  for (std::size_t a = 0; a < 4; ++a) {
    rows.row(static_cast<Eigen::Index>(a)) =
        displacement_m.segment<3>(static_cast<Eigen::Index>(3 * std::size_t{corners[a]})).transpose();
  }
  return rows;
}

void check_materials(const Materials& materials) {
  for (const auto& [region, material] : materials) {
    const MaterialProblem found = problem_of(material);
    if (!found.problem.empty()) {
      throw Error("the " + found.property + " of region " + std::to_string(region) + " " + found.problem);
    }
  }
}

void refuse_free_motions(const TetMesh& mesh, const Faces& faces, const Constraints& constraints) {
  constexpr std::size_t kMostNamedParts = 3;
  const std::vector<std::string> motions = free_rigid_motions(mesh, faces, constraints);
  if (motions.empty()) return;
  std::string sentence =
      constraints.any() ? "the displacements that are fixed do not hold it: " : "nothing is fixed: ";
  for (std::size_t i = 0; i < std::min(motions.size(), kMostNamedParts); ++i)
    sentence += (i == 0 ? "" : "; ") + motions[i];
  if (motions.size() > kMostNamedParts) {
    sentence += "; so can " + std::to_string(motions.size() - kMostNamedParts) + " other parts";
  }
  throw Error(sentence + " (three nodes that are not on one line hold a body)");
}

}  // namespace

ElasticBody::ElasticBody(TetMesh mesh, const Materials& materials, Constraints constraints)
    : mesh_(std::move(mesh)),
      materials_(materials),
      constraints_(std::move(constraints)),
      bears_(mesh_.tetrahedra.size(), true),
      used_(nodes_in_use(mesh_)) {
  check_materials(materials_);
  // Seeking the order takes as long as everything else up to the factorisation.
  std::future<std::vector<std::uint32_t>> order = std::async([this] { return elimination_order(mesh_); });
  const Faces faces = faces_of(mesh_);
  const std::vector<MeshFinding> unsound = check_for_solving(mesh_, faces);
  if (!unsound.empty()) throw Error("the mesh is not sound: " + unsound.front().text);
  material_of_.reserve(mesh_.tetrahedra.size());
  for (const std::int32_t region : mesh_.regions) {
    const auto found = materials_.find(region);
    if (found == materials_.end()) throw Error("region " + std::to_string(region) + " has no material");
    material_of_.push_back(&found->second);
  }
  refuse_free_motions(mesh_, faces, constraints_);
  stiffness_ = std::make_unique<StiffnessMatrix>(mesh_, material_of_, constraints_.axes());
  free_.resize(3 * mesh_.nodes.size());
  for (std::size_t number = 0; number < free_.size(); ++number) {
    free_[number] = used_[number / 3] && !constraints_.prescribed(number);
  }
  order_ = order.get();
  factorisation_ = std::make_unique<Factorisation>(*stiffness_, free_, order_);
}

void ElasticBody::apply(const MeshChange& change, std::span<const std::uint32_t> adrift) {
  std::vector<bool> touched(mesh_.nodes.size());
  std::vector<std::uint8_t> moved(mesh_.nodes.size());
  for (std::size_t i = 0; i < change.moved.size(); ++i) {
    mesh_.nodes[change.moved[i]] = change.positions_m[i];
    moved[change.moved[i]] = 1;
  }
  for (const auto& gone : {std::span<const std::uint32_t>(change.removed), adrift}) {
    for (const std::uint32_t t : gone) {
      if (!bears_[t]) continue;
      bears_[t] = false;
      for (const std::uint32_t node : mesh_.tetrahedra[t]) touched[node] = true;
    }
  }
  used_.assign(used_.size(), false);
  for (std::size_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    if (!bears_[t]) continue;
    const Tetrahedron& corners = mesh_.tetrahedra[t];
    const bool reshaped = std::ranges::any_of(corners, [&](std::uint32_t node) { return moved[node] != 0; });
    if (reshaped && !(signed_volume_m3(mesh_, t) > 0))
      throw Error("tetrahedron " + std::to_string(t) + " has no volume after the change");
    for (const std::uint32_t node : corners) {
      used_[node] = true;
      if (reshaped) touched[node] = true;
    }
  }
  std::vector<std::uint32_t> nodes;
  for (std::uint32_t node = 0; node < touched.size(); ++node) {
    if (touched[node]) nodes.push_back(node);
  }
  stiffness_->update(mesh_, material_of_, bears_, nodes);
  factorisation_->update(nodes);
}

Eigen::VectorXd ElasticBody::weight_n(const Vector3& gravity_m_s2) const {
  Eigen::VectorXd force_n = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * mesh_.nodes.size()));
  for (std::size_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    if (!bears_[t]) continue;
    const Vector3 quarter_n = signed_volume_m3(mesh_, t) * material_of_[t]->density_kg_m3 / 4 * gravity_m_s2;
    for (const std::uint32_t node : mesh_.tetrahedra[t]) {
      force_n.segment<3>(static_cast<Eigen::Index>(3 * std::size_t{node})) += quarter_n;
    }
  }
  return force_n;
}

Eigen::VectorXd ElasticBody::borne_n(Eigen::VectorXd force_n) const {
  for (std::size_t node = 0; node < used_.size(); ++node) {
    if (!used_[node]) force_n.segment<3>(static_cast<Eigen::Index>(3 * node)).setZero();
  }
  return force_n;
}

StaticSolution ElasticBody::solve(const Eigen::VectorXd& force_n) const {
  return solve(force_n, constraints_.displacement_m());
}

StaticSolution ElasticBody::solve(const Eigen::VectorXd& given_n, const Eigen::VectorXd& given_m) const {
  // Everything is along the nodes' own axes until the end.
  const Eigen::VectorXd force_n = constraints_.to_own_axes(given_n);
  const auto count = static_cast<std::size_t>(force_n.size());
  Eigen::VectorXd prescribed_m = Eigen::VectorXd::Zero(force_n.size());
  for (std::size_t number = 0; number < count; ++number) {
    const auto i = static_cast<Eigen::Index>(number);
    if (constraints_.prescribed(number)) prescribed_m[i] = given_m[i];
  }
  StaticSolution solution;
  // What the prescribed displacements alone would ask of the unknowns, then one step of refinement.
  const Eigen::VectorXd first_n = borne_n(force_n - *stiffness_ * prescribed_m);
  solution.displacement_m = prescribed_m + factorisation_->solve(first_n);
  Eigen::VectorXd residual_n = borne_n(force_n - *stiffness_ * solution.displacement_m);
  solution.displacement_m += factorisation_->solve(residual_n);
  const Eigen::VectorXd inner_n = *stiffness_ * solution.displacement_m;
  residual_n = force_n - inner_n;

  solution.reaction_force_n = Eigen::VectorXd::Zero(force_n.size());
  double largest_n = 0, largest_residual_n = 0;
  for (std::size_t number = 0; number < count; ++number) {
    if (!used_[number / 3]) continue;
    const auto i = static_cast<Eigen::Index>(number);
    largest_n = std::max({largest_n, std::abs(inner_n[i]), std::abs(force_n[i]), std::abs(first_n[i])});
    if (constraints_.prescribed(number)) {
      solution.reaction_force_n[i] = -residual_n[i];
    } else {
      largest_residual_n = std::max(largest_residual_n, std::abs(residual_n[i]));
    }
  }
  if (!solution.displacement_m.allFinite() || !solution.reaction_force_n.allFinite()) {
    throw Error("the solution is not finite: a force, a displacement or a modulus is out of all proportion");
  }
  if (!(largest_residual_n <= kLargestElasticResidual * largest_n)) {
    throw Error("the equations are too badly conditioned to be solved (they are met to " +
                number_text(largest_residual_n / largest_n, 2) +
                " only): moduli differ too much, or a Poisson's ratio is too near 0.5");
  }
  solution.displacement_m = constraints_.from_own_axes(std::move(solution.displacement_m));
  solution.reaction_force_n = constraints_.from_own_axes(std::move(solution.reaction_force_n));
  return solution;
}

std::size_t ElasticBody::free_components(std::size_t node) const {
  std::size_t count = 0;
  for (std::size_t component = 0; used_[node] && component < 3; ++component) {
    if (!constraints_.prescribed(3 * node + component)) ++count;
  }
  return count;
}

Eigen::MatrixXd ElasticBody::compliance_columns(std::span<const std::uint32_t> nodes) const {
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(3 * mesh_.nodes.size()),
                                                  static_cast<Eigen::Index>(3 * nodes.size()));
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    columns
        .block<3, 3>(static_cast<Eigen::Index>(3 * std::size_t{nodes[i]}), static_cast<Eigen::Index>(3 * i))
        .setIdentity();
  }
  // Where no node is turned, columns stay as they are and are not copied.
  for (Eigen::Index column = 0; constraints_.turned() && column < columns.cols(); ++column)
    columns.col(column) = constraints_.to_own_axes(columns.col(column));
  factorisation_->solve_columns(columns);
  for (Eigen::Index column = 0; constraints_.turned() && column < columns.cols(); ++column)
    columns.col(column) = constraints_.from_own_axes(columns.col(column));
  if (!columns.allFinite()) {
    throw Error("the compliance of node " + std::to_string(nodes.front()) +
                " and its neighbours is not finite: a modulus is out of all proportion");
  }
  return columns;
}

std::vector<SymmetricTensor> ElasticBody::strain(const Eigen::VectorXd& displacement_m) const {
  std::vector<SymmetricTensor> strain;
  strain.reserve(mesh_.tetrahedra.size());
  for (std::size_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    strain.push_back(
        bears_[t] ? strain_of(element_of(mesh_, t), displacements_of(mesh_.tetrahedra[t], displacement_m))
                  : SymmetricTensor::Zero());
  }
  return strain;
}

std::vector<SymmetricTensor> ElasticBody::stress_pa(const Eigen::VectorXd& displacement_m) const {
  std::vector<SymmetricTensor> all_pa;
  all_pa.reserve(mesh_.tetrahedra.size());
  for (std::size_t t = 0; t < mesh_.tetrahedra.size(); ++t) all_pa.push_back(stress_pa(displacement_m, t));
  return all_pa;
}

SymmetricTensor ElasticBody::stress_pa(const Eigen::VectorXd& displacement_m, std::size_t tetrahedron) const {
  if (!bears_[tetrahedron]) return SymmetricTensor::Zero();
  const SymmetricTensor strain = strain_of(element_of(mesh_, tetrahedron),
                                           displacements_of(mesh_.tetrahedra[tetrahedron], displacement_m));
  const SymmetricTensor stress = stress_of(*material_of_[tetrahedron], strain);
  if (!stress.allFinite() || !std::isfinite(von_mises(stress))) {
    throw Error("the stress of tetrahedron " + std::to_string(tetrahedron) +
                " is not finite: a force, a displacement or a modulus is out of all proportion");
  }
  return stress;
}

std::vector<SymmetricTensor> ElasticBody::at_nodes(const std::vector<SymmetricTensor>& of_tetrahedra) const {
  std::vector<SymmetricTensor> sums(mesh_.nodes.size(), SymmetricTensor::Zero());
  std::vector<double> volumes_m3(mesh_.nodes.size());
  for (std::size_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    if (!bears_[t]) continue;
    const double volume_m3 = signed_volume_m3(mesh_, t);
    for (const std::uint32_t node : mesh_.tetrahedra[t]) {
      sums[node] += volume_m3 * of_tetrahedra[t];
      volumes_m3[node] += volume_m3;
    }
  }
  for (std::size_t node = 0; node < sums.size(); ++node) {
    if (volumes_m3[node] > 0) sums[node] /= volumes_m3[node];
  }
  return sums;
}

}  // namespace kiroku::sim
