// The plan's radiograph and the recorded fluoroscopy at one moment of the case, as one picture. An object
// belongs to one thread.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "sim/drr/overlay.h"
#include "sim/plan/plan_frames.h"
#include "viewer/compare/comparison.h"
#include "viewer/compare/composition.h"
#include "viewer/compare/fluoroscopy.h"
#include "viewer/compare/recorded_pictures.h"

namespace kiroku::compare {

/// kBeside has the plan left, the fluoroscopy right; kWipe the plan left of a line. The others lie over each
/// other as sim::OverlayMode says.
enum class RadiographForm { kBeside, kWipe, kOpacity, kDifference, kCheckerboard, kContour };

class PairedRadiographs {
 public:
  /// What is given must outlive the object. The comparison must have a time map. `share`: opacity of the
  /// plan's radiograph, or where the line is, 0 to 1. `cautions`: CompositionForm's.
  PairedRadiographs(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                    const Comparison& comparison, const Fluoroscopy& fluoroscopy,
                    const sim::PlanFrames& frames, PlanRadiographs& radiographs, RadiographForm form,
                    double share, std::int64_t from_ns, std::int64_t to_ns,
                    const std::vector<std::string>& cautions = {});

  [[nodiscard]] int width() const { return composer_.width(); }
  [[nodiscard]] int height() const { return composer_.height(); }
  /// Moments must not go back; what was recorded as RecordedPictures gives it.
  sim::Picture at(std::int64_t case_ns);

 private:
  [[nodiscard]] sim::Picture both(const sim::ProjectionImage& recorded) const;

  const Comparison& comparison_;
  const Fluoroscopy& fluoroscopy_;
  const sim::PlanFrames& frames_;
  PlanRadiographs& radiographs_;
  RadiographForm form_;
  double share_;
  int width_, height_;
  Composer composer_;
  RecordedPictures recorded_;
  sim::ProjectionImage planned_;
  const sim::PlanFrames::Kept* planned_frame_ = nullptr;
};

}  // namespace kiroku::compare
