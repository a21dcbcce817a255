// Pictures of a comparison: films and stills of plan and recording, and the plan by itself. Objects and
// functions belong to one thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "apps/sim/comparison_progress.h"
#include "apps/sim/comparison_request.h"
#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "sim/plan/plan_frames.h"
#include "sim/render/plan_pictures.h"
#include "sim/volume/volume.h"
#include "viewer/compare/comparison_document.h"
#include "viewer/compare/paired_pictures.h"
#include "viewer/compare/paired_radiographs.h"

namespace kiroku::apps {

/// Simulated once, when it is first needed.
class SimulatedPlan {
 public:
  /// What is given outlives the object.
  SimulatedPlan(const sim::Plan& plan, ComparisonTold& told) : plan_(plan), told_(told) {}
  const sim::PlanFrames& get();

 private:
  const sim::Plan& plan_;
  ComparisonTold& told_;
  std::optional<sim::PlanFrames> frames_;
};

/// The plan's CT, read once, when it is first needed.
class PlanCt {
 public:
  /// What is given outlives the object.
  PlanCt(const ComparisonRequest& request, const sim::Plan& plan, ComparisonTold& told)
      : request_(request), plan_(plan), told_(told) {}
  /// Whether the plan or the request names one.
  [[nodiscard]] bool is_named() const { return request_.volume || !plan_.volume.empty(); }
  /// kiroku::UsageError where none is named; what sim::read_volume() throws.
  const sim::Volume& get();

 private:
  const ComparisonRequest& request_;
  const sim::Plan& plan_;
  ComparisonTold& told_;
  std::optional<sim::Volume> volume_;
};

/// The plan in pictures as large as the recording's.
class PlanView {
 public:
  PlanView(const ComparisonRequest& request, const archive::CaseReader& recording,
           const crypto::AgeIdentities& identities, const compare::Comparison& comparison,
           const sim::Plan& plan, PlanCt& ct, std::int64_t from_ns);
  sim::PlanPictures& pictures() { return *pictures_; }
  /// With what everybody must be told of what is shown.
  [[nodiscard]] compare::CompositionForm form(const ComparisonRequest& request,
                                              const compare::Provenance& made) const;

 private:
  compare::PictureSize size_;
  sim::Rgb background_;
  std::optional<sim::PlanPictures> pictures_;
};

/// From a second before the first step to a second after the last, as far as something was recorded.
/// kiroku::UsageError where the request leaves nothing of it.
archive::Span shown_span(const ComparisonRequest& request, const archive::CaseReader& recording,
                         const compare::Comparison& comparison);

/// Both in step, of `width` by `height` pixels, to the request's output; how many pictures.
std::uint64_t write_film(const ComparisonRequest& request, const archive::Span& span, int width, int height,
                         const std::function<sim::Picture(std::int64_t case_ns)>& picture_at,
                         ComparisonTold& told);

/// The plan by itself, a picture each time step, as fast as it was planned; how many.
std::uint64_t write_plan_film(const std::filesystem::path& file, const sim::Plan& plan,
                              const sim::PlanFrames& frames, sim::PlanPictures& pictures,
                              ComparisonTold& told);

/// Its radiographs, likewise, as dark and light as the fluoroscopy has it; one window for all.
std::uint64_t write_radiograph_film(const std::filesystem::path& file, const sim::Plan& plan,
                                    const sim::PlanFrames& frames, compare::PlanRadiographs& radiographs,
                                    const compare::Fluoroscopy& fluoroscopy, ComparisonTold& told);

/// What the request says of the case's fluoroscopy; without --align-at the picture in the middle of the first
/// step that was found. kiroku::UsageError where it cannot be, or no step was found.
compare::FluoroscopyRequest fluoroscopy_request(const ComparisonRequest& request,
                                                const archive::CaseReader& recording,
                                                const compare::Comparison& comparison);
/// Degrees; --field must be there. kiroku::UsageError for what is none of an endoscope.
double alignment_field_deg(const ComparisonRequest& request);
/// What --lens names; nothing where it is not there. kiroku::Error for a file that cannot be read,
/// kiroku::UsageError as sim::read_lens_calibration() and sim::Lens.
std::optional<compare::UsedLens> alignment_lens(const ComparisonRequest& request);
/// Whether it asks for the organ deformed to fit.
bool is_deformed(const ComparisonRequest& request);
/// What the request says of aligning the plan's organ with the recorded pictures: --field, --view, and --from
/// and --to, else what a film would show; all of the recording where no step was found. Without a lens
/// --field must be there.
compare::AlignmentRequest alignment_request(const ComparisonRequest& request,
                                            const std::optional<compare::UsedLens>& lens,
                                            const archive::CaseReader& recording,
                                            const compare::Comparison& comparison);
compare::RadiographForm radiograph_form(const ComparisonRequest& request);

/// The middle of each step that was found.
std::vector<compare::StillPicture> stills(const compare::Comparison& comparison,
                                          compare::PairedPictures& pictures, ComparisonTold& told);

}  // namespace kiroku::apps
