// Grasping, holding, retracting, pressing and releasing a body that may turn as far as it likes: what is
// retracted keeps its volume, where linear elements would swell (fem/corotational_body.h).
//
// A step seeks the least energy with what tools hold prescribed and with no node inside a tool that presses.
// Newton's method: about where the body lies its tangent is factorised; its compliance where tools are near
// (columns of K^-1) makes one contact problem of them (contact/contact_solver.h), whose answer is the
// next place to look from. There forces and contacts belong to the same state, so that only the forces out of
// balance are left to judge. The motion of a step is halved where this does not converge.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sim/contact/contact_solver.h"
#include "sim/contact/touchable_surface.h"
#include "sim/fem/corotational_body.h"
#include "sim/manipulation/manipulation.h"

namespace kiroku::sim {

/// As Manipulation, of which it has the functions and their errors; what is different is said here. Copies go
/// on from the same state by themselves, to the same bits. Not thread-safe. Same calls, same bits, whatever
/// the number of threads. The body must outlive it.
class CorotationalManipulation {
 public:
  /// The body as it lies under its load (3 |V|), N, which keeps its direction.
  CorotationalManipulation(const CorotationalBody& body, const Eigen::VectorXd& load_n,
                           std::vector<Tool> tools, const ContactOptions& options = {});

  /// Goes on where `previous` is, with a body of the same nodes that a cut has left of its body: what is held
  /// stays held, and what the lost elements bore is taken back bit by bit. kiroku::UsageError for another
  /// number of nodes; kiroku::Error where no equilibrium is found.
  CorotationalManipulation(const CorotationalBody& body, const Eigen::VectorXd& load_n,
                           const CorotationalManipulation& previous);

  std::size_t grasp(std::size_t tool, const Pose& pose);
  void release(std::size_t tool);
  [[nodiscard]] std::size_t held_by(std::size_t tool) const;

  /// kiroku::Error also where no equilibrium is found, with the part of the motion that was reached; then
  /// everything is as before.
  const ManipulationResult& step(std::span<const OptionalPose> poses);

  [[nodiscard]] const ManipulationResult& result() const { return result_; }
  [[nodiscard]] const std::vector<Tool>& tools() const { return tools_; }
  [[nodiscard]] const TouchableSurface& surface() const { return surface_; }
  /// As of the last step; (3 |V|).
  [[nodiscard]] const Eigen::VectorXd& displacement_m() const { return state_.displacement_m; }
  [[nodiscard]] Eigen::VectorXd tool_force_n() const;
  /// Of the last step.
  [[nodiscard]] int factorisations() const { return factorisations_; }

 private:
  struct Hold {
    std::uint32_t tool = 0;
    Pose pose;                         // at the grasp
    std::vector<std::uint32_t> nodes;  // of the mesh
    std::vector<Vector3> positions_m;  // of these, at the grasp
  };
  /// An equilibrium, or what is tried for one.
  struct State {
    std::vector<OptionalPose> poses;
    Eigen::VectorXd displacement_m;               // (3 |V|)
    Eigen::VectorXd contact_n;                    // (3 |V|)
    std::shared_ptr<const ContactSolver> solver;  // none where no tool that presses is there
    std::vector<std::uint32_t> pressing;          // which of the tools the solver's are
  };
  /// Tools that press, where they are, and which of the last solver's each is.
  struct Solids {
    std::vector<std::uint32_t> tools, before;
    std::vector<ContactTool> shapes;
    std::vector<Pose> poses;
  };
  struct Tangent {
    StiffnessMatrix stiffness;
    Factorisation factor;
    Tangent(StiffnessMatrix matrix, const std::vector<bool>& free, std::span<const std::uint32_t> order)
        : stiffness(std::move(matrix)), factor(stiffness, free, order) {}
  };

  [[nodiscard]] Eigen::VectorXd carried_over_m(const CorotationalManipulation& previous) const;
  [[nodiscard]] std::vector<OptionalPose> poses_between(std::span<const OptionalPose> to, double part) const;
  [[nodiscard]] std::vector<bool> free_now() const;
  [[nodiscard]] Eigen::VectorXd fading_n(std::span<const OptionalPose> poses) const;
  [[nodiscard]] Eigen::VectorXd pulled_m(const State& from, std::span<const OptionalPose> poses) const;
  [[nodiscard]] bool converge(std::span<const OptionalPose> poses, const Eigen::VectorXd& force_n,
                              const std::vector<bool>& free, State& state);
  [[nodiscard]] std::unique_ptr<Tangent> tangent(const Eigen::VectorXd& displacement_m,
                                                 const std::vector<bool>& free, Curvature curvature);
  [[nodiscard]] Solids solids(std::span<const OptionalPose> poses, const State& state) const;
  void press(const Tangent& tangent, const Solids& solids, State& state, Eigen::VectorXd& step_m) const;
  [[nodiscard]] std::shared_ptr<ContactNeighbourhood> neighbourhood(const std::vector<std::uint32_t>& places,
                                                                    const Eigen::MatrixXd& columns,
                                                                    const Eigen::VectorXd& rest_m) const;
  [[nodiscard]] Eigen::VectorXd surface_m(const Eigen::VectorXd& displacement_m) const;
  [[nodiscard]] ManipulationResult report(const State& state) const;
  [[nodiscard]] Vector3 position_m(std::uint32_t node, const Eigen::VectorXd& displacement_m) const;

  const CorotationalBody& body_;
  Eigen::VectorXd load_n_;
  std::vector<Tool> tools_;
  ContactOptions options_;
  TouchableSurface surface_;
  std::vector<Hold> holds_;               // in the order of the grasps
  std::vector<std::uint32_t> holder_of_;  // (|V|), kNobody for most
  State state_;
  Eigen::VectorXd severed_n_;  // (3 |V|), what a cut has just taken away; empty for nothing
  ManipulationResult result_;
  int factorisations_ = 0;
};

}  // namespace kiroku::sim
