// Nodes that tools hold: their displacements are prescribed without touching K. The forces that hold them are
// the unknowns, in the condensed compliance (after Hirota and Kaneko, see fem/compliance.h):
//
//   u = u_0 + C_:b f_b + C_:c f_c,  u_b prescribed  =>  f_b = C_bb^-1 (u_b - u_0b - C_bc f_c)
//
// u_0 is the body under its load alone, b what is bound, c contacts. What contacts see is the body with b
// held: the compliance C_cc - C_cb C_bb^-1 C_bc. C_bb has rows for components that are not prescribed, and is
// positive definite; its factor grows with a grasp and shrinks with a release (growing_cholesky.h).
//
// A tool moves what it holds as a rigid body, so that u_b is affine in the twelve numbers of the motion, its
// rotation matrix and translation. How these displace the whole body, and what they ask of the forces, is
// computed at the grasp: a step costs twelve columns a tool, however many nodes it holds.
//
// A hold may float: no hand moves it, as a clip that its applier has left. Its nodes then follow a small
// rigid motion M m that is an unknown, too, and what holds them is in balance, M^T f_b = 0. With d what f_b
// has to bring about, f_b = C_bb^-1 (d + M m), so that
//
//   f_b = H d,  H = C_bb^-1 - C_bb^-1 M (M^T C_bb^-1 M)^-1 M^T C_bb^-1
//
// H stands in for C_bb^-1 in all of the above.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Cholesky>

#include "sim/contact/contact_body.h"
#include "sim/manipulation/growing_cholesky.h"
#include "sim/manipulation/tool_checks.h"

namespace kiroku::sim {

/// A node that a tool holds.
struct BoundNode {
  std::uint32_t node = 0;  // of the mesh
  std::uint32_t tool = 0;
  Vector3 force_n = Vector3::Zero();  // on the tissue
};

/// Rows are those of the body's Compliance: of all nodes where it is complete(), of the surface if not. Not
/// thread-safe while it is changed; copies are independent. The body must outlive it.
class BoundNodes {
 public:
  explicit BoundNodes(const ContactBody& body);

  /// What one tool holds.
  struct Hold {
    std::uint32_t tool = 0;
    Pose pose;                             // at the grasp; the quaternion's length is 1
    std::vector<std::uint32_t> nodes;      // of the mesh
    std::vector<Vector3> displacements_m;  // of these, at the grasp
    bool floats = false;                   // its nodes must span_a_plane()
  };

  /// A tool that holds nothing yet, and nodes of ContactBody::surface() that are not bound. kiroku::Error if
  /// the compliance of all that is bound cannot be factorised; then nothing is sound any more.
  void bind(Hold hold);
  /// Of a tool that holds something.
  void release(std::uint32_t tool);

  [[nodiscard]] bool bound(std::uint32_t node) const { return bound_[node] != 0; }
  [[nodiscard]] std::size_t held_by(std::uint32_t tool) const;
  /// Of a tool that holds something or nothing: whether its hold floats.
  [[nodiscard]] bool floats(std::uint32_t tool) const;
  /// Where a hold that floats is while the body lies so; (3 |rows|).
  [[nodiscard]] Pose floating_pose(std::uint32_t tool, const Eigen::VectorXd& displacement_m) const;
  /// Whether the places are not all on one line, to a thousandth of their extent: how they lie tells how they
  /// are turned.
  [[nodiscard]] static bool span_a_plane(std::span<const Vector3> places_m);
  /// In the order of the grasps.
  [[nodiscard]] std::vector<Hold> holds() const;

  /// Of all rows, (3 |rows|), while the tools are at these poses, one a tool and at least for those that hold
  /// something, and nothing presses.
  void displacement_m(std::span<const OptionalPose> poses, Eigen::VectorXd& displacement_m) const;
  /// Adds what contacts of nodes that are not bound do to them beside that. The compliance of the held
  /// body at a node is computed when it is pressed first, and known as long as it is pressed in every call.
  void add_contacts(std::span<const Contact> contacts, Eigen::VectorXd& displacement_m);
  /// What holds the nodes meanwhile; by tool and node.
  [[nodiscard]] std::vector<BoundNode> forces(std::span<const OptionalPose> poses,
                                              std::span<const Contact> contacts) const;

  /// Nodes of the surface, by their place there, ascending, none of them bound: their compliance while what
  /// is bound is held. Its rest_m is that of the body while nothing is held.
  [[nodiscard]] std::shared_ptr<ContactNeighbourhood> neighbourhood(
      std::span<const std::uint32_t> places) const;

 private:
  /// The numbers of a motion: its rotation matrix less the identity by columns, its translation.
  static constexpr Eigen::Index kMotion = 12;
  using Motion = Eigen::Matrix<double, kMotion, 1>;

  /// A bound node and its columns in the compliance.
  struct Node {
    std::uint32_t node = 0, tool = 0;
    std::size_t row = 0;
    std::shared_ptr<const ComplianceGroup> group;
    Eigen::Index first_column = 0;

    [[nodiscard]] auto columns() const { return group->columns.middleCols<3>(first_column); }
  };
  /// A hold and what its motion does.
  struct Held {
    Hold hold;
    std::size_t first = 0;           // of nodes_
    Eigen::MatrixXd force_n;         // (3 |bound| x kMotion), on all that is bound
    Eigen::MatrixXd displacement_m;  // (3 |rows| x kMotion)
  };

  void learn_columns(std::span<const Contact> contacts);
  void append_rows(std::size_t first);
  void prepare();
  void prepare_floating();
  /// How the nodes of a hold move with a small motion of it, translation and rotation vector; (3 |nodes| x
  /// 6).
  [[nodiscard]] Eigen::MatrixXd rigid_motions(const Hold& hold) const;
  /// What holds the bound nodes at `displacement_m` less what is there without, where no hold floats.
  [[nodiscard]] Eigen::MatrixXd fixing_n(const Eigen::MatrixXd& displacement_m) const;
  /// The same with those that float in balance: H; (3 |bound| x m) both.
  [[nodiscard]] Eigen::MatrixXd holding_n(const Eigen::MatrixXd& displacement_m) const;
  /// Adds what forces on bound nodes do, (3 |bound| x m), to (3 |rows| x m).
  void add_displacements(const Eigen::MatrixXd& force_n, Eigen::MatrixXd& displacement_m) const;
  /// How forces at a node would displace the bound nodes, (3 |bound| x 3): C_bc.
  [[nodiscard]] Eigen::MatrixXd pushed_m(std::uint32_t node) const;
  [[nodiscard]] static Motion motion(const Hold& hold, std::span<const OptionalPose> poses);

  const ContactBody* body_;
  std::vector<std::uint8_t> bound_;  // (|V|)
  std::vector<Held> held_;
  std::vector<Node> nodes_;         // (|bound|), by hold
  std::vector<Eigen::Index> free_;  // which of the 3 |bound| components are not prescribed: rows of C_bb
  GrowingCholesky compliance_;      // C_bb
  Eigen::MatrixXd rigid_;           // (3 |bound| x 6 |floating|), M; no column where nothing floats
  Eigen::MatrixXd rigid_n_;         // C_bb^-1 M
  Eigen::LLT<Eigen::MatrixXd> floating_;              // of M^T C_bb^-1 M
  Eigen::VectorXd unheld_m_;                          // (3 |rows|), u_0
  Eigen::VectorXd grasped_m_;                         // (3 |rows|), with all tools where they grasped
  Eigen::VectorXd grasped_n_;                         // (3 |bound|), what holds it there
  std::map<std::uint32_t, Eigen::MatrixXd> pressed_;  // (3 |rows| x 3), of nodes: C_:c - C_:b C_bb^-1 C_bc
};

}  // namespace kiroku::sim
