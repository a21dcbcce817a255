// The planned operation as a fluoroscope would see it, beside the case's fluoroscopy: radiographs computed
// from the plan's CT as the plan deforms it (sim/drr), and how alike both are. Objects belong to one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "media/png.h"
#include "sim/drr/ct_projector.h"
#include "sim/drr/mesh_projector.h"
#include "sim/drr/picture.h"
#include "sim/drr/projection_geometry.h"
#include "sim/drr/registration.h"
#include "sim/plan/plan_frames.h"
#include "sim/volume/volume.h"
#include "viewer/compare/time_map.h"

namespace kiroku::compare {

/// What a stream's `purpose` says where its pictures are a fluoroscope's.
inline constexpr const char* kFluoroscopyPurpose = "fluoroscopy";
/// The stream asked for; without, the only one with that purpose. kiroku::UsageError where there is none, it
/// has no pictures, or it must be said which, by `option`.
std::string fluoroscopy_of(const archive::CaseReader& recording, const std::optional<std::string>& asked,
                           const std::string& option);

/// The plan's radiographs at any of its moments. Tissue that the plan cuts away is gone from them; what lies
/// outside of the mesh stays.
class PlanRadiographs {
 public:
  /// The plan must outlive the object, the volume need not. kiroku::Error as sim::CtProjector and
  /// sim::MeshProjector throw it.
  PlanRadiographs(const sim::Plan& plan, const sim::Volume& volume);

  /// kiroku::Error for a geometry that does not see the CT.
  sim::ProjectionImage project(const sim::PlanFrames::Kept& moment, const sim::ProjectionGeometry& geometry);
  /// Of the CT's box.
  [[nodiscard]] sim::Vector3 middle_m() const;

 private:
  sim::CtProjector ct_;
  sim::MeshProjector rest_;
  std::shared_ptr<const sim::TetMesh> cut_mesh_;  // what `cut_` was made of
  std::unique_ptr<sim::MeshProjector> cut_;       // null as long as nothing was cut
  std::optional<sim::ProjectionGeometry::Matrix> outside_by_;
  sim::ProjectionImage outside_;  // of that geometry; it does not move
};

/// A recorded picture as line integrals of some unit: light where much attenuates.
sim::ProjectionImage radiograph_of(const media::PictureView& rgb, sim::Polarity polarity);

struct FluoroscopyRequest {
  std::string stream;
  sim::ProjectionGeometry geometry;
  sim::Polarity polarity = sim::Polarity::kBoneBlack;
  std::int64_t at_ns = 0;  // the last picture that is not later is looked at
  bool align = false;      // moves the patient until that picture and the plan's radiograph are most alike
};

/// What was found.
struct Fluoroscopy {
  std::string stream;
  sim::ProjectionGeometry geometry;  // of the patient as they lay, where that was looked for
  sim::Polarity polarity = sim::Polarity::kBoneBlack;
  std::int64_t at_ns = 0;  // of the picture
  double plan_s = 0;       // the plan's moment
  double similarity = 0;   // gradient correlation, by the geometry that was given
  std::optional<sim::Registration> alignment;
};

/// Compares one recorded picture with the plan at its moment. kiroku::UsageError where the pictures have not
/// the geometry's size, or none was recorded by then; kiroku::Error as playback::PictureSpan.
Fluoroscopy compare_fluoroscopy(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                                const TimeMap& map, const sim::PlanFrames& frames,
                                PlanRadiographs& radiographs, const FluoroscopyRequest& request,
                                const std::function<void(double share)>& progress = {});

}  // namespace kiroku::compare
