#include "sim/plan/written_pose.h"

#include <cmath>
#include <numbers>

namespace kiroku::sim {
namespace {

constexpr double kNanometresPerMetre = 1e9, kParts = 1e6;

double rounded(double number, double parts) { return std::round(number * parts) / parts; }

}  // namespace

Eigen::Quaterniond orientation_of(const WrittenRotation& rotation) {
  return Eigen::Quaterniond(
      Eigen::AngleAxisd(rotation.degrees / 180 * std::numbers::pi, rotation.axis.normalized()));
}

Vector3 written_position(const Vector3& position_m, LengthUnit unit) {
  const double units = units_per_metre(unit);
  return (position_m * units).unaryExpr([&](double length) {
    return rounded(length, kNanometresPerMetre / units);
  });
}

WrittenRotation written_rotation(const Eigen::Quaterniond& orientation) {
  if (orientation.vec().isZero(0)) return {};
  const Eigen::AngleAxisd turn(orientation);
  return {turn.axis().unaryExpr([](double part) { return rounded(part, kParts); }),
          rounded(turn.angle() * 180 / std::numbers::pi, kParts)};
}

double written_time(double time_s) {
  constexpr double kTimesPerSecond = 1e6;
  return std::round(time_s * kTimesPerSecond) / kTimesPerSecond;
}

Pose as_written(const Pose& pose, LengthUnit unit) {
  Pose written;
  written.position_m = written_position(pose.position_m, unit) / units_per_metre(unit);
  // What was rounded is rounded again when it is written, so that it takes some turns to stay.
  constexpr int kMostTurns = 16;
  written.orientation = pose.orientation;
  for (int turn = 0; turn < kMostTurns; ++turn) {
    const Eigen::Quaterniond before = written.orientation;
    written.orientation = orientation_of(written_rotation(before));
    if (written.orientation.coeffs() == before.coeffs()) break;
  }
  return written;
}

}  // namespace kiroku::sim
