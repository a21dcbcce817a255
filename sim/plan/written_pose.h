// Poses as a plan's document states them: lengths in its unit, turns by axis and angle. Pure, thread-safe.
#pragma once

#include "sim/contact/pose.h"
#include "sim/mesh/length_unit.h"

namespace kiroku::sim {

struct WrittenRotation {
  Vector3 axis = Vector3::UnitZ();  // of any length but zero
  double degrees = 0;
};
Eigen::Quaterniond orientation_of(const WrittenRotation& rotation);

/// In the plan's unit, to a nanometre. What such a number means in metres is written as that number again.
Vector3 written_position(const Vector3& position_m, LengthUnit unit);
/// To 1e-6 of the axis and 1e-6 degrees.
WrittenRotation written_rotation(const Eigen::Quaterniond& orientation);

/// Times of key frames: whole microseconds, which read well.
double written_time(double time_s);

/// The pose that a document states which comes nearest to this one: a tool that is moved by hand goes through
/// such poses only, so that the plan that is saved moves it to the same bits.
Pose as_written(const Pose& pose, LengthUnit unit);

}  // namespace kiroku::sim
