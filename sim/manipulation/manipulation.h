// Grasping, holding, retracting, pressing and releasing a body with several tools at once, step by step.
//
// Source: "Interactive Volume Manipulation for Supporting Preoperative Planning": vertices that are grasped
// get the displacement of the tool prescribed. Prescribing it in K would ask for a new factorisation at every
// grasp and release. Here the forces that hold the nodes are the unknowns, in the condensed compliance
// (bound_nodes.h), so that the factor of K stays as it is; the answer is that of a body with these nodes
// prescribed. Tools that press find their contacts on the body as it is held (contact/contact_solver.h).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sim/contact/contact_body.h"
#include "sim/contact/contact_solver.h"
#include "sim/manipulation/bound_nodes.h"
#include "sim/manipulation/tool_checks.h"

namespace kiroku::sim {

struct ManipulationResult {
  /// What each tool feels, in the order of the tools; zero for those that are not there and those that
  /// neither hold nor press anything. `nodes` counts those it holds or presses. normal_n and tangential_n are
  /// of tools that press; what binds has no normal, and zero there.
  std::vector<ToolForce> tools;
  Vector3 wrist_force_n = Vector3::Zero();  // the sum over all tools
  std::vector<BoundNode> bound;             // what is held, by tool and node
  std::vector<Contact> contacts;            // what is pressed, by tool and node
  /// As in ContactResult; true, and zero for the others, where no tool that presses is there.
  bool converged = true;
  int iterations = 0;
  double deepest_penetration_m = 0;  // of a node of the surface that is not bound into a tool that presses
  double largest_gap_m = 0;
};

/// Not thread-safe. The ContactBody, and its ElasticBody, must outlive it; their stiffness, load and
/// prescribed displacements stay. Same calls, same bits, whatever the number of threads. All of a result is
/// finite. A function that throws leaves everything as it was.
///
/// A tool is named by its number in the tools given to the constructor; another number is a
/// kiroku::UsageError.
///
/// A node has one holder at most: what one tool holds no other can grasp, and no tool touches it: solids pass
/// through bound nodes. Nodes with one or two prescribed components follow their tool in the others; nodes
/// with three cannot be grasped, nor touched.
class Manipulation {
 public:
  /// The body as it lies under its load, no tool there, nothing held. kiroku::UsageError for tools without
  /// extent or name, for two of one name, and for options without sense; kiroku::Error for a body whose nodes
  /// have axes of their own.
  Manipulation(const ContactBody& body, std::vector<Tool> tools, const ContactOptions& options = {});

  /// Goes on where `previous` is, on a body whose nodes have the same numbers but which may have another
  /// shape and compliance (it was cut, say): what is held stays held with the displacements it has, and tools
  /// that stick keep what they have; a step with the last poses is made. Nodes that can no longer be bound
  /// there are let go. kiroku::UsageError for another number of nodes, and what step() throws.
  Manipulation(const ContactBody& body, const Manipulation& previous);

  /// Goes on from the same state on the same body by itself, to the same bits.
  Manipulation(const Manipulation& other);
  Manipulation& operator=(const Manipulation&) = delete;

  /// Closes a tool that kBinds, which is at `pose`: nodes of the surface that are in its shape now, as of the
  /// last step, are bound to it, and from the next step on follow it as if they were part of it:
  /// position = pose * pose_at_grasp^-1 * position_at_grasp. Nothing moves by the grasp itself. How many were
  /// bound, at least one. kiroku::Error if nothing can be grasped there, saying how far the surface is or who
  /// holds it, for a pose that is none, and for a tool that already holds something; kiroku::UsageError for a
  /// tool that does not bind.
  std::size_t grasp(std::size_t tool, const Pose& pose);

  /// Opens the tool; in the next step its nodes go where the forces on the body take them. kiroku::Error for
  /// a tool that holds nothing.
  void release(std::size_t tool);

  /// Leaves a clip: what these two tools that stick, its jaws, press between them as of the last step is held
  /// together as one rigid body that floats; not what lies at their backs. No hand moves it: forces and
  /// torques on it balance, with the arms that these have as it is left. The tools are away from then on, and
  /// what is held is the first one's, until released. How many nodes are held. kiroku::Error if one of the
  /// tools presses nothing there, or all nodes are on one line; kiroku::UsageError for tools that do not
  /// stick.
  std::size_t leave(std::size_t jaw, std::size_t other_jaw);
  /// Where a clip that was left is, as of the last step: how its nodes moved since, small rotations as of
  /// linear elements, added to the middle between its jaws as they were. kiroku::UsageError for another tool.
  [[nodiscard]] Pose floating_pose(std::size_t tool) const;

  /// How many nodes the tool holds.
  [[nodiscard]] std::size_t held_by(std::size_t tool) const;

  /// Moves all tools there at once, one optional pose a tool, and finds the balance. Valid until the next
  /// call. kiroku::UsageError for another number of poses, and for the pose of a clip that was left;
  /// kiroku::Error for poses that are none, for a tool
  /// that holds something and has no pose, for solids that leave a node no place because they overlap, for
  /// what is not finite, and what Compliance throws.
  const ManipulationResult& step(std::span<const OptionalPose> poses);

  /// As of the last step.
  [[nodiscard]] const ManipulationResult& result() const { return result_; }
  [[nodiscard]] const std::vector<Tool>& tools() const { return tools_; }

  /// Of all nodes, as of the last step; (3 |V|), m. A copy where the compliance is complete(), a solve if
  /// not; from it follow strain and stress (ElasticBody::stress_pa()).
  [[nodiscard]] Eigen::VectorXd displacement_m() const;
  /// What all tools do to the nodes, as of the last step; (3 |V|), N. Added to the body's load,
  /// ElasticBody::solve() answers with the same displacements and with the reactions of what is prescribed.
  [[nodiscard]] Eigen::VectorXd tool_force_n() const;

 private:
  /// Contacts of tools that press.
  struct Pressed {
    std::unique_ptr<ContactSolver> solver;
    std::vector<std::uint32_t> tools;  // which of the tools the solver's are
    Eigen::VectorXd displacement_m;    // (3 |rows|)
  };

  [[nodiscard]] std::vector<OptionalPose> checked(std::span<const OptionalPose> poses) const;
  [[noreturn]] void refuse_grasp(const Tool& tool, const Pose& pose) const;
  [[nodiscard]] std::vector<Vector3> places_of(const BoundNodes::Hold& hold) const;
  Pressed press(std::span<const OptionalPose> poses, Eigen::VectorXd untouched_m);
  void look_at_surface(const Eigen::VectorXd& displacement_m);
  [[nodiscard]] std::vector<std::uint32_t> places_near() const;
  [[nodiscard]] ManipulationResult report(std::span<const OptionalPose> poses, const Pressed& pressed) const;
  [[nodiscard]] Eigen::Index row_of(std::uint32_t node) const;
  [[nodiscard]] Vector3 position_m(std::uint32_t node, const Eigen::VectorXd& displacement_m) const;

  const ContactBody& body_;
  std::vector<Tool> tools_;
  ContactOptions options_;
  double size_m_;  // of the body, as in ContactNeighbourhood
  BoundNodes bound_;
  bool bound_changed_ = false;       // since the last step
  std::vector<OptionalPose> poses_;  // of the last step or grasp
  Pressed pressed_;                  // as of the last step; no solver where no tool that presses was there
  ManipulationResult result_;

  // Of one step only, kept for their memory.
  std::vector<std::uint8_t> near_;  // (|surface|), what tools that press may meet
  Eigen::VectorXd surface_m_;       // (3 |surface|)
  PointTree tree_;
};

}  // namespace kiroku::sim
