// What is pushed aside, and what lies behind it.
#pragma once

#include <memory>

#include <Eigen/Geometry>

#include "sim/contact/contact_body.h"
#include "sim/render/camera.h"
#include "sim/render/surface_renderer.h"
#include "trainer/hand/trocar.h"
#include "trainer/objects/organ_object.h"

namespace kiroku::trainer {

inline constexpr double kFingertipMetres = 0.008;  // the radius of a fingertip
inline constexpr std::size_t kMostExclusionFingers = 5;

/// Between a glove and tissue that is neither dry nor under a liquid (docs/explanation/training.md,
/// "Friction").
inline constexpr double kFingertipFriction = 0.5, kMostFriction = 5;

/// The task: the line behind the organ is to be seen by the trainee's eye, nearly whole, for a while.
struct ExclusionTask {
  sim::Vector3 eye_m = sim::Vector3::Zero();
  sim::Vector3 looks_at_m = sim::Vector3::Zero();
  /// Unit vectors: the way the organ is lifted, up in the picture, and the one along which fingers lie side
  /// by side, to the right in the picture.
  sim::Vector3 lifts = sim::Vector3::UnitZ(), aside = sim::Vector3::UnitX();
  /// The middle of a hand whose fingertips touch the border from below.
  sim::Vector3 under_border_m = sim::Vector3::Zero();
  sim::Vector3 line_from_m = sim::Vector3::Zero(), line_to_m = sim::Vector3::Zero();
  double line_radius_m = 0.0015;
  double visible_share = 0.9;  // of the line's picture, from which on it counts as seen
  double hold_s = 1;           // how long it is to stay so
  double most_s = 60;          // then the task is over
  /// Von Mises stress that is taken for damage. A parameter of the training, no statement about tissue.
  double damage_pa = 100e3;
  /// Of a gloved fingertip on the organ, Coulomb's coefficient; 0: fingers glide. A parameter of the
  /// training.
  double friction = kFingertipFriction;

  /// From the trainee on into the body, which is where fingers that lift point.
  [[nodiscard]] sim::Vector3 away() const { return lifts.cross(aside); }
  /// How fingers are held that lift, in the axes of HandShape: side by side, pointing away, pads up.
  [[nodiscard]] Eigen::Quaterniond lifting_hand() const;
};

/// Of objects A, B and C: the eye of who stands at the object's side of -y and looks over its border, the
/// line below the object behind that border: hidden until the border is lifted by some millimetres.
ExclusionTask exclusion_task(ObjectKind kind);

/// Trocars of so many instruments that lift the border from below: in a wall between trainee and organ, 12 cm
/// before the border and 5 cm below it, 6 cm apart. Their x axes go along the border, y axes against the way
/// the organ is lifted, z axes towards where fingers would lie side by side. 1 to kMostExclusionFingers,
/// kiroku::UsageError for others.
std::vector<Trocar> trocars_of(const ExclusionTask& task, std::size_t instruments);

/// A camera at the eye; 28 degrees high.
sim::Camera camera_of(const ExclusionTask& task, int width, int height);
/// The line as a rod.
sim::Solid line_of(const ExclusionTask& task);

/// Where fingers lie side by side along a border, from its middle: 1 to kMostExclusionFingers numbers,
/// kiroku::UsageError for others.
std::span<const double> side_by_side_m(std::size_t fingers);

/// Object, body and columns of compliance; made once, for many runs. The columns of all that may be touched
/// are there from the start, so that runs that drive their own time repeat to the bit.
class ExclusionBody {
 public:
  ExclusionBody(OrganObject object, const ExclusionTask& task);
  ExclusionBody(const ExclusionBody&) = delete;
  ExclusionBody& operator=(const ExclusionBody&) = delete;

  [[nodiscard]] const ExclusionTask& task() const { return task_; }
  [[nodiscard]] const OrganObject& object() const { return object_; }
  [[nodiscard]] const sim::ElasticBody& body() const { return *body_; }
  [[nodiscard]] const sim::ContactBody& contact() const { return *contact_; }
  [[nodiscard]] const std::vector<double>& volumes_m3() const { return volumes_m3_; }  // (|T|), at rest

 private:
  OrganObject object_;
  ExclusionTask task_;
  std::unique_ptr<sim::ElasticBody> body_;
  std::unique_ptr<sim::ContactBody> contact_;
  std::vector<double> volumes_m3_;
};

/// How much of the line can be seen, in a picture of the body and the line alone: fingers, which a trainee
/// can take away, hide nothing. For the thread that made the renderer.
class VisibilityMeter {
 public:
  VisibilityMeter(sim::SurfaceRenderer& renderer, const ExclusionTask& task, int width, int height);
  /// 0 to 1: pixels of the line to those it has without the body.
  [[nodiscard]] double visible_share(std::span<const double> displacement_m);

 private:
  sim::SurfaceRenderer& renderer_;
  sim::SurfaceScene scene_;
  double whole_ = 0;
};

/// The same by geometry: the share of straight lines from the eye to places spread evenly over the line's
/// outline that meet no face of the deformed surface. Slow.
double geometric_visible_share(const sim::TetMesh& mesh, std::span<const double> displacement_m,
                               const ExclusionTask& task);

}  // namespace kiroku::trainer
