// The plate that is pressed in the haptic-rate experiment, and fingers on it.
#pragma once

#include <memory>
#include <vector>

#include "sim/contact/contact_body.h"
#include "sim/haptics/haptic_contact.h"
#include "sim/haptics/simulated_hand.h"
#include "sim/render/picture.h"
#include "trainer/haptic_rate/fingers.h"

namespace kiroku::trainer {

/// What a finger is to press with.
inline constexpr double kLeastPressN = 0.5, kMostPressN = 1.0;

/// Source: "Haptic Rate for Surgical Manipulations with Fingers and Instruments" and "Construction of
/// Training Environment for Surgical Exclusion with a Basic Study of Multi-finger Haptic Interaction": a soft
/// plate of 20 x 20 x 1.5 cm, E 0.2 MPa, Poisson's ratio 0.4; the latter alone says what holds it: 7.5 % of
/// its length are fixed at both ends (x). The papers' mesh had 1,334 vertices and 4,745 tetrahedra, this one
/// has 1,323 and 4,800. Its upper face is z = 0.
///
/// Made once (a second); the body may be shared by threads as ContactBody says.
class Plate {
 public:
  Plate();
  Plate(const Plate&) = delete;
  Plate& operator=(const Plate&) = delete;

  [[nodiscard]] const sim::ElasticBody& body() const { return *body_; }
  [[nodiscard]] const sim::ContactBody& contact() const { return *contact_; }

  /// So many fingertips, 1 to kMostFingers; kiroku::UsageError for others.
  [[nodiscard]] static std::vector<sim::ContactTool> fingers(std::size_t count, bool stick = false);
  /// Where these fingertips are when each presses with that force, N, into the plate; 0: touching just so.
  /// One finger lies in the plate's middle, named ones beside each other as they do on a hand above it.
  [[nodiscard]] std::vector<sim::Pose> pressing(const Fingers& fingers, double force_n) const;

 private:
  std::unique_ptr<sim::ElasticBody> body_;
  std::unique_ptr<sim::ContactBody> contact_;
};

/// The colour of a touched place: blue at kLeastPressN and less, red at kMostPressN and more, mixed between.
sim::Rgb colour_of_press(double force_n);

/// The forces of contact for a program that drives time itself: steps as HapticContact's, with what is near
/// the fingers known from the first step on. For one thread.
class PlateForces : public sim::ForceSource {
 public:
  /// `plate` must outlive it; fingers as at `poses`, which glide on it, or stick to it where they touch.
  PlateForces(const Plate& plate, std::span<const sim::Pose> poses, bool stick = false);
  void forces(std::span<const sim::Pose> poses, double period_s, std::span<sim::Vector3> forces_n) override;
  [[nodiscard]] const sim::ContactResult& result() const { return solver_.result(); }

 private:
  sim::ContactSolver solver_;
};

}  // namespace kiroku::trainer
