#include "viewer/compare/paired_radiographs.h"

#include <algorithm>
#include <cmath>

#include "viewer/compare/captions.h"

namespace kiroku::compare {
namespace {

CompositionForm layout_of(RadiographForm form, const sim::ProjectionGeometry& geometry,
                          const std::vector<std::string>& cautions) {
  CompositionForm layout;
  layout.arrangement = form == RadiographForm::kBeside ? Arrangement::kSideBySide : Arrangement::kOverlay;
  layout.width = static_cast<int>(geometry.columns());
  layout.height = static_cast<int>(geometry.rows());
  layout.cautions = cautions;
  return layout;
}

sim::OverlayMode mode_of(RadiographForm form) {
  switch (form) {
    case RadiographForm::kOpacity:
      return sim::OverlayMode::kOpacity;
    case RadiographForm::kDifference:
      return sim::OverlayMode::kDifference;
    case RadiographForm::kCheckerboard:
      return sim::OverlayMode::kCheckerboard;
    case RadiographForm::kContour:
      return sim::OverlayMode::kContour;
    case RadiographForm::kBeside:
    case RadiographForm::kWipe:
      break;
  }
  return sim::OverlayMode::kBeside;
}

}  // namespace

PairedRadiographs::PairedRadiographs(const archive::CaseReader& recording,
                                     const crypto::AgeIdentities& identities, const Comparison& comparison,
                                     const Fluoroscopy& fluoroscopy, const sim::PlanFrames& frames,
                                     PlanRadiographs& radiographs, RadiographForm form, double share,
                                     std::int64_t from_ns, std::int64_t to_ns,
                                     const std::vector<std::string>& cautions)
    : comparison_(comparison),
      fluoroscopy_(fluoroscopy),
      frames_(frames),
      radiographs_(radiographs),
      form_(form),
      share_(share),
      width_(static_cast<int>(fluoroscopy.geometry.columns())),
      height_(static_cast<int>(fluoroscopy.geometry.rows())),
      composer_(layout_of(form, fluoroscopy.geometry, cautions)),
      recorded_(recording, identities, fluoroscopy.stream, from_ns, to_ns, width_, height_) {}

sim::Picture PairedRadiographs::at(std::int64_t case_ns) {
  const sim::Picture& picture = recorded_.at(case_ns);
  const PlanMoment moment = comparison_.map->plan_at(case_ns);
  const sim::PlanFrames::Kept& kept = frames_.at(moment.step, moment.plan_s);
  if (&kept != planned_frame_) {
    planned_ = radiographs_.project(kept, fluoroscopy_.geometry);
    planned_frame_ = &kept;
  }
  const sim::ProjectionImage recorded =
      radiograph_of({picture.width, picture.height, 3, picture.rgb}, fluoroscopy_.polarity);
  return composer_.frame(both(recorded), caption_at(comparison_, case_ns));
}

sim::Picture PairedRadiographs::both(const sim::ProjectionImage& recorded) const {
  const sim::ColourPicture laid = sim::overlay_of(recorded, planned_, mode_of(form_), share_);
  sim::Picture out(composer_.width(), height_);
  const int line = static_cast<int>(std::lround(share_ * width_));
  const int gap = composer_.width() - 2 * width_;  // of kBeside
  constexpr std::uint8_t kInk = 236;
  for (int y = 0; y < height_; ++y) {
    const auto from = [&](int x) {
      return laid.pixels[static_cast<std::size_t>(y) * laid.columns + static_cast<std::size_t>(x)].data();
    };
    for (int x = 0; x < width_; ++x) {
      if (form_ == RadiographForm::kBeside) {
        std::copy_n(from(width_ + x), 3, out.pixel(x, y));
        std::copy_n(from(x), 3, out.pixel(width_ + gap + x, y));
      } else if (form_ == RadiographForm::kWipe) {
        std::copy_n(from(x < line ? width_ + x : x), 3, out.pixel(x, y));
        if (x == line) std::fill_n(out.pixel(x, y), 3, kInk);
      } else {
        std::copy_n(from(x), 3, out.pixel(x, y));
      }
    }
  }
  return out;
}

}  // namespace kiroku::compare
