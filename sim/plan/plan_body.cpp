#include "sim/plan/plan_body.h"

#include <utility>

#include "base/error.h"
#include "sim/manipulation/corotational_manipulation.h"

namespace kiroku::sim {
namespace {

class LinearBody : public PlanBody {
 public:
  LinearBody(const Plan& plan, std::vector<Tool> tools)
      : plan_(plan),
        parts_(std::make_shared<const Parts>(plan.body.mesh, plan)),
        manipulation_(parts_->contact, std::move(tools)) {}
  LinearBody(const LinearBody& other) = default;

  [[nodiscard]] std::unique_ptr<PlanBody> copy() const override {
    return std::make_unique<LinearBody>(*this);
  }
  void grasp(std::size_t tool, const Pose& pose) override { manipulation_.grasp(tool, pose); }
  void release(std::size_t tool) override { manipulation_.release(tool); }
  const ManipulationResult& step(std::span<const OptionalPose> poses) override {
    return manipulation_.step(poses);
  }
  [[nodiscard]] const ManipulationResult& result() const override { return manipulation_.result(); }
  [[nodiscard]] Eigen::VectorXd displacement_m() const override { return manipulation_.displacement_m(); }
  [[nodiscard]] Eigen::VectorXd tool_force_n() const override { return manipulation_.tool_force_n(); }
  [[nodiscard]] std::vector<SymmetricTensor> stress_pa(const Eigen::VectorXd& displacement_m) const override {
    return parts_->elastic.stress_pa(displacement_m);
  }
  [[nodiscard]] std::span<const std::uint32_t> surface() const override { return parts_->contact.surface(); }
  [[nodiscard]] std::unique_ptr<PlanBody> after_cut(TetMesh bearing) const override {
    return std::unique_ptr<PlanBody>(
        new LinearBody(plan_, std::make_shared<const Parts>(std::move(bearing), plan_), manipulation_));
  }

 private:
  /// Everything that follows from which tetrahedra are there; copies share it.
  struct Parts {
    Parts(TetMesh mesh, const Plan& plan)
        : elastic(std::move(mesh), plan.body.materials, plan.body.constraints),
          contact(elastic, elastic.weight_n(plan.body.gravity_m_s2)) {}
    ElasticBody elastic;
    ContactBody contact;
  };

  LinearBody(const Plan& plan, std::shared_ptr<const Parts> parts, const Manipulation& previous)
      : plan_(plan), parts_(std::move(parts)), manipulation_(parts_->contact, previous) {}

  const Plan& plan_;
  std::shared_ptr<const Parts> parts_;
  Manipulation manipulation_;  // on parts_
};

class TurningBody : public PlanBody {
 public:
  TurningBody(const Plan& plan, std::vector<Tool> tools)
      : body_(std::make_shared<const CorotationalBody>(plan.body.mesh, plan.body.materials,
                                                       plan.body.constraints)),
        manipulation_(*body_, body_->linear().weight_n(plan.body.gravity_m_s2), std::move(tools)) {}
  TurningBody(const TurningBody& other) = default;

  [[nodiscard]] std::unique_ptr<PlanBody> copy() const override {
    return std::make_unique<TurningBody>(*this);
  }
  void grasp(std::size_t tool, const Pose& pose) override { manipulation_.grasp(tool, pose); }
  void release(std::size_t tool) override { manipulation_.release(tool); }
  const ManipulationResult& step(std::span<const OptionalPose> poses) override {
    return manipulation_.step(poses);
  }
  [[nodiscard]] const ManipulationResult& result() const override { return manipulation_.result(); }
  [[nodiscard]] Eigen::VectorXd displacement_m() const override { return manipulation_.displacement_m(); }
  [[nodiscard]] Eigen::VectorXd tool_force_n() const override { return manipulation_.tool_force_n(); }
  [[nodiscard]] std::vector<SymmetricTensor> stress_pa(const Eigen::VectorXd& displacement_m) const override {
    return body_->stress_pa(displacement_m);
  }
  [[nodiscard]] std::span<const std::uint32_t> surface() const override {
    return manipulation_.surface().nodes;
  }
  [[nodiscard]] std::unique_ptr<PlanBody> after_cut(TetMesh) const override {
    throw Error(kTurningBodyIsNotCut);
  }

 private:
  std::shared_ptr<const CorotationalBody> body_;
  CorotationalManipulation manipulation_;  // on body_
};

}  // namespace

std::unique_ptr<PlanBody> plan_body(const Plan& plan, std::vector<Tool> tools) {
  if (plan.corotational) return std::make_unique<TurningBody>(plan, std::move(tools));
  return std::make_unique<LinearBody>(plan, std::move(tools));
}

}  // namespace kiroku::sim
