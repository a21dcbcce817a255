#include "sim/contact/contact_body.h"

#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "base/error.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::sim {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

Eigen::Index at(std::size_t node) { return static_cast<Eigen::Index>(3 * node); }

}  // namespace

ContactBody::ContactBody(const ElasticBody& body, const Eigen::VectorXd& load_n,
                         const ComplianceOptions& options)
    : body_(body), place_of_(body.mesh().nodes.size(), kNone) {
  const TetMesh& mesh = body_.mesh();
  load_n_ = load_n.size() > 0 ? load_n : Eigen::VectorXd::Zero(at(mesh.nodes.size()));
  if (load_n_.size() != at(mesh.nodes.size())) {
    throw UsageError("the load has " + std::to_string(load_n_.size()) + " components, the body " +
                     std::to_string(3 * mesh.nodes.size()));
  }
  size_m_ = extent_of(mesh).longest_side_m();
  unloaded_m_ = body_.solve(load_n_).displacement_m;
  rest_m_ = unloaded_m_;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    rest_m_.segment<3>(at(node)) += mesh.nodes[node];

  std::vector<double> area_m2(mesh.nodes.size());
  std::vector<std::uint32_t> nodes;
  for (const Face& face : faces_of(mesh).surface) {
    const Vector3& a = mesh.nodes[face.nodes[0]];
    const double third_m2 =
        (mesh.nodes[face.nodes[1]] - a).cross(mesh.nodes[face.nodes[2]] - a).norm() / 2 / 3;
    for (const std::uint32_t node : face.nodes) {
      area_m2[node] += third_m2;
      if (place_of_[node] != kNone || body_.free_components(node) == 0) continue;
      place_of_[node] = 0;
      nodes.push_back(node);
    }
  }
  std::vector<std::uint32_t> grouped;
  for (const auto& group : neighbouring_groups(mesh.nodes, nodes, Compliance::kGroupSize))
    grouped.insert(grouped.end(), group.begin(), group.end());
  surface_rest_m_.resize(at(grouped.size()));
  for (std::uint32_t place = 0; place < grouped.size(); ++place) {
    const std::uint32_t node = grouped[place];
    place_of_[node] = place;
    area_m2_.push_back(area_m2[node]);
    free_.push_back(body_.free_components(node) == 3 ? 1 : 0);
    surface_rest_m_.segment<3>(at(place)) = rest_m_.segment<3>(at(node));
  }
  compliance_ = std::make_unique<Compliance>(body_, std::move(grouped), options);
  if (!compliance_->complete()) return;
  for (const std::uint32_t node : surface()) {
    auto group = compliance_->group_of(node);
    const Eigen::Index first = Compliance::first_column(*group, node);
    columns_.emplace_back(std::move(group), first);
  }
}

std::uint32_t ContactBody::place_of(std::uint32_t node) const {
  if (node >= place_of_.size() || place_of_[node] == kNone) {
    throw Error("node " + std::to_string(node) +
                " cannot be touched: it is not on the surface, or nothing can move it");
  }
  return place_of_[node];
}

std::shared_ptr<const ContactNeighbourhood> ContactBody::neighbourhood(
    std::span<const std::uint32_t> places) const {
  auto made = std::make_shared<ContactNeighbourhood>();
  made->size_m = size_m_;
  made->rest_m.resize(at(places.size()));
  made->compliance.resize(at(places.size()), at(places.size()));
  for (std::size_t i = 0; i < places.size(); ++i) {
    const std::uint32_t place = places[i];
    made->nodes.push_back(surface()[place]);
    made->area_m2.push_back(area_m2_[place]);
    made->free.push_back(free_[place]);
    made->rest_m.segment<3>(at(i)) = surface_rest_m_.segment<3>(at(place));
  }
  const auto groups = compliance_->groups_of(made->nodes);
  for (std::size_t j = 0; j < places.size(); ++j) {
    const auto columns =
        groups[j]->columns.middleCols<3>(Compliance::first_column(*groups[j], made->nodes[j]));
    // Only what is below the diagonal is taken, and mirrored, so that the matrix is symmetric to the bit.
    for (std::size_t i = j; i < places.size(); ++i) {
      Eigen::Matrix3d block = columns.middleRows<3>(at(compliance_->row_of(made->nodes[i])));
      if (i == j) block = (block + block.transpose().eval()) / 2;
      made->compliance.block<3, 3>(at(i), at(j)) = block;
      made->compliance.block<3, 3>(at(j), at(i)) = block.transpose();
    }
  }
  return made;
}

std::shared_ptr<const ContactNeighbourhood> ContactBody::whole_surface() const {
  std::vector<std::uint32_t> places(surface().size());
  for (std::uint32_t place = 0; place < places.size(); ++place) places[place] = place;
  return neighbourhood(places);
}

void ContactBody::displacement_m(std::span<const Contact> contacts, Eigen::VectorXd& displacement_m) const {
  if (!compliance_->complete()) {
    Eigen::VectorXd force_n = load_n_;
    for (const Contact& contact : contacts) force_n.segment<3>(at(contact.node)) += contact.force_n;
    displacement_m = body_.solve(force_n).displacement_m;
    return;
  }
  displacement_m = unloaded_m_;
  for (const Contact& contact : contacts) {
    const auto& [group, first] = columns_[place_of(contact.node)];
    displacement_m += group->columns.middleCols<3>(first).lazyProduct(contact.force_n);
  }
}

}  // namespace kiroku::sim
