// The tools of a plan moved by pointers on its picture: a mouse, keys, up to five touch points.
//
// A pointer that comes down on forceps, a grasper or a clip that hold takes these, elsewhere on the organ it
// grasps with free forceps, pinches with the jaws of a free grasper, clips with a clip that was not used yet,
// or puts a free finger there. While it is down
// its tool follows it in the plane of the picture, as deep as it is pushed, turns about the line of sight as
// it is turned, and leans as it leans. Fingers leave when their pointer goes up; the others stay.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sim/mesh/mesh_topology.h"
#include "sim/plan/plan_session.h"
#include "sim/render/camera.h"

namespace kiroku::viewer {

enum class PointerUse { kGrasp, kPinch, kClip, kPress };

struct PlanPointer {
  std::uint32_t id = 0;  // as long as it is down
  double x = 0, y = 0;   // in the picture, from 0 at its left upper corner to 1
  double push_m = 0;     // away from the eye
  double turn_deg = 0;   // clockwise, as the picture shows it
  /// How far the tool's end towards the eye leans to the right and downwards in the picture, as a pen is
  /// tilted.
  double lean_x_deg = 0, lean_y_deg = 0;
};

/// Not thread-safe.
class PointerTools {
 public:
  /// `session` must outlive it.
  explicit PointerTools(sim::PlanSession& session);

  /// Tools that pointers have go on from where they are.
  void see_from(const sim::Camera& camera);
  /// All pointers that are down now. kiroku::Error where one grasps what cannot be grasped, or no tool is
  /// free for it; the others go on.
  void point(PointerUse use, const std::vector<PlanPointer>& pointers);
  /// The jaws of a grasper or a clip closer together, or further apart, by this share of what they are;
  /// pointers keep what they have. What PlanSession::close() throws.
  void close(std::size_t jaws, double share);
  /// Ends what moves, and forgets all pointers until they come down anew: before another deed.
  void release();
  /// One time step of the plan, where a tool is not yet where its pointer is; false where none moved. What
  /// PlanSession::advance() throws; pointers are let go then.
  bool advance();
  /// Fingers that never touched, since the last call: their names.
  std::vector<std::string> take_missed();

  /// Where the picture's line first meets the organ as it lies now.
  [[nodiscard]] std::optional<sim::Vector3> on_organ(double x, double y) const;

  /// Tissue is pulled no faster: pointers come in steps, and what is solved for goes from one balance to the
  /// next.
  static constexpr double kMostSpeedMetres = 0.12;
  static constexpr double kMostTurnRadians = 1.5;  // a second, likewise

 private:
  struct Held {
    std::uint32_t id = 0;
    std::size_t tool = 0;
    PointerUse use = PointerUse::kGrasp;
    sim::Pose pose;  // where the tool is
    PlanPointer at;
    Eigen::Vector2d beside = Eigen::Vector2d::Zero();              // slopes from the pointer to the tool
    double depth_m = 0;                                            // of the tool, without what it is pushed
    Eigen::Quaterniond unturned = Eigen::Quaterniond::Identity();  // the tool's, without how it is turned
  };

  void take(Held& held);
  /// Where the nodes of the organ's surface are now.
  [[nodiscard]] std::vector<sim::Vector3> surface_places() const;
  void come_down(PointerUse use, const PlanPointer& pointer);
  [[nodiscard]] std::optional<std::size_t> holder_at(const sim::Vector3& place_m) const;
  /// At least one.
  [[nodiscard]] std::vector<std::size_t> free_tools(sim::ToolKind kind, const char* what) const;
  std::size_t grasp(const sim::Vector3& place_m);
  std::size_t pinch(const sim::Vector3& place_m, sim::ToolKind kind);
  [[nodiscard]] sim::Vector3 goal_m(const Held& held) const;
  /// What turns a tool as its pointer is turned and leans.
  [[nodiscard]] Eigen::Quaterniond turn_of(const Held& held) const;
  void end_motion();

  sim::PlanSession& session_;
  sim::Camera camera_;
  std::vector<Held> held_;
  std::vector<std::uint32_t> ignored_;  // pointers that are down and have no tool
  std::vector<std::size_t> moving_;     // tools of the session's motion, in its order
  std::vector<std::string> missed_;
};

}  // namespace kiroku::viewer
