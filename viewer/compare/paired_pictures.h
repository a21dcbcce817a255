// The plan and the recording at one moment of the case, as one picture: what films and stills are made of. An
// object belongs to one thread.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "sim/align/lens_pictures.h"
#include "sim/plan/plan_frames.h"
#include "sim/render/plan_pictures.h"
#include "viewer/compare/comparison.h"
#include "viewer/compare/composition.h"
#include "viewer/compare/recorded_pictures.h"

namespace kiroku::compare {

/// Size of the recorded pictures, scaled down to at most `widest` and to even sides. kiroku::Error where
/// there is none from `from_ns` on.
struct PictureSize {
  int width = 0, height = 0;
};
PictureSize picture_size(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                         const std::string& stream, std::int64_t from_ns, int widest);

class PairedPictures {
 public:
  /// What is given must outlive the object. `plan` renders pictures of the form's size; where it is laid on
  /// the recording by an alignment with a lens, they are made larger, then bent as the lens does. The
  /// comparison must have a time map.
  PairedPictures(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                 const Comparison& comparison, const sim::PlanFrames& frames, sim::PlanPictures& plan,
                 const CompositionForm& form, std::int64_t from_ns, std::int64_t to_ns);

  [[nodiscard]] int width() const { return composer_.width(); }
  [[nodiscard]] int height() const { return composer_.height(); }
  /// Moments must not go back. Black where nothing was recorded yet; where a recording stops for a while, its
  /// last picture stays.
  sim::Picture at(std::int64_t case_ns);
  /// What is done at that moment, and when that is on both clocks. Where the plan is laid on the recording it
  /// also says how well the organ is placed in the picture that at() gave last, or that it is not.
  [[nodiscard]] Caption caption_at(std::int64_t case_ns) const;

 private:
  /// Whether the plan is laid on the recording by an alignment.
  [[nodiscard]] bool is_aligned() const;
  /// Where that has the organ in the recorded picture that is shown.
  [[nodiscard]] std::optional<sim::AlignedMoment> aligned() const;
  /// The organ's shape in that picture, where it was deformed to fit it.
  [[nodiscard]] std::optional<ShownDeformation> deformed() const;
  void clear_rendered();
  [[nodiscard]] sim::Picture background(int width, int height) const;
  /// Whether colours say how far the organ departs from the plan, and how it does in that picture.
  [[nodiscard]] bool is_from_plan() const;
  [[nodiscard]] const Departure* departure() const;
  void draw_shape(ShownDeformation shown);
  void render(const PlanMoment& moment, std::int64_t case_ns);

  const Comparison& comparison_;
  const sim::PlanFrames& frames_;
  sim::PlanPictures& plan_;
  CompositionForm form_;
  Composer composer_;
  RecordedPictures recorded_;
  std::optional<sim::BentPictures> bent_;  // where the alignment has a lens
  sim::Picture rendered_;
  const sim::PlanFrames::Kept* rendered_frame_ = nullptr;
  std::optional<sim::Camera> rendered_camera_;
};

}  // namespace kiroku::compare
