#include "sim/respiration/motion_responses.h"

#include <string>

#include "base/error.h"

namespace kiroku::sim {
namespace {

constexpr std::size_t kOfGroup = kUnitMotions / 2;
constexpr std::array<BoundaryGroup, 2> kMoved{BoundaryGroup::kRibCage, BoundaryGroup::kDiaphragm};

}  // namespace

std::array<double, kUnitMotions> parts_of(const BreathingMotion& motion, const Waveform& waveform,
                                          double time_s) {
  std::array<double, kUnitMotions> parts{};
  std::size_t at = 0;
  for (const GroupMotion* group : {&motion.rib_cage, &motion.diaphragm}) {
    const double moved_m = group->moved_m(waveform, time_s);
    if (group->direction) {
      for (Eigen::Index axis = 0; axis < 3; ++axis)
        parts[at + static_cast<std::size_t>(axis)] = moved_m * (*group->direction)[axis];
    } else {
      parts[at + 3] = moved_m;
    }
    at += kOfGroup;
  }
  return parts;
}

void require_moved(const BoundaryGroups& groups) {
  const auto counts = counts_of(groups);
  for (const BoundaryGroup group : kMoved) {
    if (counts[static_cast<std::size_t>(group)] > 0) continue;
    throw Error(std::string("no node of the lung is of the group ") + name_of(group) +
                ", so that it cannot be moved: give it some in 'groups', or take back what took them away");
  }
}

MotionResponses::MotionResponses(const BreathingBody& body, const std::function<void(std::size_t)>& solved) {
  require_moved(body.groups());
  std::size_t at = 0;
  for (const BoundaryGroup group : kMoved) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      unit_[at++] = body.response(group, Vector3::Unit(axis));
      if (solved) solved(at);
    }
    unit_[at++] = body.response(group, std::nullopt);
    if (solved) solved(at);
  }
}

std::vector<Vector3> MotionResponses::displacement_m(const BreathingMotion& motion, const Waveform& waveform,
                                                     double time_s) const {
  const std::array<double, kUnitMotions> parts = parts_of(motion, waveform, time_s);
  std::vector<Vector3> moved_m(static_cast<std::size_t>(unit_[0].size() / 3), Vector3::Zero());
  Eigen::Map<Eigen::VectorXd> all(moved_m.data()->data(), unit_[0].size());
  for (std::size_t i = 0; i < kUnitMotions; ++i) {
    if (parts[i] != 0) all += parts[i] * unit_[i];
  }
  return moved_m;
}

Vector3 MotionResponses::Place::displacement_m(const BreathingMotion& motion, const Waveform& waveform,
                                               double time_s) const {
  const std::array<double, kUnitMotions> parts = parts_of(motion, waveform, time_s);
  Vector3 moved_m = Vector3::Zero();
  for (std::size_t i = 0; i < kUnitMotions; ++i) moved_m += parts[i] * unit_[i];
  return moved_m;
}

MotionResponses::Place MotionResponses::at(const MeshPoint& point) const {
  Place place;
  for (std::size_t i = 0; i < kUnitMotions; ++i) place.unit_[i] = point.mean(unit_[i]);
  return place;
}

}  // namespace kiroku::sim
