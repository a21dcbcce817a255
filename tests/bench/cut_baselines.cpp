#include "tests/bench/cut_baselines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include <Eigen/Geometry>

#include "sim/fem/stiffness.h"
#include "sim/mesh/disjoint_sets.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::test {
namespace {

using sim::SweepSurface;
using sim::TetMesh;
using sim::Tetrahedron;
using sim::Vector3;

constexpr std::array<std::array<std::size_t, 2>, 6> kEdgesOfOne{
    {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

bool contains(const Tetrahedron& corners, std::uint32_t node) {
  return std::ranges::find(corners, node) != corners.end();
}

bool near(const SweepSurface& sweep, const TetMesh& mesh, const Tetrahedron& corners) {
  Vector3 least = mesh.nodes[corners[0]], greatest = least;
  for (const std::uint32_t node : corners) {
    least = least.cwiseMin(mesh.nodes[node]);
    greatest = greatest.cwiseMax(mesh.nodes[node]);
  }
  const double slack_m = SweepSurface::kTouch * (greatest - least).sum();
  return (least.array() <= sweep.extent().greatest.array() + slack_m).all() &&
         (greatest.array() >= sweep.extent().least.array() - slack_m).all();
}

}  // namespace

RemovingCut::RemovingCut(TetMesh mesh) : mesh_(std::move(mesh)), present_(mesh_.tetrahedra.size(), 1) {}

std::vector<std::uint32_t> RemovingCut::cut(const SweepSurface& sweep) {
  std::vector<std::uint32_t> gone;
  for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    const Tetrahedron& corners = mesh_.tetrahedra[t];
    if (!present(t) || !near(sweep, mesh_, corners)) continue;
    const bool met = std::ranges::any_of(kEdgesOfOne, [&](const auto& edge) {
      return sweep.crossing(mesh_.nodes[corners[edge[0]]], mesh_.nodes[corners[edge[1]]]) != 0;
    });
    if (!met) continue;
    present_[t] = 0;
    gone.push_back(t);
  }
  return gone;
}

TetMesh RemovingCut::mesh() const {
  TetMesh left{mesh_.nodes, {}, {}};
  for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    if (!present(t)) continue;
    left.tetrahedra.push_back(mesh_.tetrahedra[t]);
    left.regions.push_back(mesh_.regions[t]);
  }
  return left;
}

PartingMesh::PartingMesh(TetMesh mesh) : mesh_(std::move(mesh)), around_(mesh_.nodes.size()) {
  for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    for (const std::uint32_t node : mesh_.tetrahedra[t]) around_[node].push_back(t);
  }
}

std::uint32_t PartingMesh::add_node(const Vector3& position_m) {
  mesh_.nodes.push_back(position_m);
  around_.emplace_back();
  return static_cast<std::uint32_t>(mesh_.nodes.size() - 1);
}

void PartingMesh::bisect(std::uint32_t a, std::uint32_t b, std::uint32_t node) {
  const std::vector<std::uint32_t> around_a = around_[a];
  for (const std::uint32_t t : around_a) {
    if (!contains(mesh_.tetrahedra[t], b)) continue;
    const auto half = static_cast<std::uint32_t>(mesh_.tetrahedra.size());
    Tetrahedron of_b = mesh_.tetrahedra[t];
    std::ranges::replace(of_b, a, node);
    std::ranges::replace(mesh_.tetrahedra[t], b, node);
    mesh_.tetrahedra.push_back(of_b);
    mesh_.regions.push_back(mesh_.regions[t]);
    std::erase(around_[b], t);
    around_[node].push_back(t);
    for (const std::uint32_t corner : of_b) around_[corner].push_back(half);
  }
}

std::vector<std::uint32_t> PartingMesh::shared(std::uint32_t t, std::uint32_t u) const {
  std::vector<std::uint32_t> nodes;
  for (const std::uint32_t node : mesh_.tetrahedra[t]) {
    if (contains(mesh_.tetrahedra[u], node)) nodes.push_back(node);
  }
  return nodes;
}

template <typename Opened>
std::vector<std::uint32_t> PartingMesh::part(std::uint32_t node, Opened opened) {
  const std::vector<std::uint32_t> members = around_[node];
  const auto count = static_cast<std::uint32_t>(members.size());
  sim::DisjointSets sets(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    for (std::uint32_t j = i + 1; j < count; ++j) {
      if (shared(members[i], members[j]).size() == 3 && !opened(members[i], members[j])) sets.join(i, j);
    }
  }
  std::map<std::uint32_t, std::uint32_t> own{{sets.find(0), node}};  // the node of each group
  std::vector<std::uint32_t> added;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto [found, is_new] = own.try_emplace(sets.find(i), 0);
    if (is_new) {
      const Vector3 position_m = mesh_.nodes[node];
      found->second = add_node(position_m);
      added.push_back(found->second);
    }
    if (found->second == node) continue;
    std::ranges::replace(mesh_.tetrahedra[members[i]], node, found->second);
    std::erase(around_[node], members[i]);
    around_[found->second].push_back(members[i]);
  }
  return added;
}

SubdividingCut::SubdividingCut(TetMesh mesh)
    : PartingMesh(std::move(mesh)), on_blade_(this->mesh().nodes.size()) {}

void SubdividingCut::cut(const SweepSurface& sweep) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const Tetrahedron& corners : mesh().tetrahedra) {
    if (!near(sweep, mesh(), corners)) continue;
    for (const auto& [i, j] : kEdgesOfOne) {
      const auto [a, b] = std::minmax(corners[i], corners[j]);
      // An edge from the blade's own nodes lies on one side of it.
      if (on_blade_[a] == 0 && on_blade_[b] == 0 && sweep.crossing(mesh().nodes[a], mesh().nodes[b]) != 0)
        edges.emplace(a, b);
    }
  }
  std::set<std::uint32_t> touched;
  for (const auto& [a, b] : edges) {
    const Vector3 from_m = mesh().nodes[a], to_m = mesh().nodes[b];
    const Vector3 normal = sweep.nearest((from_m + to_m) / 2).normal;
    const double before_m = normal.dot(from_m - sweep.from().tip);
    const double share = before_m / (before_m - normal.dot(to_m - sweep.from().tip));
    const std::uint32_t node = add_node(from_m + share * (to_m - from_m));
    on_blade_.push_back(1);
    bisect(a, b, node);
    touched.insert(node);
  }
  std::set<std::uint32_t> to_part;
  for (const std::uint32_t node : touched) {
    for (const std::uint32_t t : around(node)) {
      for (const std::uint32_t corner : mesh().tetrahedra[t]) {
        if (on_blade_[corner] != 0) to_part.insert(corner);
      }
    }
  }
  for (const std::uint32_t node : to_part) {
    const auto added = part(node, [this](std::uint32_t t, std::uint32_t u) {
      return std::ranges::all_of(shared(t, u),
                                 [this](std::uint32_t corner) { return on_blade_[corner] != 0; });
    });
    on_blade_.resize(on_blade_.size() + added.size(), 1);
  }
}

FaceSplittingCut::FaceSplittingCut(TetMesh mesh) : PartingMesh(std::move(mesh)) {
  between_ = sim::faces_of(this->mesh()).between;
  for (const Tetrahedron& corners : this->mesh().tetrahedra) {
    Vector3 sum_m = Vector3::Zero();
    for (const std::uint32_t node : corners) sum_m += this->mesh().nodes[node];
    centre_.emplace_back(sum_m / 4);
  }
}

void FaceSplittingCut::cut(const SweepSurface& sweep) {
  std::vector<std::array<std::uint32_t, 2>> faces;
  for (const auto& [t, u] : between_) {
    if (sweep.crossing(centre_[t], centre_[u]) != 0) faces.push_back({t, u});
  }
  open(faces);
}

void FaceSplittingCut::open(const std::function<bool(const std::array<Vector3, 3>&)>& chosen) {
  std::vector<std::array<std::uint32_t, 2>> faces;
  for (const auto& [t, u] : between_) {
    const std::vector<std::uint32_t> nodes = shared(t, u);
    if (nodes.size() == 3 && chosen({mesh().nodes[nodes[0]], mesh().nodes[nodes[1]], mesh().nodes[nodes[2]]}))
      faces.push_back({t, u});
  }
  open(faces);
}

void FaceSplittingCut::open(const std::vector<std::array<std::uint32_t, 2>>& faces) {
  std::set<std::uint32_t> to_part;
  for (const auto& [t, u] : faces) {
    opened_.insert(std::minmax(t, u));
    for (const std::uint32_t node : shared(t, u)) to_part.insert(node);
  }
  for (const std::uint32_t node : to_part)
    part(node, [this](std::uint32_t t, std::uint32_t u) { return opened_.contains(std::minmax(t, u)); });
}

double volume_m3(const TetMesh& mesh) {
  double sum_m3 = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) sum_m3 += sim::signed_volume_m3(mesh, t);
  return sum_m3;
}

double smallest_dihedral_degrees(const TetMesh& mesh) {
  double largest_cosine = -1;
  for (const Tetrahedron& corners : mesh.tetrahedra) {
    std::array<Vector3, 4> outward;
    for (std::size_t face = 0; face < 4; ++face) {
      const auto& [a, b, c] = sim::kFaceCorners[face];
      const Vector3& origin = mesh.nodes[corners[a]];
      outward[face] = (mesh.nodes[corners[b]] - origin).cross(mesh.nodes[corners[c]] - origin).normalized();
    }
    for (const auto& [i, j] : kEdgesOfOne)
      largest_cosine = std::max(largest_cosine, -outward[i].dot(outward[j]));
  }
  return std::acos(std::min(largest_cosine, 1.0)) * 180 / std::numbers::pi;
}

TetMesh largest_part(const TetMesh& mesh) {
  const sim::Parts parts = sim::face_connected_parts(mesh, sim::faces_of(mesh));
  std::vector<std::size_t> count(parts.count);
  for (const std::uint32_t part : parts.of_tetrahedron) ++count[part];
  const auto largest = static_cast<std::uint32_t>(std::ranges::max_element(count) - count.begin());
  TetMesh kept{mesh.nodes, {}, {}};
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (parts.of_tetrahedron[t] != largest) continue;
    kept.tetrahedra.push_back(mesh.tetrahedra[t]);
    kept.regions.push_back(mesh.regions[t]);
  }
  return kept;
}

double condition_number(const sim::ElasticBody& body) {
  constexpr int kPower = 300, kInverse = 30;
  std::vector<const sim::Material*> materials;
  for (std::size_t t = 0; t < body.mesh().tetrahedra.size(); ++t) materials.push_back(&body.material_of(t));
  const sim::StiffnessMatrix stiffness(body.mesh(), materials);
  const auto among_unknowns = [&](Eigen::VectorXd vector) {
    for (Eigen::Index i = 0; i < vector.size(); ++i) {
      if (!body.free()[static_cast<std::size_t>(i)]) vector[i] = 0;
    }
    return vector;
  };
  std::mt19937 random(3);
  Eigen::VectorXd start(static_cast<Eigen::Index>(3 * body.mesh().nodes.size()));
  for (double& component : start) component = static_cast<double>(random()) / 4294967296.0 - 0.5;
  start = among_unknowns(start).normalized();
  Eigen::VectorXd vector = start;
  double largest = 0, least = 0;
  for (int i = 0; i < kPower; ++i) {
    const Eigen::VectorXd image = among_unknowns(stiffness * vector);
    largest = image.norm();
    vector = image / largest;
  }
  vector = start;
  for (int i = 0; i < kInverse; ++i) {
    const Eigen::VectorXd image = body.solve(vector).displacement_m;
    least = 1 / image.norm();
    vector = image * least;
  }
  return largest / least;
}

}  // namespace kiroku::test
