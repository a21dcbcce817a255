// The organ of a plan under the hands of its tools: of linear elements, or of such that turn.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sim/manipulation/manipulation.h"
#include "sim/plan/plan.h"

namespace kiroku::sim {

/// Not thread-safe. Same calls, same bits, whatever the number of threads. Tools are those given to
/// plan_body(), by their number there.
class PlanBody {
 public:
  PlanBody() = default;
  virtual ~PlanBody() = default;
  PlanBody& operator=(const PlanBody&) = delete;

  /// Goes on from the same moment by itself, to the same bits.
  [[nodiscard]] virtual std::unique_ptr<PlanBody> copy() const = 0;

  /// As Manipulation has them.
  virtual void grasp(std::size_t tool, const Pose& pose) = 0;
  virtual void release(std::size_t tool) = 0;
  /// The clip whose jaws are this tool and the next; of linear bodies alone.
  virtual void leave(std::size_t first_jaw) = 0;
  [[nodiscard]] virtual Pose floating_pose(std::size_t first_jaw) const = 0;
  virtual const ManipulationResult& step(std::span<const OptionalPose> poses) = 0;
  [[nodiscard]] virtual const ManipulationResult& result() const = 0;
  [[nodiscard]] virtual Eigen::VectorXd displacement_m() const = 0;
  [[nodiscard]] virtual Eigen::VectorXd tool_force_n() const = 0;

  /// Constant in each tetrahedron that bears, in their order.
  [[nodiscard]] virtual std::vector<SymmetricTensor> stress_pa(
      const Eigen::VectorXd& displacement_m) const = 0;
  /// The nodes that tools can touch.
  [[nodiscard]] virtual std::span<const std::uint32_t> surface() const = 0;

  /// What a cut left of it, of which `bearing` are the tetrahedra that bear, under the same hands.
  /// kiroku::Error where it cannot be cut.
  [[nodiscard]] virtual std::unique_ptr<PlanBody> after_cut(TetMesh bearing) const = 0;

 protected:
  PlanBody(const PlanBody&) = default;
};

/// The plan's organ as it lies under its weight. The plan must outlive it. kiroku::Error for a body that
/// cannot be solved for, as ElasticBody throws it.
std::unique_ptr<PlanBody> plan_body(const Plan& plan, std::vector<Tool> tools);
}  // namespace kiroku::sim
