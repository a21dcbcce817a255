#include "trainer/exclusion/pointer_hand.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "sim/render/picking.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

/// Where fingers are free to go everywhere: so far before what of the organ is nearest to the eye, which
/// comes nearer when it is lifted.
constexpr double kClearanceMetres = 0.05;
/// So near to that depth, or to a pointer's line, counts as there.
constexpr double kThereMetres = 0.003;
/// Below the border, ready to lift it.
constexpr double kBelowOrganMetres = 0.004;
/// Pointers that left the picture while they were down are followed so far, in sizes of the picture.
constexpr double kOutside = 0.5;
/// Where fingers lie that nothing moves: the middle is 0, the lower border -1.
constexpr double kLyingDown = -0.9;

void check(const PointerInput& input, std::uint64_t last, std::size_t fingers) {
  if (input.number <= last)
    throw UsageError("pointers of number " + std::to_string(input.number) + " came after those of " +
                     std::to_string(last) + ": numbers must rise");
  const auto in_picture = [](double at) { return at >= -kOutside && at <= 1 + kOutside; };
  std::array<bool, kMostExclusionFingers + 1> stands{};
  for (const Pointer& pointer : input.pointers) {
    if (pointer.finger > fingers)
      throw UsageError("there is no finger " + std::to_string(pointer.finger) + ": the hand has " +
                       std::to_string(fingers));
    if (stands.at(pointer.finger) || (stands[0] && pointer.finger > 0))
      throw UsageError("finger " + std::to_string(pointer.finger) + " has more than one pointer");
    stands.at(pointer.finger) = true;
    if (!in_picture(pointer.x) || !in_picture(pointer.y))
      throw UsageError("a pointer is far outside the picture: x and y go from 0 to 1");
    if (!(std::abs(pointer.push_m) <= PointerHand::kMostPushMetres))
      throw UsageError("a pointer pushes by more than 8 cm");
  }
  if (stands[0] && input.pointers.size() > 1)
    throw UsageError("the whole hand has one pointer, or each finger its own");
}

}  // namespace

PointerHand::PointerHand(const ExclusionBody& body, const sim::Camera& camera, std::size_t fingers,
                         double period_s)
    : body_(body),
      camera_(camera),
      period_s_(period_s),
      held_(body.task().lifting_hand()),
      surface_(sim::faces_of(body.object().mesh).surface),
      fingers_(side_by_side_m(fingers).size()) {
  see({});
  const auto by_depth = [](const Vector3& a, const Vector3& b) { return a.z() < b.z(); };
  free_m_ = std::ranges::min_element(nodes_view_m_, by_depth)->z() - kClearanceMetres - kFingertipMetres;
  const ExclusionTask& task = body.task();
  under_border_m_ = in_view(task.under_border_m - kBelowOrganMetres * task.lifts).z();
  for (std::size_t i = 0; i < fingers; ++i) fingers_[i].view_m = lies_down_m(i);
}

Vector3 PointerHand::in_view(const Vector3& place_m) const { return sim::in_depth_m(camera_, place_m); }

Vector3 PointerHand::lies_down_m(std::size_t finger) const {
  return {side_by_side_m(fingers_.size())[finger] * free_m_ / under_border_m_,
          kLyingDown * camera_.half_extent.y() * free_m_, free_m_};
}

double PointerHand::depth_at(const Eigen::Vector2d& slope) const {
  const auto depth_m = sim::depth_along(surface_, nodes_view_m_, slope);
  return depth_m ? *depth_m - kFingertipMetres : under_border_m_;
}

void PointerHand::see(std::span<const double> displacement_m) {
  const std::vector<Vector3>& nodes = body_.object().mesh.nodes;
  std::vector<Vector3> seen(nodes.size());
  for (std::size_t node = 0; node < nodes.size(); ++node) {
    Vector3 place_m = nodes[node];
    if (!displacement_m.empty()) place_m += Eigen::Map<const Vector3>(displacement_m.data() + 3 * node);
    seen[node] = in_view(place_m);
  }
  const std::lock_guard guard(input_mutex_);
  nodes_view_m_.swap(seen);
}

void PointerHand::point(const PointerInput& input, Clock::time_point arrived) {
  const std::lock_guard inputs(input_mutex_);
  Wanted wanted;
  {
    const std::lock_guard guard(mutex_);
    wanted = wanted_;
  }
  check(input, wanted.number, fingers_.size());
  std::array<std::optional<double>, kMostExclusionFingers + 1> came_down_m;
  for (std::size_t i = 0; i < fingers_.size(); ++i) wanted.aims.at(i).down = false;
  for (const Pointer& pointer : input.pointers) {
    const Eigen::Vector2d slope = sim::slope_of(camera_, pointer.x, pointer.y);
    const std::optional<double> before_m = came_down_m_.at(pointer.finger);
    const double base_m = before_m ? *before_m : depth_at(slope);
    came_down_m.at(pointer.finger) = base_m;
    const double depth_m = std::max(free_m_, base_m + pointer.push_m);
    for (std::size_t i = 0; i < fingers_.size(); ++i) {
      if (pointer.finger != 0 && pointer.finger != i + 1) continue;
      const double aside_m = pointer.finger == 0 ? side_by_side_m(fingers_.size())[i] : 0;
      wanted.aims.at(i) = {true, slope + Eigen::Vector2d(aside_m / depth_m, 0), depth_m};
    }
  }
  came_down_m_ = came_down_m;
  wanted.number = input.number;
  wanted.arrived = arrived;
  const std::lock_guard guard(mutex_);
  wanted_ = wanted;
}

Vector3 PointerHand::goal_of(std::size_t finger) {
  const Aim& aim = seen_.aims.at(finger);
  Finger& own = fingers_[finger];
  const auto on_line = [](const Eigen::Vector2d& slope, double depth_m) {
    return Vector3(slope.x() * depth_m, slope.y() * depth_m, depth_m);
  };
  if (!aim.down) own.follows = false;
  if (!own.follows && own.view_m.z() > free_m_ + kThereMetres)  // back the way it came
    return on_line(own.view_m.head<2>() / own.view_m.z(), free_m_);
  if (!aim.down) return lies_down_m(finger);
  if ((aim.slope * own.view_m.z() - own.view_m.head<2>()).norm() < kThereMetres) own.follows = true;
  return on_line(aim.slope, own.follows ? aim.depth_m : free_m_);
}

bool PointerHand::read(std::span<sim::Pose> poses) {
  {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (lock.owns_lock()) {
      seen_ = wanted_;
      if (told_ < felt_) {
        felt_ring_.at(felt_next_++ % felt_ring_.size()) = {felt_, felt_at_};
        told_ = felt_;
      }
    }
  }
  const double share = 1 - std::exp(-period_s_ / kLagSeconds);
  for (std::size_t i = 0; i < fingers_.size(); ++i) {
    const Vector3 way_m = share * (goal_of(i) - fingers_[i].view_m);
    const double most_m = kMostSpeedMetres * period_s_;
    fingers_[i].view_m += way_m * std::min(1.0, most_m / std::max(way_m.norm(), most_m));
    const Vector3& view_m = fingers_[i].view_m;
    poses[i].position_m = sim::from_depth_m(camera_, view_m);
    poses[i].orientation = held_;
  }
  return true;
}

void PointerHand::write(std::span<const Vector3> /*forces_n*/) {
  if (seen_.number == felt_) return;
  felt_ = seen_.number;
  felt_at_ = Clock::now();
  input_to_force_.add(felt_at_ - seen_.arrived);
}

std::uint64_t PointerHand::felt_by(Clock::time_point time) const {
  const std::lock_guard guard(mutex_);
  std::uint64_t newest = 0;
  for (const Felt& felt : felt_ring_) {
    if (felt.number > newest && felt.at <= time) newest = felt.number;
  }
  return newest;
}

}  // namespace kiroku::trainer
