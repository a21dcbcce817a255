#include "sim/contact/contact_body.h"

#include <utility>

#include "base/error.h"
#include "sim/mesh/degrees_of_freedom.h"

namespace kiroku::sim {
ContactBody::ContactBody(const ElasticBody& body, const Eigen::VectorXd& load_n,
                         const ComplianceOptions& options)
    : body_(body), touchable_(body) {
  const TetMesh& mesh = body_.mesh();
  load_n_ = load_n.size() > 0 ? load_n : Eigen::VectorXd::Zero(first_row(mesh.nodes.size()));
  if (load_n_.size() != first_row(mesh.nodes.size())) {
    throw UsageError("the load has " + std::to_string(load_n_.size()) + " components, the body " +
                     std::to_string(3 * mesh.nodes.size()));
  }
  unloaded_m_ = body_.solve(load_n_).displacement_m;
  rest_m_ = unloaded_m_;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    rest_m_.segment<3>(first_row(node)) += mesh.nodes[node];

  surface_rest_m_.resize(first_row(surface().size()));
  for (std::size_t place = 0; place < surface().size(); ++place)
    surface_rest_m_.segment<3>(first_row(place)) = rest_m_.segment<3>(first_row(surface()[place]));
  compliance_ = std::make_unique<Compliance>(body_, surface(), options);
  if (!compliance_->complete()) return;
  for (const std::uint32_t node : surface()) {
    auto group = compliance_->group_of(node);
    const Eigen::Index first = Compliance::first_column(*group, node);
    columns_.emplace_back(std::move(group), first);
  }
}

std::uint32_t ContactBody::place_of(std::uint32_t node) const {
  if (node >= touchable_.place_of.size() || touchable_.place_of[node] == TouchableSurface::kNowhere) {
    throw Error("node " + std::to_string(node) +
                " cannot be touched: it is not on the surface, or nothing can move it");
  }
  return touchable_.place_of[node];
}

std::shared_ptr<const ContactNeighbourhood> ContactBody::neighbourhood(
    std::span<const std::uint32_t> places) const {
  auto made = std::make_shared<ContactNeighbourhood>();
  made->size_m = touchable_.size_m;
  made->rest_m.resize(first_row(places.size()));
  made->compliance.resize(first_row(places.size()), first_row(places.size()));
  for (std::size_t i = 0; i < places.size(); ++i) {
    const std::uint32_t place = places[i];
    made->nodes.push_back(surface()[place]);
    made->area_m2.push_back(touchable_.area_m2[place]);
    made->free.push_back(touchable_.free[place]);
    made->rest_m.segment<3>(first_row(i)) = surface_rest_m_.segment<3>(first_row(place));
  }
  const auto groups = compliance_->groups_of(made->nodes);
  for (std::size_t j = 0; j < places.size(); ++j) {
    const auto columns =
        groups[j]->columns.middleCols<3>(Compliance::first_column(*groups[j], made->nodes[j]));
    // Only what is below the diagonal is taken, and mirrored, so that the matrix is symmetric to the bit.
    for (std::size_t i = j; i < places.size(); ++i) {
      Eigen::Matrix3d block = columns.middleRows<3>(first_row(compliance_->row_of(made->nodes[i])));
      if (i == j) block = (block + block.transpose().eval()) / 2;
      made->compliance.block<3, 3>(first_row(i), first_row(j)) = block;
      made->compliance.block<3, 3>(first_row(j), first_row(i)) = block.transpose();
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
    for (const Contact& contact : contacts) force_n.segment<3>(first_row(contact.node)) += contact.force_n;
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
