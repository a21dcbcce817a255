#include "viewer/compare/paired_pictures.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "viewer/compare/captions.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::compare {
namespace {

int even(double side) { return std::max(16, 2 * static_cast<int>(std::lround(side / 2))); }

}  // namespace

PictureSize picture_size(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                         const std::string& stream, std::int64_t from_ns, int widest) {
  playback::PictureSpan reader(recording, identities, stream, from_ns);
  if (!reader.next()) throw Error("stream '" + stream + "' holds no picture at that time");
  const double wide = reader.width(), high = reader.height();
  const double scale = std::min(1.0, widest / wide);
  return {even(wide * scale), even(high * scale)};
}

PairedPictures::PairedPictures(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                               const Comparison& comparison, const sim::PlanFrames& frames,
                               sim::PlanPictures& plan, const CompositionForm& form, std::int64_t from_ns,
                               std::int64_t to_ns)
    : comparison_(comparison),
      frames_(frames),
      plan_(plan),
      form_(form),
      composer_(form),
      recorded_(recording, identities, comparison.stream, from_ns, to_ns, form.width, form.height),
      rendered_(form.width, form.height) {}

bool PairedPictures::has_no_place(std::int64_t case_ns) const {
  if (!comparison_.alignment || form_.arrangement == Arrangement::kSideBySide) return false;
  const sim::AlignedMoment* const moment = comparison_.alignment->at(case_ns);
  return moment == nullptr || !moment->held();
}

void PairedPictures::render(const PlanMoment& moment, std::int64_t case_ns) {
  const sim::PlanFrames::Kept& kept = frames_.at(moment.step, moment.plan_s);
  if (has_no_place(case_ns)) {
    // Nothing of the plan is laid where it would be a guess.
    for (std::size_t i = 0; i < rendered_.rgb.size(); ++i) rendered_.rgb[i] = form_.plan_background[i % 3];
    rendered_frame_ = nullptr;
    return;
  }
  const sim::Camera* camera = nullptr;
  if (form_.arrangement != Arrangement::kSideBySide) {
    if (comparison_.alignment) {
      camera = &comparison_.alignment->at(case_ns)->camera;
    } else if (comparison_.camera) {
      camera = &comparison_.camera->camera_at(case_ns);
    }
  }
  if (&kept == rendered_frame_ && camera == rendered_camera_) return;
  if (camera != nullptr) plan_.set_camera(*camera);
  rendered_ = plan_.picture(kept.frame, *kept.mesh);
  rendered_frame_ = &kept;
  rendered_camera_ = camera;
}

Caption PairedPictures::caption_at(std::int64_t case_ns) const {
  Caption caption = compare::caption_at(comparison_, case_ns);
  if (form_.arrangement != Arrangement::kSideBySide && comparison_.camera && comparison_.camera->lost_ns() &&
      case_ns >= *comparison_.camera->lost_ns())
    caption.step += "    (camera lost)";
  if (has_no_place(case_ns)) caption.step += "    (organ not found here)";
  return caption;
}

sim::Picture PairedPictures::at(std::int64_t case_ns) {
  const sim::Picture& recorded = recorded_.at(case_ns);
  render(comparison_.map->plan_at(case_ns), case_ns);
  return composer_.compose(rendered_, recorded, caption_at(case_ns));
}

}  // namespace kiroku::compare
