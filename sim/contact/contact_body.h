// A held body as tools meet it: its surface, its compliance there, and how the whole body lies under the
// forces of contacts.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sim/contact/contact_solver.h"
#include "sim/contact/touchable_surface.h"
#include "sim/fem/compliance.h"

namespace kiroku::sim {

/// Thread-safe but for displacement_m(), which one thread at a time may call where the compliance is not
/// complete(). The body must outlive it, and be solved by no other thread during that call.
class ContactBody {
 public:
  /// `load_n` (3 |V|), N: what acts besides contact, such as weight; may be empty for none. What
  /// Compliance and ElasticBody::solve() throw.
  ContactBody(const ElasticBody& body, const Eigen::VectorXd& load_n = {},
              const ComplianceOptions& options = {});

  [[nodiscard]] const ElasticBody& body() const { return body_; }
  /// Of the nodes of the surface that may be touched, in groups that lie beside each other.
  [[nodiscard]] Compliance& compliance() const { return *compliance_; }
  [[nodiscard]] const std::vector<std::uint32_t>& surface() const { return touchable_.nodes; }
  /// Where a node stands in surface(); kiroku::Error for a node that may not be touched.
  [[nodiscard]] std::uint32_t place_of(std::uint32_t node) const;
  /// (3 |V|), m: where they are when no tool touches.
  [[nodiscard]] const Eigen::VectorXd& rest_m() const { return rest_m_; }

  /// Of surface nodes, by their number in surface(), ascending, so that they lie beside each other too.
  /// Columns that are missing are computed. To be made beside the force loop, not in it.
  [[nodiscard]] std::shared_ptr<const ContactNeighbourhood> neighbourhood(
      std::span<const std::uint32_t> places) const;
  [[nodiscard]] std::shared_ptr<const ContactNeighbourhood> whole_surface() const;

  /// Of all nodes under the load and the forces; (3 |V|), written into `displacement_m`. By columns where the
  /// compliance is complete(), then without allocation after the first time; by a solve if not.
  void displacement_m(std::span<const Contact> contacts, Eigen::VectorXd& displacement_m) const;

 private:
  const ElasticBody& body_;
  TouchableSurface touchable_;
  Eigen::VectorXd load_n_, unloaded_m_, rest_m_, surface_rest_m_;
  std::unique_ptr<Compliance> compliance_;
  /// The group of every node of the surface and its first column there, where the compliance is complete().
  std::vector<std::pair<std::shared_ptr<const ComplianceGroup>, Eigen::Index>> columns_;
};

}  // namespace kiroku::sim
