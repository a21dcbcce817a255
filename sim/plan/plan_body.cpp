#include "sim/plan/plan_body.h"

#include <type_traits>
#include <utility>

#include "base/error.h"
#include "sim/manipulation/corotational_manipulation.h"

namespace kiroku::sim {
namespace {

/// A body under its hands: `Body` is what copies share, `Hands` manipulates it.
template <typename Body, typename Hands>
class HandledBody : public PlanBody {
 public:
  void grasp(std::size_t tool, const Pose& pose) override { hands_.grasp(tool, pose); }
  void release(std::size_t tool) override { hands_.release(tool); }
  void leave(std::size_t first_jaw) override {
    if constexpr (kFloats) {
      hands_.leave(first_jaw, first_jaw + 1);
    } else {
      throw UsageError("a body of elements that turn holds no clip that was left");
    }
  }
  [[nodiscard]] Pose floating_pose(std::size_t first_jaw) const override {
    if constexpr (kFloats) {
      return hands_.floating_pose(first_jaw);
    } else {
      throw UsageError("a body of elements that turn holds no clip that was left");
    }
  }
  const ManipulationResult& step(std::span<const OptionalPose> poses) override { return hands_.step(poses); }
  [[nodiscard]] const ManipulationResult& result() const override { return hands_.result(); }
  [[nodiscard]] Eigen::VectorXd displacement_m() const override { return hands_.displacement_m(); }
  [[nodiscard]] Eigen::VectorXd tool_force_n() const override { return hands_.tool_force_n(); }

 protected:
  /// `make` gives the hands on the body.
  template <typename Make>
  HandledBody(std::shared_ptr<const Body> body, Make make) : body_(std::move(body)), hands_(make(*body_)) {}
  HandledBody(const HandledBody& other) = default;
  [[nodiscard]] const Body& body() const { return *body_; }
  [[nodiscard]] const Hands& hands() const { return hands_; }

 private:
  static constexpr bool kFloats = std::is_same_v<Hands, Manipulation>;
  std::shared_ptr<const Body> body_;
  Hands hands_;  // on body_
};

/// Everything that follows from which tetrahedra are there.
struct LinearParts {
  LinearParts(TetMesh mesh, const Plan& plan)
      : elastic(std::move(mesh), plan.body.materials, plan.body.constraints),
        contact(elastic, elastic.weight_n(plan.body.gravity_m_s2)) {}
  ElasticBody elastic;
  ContactBody contact;
};

class LinearBody : public HandledBody<LinearParts, Manipulation> {
 public:
  LinearBody(const Plan& plan, std::vector<Tool> tools)
      : HandledBody(std::make_shared<const LinearParts>(plan.body.mesh, plan),
                    [&](const LinearParts& parts) { return Manipulation(parts.contact, std::move(tools)); }),
        plan_(plan) {}
  /// Goes on where `previous` is.
  LinearBody(const Plan& plan, TetMesh bearing, const Manipulation& previous)
      : HandledBody(std::make_shared<const LinearParts>(std::move(bearing), plan),
                    [&](const LinearParts& parts) { return Manipulation(parts.contact, previous); }),
        plan_(plan) {}

  [[nodiscard]] std::unique_ptr<PlanBody> copy() const override {
    return std::make_unique<LinearBody>(*this);
  }
  [[nodiscard]] std::vector<SymmetricTensor> stress_pa(const Eigen::VectorXd& displacement_m) const override {
    return body().elastic.stress_pa(displacement_m);
  }
  [[nodiscard]] std::span<const std::uint32_t> surface() const override { return body().contact.surface(); }
  [[nodiscard]] std::unique_ptr<PlanBody> after_cut(TetMesh bearing) const override {
    return std::make_unique<LinearBody>(plan_, std::move(bearing), hands());
  }

 private:
  const Plan& plan_;
};

class TurningBody : public HandledBody<CorotationalBody, CorotationalManipulation> {
 public:
  TurningBody(const Plan& plan, std::vector<Tool> tools)
      : HandledBody(std::make_shared<const CorotationalBody>(plan.body.mesh, plan.body.materials,
                                                             plan.body.constraints),
                    [&](const CorotationalBody& body) {
                      return CorotationalManipulation(body, body.linear().weight_n(plan.body.gravity_m_s2),
                                                      std::move(tools));
                    }),
        plan_(plan) {}
  /// Goes on where `previous` is.
  TurningBody(const Plan& plan, TetMesh bearing, const CorotationalManipulation& previous)
      : HandledBody(std::make_shared<const CorotationalBody>(std::move(bearing), plan.body.materials,
                                                             plan.body.constraints),
                    [&](const CorotationalBody& body) {
                      return CorotationalManipulation(body, body.linear().weight_n(plan.body.gravity_m_s2),
                                                      previous);
                    }),
        plan_(plan) {}

  [[nodiscard]] std::unique_ptr<PlanBody> copy() const override {
    return std::make_unique<TurningBody>(*this);
  }
  [[nodiscard]] std::vector<SymmetricTensor> stress_pa(const Eigen::VectorXd& displacement_m) const override {
    return body().stress_pa(displacement_m);
  }
  [[nodiscard]] std::span<const std::uint32_t> surface() const override { return hands().surface().nodes; }
  [[nodiscard]] std::unique_ptr<PlanBody> after_cut(TetMesh bearing) const override {
    return std::make_unique<TurningBody>(plan_, std::move(bearing), hands());
  }

 private:
  const Plan& plan_;
};

}  // namespace

std::unique_ptr<PlanBody> plan_body(const Plan& plan, std::vector<Tool> tools) {
  if (plan.corotational) return std::make_unique<TurningBody>(plan, std::move(tools));
  return std::make_unique<LinearBody>(plan, std::move(tools));
}

}  // namespace kiroku::sim
