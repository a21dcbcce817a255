#include "trainer/exclusion/opened_object.h"

#include <algorithm>
#include <map>
#include <utility>

namespace kiroku::trainer {
namespace {

using sim::Vector3;

class Opening {
 public:
  Opening(const sim::TetMesh& mesh, const Vector3& on_plane_m, const Vector3& away) : mesh_(mesh) {
    for (const Vector3& node : mesh.nodes) above_m_.push_back(away.normalized().dot(node - on_plane_m));
  }

  OpenedObject open() {
    for (std::size_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
      region_ = mesh_.regions[t];
      sim::Tetrahedron nodes = mesh_.tetrahedra[t];
      // Not std::ranges::partition: Clang 14 does not compile the range that it returns.
      const auto lost =
          std::partition(nodes.begin(), nodes.end(), [&](std::uint32_t node) { return above_m_[node] <= 0; });
      cut(nodes, static_cast<std::size_t>(lost - nodes.begin()));
    }
    return std::move(found_);
  }

 private:
  /// `nodes` begin with those that are kept.
  void cut(const sim::Tetrahedron& nodes, std::size_t kept) {
    const auto [a, b, c, d] = nodes;
    if (kept == 4) {
      add({at(a), at(b), at(c), at(d)});
    } else if (kept == 3) {
      add_prism({at(a), at(b), at(c)}, {between(a, d), between(b, d), between(c, d)});
    } else if (kept == 2) {
      add_prism({at(a), between(a, c), between(a, d)}, {at(b), between(b, c), between(b, d)});
    } else if (kept == 1) {
      add({at(a), between(a, b), between(a, c), between(a, d)});
    }
  }

  /// Cuts each of its four-sided faces along the diagonal of its least node, so that a neighbour that shares
  /// the face cuts it likewise: Dompierre, Labbe, Vallet and Camarero, "How to subdivide pyramids, prisms and
  /// hexahedra into tetrahedra", 1999.
  void add_prism(const std::array<std::uint32_t, 3>& lower, const std::array<std::uint32_t, 3>& upper) {
    static constexpr std::array<std::array<std::size_t, 6>, 6> kFromLeast{{{0, 1, 2, 3, 4, 5},
                                                                           {1, 2, 0, 4, 5, 3},
                                                                           {2, 0, 1, 5, 3, 4},
                                                                           {3, 5, 4, 0, 2, 1},
                                                                           {4, 3, 5, 1, 0, 2},
                                                                           {5, 4, 3, 2, 1, 0}}};
    const std::array<std::uint32_t, 6> all{lower[0], lower[1], lower[2], upper[0], upper[1], upper[2]};
    std::array<std::uint32_t, 6> n{};
    const auto least = static_cast<std::size_t>(std::ranges::min_element(all) - all.begin());
    for (std::size_t i = 0; i < n.size(); ++i) n[i] = all[kFromLeast[least][i]];
    if (std::min(n[1], n[5]) < std::min(n[2], n[4])) {
      add({n[0], n[1], n[2], n[5]});
      add({n[0], n[1], n[5], n[4]});
    } else {
      add({n[0], n[1], n[2], n[4]});
      add({n[0], n[4], n[2], n[5]});
    }
    add({n[0], n[4], n[5], n[3]});
  }

  /// Flat ones, where the plane goes through a node, are left out.
  void add(sim::Tetrahedron nodes) {
    found_.mesh.tetrahedra.push_back(nodes);
    found_.mesh.regions.push_back(region_);
    const double volume_m3 = sim::signed_volume_m3(found_.mesh, found_.mesh.tetrahedra.size() - 1);
    if (volume_m3 < 0) std::swap(found_.mesh.tetrahedra.back()[2], found_.mesh.tetrahedra.back()[3]);
    if (volume_m3 != 0) return;
    found_.mesh.tetrahedra.pop_back();
    found_.mesh.regions.pop_back();
  }

  std::uint32_t at(std::uint32_t node) { return node_on(node, node, 0); }
  /// Where the plane meets the edge between a node that is kept and one that is not.
  std::uint32_t between(std::uint32_t kept, std::uint32_t lost) {
    const double share = above_m_[kept] / (above_m_[kept] - above_m_[lost]);
    return share == 0 ? at(kept) : node_on(kept, lost, share);
  }
  std::uint32_t node_on(std::uint32_t from, std::uint32_t to, double share) {
    const auto next = static_cast<std::uint32_t>(found_.mesh.nodes.size());
    const auto [found, is_new] = numbers_.try_emplace({from, to}, next);
    if (!is_new) return found->second;
    found_.mesh.nodes.emplace_back((1 - share) * mesh_.nodes[from] + share * mesh_.nodes[to]);
    found_.ends.push_back({from, to});
    found_.shares.push_back(share);
    return next;
  }

  const sim::TetMesh& mesh_;
  std::vector<double> above_m_;
  std::int32_t region_ = 0;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> numbers_;
  OpenedObject found_;
};

}  // namespace

std::vector<double> OpenedObject::numbers(const std::vector<double>& of_whole) const {
  std::vector<double> found;
  for (std::size_t node = 0; node < ends.size(); ++node)
    found.push_back((1 - shares[node]) * of_whole[ends[node][0]] + shares[node] * of_whole[ends[node][1]]);
  return found;
}

Eigen::VectorXd OpenedObject::displacement_m(const Eigen::VectorXd& of_whole_m) const {
  Eigen::VectorXd found(3 * static_cast<Eigen::Index>(ends.size()));
  for (std::size_t node = 0; node < ends.size(); ++node) {
    found.segment<3>(3 * static_cast<Eigen::Index>(node)) =
        (1 - shares[node]) * of_whole_m.segment<3>(3 * static_cast<Eigen::Index>(ends[node][0])) +
        shares[node] * of_whole_m.segment<3>(3 * static_cast<Eigen::Index>(ends[node][1]));
  }
  return found;
}

OpenedObject open_object(const sim::TetMesh& mesh, const Vector3& on_plane_m, const Vector3& away) {
  return Opening(mesh, on_plane_m, away).open();
}

}  // namespace kiroku::trainer
