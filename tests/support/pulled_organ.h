// An organ that is held at its back and pulled at one spot, by finite elements that are not those of a fit:
// corotational, of smaller cells, a lobe stiffer than the rest, held over another area. Fixed seeds: the same
// everywhere.
#pragma once

#include <limits>
#include <memory>
#include <vector>

#include "sim/align/deformable_organ.h"
#include "sim/fem/corotational_body.h"
#include "tests/support/endoscope_scene.h"

namespace kiroku::test {

/// Where an organ is held: its nodes within a ball.
struct Held {
  sim::Vector3 middle_m{-0.03, 0.02, 0.025};
  double radius_m = 0.035;
};

inline sim::Constraints held_nodes(const sim::TetMesh& mesh, const Held& held) {
  sim::Constraints constraints(mesh.nodes.size());
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) {
    if ((mesh.nodes[i] - held.middle_m).norm() < held.radius_m)
      constraints.prescribe(i, sim::Vector3::Zero(), "held");
  }
  return constraints;
}

/// As a plan has it: of one material, linear.
inline sim::ElasticBody plan_body(const sim::TetMesh& mesh, const Held& held = {}) {
  return {mesh, {{0, {3000, 0.4, 1000}}}, held_nodes(mesh, held)};
}

/// In what it differs from its plan.
struct OrganNature {
  Held held;
  double stiffer = 1;    // so many times is the left lobe's modulus the rest's
  double lobe_m = 0.02;  // where the lobe begins, x
  double poisson_ratio = 0.45;
};

class PulledOrgan {
 public:
  explicit PulledOrgan(const std::array<std::uint32_t, 3>& cells, const OrganNature& nature = {})
      : mesh_(liver_like_mesh(cells)), surface_(sim::organ_surface(mesh_)) {
    for (std::size_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
      double x = 0;
      for (const std::uint32_t node : mesh_.tetrahedra[t]) x += mesh_.nodes[node].x() / 4;
      mesh_.regions[t] = x > nature.lobe_m ? 1 : 0;
    }
    constexpr double kModulusPa = 5000;
    body_ = std::make_unique<sim::CorotationalBody>(
        mesh_,
        sim::Materials{{0, {kModulusPa, nature.poisson_ratio, 1000}},
                       {1, {nature.stiffer * kModulusPa, nature.poisson_ratio, 1000}}},
        held_nodes(mesh_, nature.held));
  }

  [[nodiscard]] const sim::TetMesh& mesh() const { return mesh_; }
  [[nodiscard]] const sim::OrganSurface& surface() const { return surface_; }

  /// Pulled about a surface node near `spot_m`, as a forceps does, until a node goes about `farthest_m`: the
  /// force for it, (3 |V|).
  [[nodiscard]] Eigen::VectorXd force_n(const sim::Vector3& spot_m, const sim::Vector3& direction,
                                        double farthest_m) const {
    constexpr double kGraspM = 0.012;
    Eigen::VectorXd force = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(mesh_.nodes.size()));
    const sim::Vector3 at = sim::place_m(surface_, sim::nearest_place(surface_, spot_m));
    for (std::size_t i = 0; i < surface_.nodes.size(); ++i) {
      const double away = (surface_.nodes[i] - at).norm() / kGraspM;
      force.segment<3>(3 * Eigen::Index{surface_.mesh_nodes[i]}) =
          std::exp(-away * away) * direction.normalized();
    }
    force *= farthest_m / farthest(body_->linear().solve(force).displacement_m);
    // Turned, it resists otherwise than small displacements say.
    for (int i = 0; i < 2; ++i) force *= farthest_m / farthest(body_->solve(force).displacement_m);
    return force;
  }
  [[nodiscard]] Eigen::VectorXd displacement_m(const Eigen::VectorXd& force_n) const {
    return body_->solve(force_n).displacement_m;
  }

  static double farthest(const Eigen::VectorXd& displacement_m) {
    double most = 0;
    for (Eigen::Index i = 0; i < displacement_m.size(); i += 3)
      most = std::max(most, displacement_m.segment<3>(i).norm());
    return most;
  }

  /// Of the nodes of another mesh's surface of the same shape, m.
  [[nodiscard]] std::vector<sim::Vector3> at_nodes_of(const sim::OrganSurface& other,
                                                      const Eigen::VectorXd& displacement_m) const {
    std::vector<sim::Vector3> all;
    for (const sim::Vector3& node : other.nodes) {
      const sim::SurfacePlace place = sim::nearest_place(surface_, node);
      sim::Vector3& mean = all.emplace_back(sim::Vector3::Zero());
      for (std::size_t i = 0; i < 3; ++i)
        mean +=
            place.weights[static_cast<Eigen::Index>(i)] *
            displacement_m.segment<3>(3 * Eigen::Index{surface_.mesh_nodes[surface_.faces[place.face][i]]});
    }
    return all;
  }

 private:
  sim::TetMesh mesh_;
  sim::OrganSurface surface_;
  std::unique_ptr<sim::CorotationalBody> body_;
};

}  // namespace kiroku::test
