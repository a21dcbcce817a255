#include "sim/align/organ_track.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "sim/align/search_verdict.h"
#include "sim/align/surface_points.h"

namespace kiroku::sim {
namespace {

// One that is followed has its past to stand on.
constexpr double kHeldBorderPx = 1.7, kHeldSupported = 0.6, kHeldAgreement = 0.5, kHeldSeen = 0.3;

bool is_outlined(const OutlineFit& fit) {
  return fit.supported >= kHeldSupported && fit.border_px <= kHeldBorderPx &&
         fit.agreement >= kHeldAgreement && fit.seen >= kHeldSeen;
}

Picture scaled_down(const Picture& picture, int lesser_side) {
  const int side = std::min(picture.width, picture.height);
  if (side <= lesser_side) return picture;
  const double scale = double(lesser_side) / side;
  Picture small(static_cast<int>(std::lround(picture.width * scale)),
                static_cast<int>(std::lround(picture.height * scale)));
  const cv::Mat from(picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data()));
  cv::Mat to(small.height, small.width, CV_8UC3, small.rgb.data());
  cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
  return small;
}

}  // namespace

const char* name_of(WhyLost why) {
  switch (why) {
    case WhyLost::kNotLost:
      return "held";
    case WhyLost::kNoOrgan:
      return "no-organ";
    case WhyLost::kAlike:
      return "two-places-alike";
    case WhyLost::kMirrored:
      return "mirrored";
    case WhyLost::kHidden:
      return "hidden";
    case WhyLost::kUncertain:
      return "uncertain";
    case WhyLost::kContradictory:
      return "contradictory";
    case WhyLost::kNotLooked:
      return "not-looked";
  }
  return "no-organ";
}

class OrganTrack::Following {
 public:
  Following(const TetMesh& mesh, double field_deg, const SearchRange& range)
      : surface_(organ_surface(mesh)), field_deg_(field_deg), search_(surface_, range) {}

  AlignedMoment take(std::int64_t time_ns, const Picture& given) {
    if (given.width != width_ || given.height != height_) {
      // Nothing is followed from one size into another: it is sought anew, first where it was.
      points_.drop();
      lost_ = true;
      width_ = given.width;
      height_ = given.height;
    }
    picture_ = scaled_down(given, kLesserSidePx);
    const Picture& picture = picture_;
    pinhole_ = pinhole_of(field_deg_, picture.width, picture.height);
    cover_ = cover_of(picture);
    cells_ = colour_cells(picture, cover_);
    points_.follow(picture, cover_);
    AlignedMoment moment = place_ && !lost_ ? follow(picture) : find(picture);
    moment.time_ns = time_ns;
    moment.camera.half_extent = half_extent_of(field_deg_, width_, height_);
    scale_ = double(std::min(width_, height_)) / std::min(picture.width, picture.height);
    moment.misfit_px *= scale_;
    moment.rival_px *= scale_;
    lost_ = !moment.held();
    if (lost_) points_.drop();
    return moment;
  }

  [[nodiscard]] Taken taken() const {
    return {picture_, scale_, cover_, cells_, pinhole_, place_ && !lost_ ? &*place_ : nullptr};
  }

 private:
  static AlignedMoment lost(WhyLost why, const OutlineFit* fit = nullptr) {
    AlignedMoment moment;
    moment.why = why;
    if (fit != nullptr) {
      moment.misfit_px = fit->misfit_px;
      moment.supported = fit->supported;
    }
    return moment;
  }

  /// Keeps the place and says so; lost where its error is too large.
  AlignedMoment hold(const Picture& picture, const Expected& at, const OutlineFit& fit) {
    AlignedMoment moment = lost(WhyLost::kNotLost, &fit);
    moment.camera = at.camera;
    moment.standard_error_m = standard_error_m(surface_, at.camera, at.covariance_m2);
    if (!(moment.standard_error_m <= kLargestErrorM)) {
      moment.why = WhyLost::kUncertain;
      return moment;
    }
    place_ = at;
    if (points_.worn()) points_.fix(surface_, pinhole_, at);
    learn(picture, fit);
    return moment;
  }

  void learn(const Picture& picture, const OutlineFit& fit) {
    constexpr double kSure = 0.6, kShare = 0.1;
    if (fit.supported < kSure || fit.seen < kSeenOfOutline) return;
    const auto silhouette = silhouette_of(surface_, fit.camera, pinhole_, picture.width, picture.height, 2);
    if (!silhouette) return;
    const double ring_px =
        0.5 * pinhole_.focal_px * surface_.radius_m / -fit.camera.view_m(surface_.middle_m).z();
    const ColourModel seen = colours_of(cells_, *silhouette, ring_px);
    colours_ = colours_ ? mixed(*colours_, seen, kShare) : seen;
  }

  AlignedMoment follow(const Picture& picture) {
    const std::optional<PointsFit> by_points = points_.fit(surface_, pinhole_);
    constexpr double kAgree = 0.5, kMostPx = 1.5;
    const bool flows = by_points && by_points->share >= kAgree && by_points->misfit_px <= kMostPx;
    Expected expected = *place_;
    // What the camera may have gone since the last picture, and by how much flow is wrong together: it
    // follows highlights and what a codec makes of soft tissue, which no spread of its points shows.
    constexpr double kUnseenM = 0.01, kFlowM = 0.002;
    if (flows) {
      expected = by_points->expected;
      expected.covariance_m2 += kFlowM * kFlowM * MotionCovariance::Identity();
    } else {
      expected.covariance_m2 += kUnseenM * kUnseenM * MotionCovariance::Identity();
    }
    const ColourModel* const colours = colours_ ? &*colours_ : nullptr;
    auto fit = fit_outline(cells_, surface_, pinhole_, expected, colours, {16, 5, 6});
    if (!fit || !is_outlined(*fit)) {
      // Flow may have followed what shines, or a tool: once more from where the organ was, and wide.
      const Expected before{place_->camera,
                            place_->covariance_m2 + kUnseenM * kUnseenM * MotionCovariance::Identity()};
      const auto wide = fit_outline(cells_, surface_, pinhole_, before, colours, {32, 9, 6});
      if (wide && (!fit || wide->misfit_px < fit->misfit_px)) fit = wide;
    }
    if (!fit || !is_outlined(*fit)) return lost(WhyLost::kHidden, fit ? &*fit : nullptr);
    if (flows) {
      // How far the outline is from where the points have it, against how well they know.
      const double apart_m = way_between_m(surface_, fit->camera, expected.camera);
      constexpr double kErrors = 4;
      const double known_m = standard_error_m(surface_, expected.camera, expected.covariance_m2);
      contradictions_ = apart_m > kErrors * known_m ? contradictions_ + 1 : 0;
      constexpr int kMostContradictions = 3;
      if (contradictions_ >= kMostContradictions) {
        contradictions_ = 0;
        return lost(WhyLost::kContradictory, &*fit);
      }
    }
    return hold(picture, {fit->camera, fit->covariance_m2}, *fit);
  }

  AlignedMoment find(const Picture& picture) {
    ++pictures_lost_;
    // Close to where it was last, with the colours that it had.
    if (place_ && colours_) {
      Expected near = *place_;
      constexpr double kAwayM = 0.03;
      near.covariance_m2 += kAwayM * kAwayM * MotionCovariance::Identity();
      const auto fit = fit_outline(cells_, surface_, pinhole_, near, &*colours_, {40, 12, 6});
      if (fit && explains(*fit) && is_borne_out(*fit)) return found(picture, *fit, 0);
    }
    if (pictures_lost_ <= searched_at_ + waits_) return lost(WhyLost::kNotLooked);
    searched_at_ = pictures_lost_;
    constexpr int kLongestWait = 20;
    waits_ = std::min(kLongestWait, std::max(5, 2 * waits_));
    return search(picture);
  }

  AlignedMoment search(const Picture& picture) {
    const std::vector<OutlineFit> fits = search_.find(picture, cover_, cells_, pinhole_);
    // Then the mirror image is not searched: that takes as long again.
    if (std::ranges::all_of(fits, is_covered)) return lost(WhyLost::kNoOrgan);
    const Picture mirror = mirrored(picture);
    const Cover mirror_cover = cover_of(mirror);
    const SearchVerdict verdict =
        verdict_of(fits, search_.find(mirror, mirror_cover, colour_cells(mirror, mirror_cover), pinhole_));
    if (verdict.why == WhyLost::kNotLost) return found(picture, *verdict.best, verdict.rival_px);
    AlignedMoment moment = lost(verdict.why, verdict.best ? &*verdict.best : nullptr);
    moment.rival_px = verdict.rival_px;
    return moment;
  }

  AlignedMoment found(const Picture& picture, const OutlineFit& fit, double rival_px) {
    AlignedMoment moment = hold(picture, {fit.camera, fit.covariance_m2}, fit);
    moment.rival_px = rival_px;
    if (moment.held()) {
      points_.fix(surface_, pinhole_, *place_);
      pictures_lost_ = searched_at_ = waits_ = 0;
    }
    return moment;
  }

  OrganSurface surface_;
  double field_deg_;
  PoseSearch search_;
  int width_ = 0, height_ = 0;
  Pinhole pinhole_;
  Picture picture_;                // that was taken last, scaled down
  double scale_ = 1;               // how many pixels of the given picture are one of it
  Cover cover_;                    // of it
  ColourCells cells_;              // likewise
  std::optional<Expected> place_;  // the last that was held
  bool lost_ = true;
  std::optional<ColourModel> colours_;
  SurfacePoints points_;
  int contradictions_ = 0;
  int pictures_lost_ = 0, searched_at_ = 0, waits_ = 0;
};

OrganTrack::OrganTrack(const TetMesh& mesh, double field_deg, const SearchRange& range) {
  if (!(field_deg >= kLeastFieldDeg && field_deg <= kGreatestFieldDeg))
    throw UsageError("the field of view must be from 10 to 120 degrees");
  following_ = std::make_unique<Following>(mesh, field_deg, range);
}

OrganTrack::~OrganTrack() = default;

AlignedMoment OrganTrack::take(std::int64_t time_ns, const Picture& picture) {
  return following_->take(time_ns, picture);
}

OrganTrack::Taken OrganTrack::taken() const { return following_->taken(); }

}  // namespace kiroku::sim
