// Contact for a force loop on a body of any size: forces at the loop's rate from what is known around the
// tools, while a slower loop finds out what they will touch next, and how the whole body lies.
//
//   force loop (1 kHz)          poses → ContactSolver on a neighbourhood → forces
//                                          ↑ next neighbourhood   ↓ contacts
//   deformation loop (30 Hz)    contacts → where the surface is → which nodes are near → their columns
//
// The two meet in one place, guarded by a lock that the force loop only tries: it never waits, allocates or
// frees. When the neighbourhood changes, what is pressed stays pressed; what is still different (a node that
// could not be touched before, as its columns were missing) is faded in, so that forces stay continuous.
#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "sim/contact/contact_body.h"
#include "sim/haptics/force_loop.h"

namespace kiroku::sim {

struct HapticContactOptions {
  /// Few iterations a step do for what a hand moves in a millisecond; the next step goes on from there.
  ContactOptions contact{1e-6, 10};
  /// Nodes within it of a tool belong to the neighbourhood; those within twice of it are fetched ahead. To be
  /// more than a tool moves from one refresh() to the next. In lengths of the body. The compliance's memory
  /// must hold the columns of all of these, or they push each other out.
  double margin = 0.08;
  std::chrono::nanoseconds fade = std::chrono::milliseconds(20);
};

class HapticContact : public ForceSource {
 public:
  /// The body must outlive it. Until the first refresh() nothing is felt, but for bodies whose surface has at
  /// most kWholeSurface nodes and whose compliance is complete(): these are touched everywhere at once, and
  /// refresh() only tells how they lie. Throws what ContactSolver does.
  HapticContact(const ContactBody& body, std::vector<ContactTool> tools,
                const HapticContactOptions& options = {});

  static constexpr std::size_t kWholeSurface = 512;

  /// For the force loop's thread. Steps that fail (tools that overlap) repeat the forces before and are
  /// counted.
  void forces(std::span<const Pose> poses, double period_s, std::span<Vector3> forces_n) override;
  WristForce wrist_force(const Vector3& wrist_m) override;
  /// What one tool bears of the last forces(), its torque about a point. For the force loop's thread.
  [[nodiscard]] WristForce tool_force(std::size_t tool, const Vector3& about_m) const;

  struct Deformation {
    std::vector<Contact> contacts;   // that it was computed from
    Eigen::VectorXd displacement_m;  // (3 |V|)
    std::size_t nodes_known = 0;     // in the newest neighbourhood
    std::size_t nodes_awaited = 0;   // near a tool, but their columns are still being computed
    std::uint64_t steps_failed = 0;  // of the force loop, so far
  };
  /// For one other thread, as often as it can. Missing columns are computed by the compliance's worker and
  /// not waited for. What Compliance and ElasticBody::solve() throw.
  Deformation refresh();

 private:
  /// What tools feel: a force each, N, and its torque about the tool's origin, N m.
  struct Felt {
    explicit Felt(std::size_t tools) : forces_n(tools, Vector3::Zero()), torques_nm(forces_n) {}
    std::vector<Vector3> forces_n, torques_nm;
  };
  /// What was felt before a change, on its way to what is felt after it.
  class Fade {
   public:
    Fade(std::size_t tools, double fade_s) : difference_(tools), fade_s_(fade_s) {}
    void begin(const Felt& before, const Felt& after);
    void apply(double period_s, Felt& felt);

   private:
    Felt difference_;
    double fade_s_, left_s_ = 0;
  };

  bool solve(std::span<const Pose> poses, Felt& felt);

  const ContactBody& body_;
  HapticContactOptions options_;
  std::vector<ContactTool> tools_;
  bool whole_;
  double size_m_;

  // The force loop's.
  std::unique_ptr<ContactSolver> solver_;
  Felt last_, found_;
  std::vector<Pose> last_poses_;  // of last_
  Fade fade_;
  std::uint64_t failed_ = 0;

  // The deformation loop's.
  std::vector<std::uint8_t> near_, known_, ahead_;  // (|surface|)
  Eigen::VectorXd positions_m_;
  PointTree tree_;

  std::mutex mutex_;  // for what both see
  std::unique_ptr<ContactSolver> next_, used_;
  std::vector<Contact> contacts_;
  std::vector<Pose> poses_;
  bool has_poses_ = false;
  std::uint64_t failed_seen_ = 0;
  std::size_t room_ = 0;  // for contacts, that the force loop's solver has
};

}  // namespace kiroku::sim
