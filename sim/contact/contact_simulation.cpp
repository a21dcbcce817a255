#include "sim/contact/contact_simulation.h"

#include <algorithm>
#include <utility>

namespace kiroku::sim {
namespace {

/// How far around the tools columns are taken at once, in lengths of the body: too little and steps are
/// repeated, too much and columns are computed that nobody asks for.
constexpr double kMargin = 0.02;

std::vector<std::uint32_t> marked(const std::vector<std::uint8_t>& near) {
  std::vector<std::uint32_t> places;
  for (std::uint32_t place = 0; place < near.size(); ++place) {
    if (near[place] != 0) places.push_back(place);
  }
  return places;
}

}  // namespace

bool mark_near(const PointTree& tree, const Eigen::VectorXd& positions_m, std::span<const ContactTool> tools,
               std::span<const Pose> poses, double margin_m, std::vector<std::uint8_t>& near) {
  bool any = false;
  for (std::size_t tool = 0; tool < tools.size(); ++tool) {
    const ToolShape& shape = tools[tool].shape;
    tree.visit_near(poses[tool].position_m, bounding_radius_m(shape) + margin_m, [&](std::size_t place) {
      if (near[place] != 0) return;
      const Vector3 at_m = positions_m.segment<3>(static_cast<Eigen::Index>(3 * place));
      if (distance_to(shape, poses[tool].to_tool(at_m)).distance_m > margin_m) return;
      near[place] = 1;
      any = true;
    });
  }
  return any;
}

ContactSimulation::ContactSimulation(const ContactBody& body, std::vector<ContactTool> tools,
                                     const ContactOptions& options)
    : body_(body),
      options_(options),
      solver_(std::make_unique<ContactSolver>(body.neighbourhood({}), std::move(tools), options)),
      near_(body.surface().size()),
      tree_(body.surface().size()) {
  body_.surface_positions_m({}, positions_m_);
  tree_.refit(positions_m_);
}

const ContactResult& ContactSimulation::step(std::span<const Pose> poses) {
  solver_->check(poses);
  const ContactNeighbourhood& known = solver_->neighbourhood();
  const double margin_m = kMargin * known.size_m, tolerance_m = options_.tolerance * known.size_m;
  bool more = mark_near(tree_, positions_m_, solver_->tools(), poses, margin_m, near_);
  do {
    if (more) {
      // Afresh, so that what was left behind is forgotten; what presses stays.
      std::ranges::fill(near_, 0);
      mark_near(tree_, positions_m_, solver_->tools(), poses, margin_m, near_);
      for (const Contact& contact : solver_->result().contacts) near_[body_.place_of(contact.node)] = 1;
      auto wider =
          std::make_unique<ContactSolver>(body_.neighbourhood(marked(near_)), solver_->tools(), options_);
      wider->continue_from(*solver_);
      wider->step(poses);
      solver_ = std::move(wider);
    } else {
      solver_->step(poses);
    }
    body_.surface_positions_m(solver_->result().contacts, positions_m_);
    tree_.refit(positions_m_);
    more = mark_near(tree_, positions_m_, solver_->tools(), poses, -tolerance_m, near_);
  } while (more);
  return solver_->result();
}

Eigen::VectorXd ContactSimulation::displacement_m() const {
  Eigen::VectorXd displacement_m;
  body_.displacement_m(solver_->result().contacts, displacement_m);
  return displacement_m;
}

}  // namespace kiroku::sim
