#include "trainer/hand/hand_shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace kiroku::trainer {

using sim::Pose;
using sim::Vector3;

namespace {

/// The distal capsule ends this far behind the fingertip's middle: what the fingertip touches it does not.
constexpr double kBehindTipMetres = 0.006;
constexpr double kPalmHalfMetres = 0.028, kPalmApartMetres = 0.022;

/// A capsule of that length (its axis) that begins at `from` and goes towards `to`; `otherwise` where both
/// are one.
Pose capsule_along(const Vector3& from_m, const Vector3& to_m, double length_m, const Vector3& otherwise) {
  const Vector3 way = to_m - from_m;
  const Vector3 along = way.norm() > 1e-9 ? Vector3(way.normalized()) : otherwise;
  return {from_m + length_m / 2 * along, Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), along)};
}

/// The part of `of` across `along`, of length 1; any such direction where there is none.
Vector3 across(const Vector3& of, const Vector3& along) {
  const Vector3 part = of - of.dot(along) * along;
  return part.norm() > 1e-6 ? Vector3(part.normalized()) : along.unitOrthogonal();
}

/// Where the joint between proximal and middle phalanx is.
Vector3 middle_joint_m(const Vector3& knuckle_m, const Vector3& distal_joint_m, const Vector3& bends) {
  constexpr double kFirst = HandShape::kProximalMetres, kSecond = HandShape::kMiddleMetres;
  const Vector3 way_m = distal_joint_m - knuckle_m;
  const double far_m = way_m.norm();
  const Vector3 along = far_m > 1e-9 ? Vector3(way_m / far_m) : bends.unitOrthogonal();
  const double reach_m = std::clamp(far_m, kFirst - kSecond, kFirst + kSecond);
  // Two sides of a triangle over the third.
  const double foot_m = (kFirst * kFirst - kSecond * kSecond + reach_m * reach_m) / (2 * reach_m);
  const double height_m = std::sqrt(std::max(0.0, kFirst * kFirst - foot_m * foot_m));
  return knuckle_m + foot_m * along - height_m * across(bends, along);
}

}  // namespace

std::vector<sim::ContactTool> HandShape::tools(double friction) const {
  std::vector<sim::ContactTool> tools;
  const auto add = [&](const std::string& name, double radius_m, double length_m) {
    tools.push_back({name, sim::Capsule{radius_m, length_m / 2}});
    if (friction == 0) return;
    tools.back().sticks = true;
    tools.back().friction = friction;
  };
  for (std::size_t finger = 1; finger <= fingers_; ++finger) {
    const std::string of = " phalanx of finger " + std::to_string(finger);
    add("distal" + of, kPhalanxRadiusMetres, kDistalMetres - kBehindTipMetres);
    add("middle" + of, kPhalanxRadiusMetres, kMiddleMetres);
    add("proximal" + of, kPhalanxRadiusMetres, kProximalMetres);
  }
  for (std::size_t i = 1; i <= kPalmCapsules; ++i)
    add("palm " + std::to_string(i), kPalmRadiusMetres, 2 * kPalmHalfMetres);
  return tools;
}

void HandShape::place(const Pose& wrist, std::span<const Pose> fingertips, std::span<Pose> parts) const {
  const Vector3 ahead = wrist.orientation * Vector3::UnitY(), palmar = wrist.orientation * Vector3::UnitZ();
  std::size_t part = 0;
  for (std::size_t finger = 0; finger < fingers_; ++finger) {
    const Pose& tip = fingertips[finger];
    const double aside_m =
        (static_cast<double>(finger) - static_cast<double>(fingers_ - 1) / 2) * kKnucklesApartMetres;
    const Vector3 knuckle_m = wrist.from_tool({aside_m, kKnuckleMetres, 0});
    const Vector3 distal_joint_m = tip.from_tool({0, -kDistalMetres, 0});
    const Vector3 bends = palmar + tip.orientation * Vector3::UnitZ();
    const Vector3 joint_m = middle_joint_m(knuckle_m, distal_joint_m, bends);
    parts[part++] = capsule_along(distal_joint_m, tip.position_m, kDistalMetres - kBehindTipMetres, ahead);
    parts[part++] = capsule_along(distal_joint_m, joint_m, kMiddleMetres, -ahead);
    parts[part++] = capsule_along(knuckle_m, joint_m, kProximalMetres, ahead);
  }
  for (std::size_t i = 0; i < kPalmCapsules; ++i) {
    const double aside_m = (static_cast<double>(i) - (kPalmCapsules - 1) / 2.0) * kPalmApartMetres;
    const Vector3 begins_m = wrist.from_tool({aside_m, kPalmMiddleMetres - kPalmHalfMetres, 0});
    parts[part++] = capsule_along(begins_m, begins_m + ahead, 2 * kPalmHalfMetres, ahead);
  }
}

Pose HandShape::wrist_behind(std::span<const Pose> fingertips) {
  constexpr double kNearlyStraight = 0.97;
  Vector3 middle_m = Vector3::Zero(), ahead = Vector3::Zero(), palmar = Vector3::Zero();
  for (const Pose& tip : fingertips) {
    middle_m += tip.position_m / static_cast<double>(fingertips.size());
    ahead += tip.orientation * Vector3::UnitY();
    palmar += tip.orientation * Vector3::UnitZ();
  }
  ahead = ahead.norm() > 1e-6 ? Vector3(ahead.normalized()) : Vector3(Vector3::UnitY());
  palmar = across(palmar, ahead);
  Eigen::Matrix3d axes;
  axes << ahead.cross(palmar), ahead, palmar;
  const double behind_m =
      kKnuckleMetres + kDistalMetres + kNearlyStraight * (kProximalMetres + kMiddleMetres);
  return {middle_m - behind_m * ahead, Eigen::Quaterniond(axes).normalized()};
}

}  // namespace kiroku::trainer
