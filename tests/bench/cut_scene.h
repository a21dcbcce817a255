// What the ways to cut are compared on: a long block, held from below, pulled at both sides, and a blade that
// goes along it obliquely from one end, with its tip inside. Lengths in m. Pure, thread-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "sim/cutting/blade_path.h"
#include "sim/cutting/closest_point.h"
#include "sim/fem/elastic_body.h"
#include "sim/mesh/mesh_topology.h"
#include "sim/mesh/tet_grid.h"
#include "tests/bench/cut_baselines.h"

namespace kiroku::test {

/// x across, y along, z up from what is held.
struct CutScene {
  sim::Vector3 size_m{0.05, 0.5, 0.04};
  double tip_z_m = 0.015, end_y_m = 0.45;
  double pull_n = 2.5;  // at each side, all of its nodes together
  sim::Material tissue{5e3, 0.45};

  /// Where the blade's plane is; it leans and is not in line with the block.
  [[nodiscard]] double blade_x_m(double y_m, double z_m) const {
    return 0.5 * size_m.x() - 0.004 + 0.016 * y_m + 0.08 * (z_m - tip_z_m);
  }
  [[nodiscard]] sim::Vector3 on_blade(double y_m, double z_m) const {
    return {blade_x_m(y_m, z_m), y_m, z_m};
  }
  /// Of unit length, towards greater x.
  [[nodiscard]] sim::Vector3 blade_normal() const { return sim::Vector3(1, -0.016, -0.08).normalized(); }

  [[nodiscard]] std::vector<sim::SweepSurface> sweeps(int steps) const {
    const double outside_m = -0.004, above_m = size_m.z() + 0.01;
    std::vector<sim::BladePose> path;
    for (int step = 0; step <= steps; ++step) {
      const double y_m = outside_m + (end_y_m - outside_m) * step / steps;
      path.push_back({on_blade(y_m, tip_z_m), on_blade(y_m, above_m)});
    }
    return sim::sweep_surfaces(path);
  }

  /// A mesh that knows nothing of the blade: its nodes are moved about, those of the surface within it.
  [[nodiscard]] sim::TetMesh uneven(const std::array<std::uint32_t, 3>& cells) const {
    sim::TetMesh mesh = sim::tet_grid(cells, size_m);
    std::mt19937 random(7);
    for (sim::Vector3& node : mesh.nodes) {
      for (Eigen::Index i = 0; i < 3; ++i) {
        const double by = 0.4 * (static_cast<double>(random()) / 4294967296.0 - 0.5);
        const bool inside = node[i] > 1e-9 && node[i] < size_m[i] - 1e-9;
        if (inside) node[i] += by * size_m[i] / cells[static_cast<std::size_t>(i)];
      }
    }
    return mesh;
  }

  /// A mesh with nodes and faces on the blade's path up to its very border, split there; but for one triangle
  /// at the path's inner corner, whose nodes all lie on the border. `cells[0]` is even; the tip and the end
  /// of the path lie between two layers of nodes.
  [[nodiscard]] sim::TetMesh exactly_split(const std::array<std::uint32_t, 3>& cells) const {
    sim::TetMesh mesh = sim::tet_grid(cells, {1, 1, 1});
    // The share of a length that lies before the place where a layer of nodes is put.
    const auto stretched = [](double share, double place, std::uint32_t count) {
      const double layer = std::round(place * count) / count;
      return share <= layer ? share * place / layer : 1 - (1 - share) * (1 - place) / (1 - layer);
    };
    for (sim::Vector3& node : mesh.nodes) {
      const double y_m = size_m.y() * stretched(node.y(), end_y_m / size_m.y(), cells[1]);
      const double z_m = size_m.z() * stretched(node.z(), tip_z_m / size_m.z(), cells[2]);
      const double blade_m = blade_x_m(y_m, z_m);
      const double x_m =
          node.x() <= 0.5 ? 2 * node.x() * blade_m : blade_m + (2 * node.x() - 1) * (size_m.x() - blade_m);
      node = {x_m, y_m, z_m};
    }
    FaceSplittingCut cut(std::move(mesh));
    cut.open([this](const std::array<sim::Vector3, 3>& corners) {
      const bool on_plane = std::ranges::all_of(corners, [this](const sim::Vector3& corner) {
        return std::abs(blade_normal().dot(corner - on_blade(0, 0))) < 1e-9;
      });
      const sim::Vector3 centre = (corners[0] + corners[1] + corners[2]) / 3;
      return on_plane && centre.y() < end_y_m && centre.z() > tip_z_m;
    });
    return cut.mesh();
  }

  [[nodiscard]] sim::Constraints held(const sim::TetMesh& mesh) const {
    sim::Constraints constraints(mesh.nodes.size());
    for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
      if (mesh.nodes[node].z() < 1e-9) constraints.prescribe(node, sim::Vector3::Zero(), "scene");
    }
    return constraints;
  }

  /// Spread evenly over both sides' faces, outward; (3 |V|).
  [[nodiscard]] Eigen::VectorXd pull(const sim::TetMesh& mesh) const {
    Eigen::VectorXd force_n = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * mesh.nodes.size()));
    const double side_m2 = size_m.y() * size_m.z();
    for (const sim::Face& face : sim::faces_of(mesh).surface) {
      const auto& [a, b, c] = face.nodes;
      const bool left = all_at(mesh, face, 0), right = all_at(mesh, face, size_m.x());
      if (!left && !right) continue;
      const double area_m2 = (mesh.nodes[b] - mesh.nodes[a]).cross(mesh.nodes[c] - mesh.nodes[a]).norm() / 2;
      for (const std::uint32_t node : face.nodes)
        force_n[static_cast<Eigen::Index>(3 * std::size_t{node})] +=
            (left ? -1 : 1) * pull_n * area_m2 / side_m2 / 3;
    }
    return force_n;
  }

  /// How a body that was cut opens, at places of the path, across the blade.
  struct Opening {
    std::vector<double> gap_m;     // from face to face, what the cut took away included
    std::vector<double> motion_m;  // how far the faces have moved apart
  };
  /// At each place the tissue that is nearest on either side counts.
  [[nodiscard]] Opening opening(const sim::TetMesh& mesh, const Eigen::VectorXd& displacement_m) const {
    const sim::Vector3 normal = blade_normal();
    std::array<std::vector<sim::Face>, 2> faces;  // behind the blade, before it
    for (const sim::Face& face : sim::faces_of(mesh).surface) {
      sim::Vector3 centre = sim::Vector3::Zero();
      for (const std::uint32_t node : mesh.tetrahedra[face.tetrahedron]) centre += mesh.nodes[node] / 4;
      faces[normal.dot(centre - on_blade(0, 0)) > 0 ? 1 : 0].push_back(face);
    }
    Opening opening;
    for (int along = 1; along <= 8; ++along) {
      for (int up = 1; up <= 4; ++up) {
        const sim::Vector3 place =
            on_blade(0.1 * along * end_y_m, tip_z_m + 0.25 * up * (size_m.z() - tip_z_m));
        std::array<double, 2> lies{}, moved{};
        for (std::size_t side = 0; side < 2; ++side) {
          double least_m = std::numeric_limits<double>::infinity();
          for (const sim::Face& face : faces[side]) {
            const std::array<sim::Vector3, 3> corners{mesh.nodes[face.nodes[0]], mesh.nodes[face.nodes[1]],
                                                      mesh.nodes[face.nodes[2]]};
            const sim::Vector3 weights = sim::closest_weights(place, corners);
            sim::Vector3 at = sim::Vector3::Zero(), by = sim::Vector3::Zero();
            for (std::size_t i = 0; i < 3; ++i) {
              const auto row = static_cast<Eigen::Index>(3 * std::size_t{face.nodes[i]});
              at += weights[static_cast<Eigen::Index>(i)] * corners[i];
              by += weights[static_cast<Eigen::Index>(i)] * displacement_m.segment<3>(row);
            }
            if ((at - place).norm() >= least_m) continue;
            least_m = (at - place).norm();
            moved[side] = normal.dot(by);
            lies[side] = normal.dot(at) + moved[side];
          }
        }
        opening.gap_m.push_back(lies[1] - lies[0]);
        opening.motion_m.push_back(moved[1] - moved[0]);
      }
    }
    return opening;
  }

 private:
  static bool all_at(const sim::TetMesh& mesh, const sim::Face& face, double x_m) {
    return std::ranges::all_of(
        face.nodes, [&](std::uint32_t node) { return std::abs(mesh.nodes[node].x() - x_m) < 1e-9; });
  }
};

}  // namespace kiroku::test
