// Tools moved step by step against a body of any size, exactly: what plans are run with. Beside a force loop,
// which cannot wait for columns, see haptics/haptic_contact.h.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sim/contact/contact_body.h"

namespace kiroku::sim {

/// Not thread-safe. The body must outlive it. Same steps, same bits, whatever the number of threads.
class ContactSimulation {
 public:
  ContactSimulation(const ContactBody& body, std::vector<ContactTool> tools,
                    const ContactOptions& options = {});

  /// Valid until the next call. deepest_penetration_m is over the whole surface. What ContactSolver::step()
  /// and Compliance throw.
  const ContactResult& step(std::span<const Pose> poses);

  /// Of all nodes, as of the last step; (3 |V|).
  [[nodiscard]] Eigen::VectorXd displacement_m() const;

 private:
  const ContactBody& body_;
  ContactOptions options_;
  std::unique_ptr<ContactSolver> solver_;
  std::vector<std::uint8_t> near_;  // (|surface|), in the solver's neighbourhood
  Eigen::VectorXd positions_m_;     // (3 |surface|)
  PointTree tree_;
};

/// Which nodes of the surface, as they lie now, are within `margin_m` of a tool; marks them in `near`
/// (|surface|), whether any was not marked before.
bool mark_near(const PointTree& tree, const Eigen::VectorXd& positions_m, std::span<const ContactTool> tools,
               std::span<const Pose> poses, double margin_m, std::vector<std::uint8_t>& near);

}  // namespace kiroku::sim
