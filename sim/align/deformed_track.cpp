#include "sim/align/deformed_track.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "sim/align/border.h"
#include "sim/align/surface_points.h"
#include "sim/align/surroundings.h"

namespace kiroku::sim {
namespace {

// A rigid organ that shows so much of its outline, and fits it so well, explains the picture. In pixels of
// the picture that was looked at.
constexpr double kRestSupported = 0.95, kRestMisfitPx = 1;
// After so many pictures in a row displacements are not counted from there any more.
constexpr int kMostMoved = 3, kMostUseless = 20;
// What the endoscope may have moved although its surroundings seem to stand.
constexpr double kSwayM = 0.0005;

/// Tissue that a place of the organ explains.
constexpr double kExplainedPx = 1.5;

/// Between outline and border over all lines that are not covered; those without a border count as kWorstPx.
double misfit_px(const DeformedFit& fit) {
  return std::sqrt(fit.supported * fit.border_px * fit.border_px + (1 - fit.supported) * kWorstPx * kWorstPx);
}

}  // namespace

const char* name_of(WhyRigid why) {
  switch (why) {
    case WhyRigid::kDeformed:
      return "deformed";
    case WhyRigid::kAtRest:
      return "at-rest";
    case WhyRigid::kNoRest:
      return "not-seen-at-rest";
    case WhyRigid::kMoved:
      return "endoscope-moved";
    case WhyRigid::kUnseen:
      return "surroundings-unseen";
    case WhyRigid::kUnfitted:
      return "unfitted";
    case WhyRigid::kWithinError:
      return "within-error";
    case WhyRigid::kNotBetter:
      return "not-better";
    case WhyRigid::kNotKept:
      return "not-kept";
  }
  return "unfitted";
}

class DeformedTrack::Following {
 public:
  explicit Following(const DeformableOrgan& organ) : organ_(organ) {}

  DeformedMoment take(const OrganTrack::Taken& taken, const AlignedMoment& rigid) {
    if (taken.picture.width != width_ || taken.picture.height != height_) {
      width_ = taken.picture.width;
      height_ = taken.picture.height;
      rest_.reset();
      points_.drop();
    }
    points_.follow(taken.picture, taken.cover);
    if (!rest_) return begin(taken, rigid);
    const Stillness stillness = rest_->surroundings.look(taken.picture, taken.cover).stillness;
    if (stillness != Stillness::kStill) {
      ++useless_;
      moved_ = stillness == Stillness::kMoved ? moved_ + 1 : 0;
      if (moved_ >= kMostMoved || useless_ >= kMostUseless) {
        rest_.reset();
        return begin(taken, rigid);
      }
      return rigid_because(stillness == Stillness::kMoved ? WhyRigid::kMoved : WhyRigid::kUnseen);
    }
    moved_ = 0;
    DeformedMoment moment = fitted(taken, rigid);
    useless_ = moment.why == WhyRigid::kUnfitted ? useless_ + 1 : 0;
    if (useless_ >= kMostUseless) rest_.reset();
    return moment;
  }

 private:
  struct Rest {
    std::int64_t time_ns;
    Expected place;
    Surroundings surroundings;
    ColourModel colours;
    std::vector<std::pair<Vector3, SurfacePlace>> places;  // of the points, in their order
    Rest(std::int64_t at_ns, const OrganTrack::Taken& taken, const Silhouette& silhouette)
        : time_ns(at_ns), place(*taken.place), surroundings(taken.picture, taken.cover, silhouette) {}
  };

  static DeformedMoment rigid_because(WhyRigid why) {
    DeformedMoment moment;
    moment.why = why;
    return moment;
  }

  DeformedMoment begin(const OrganTrack::Taken& taken, const AlignedMoment& rigid) {
    const bool rests = taken.place != nullptr && rigid.supported >= kRestSupported &&
                       rigid.misfit_px <= kRestMisfitPx * taken.scale;
    if (!rests) return rigid_because(WhyRigid::kNoRest);
    const OrganSurface& surface = organ_.surface();
    const auto silhouette = silhouette_of(surface, taken.place->camera, taken.pinhole, taken.picture.width,
                                          taken.picture.height, 2);
    if (!silhouette) return rigid_because(WhyRigid::kNoRest);
    rest_.emplace(rigid.time_ns, taken, *silhouette);
    const double depth_m = -taken.place->camera.view_m(surface.middle_m).z();
    rest_->colours =
        colours_of(taken.cells, *silhouette, 0.5 * taken.pinhole.focal_px * surface.radius_m / depth_m);
    points_.fix(surface, taken.pinhole, rest_->place);
    for (const auto& [organ_m, pixel] : points_.followed())
      rest_->places.emplace_back(organ_m, nearest_place(surface, organ_m));
    begin_.resize(0);
    moved_ = useless_ = 0;
    return rigid_because(WhyRigid::kAtRest);
  }

  [[nodiscard]] std::vector<TrackedTissue> tissue() const {
    std::vector<TrackedTissue> all;
    auto place = rest_->places.begin();
    for (const auto& [organ_m, pixel] : points_.followed()) {
      // Those that are left are in the order of those that were fixed.
      while (place != rest_->places.end() && place->first != organ_m) ++place;
      if (place == rest_->places.end()) break;
      all.push_back({place->second, pixel});
    }
    return all;
  }

  DeformedMoment fitted(const OrganTrack::Taken& taken, const AlignedMoment& rigid) {
    const std::vector<TrackedTissue> followed = tissue();
    Expected expected = rest_->place;
    expected.covariance_m2 += kSwayM * kSwayM * MotionCovariance::Identity();
    const DeformedFit fit =
        fit_deformed(taken.cells, organ_, taken.pinhole, expected, begin_, followed, &rest_->colours);
    DeformedMoment moment;
    if (!fit.fitted()) {
      moment.why = WhyRigid::kUnfitted;
      moment.unfitted = fit.why;
      return moment;
    }
    begin_ = fit.coefficients;
    describe(fit, moment);
    moment.misfit_px *= taken.scale;
    moment.rest_ns = rest_->time_ns;
    moment.camera.half_extent = rigid.camera.half_extent;
    moment.rigid_points_agree = taken.place != nullptr ? explained(followed, *taken.place, taken.pinhole) : 0;
    moment.why = verdict(moment, rigid);
    return moment;
  }

  void describe(const DeformedFit& fit, DeformedMoment& moment) const {
    moment.camera = fit.camera;
    moment.displacement_m = fit.shape.displacement_m;
    double square = 0, told = 0, seen = 0, beyond = 0;
    for (std::size_t node = 0; node < moment.displacement_m.size(); ++node) {
      const double error_m = fit.standard_error_m(node), size_m = moment.displacement_m[node].norm();
      moment.error_m.push_back(static_cast<float>(error_m));
      moment.told.push_back(fit.told(node));
      if (!moment.told.back()) continue;
      told += 1;
      square += error_m * error_m;
      moment.largest_m = std::max(moment.largest_m, size_m);
      if (!fit.seen[node]) continue;
      seen += 1;
      if (size_m > kBeyond * error_m) beyond += 1;
    }
    moment.standard_error_m = std::sqrt(square / std::max(1.0, told));
    moment.beyond = beyond / std::max(1.0, seen);
    moment.misfit_px = misfit_px(fit);
    moment.supported = fit.supported;
    moment.points = fit.points;
    moment.points_agree = fit.points_agree;
  }

  /// Share of the tissue that the organ at rest explains.
  [[nodiscard]] double explained(const std::vector<TrackedTissue>& followed, const Expected& place,
                                 const Pinhole& pinhole) const {
    double agree = 0;
    for (const TrackedTissue& each : followed) {
      const Vector3 view = place.camera.view_m(place_m(organ_.surface(), each.place));
      if (view.z() < 0 && (pinhole.pixel(view) - each.pixel).norm() <= kExplainedPx) agree += 1;
    }
    return agree / std::max(1.0, double(followed.size()));
  }

  /// Outline and tissue are both asked, as each alone may be explained by chance.
  static WhyRigid verdict(const DeformedMoment& moment, const AlignedMoment& rigid) {
    if (moment.beyond < kLeastBeyond) return WhyRigid::kWithinError;
    if (!rigid.held()) return WhyRigid::kDeformed;
    constexpr double kMoreAgree = 0.2;
    const bool by_tissue = moment.points >= SurfacePoints::kLeastPoints &&
                           moment.points_agree >= moment.rigid_points_agree + kMoreAgree;
    return moment.misfit_px <= rigid.misfit_px || by_tissue ? WhyRigid::kDeformed : WhyRigid::kNotBetter;
  }

  const DeformableOrgan& organ_;
  SurfacePoints points_;
  std::optional<Rest> rest_;
  Eigen::VectorXd begin_;
  int width_ = 0, height_ = 0;   // of the picture before
  int moved_ = 0, useless_ = 0;  // pictures in a row
};

DeformedTrack::DeformedTrack(const DeformableOrgan& organ) : following_(std::make_unique<Following>(organ)) {}

DeformedTrack::~DeformedTrack() = default;

DeformedMoment DeformedTrack::take(const OrganTrack::Taken& taken, const AlignedMoment& rigid) {
  return following_->take(taken, rigid);
}

}  // namespace kiroku::sim
