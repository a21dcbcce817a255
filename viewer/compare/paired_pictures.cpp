#include "viewer/compare/paired_pictures.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "viewer/compare/captions.h"
#include "viewer/compare/deformed_drawing.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::compare {
namespace {

bool same(const std::optional<sim::Camera>& a, const std::optional<sim::Camera>& b) {
  if (!a || !b) return !a && !b;
  return a->eye_m == b->eye_m && a->to_view == b->to_view && a->half_extent == b->half_extent &&
         a->centre == b->centre;
}

std::string words_of(const ShownDeformation& shown) {
  constexpr double kMmPerM = 1000;
  return "organ deformed up to " + number_text(kMmPerM * shown.largest_m, 2) + " mm, error " +
         number_text(kMmPerM * shown.standard_error_m, 2) + " mm";
}

std::string words_of(const Departure& departure) {
  constexpr double kMmPerM = 1000;
  const auto mm = [](double metres) { return number_text(kMmPerM * metres, 2) + " mm"; };
  if (!departure.departed())
    return "organ as planned, within " + number_text(sim::DeformedTrack::kBeyond, 1) + " errors of " +
           mm(departure.standard_error_m);
  return "organ departs from the plan by up to " + mm(departure.largest_m) + ", error " +
         mm(departure.largest_error_m);
}

/// How well the organ is placed, for the caption.
std::string words_of(const std::optional<sim::AlignedMoment>& place,
                     const std::optional<sim::WhyRigid>& rigid) {
  if (!place) return "organ not looked for here";
  if (place->why == sim::WhyLost::kNotLooked) return "organ lost before, not searched for here";
  if (!place->held()) return "organ not found here";
  constexpr double kMmPerM = 1000;
  const std::string error = number_text(kMmPerM * place->standard_error_m, 2) + " mm";
  // What is new comes first: a caption has one line.
  return rigid ? "rigid organ, error " + error + ": " + sentence_of(*rigid)
               : "organ placed, standard error " + error;
}

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
      rendered_(form.width, form.height) {
  if (!is_aligned() || !comparison.alignment->lens) return;
  bent_.emplace(comparison.alignment->lens->lens, form.width, form.height);
  plan_.set_size(bent_->drawn_width(), bent_->drawn_height(), plan_.scene().spacing_m);
}

bool PairedPictures::is_aligned() const {
  return comparison_.alignment && form_.arrangement != Arrangement::kSideBySide;
}

std::optional<sim::AlignedMoment> PairedPictures::aligned() const {
  const std::optional<std::int64_t> taken_ns = recorded_.taken_ns();
  return taken_ns ? comparison_.alignment->at(*taken_ns) : std::nullopt;
}

std::optional<ShownDeformation> PairedPictures::deformed() const {
  const std::optional<std::int64_t> taken_ns = recorded_.taken_ns();
  return taken_ns ? comparison_.alignment->deformed_at(*taken_ns) : std::nullopt;
}

bool PairedPictures::is_from_plan() const {
  return form_.from_plan && is_aligned() && comparison_.alignment->deformed;
}

const Departure* PairedPictures::departure() const {
  const std::optional<std::int64_t> taken_ns = recorded_.taken_ns();
  return taken_ns ? comparison_.alignment->departure_at(*taken_ns) : nullptr;
}

void PairedPictures::clear_rendered() {
  rendered_ = background(form_.width, form_.height);
  rendered_frame_ = nullptr;
}

sim::Picture PairedPictures::background(int width, int height) const {
  sim::Picture picture(width, height);
  for (std::size_t i = 0; i < picture.rgb.size(); ++i) picture.rgb[i] = form_.plan_background[i % 3];
  return picture;
}

void PairedPictures::draw_shape(ShownDeformation shown) {
  const sim::DrawnSurface& surface = comparison_.alignment->surface;
  const DeformedAlignment& found = *comparison_.alignment->deformed;
  const auto draw = [&](sim::Picture& picture) {
    if (is_from_plan()) {
      draw_departure(picture, surface, shown, departure()->beyond_m, found.departure_scale_mm());
    } else {
      draw_deformed(picture, surface, shown, found.scale_mm());
    }
  };
  clear_rendered();
  if (!bent_) {
    draw(rendered_);
    return;
  }
  shown.camera = bent_->drawn(shown.camera);
  sim::Picture drawn = background(bent_->drawn_width(), bent_->drawn_height());
  draw(drawn);
  rendered_ = bent_->bent(drawn, form_.plan_background);
}

void PairedPictures::render(const PlanMoment& moment, std::int64_t case_ns) {
  const sim::PlanFrames::Kept& kept = frames_.at(moment.step, moment.plan_s);
  std::optional<sim::Camera> camera;
  if (is_from_plan()) {
    const Departure* const found = departure();
    const auto shown = found != nullptr && found->compared()
                           ? comparison_.alignment->shape_at(*recorded_.taken_ns())
                           : std::nullopt;
    // Where nothing can be said of a departure, nothing is laid.
    if (shown) {
      draw_shape(*shown);
    } else {
      clear_rendered();
    }
    return;
  }
  if (is_aligned()) {
    if (const auto shown = deformed()) {
      draw_shape(*shown);
      return;
    }
    const std::optional<sim::AlignedMoment> place = aligned();
    if (!place || !place->held()) {
      // Nothing of the plan is laid where it would be a guess.
      clear_rendered();
      return;
    }
    camera = bent_ ? bent_->drawn(place->camera) : place->camera;
  } else if (comparison_.camera && form_.arrangement != Arrangement::kSideBySide) {
    camera = comparison_.camera->camera_at(case_ns);
  }
  if (&kept == rendered_frame_ && same(camera, rendered_camera_)) return;
  if (camera) plan_.set_camera(*camera);
  rendered_ = plan_.picture(kept.frame, *kept.mesh);
  if (bent_) rendered_ = bent_->bent(rendered_, form_.plan_background);
  rendered_frame_ = &kept;
  rendered_camera_ = camera;
}

Caption PairedPictures::caption_at(std::int64_t case_ns) const {
  Caption caption = compare::caption_at(comparison_, case_ns);
  const Departure* const departed = is_from_plan() ? departure() : nullptr;
  if (departed != nullptr && departed->why != WhyNoDeparture::kNoShape) {
    const bool compared = departed->compared();
    caption.step += "    (" + (compared ? words_of(*departed) : sentence_of(departed->why)) + ")";
    if (compared) {
      caption.displacement_mm = comparison_.alignment->deformed->departure_scale_mm();
      caption.scale_title = "mm from plan";
    }
  } else if (is_aligned()) {
    if (const auto shown = deformed()) {
      caption.step += "    (" + words_of(*shown) + ")";
      caption.displacement_mm = comparison_.alignment->deformed->scale_mm();
    } else {
      const std::optional<std::int64_t> taken_ns = recorded_.taken_ns();
      caption.step +=
          "    (" +
          words_of(aligned(), taken_ns ? comparison_.alignment->rigid_at(*taken_ns) : std::nullopt) + ")";
    }
  } else if (form_.arrangement != Arrangement::kSideBySide && comparison_.camera &&
             comparison_.camera->lost_ns() && case_ns >= *comparison_.camera->lost_ns()) {
    caption.step += "    (camera lost)";
  }
  return caption;
}

sim::Picture PairedPictures::at(std::int64_t case_ns) {
  const sim::Picture& recorded = recorded_.at(case_ns);
  render(comparison_.map->plan_at(case_ns), case_ns);
  return composer_.compose(rendered_, recorded, caption_at(case_ns));
}

}  // namespace kiroku::compare
