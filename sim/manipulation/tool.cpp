#include "sim/manipulation/tool.h"

#include <utility>

namespace kiroku::sim {
namespace {

ToolAction pressing(bool sticks) { return sticks ? ToolAction::kSticks : ToolAction::kGlides; }

}  // namespace

Tool forceps(std::string name, const Vector3& half_extent_m) {
  return {std::move(name), Box{half_extent_m}, ToolAction::kBinds};
}

Tool pin(std::string name, double radius_m) {
  return {std::move(name), Sphere{radius_m}, ToolAction::kBinds};
}

Tool flat_retractor(std::string name, const Vector3& half_extent_m, bool sticks) {
  return {std::move(name), Box{half_extent_m}, pressing(sticks)};
}

Tool hook(std::string name, double radius_m, double half_length_m, bool sticks) {
  return {std::move(name), Capsule{radius_m, half_length_m}, pressing(sticks)};
}

Tool finger(std::string name, double radius_m, bool sticks) {
  return {std::move(name), Sphere{radius_m}, pressing(sticks)};
}

}  // namespace kiroku::sim
