#include "sim/respiration/tumour_track.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "sim/drr/registration.h"
#include "sim/respiration/gradient_terms.h"

namespace kiroku::sim {
namespace {

constexpr std::size_t kMostTrackPixels = 256;
/// How far beside its expected place a tumour is sought.
constexpr double kSearchM = 0.010;
/// Seen is what explains so many times as much as the best place apart from it ...
constexpr double kStandsOut = 1.8;
/// ... with a factor that is so many times its surroundings' at least and at most.
constexpr double kLeastFactor = 0.4, kGreatestFactor = 2.5;
/// What is not lung by HU.
constexpr float kDenserThanLungHu = -500;
constexpr float kUsualLungHu = -850;
/// How well the lung's motion at the tumour is known before: a shift, parts of its response, a lag.
constexpr double kTrackShiftM = 0.002, kPriorResponse = 0.25, kPriorLagS = 0.15;
/// No place is known better.
constexpr double kFloorM = 0.0002;
/// What the surroundings do to all sightings of a view alike, in pixels: their structure is much the same in
/// each picture, so that many pictures do not average it away.
constexpr double kSharedPixels = 0.25;

/// The tumour's elements in a volume of what they have more than the lung around them.
class TumourAlone {
 public:
  TumourAlone(const BreathingModel& model, const Volume& volume) {
    const Tumour& tumour = model.needed_tumour();
    std::vector<std::int64_t> number(model.mesh.nodes.size(), -1);
    for (const std::uint32_t t : tumour.tetrahedra) {
      Tetrahedron corners = model.mesh.tetrahedra[t];
      for (std::uint32_t& corner : corners) {
        if (number[corner] < 0) {
          number[corner] = static_cast<std::int64_t>(nodes_.size());
          nodes_.push_back(corner);
          mesh_.nodes.push_back(model.mesh.nodes[corner]);
        }
        corner = static_cast<std::uint32_t>(number[corner]);
      }
      mesh_.tetrahedra.push_back(corners);
      mesh_.regions.push_back(1);
    }
    const Volume alone = cut_out(volume);
    ct_ = std::make_unique<CtProjector>(alone, Attenuation(Attenuation::kCtEnergyKev));
    projector_ = std::make_unique<MeshProjector>(*ct_, mesh_);
  }

  [[nodiscard]] ProjectionImage project(const ProjectionGeometry& geometry,
                                        const std::vector<Vector3>& displacement_m) const {
    std::vector<Vector3> own_m;
    for (const std::uint32_t node : nodes_) own_m.push_back(displacement_m[node]);
    return projector_->inside(geometry, own_m);
  }
  [[nodiscard]] const TetMesh& mesh() const { return mesh_; }

 private:
  /// The box around the tumour; HU such that attenuation is what the tumour has more.
  [[nodiscard]] Volume cut_out(const Volume& volume) const {
    const Grid& grid = volume.grid;
    constexpr double kAroundM = 0.01;
    Vector3 least = Vector3::Constant(std::numeric_limits<double>::infinity()), greatest = -least;
    for (const Vector3& node : mesh_.nodes) {
      const Vector3 index = grid.index(node);
      const Vector3 around = Vector3::Constant(kAroundM).cwiseQuotient(grid.spacing_m);
      least = least.cwiseMin(index - around);
      greatest = greatest.cwiseMax(index + around);
    }
    std::array<std::size_t, 3> from{}, to{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<Eigen::Index>(axis);
      const double last = static_cast<double>(grid.size[axis] - 1);
      from[axis] = static_cast<std::size_t>(std::clamp(std::floor(least[at]), 0.0, last));
      to[axis] = static_cast<std::size_t>(std::clamp(std::ceil(greatest[at]), 0.0, last));
    }
    Volume alone;
    alone.grid = grid;
    alone.grid.origin_m = grid.patient_m({double(from[0]), double(from[1]), double(from[2])});
    std::vector<float> lung;
    for (std::size_t k = from[2]; k <= to[2]; ++k) {
      for (std::size_t j = from[1]; j <= to[1]; ++j) {
        for (std::size_t i = from[0]; i <= to[0]; ++i) {
          alone.hu.push_back(volume.hu[grid.offset(i, j, k)]);
          if (alone.hu.back() < kDenserThanLungHu) lung.push_back(alone.hu.back());
        }
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis) alone.grid.size[axis] = to[axis] - from[axis] + 1;
    float around_hu = kUsualLungHu;
    if (!lung.empty()) {
      const auto middle = lung.begin() + static_cast<std::ptrdiff_t>(lung.size() / 2);
      std::ranges::nth_element(lung, middle);
      around_hu = *middle;
    }
    for (float& hu : alone.hu) hu = std::max(hu - around_hu, 0.0F) + kAirHu;
    return alone;
  }

  TetMesh mesh_;
  std::vector<std::uint32_t> nodes_;  // of the lung's mesh
  std::unique_ptr<CtProjector> ct_;
  std::unique_ptr<MeshProjector> projector_;
};

/// Differences of a part of a picture, along rows and down columns.
struct Differences {
  std::size_t columns = 0, rows = 0;
  std::vector<float> along, down;
  static Differences of(std::span<const float> image, std::size_t width, std::size_t u0, std::size_t v0,
                        std::size_t columns, std::size_t rows) {
    Differences differences{columns, rows, {}, {}};
    for (std::size_t v = v0; v < v0 + rows; ++v) {
      for (std::size_t u = u0; u < u0 + columns; ++u) {
        const std::size_t at = v * width + u;
        differences.along.push_back(image[at + 1] - image[at]);
        differences.down.push_back(image[at + width] - image[at]);
      }
    }
    return differences;
  }
};
double product(const Differences& a, const Differences& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.along.size(); ++i)
    sum += double(a.along[i]) * double(b.along[i]) + double(a.down[i]) * double(b.down[i]);
  return sum;
}
void subtract(Differences& from, double times, const Differences& what) {
  for (std::size_t i = 0; i < from.along.size(); ++i) {
    from.along[i] -= static_cast<float>(times) * what.along[i];
    from.down[i] -= static_cast<float>(times) * what.down[i];
  }
}

/// Where a picture shows the tumour, from where it was expected.
struct Sighting {
  bool seen = false;
  double stands_out = 0;
  Eigen::Vector2d offset_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px = Eigen::Matrix2d::Identity();
};

/// `background` has no tumour, `tumour` is it where it is expected, at `place`.
Sighting look_for(std::span<const float> measured, std::span<const float> background,
                  std::span<const float> tumour, std::size_t width, std::size_t height,
                  const PixelPoint& place, double radius_px, int search) {
  Sighting sighting;
  const double reach = radius_px + search + 2;
  const double left = std::floor(place.column - reach), top = std::floor(place.row - reach);
  const auto side = static_cast<std::size_t>(2 * reach) + 1;
  if (left < 0 || top < 0 || left + double(side) + 1 >= double(width) ||
      top + double(side) + 1 >= double(height))
    return sighting;
  const auto u0 = static_cast<std::size_t>(left), v0 = static_cast<std::size_t>(top);
  Differences y = Differences::of(measured, width, u0, v0, side, side);
  const Differences b = Differences::of(background, width, u0, v0, side, side),
                    t = Differences::of(tumour, width, u0, v0, side, side);
  const double bb = product(b, b), tt = product(t, t);
  if (!(bb > 0) || !(tt > 0)) return sighting;
  const double around = product(y, b) / bb;
  subtract(y, around, b);
  const double left_over = product(y, y);
  if (!(left_over > 0) || !(around > 0)) return sighting;
  // What each place explains; the tumour's own pixels stay within the window.
  const int places = 2 * search + 1;
  Eigen::MatrixXd gain = Eigen::MatrixXd::Zero(places, places), factor = gain;
  const auto inner = static_cast<int>(side) - search;
  for (int dv = -search; dv <= search; ++dv) {
    for (int du = -search; du <= search; ++du) {
      double yt = 0, bt = 0;
      for (int v = search; v < inner; ++v) {
        const auto from = static_cast<std::size_t>(v) * side, to = static_cast<std::size_t>(v + dv) * side;
        for (int u = search; u < inner; ++u) {
          const std::size_t i = from + static_cast<std::size_t>(u), j = to + static_cast<std::size_t>(u + du);
          yt += double(t.along[i]) * double(y.along[j]) + double(t.down[i]) * double(y.down[j]);
          bt += double(t.along[i]) * double(b.along[j]) + double(t.down[i]) * double(b.down[j]);
        }
      }
      const double own = tt - bt * bt / bb;
      if (!(own > 0.05 * tt)) continue;
      factor(dv + search, du + search) = yt / own;
      if (yt > 0) gain(dv + search, du + search) = yt * yt / own;
    }
  }
  Eigen::Index row = 0, column = 0;
  const double best = gain.maxCoeff(&row, &column);
  if (!(best > 0)) return sighting;
  // The best of all that does not belong to the same peak.
  const double apart = std::max(2.0, 0.6 * radius_px);
  double second = 0;
  for (Eigen::Index v = 0; v < places; ++v) {
    for (Eigen::Index u = 0; u < places; ++u) {
      if (std::hypot(double(v - row), double(u - column)) >= apart) second = std::max(second, gain(v, u));
    }
  }
  sighting.stands_out = second > 0 ? best / second : kStandsOut * 10;
  const double relative = factor(row, column) / around;
  if (row == 0 || column == 0 || row == places - 1 || column == places - 1) return sighting;
  // A paraboloid through the nine around it.
  const auto g = [&](int v, int u) { return gain(row + v, column + u); };
  const double gu = (g(0, 1) - g(0, -1)) / 2, gv = (g(1, 0) - g(-1, 0)) / 2;
  Eigen::Matrix2d curve;
  curve(0, 0) = g(0, 1) - 2 * g(0, 0) + g(0, -1);
  curve(1, 1) = g(1, 0) - 2 * g(0, 0) + g(-1, 0);
  curve(0, 1) = curve(1, 0) = (g(1, 1) - g(1, -1) - g(-1, 1) + g(-1, -1)) / 4;
  const Eigen::Matrix2d sharp = -curve;
  if (!(sharp(0, 0) > 0) || !(sharp.determinant() > 0)) return sighting;
  Eigen::Vector2d beside = sharp.inverse() * Eigen::Vector2d(gu, gv);
  if (beside.cwiseAbs().maxCoeff() > 1) beside /= beside.cwiseAbs().maxCoeff();
  sighting.offset_px = Eigen::Vector2d(double(column) - search, double(row) - search) + beside;
  const double variance = std::max(left_over - best, 0.0) / (2 * double(side * side)) * kSharedDifferences;
  sighting.covariance_px = 2 * variance * sharp.inverse();
  sighting.seen =
      sighting.stands_out >= kStandsOut && relative >= kLeastFactor && relative <= kGreatestFactor;
  return sighting;
}

/// A place seen, at the tumour's depth, along two axes across the ray, in the patient as the CT has them.
struct SeenPlace {
  std::size_t moment = 0, view = 0;
  Eigen::Matrix<double, 2, 3> across;  // of length 1 each
  Eigen::Vector2d offset_m;            // from where the lung has it
  Eigen::Matrix2d covariance_m2;
};

constexpr Eigen::Index kCorrections = 12;
/// How a shift, the responses to both groups and a lag move the tumour; (3, 12).
Eigen::Matrix<double, 3, kCorrections> corrections_of(const BreathState& state,
                                                      const Vector3& speed_m_per_s) {
  Eigen::Matrix<double, 3, kCorrections> corrections;
  corrections.leftCols<3>().setIdentity();
  corrections.middleCols<3>(3) = state.rib_cage_m * Eigen::Matrix3d::Identity();
  corrections.middleCols<3>(6) = state.diaphragm_m * Eigen::Matrix3d::Identity();
  corrections.rightCols<3>() = speed_m_per_s.asDiagonal();
  return corrections;
}

/// What is known of the corrections, followed by what each view's sightings are off by, along both axes.
struct Correction {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  double left_m2 = kFloorM * kFloorM;  // of each axis, after it
};

/// Before anything was seen. `pose_m2`: of the tumour's place by the pose, in the patient; `pixel_m`: of each
/// view.
Correction known_before(const Eigen::Matrix3d& pose_m2, std::span<const double> pixel_m) {
  Correction known;
  const Eigen::Index count = kCorrections + 2 * static_cast<Eigen::Index>(pixel_m.size());
  known.mean = Eigen::VectorXd::Zero(count);
  Eigen::VectorXd deviation(count);
  deviation.head<kCorrections>() << Vector3::Constant(kTrackShiftM),
      Eigen::Matrix<double, 6, 1>::Constant(kPriorResponse), Vector3::Constant(kPriorLagS);
  for (std::size_t view = 0; view < pixel_m.size(); ++view)
    deviation.segment<2>(kCorrections + 2 * static_cast<Eigen::Index>(view))
        .setConstant(kSharedPixels * pixel_m[view]);
  known.covariance = deviation.cwiseAbs2().asDiagonal();
  known.covariance.topLeftCorner<3, 3>() += pose_m2;
  return known;
}

/// How a place seen depends on what a view's sightings are off by, (2, 2 views).
Eigen::MatrixXd shared_of(const SeenPlace& place, Eigen::Index columns) {
  Eigen::MatrixXd shared = Eigen::MatrixXd::Zero(2, columns);
  shared.middleCols<2>(2 * static_cast<Eigen::Index>(place.view)).setIdentity();
  return shared;
}

/// Least squares with what is known before; places far from it lose their say (Geman and McClure).
Correction correct(const Correction& before, const std::vector<SeenPlace>& places,
                   const std::vector<Eigen::Matrix<double, 3, kCorrections>>& of_moments) {
  Correction correction = before;
  if (places.empty()) return correction;
  const Eigen::MatrixXd prior = before.covariance.inverse();
  const Eigen::Index count = before.mean.size();
  double scale_m2 = 0;
  for (const SeenPlace& place : places) scale_m2 += place.offset_m.squaredNorm() / 2 / double(places.size());
  constexpr int kRounds = 8;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::MatrixXd normal = prior;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
    double squares = 0, weights = 0;
    for (const SeenPlace& place : places) {
      Eigen::MatrixXd slope(2, count);
      slope << place.across * of_moments[place.moment], shared_of(place, count - kCorrections);
      const Eigen::Vector2d left = place.offset_m - slope * correction.mean;
      constexpr double kTimes = 9;  // three deviations
      const double part = 1 / (1 + left.squaredNorm() / 2 / (kTimes * scale_m2)), weight = part * part;
      const Eigen::Matrix2d information =
          weight * (place.covariance_m2 + scale_m2 * Eigen::Matrix2d::Identity()).inverse();
      normal += slope.transpose() * information * slope;
      right += slope.transpose() * information * place.offset_m;
      squares += weight * left.squaredNorm() / 2;
      weights += weight;
    }
    correction.covariance = normal.inverse();
    correction.mean = correction.covariance * right;
    scale_m2 = std::max(squares / weights, kFloorM * kFloorM);
  }
  correction.left_m2 = scale_m2;
  return correction;
}

double median_of(std::vector<double> values) {
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
  return values[values.size() / 2];
}

}  // namespace

const char* name_of(TumourSight sight) {
  switch (sight) {
    case TumourSight::kSeen:
      return "seen";
    case TumourSight::kPredicted:
      return "predicted";
    case TumourSight::kLost:
      break;
  }
  return "lost";
}

TumourTrack track_tumour(const BreathingModel& model, const BreathingScene& scene, const Volume& volume,
                         const std::vector<ProjectionGeometry>& views,
                         std::span<const SeriesPicture> pictures, const SeriesFit& fit) {
  const TumourAlone tumour(model, volume);
  const MeshPoint centre = centre_of(model.mesh, model.needed_tumour());
  const Vector3 rest_m = centre.mean(model.mesh.nodes);
  const Vector3 by_rib_cage = scene.response(BoundaryGroup::kRibCage, centre),
                by_diaphragm = scene.response(BoundaryGroup::kDiaphragm, centre);
  double radius_m = 0;
  for (const Vector3& node : tumour.mesh().nodes) radius_m = std::max(radius_m, (node - rest_m).norm());

  // The lung's own word.
  const std::size_t count = fit.moments.size();
  std::vector<Vector3> moved_m(count);
  for (std::size_t m = 0; m < count; ++m) {
    const BreathState& state = fit.moments[m].state;
    moved_m[m] = state.rib_cage_m * by_rib_cage + state.diaphragm_m * by_diaphragm;
  }
  std::vector<Eigen::Matrix<double, 3, kCorrections>> corrections(count);
  for (std::size_t m = 0; m < count; ++m) {
    const std::size_t before = m == 0 ? 0 : m - 1, after = std::min(m + 1, count - 1);
    const double span_s = fit.moments[after].time_s - fit.moments[before].time_s;
    corrections[m] =
        corrections_of(fit.moments[m].state, Vector3((moved_m[after] - moved_m[before]) / span_s));
  }

  // Each picture, near where the lung has it.
  TumourTrack track;
  track.moments.resize(count);
  std::vector<std::vector<SeenPlace>> seen(count);
  std::vector<double> pixels_m(views.size(), 0);  // at the tumour
  for (std::size_t view = 0; view < views.size(); ++view) {
    const std::size_t factor =
        std::max<std::size_t>(std::min(views[view].columns(), views[view].rows()) / kMostTrackPixels, 1);
    const ProjectionGeometry geometry = views[view].binned(factor).of_moved_patient(fit.pose);
    const ProjectionImage still = scene.still(geometry);
    const Vector3 origin = geometry.source_m();
    const auto at_rest = geometry.project(rest_m);
    if (!at_rest)
      throw Error("the tumour is not in front of the source of geometry " + std::to_string(view + 1));
    pixels_m[view] = at_rest->depth_m * geometry.pixel_rays().along_row.norm();
    for (std::size_t m = 0; m < count; ++m) {
      const SeriesMoment& moment = fit.moments[m];
      for (const std::size_t number : moment.pictures) {
        if (pictures[number].view != view) continue;
        const Vector3 expected_m = rest_m + moved_m[m];
        const auto place = geometry.project(expected_m);
        if (!place) continue;
        const std::vector<Vector3> displacement_m = scene.displacement_m(moment.state);
        ProjectionImage background = scene.moving(geometry, moment.state);
        add_to(background, still);
        const ProjectionImage alone = tumour.project(geometry, displacement_m);
        for (std::size_t i = 0; i < alone.values.size(); ++i) background.values[i] -= alone.values[i];
        const ProjectionImage measured = binned(pictures[number].image, factor);
        const double pixel_m = place->depth_m * geometry.pixel_rays().along_row.norm();
        const Sighting sighting =
            look_for(measured.values, background.values, alone.values, measured.columns, measured.rows,
                     *place, radius_m / pixel_m, static_cast<int>(std::ceil(kSearchM / pixel_m)));
        TumourMoment& told = track.moments[m];
        told.stands_out = std::max(told.stands_out, sighting.stands_out);
        if (!sighting.seen) continue;
        ++told.views_seen;
        SeenPlace there;
        there.moment = m;
        there.view = view;
        const Vector3 ray = (expected_m - origin).normalized();
        Vector3 along = geometry.pixel_rays().along_row;
        along = (along - along.dot(ray) * ray).normalized();
        Vector3 down = geometry.pixel_rays().down_column;
        down = (down - down.dot(ray) * ray - down.dot(along) * along).normalized();
        there.across.row(0) = along;
        there.across.row(1) = down;
        there.offset_m = pixel_m * sighting.offset_px;
        there.covariance_m2 = pixel_m * pixel_m * sighting.covariance_px;
        seen[m].push_back(there);
      }
    }
  }
  std::vector<SeenPlace> all;
  for (const std::vector<SeenPlace>& of_moment : seen)
    all.insert(all.end(), of_moment.begin(), of_moment.end());
  // How unsure the pose makes the tumour's place; along rays that is all that is known.
  const Eigen::Matrix3d turn = fit.pose.linear();
  Eigen::Matrix<double, 3, 6> by_pose;
  const Vector3 arm_m = turn * (rest_m - scene.middle_m());
  by_pose.leftCols<3>().setIdentity();
  by_pose.rightCols<3>() << 0, arm_m.z(), -arm_m.y(), -arm_m.z(), 0, arm_m.x(), arm_m.y(), -arm_m.x(), 0;
  const Eigen::Matrix3d pose_m2 =
      turn.transpose() * by_pose * fit.pose_uncertainty * by_pose.transpose() * turn;
  const Correction correction = correct(known_before(pose_m2, pixels_m), all, corrections);
  for (const SeenPlace& place : all) {
    track.before_correction_m += place.offset_m.squaredNorm() / 2;
    track.after_correction_m +=
        (place.offset_m - place.across * corrections[place.moment] * correction.mean.head<kCorrections>())
            .squaredNorm() /
        2;
  }
  if (!all.empty()) {
    track.before_correction_m = std::sqrt(track.before_correction_m / double(all.size()));
    track.after_correction_m = std::sqrt(track.after_correction_m / double(all.size()));
  }

  // Pictures that do not look like the lung tell nothing of it.
  std::vector<double> similarities, deviations;
  for (const SeriesMoment& moment : fit.moments) similarities.push_back(moment.similarity);
  const double usual = median_of(similarities);
  for (const double similarity : similarities) deviations.push_back(std::abs(similarity - usual));
  constexpr double kTimes = 6;
  const double least = usual - std::max(kTimes * 1.4826 * median_of(deviations), usual / 4);

  for (std::size_t m = 0; m < count; ++m) {
    TumourMoment& told = track.moments[m];
    const SeriesMoment& moment = fit.moments[m];
    told.time_s = moment.time_s;
    if (told.views_seen > 0) {
      told.sight = TumourSight::kSeen;
      ++track.seen;
    } else if (moment.similarity >= least) {
      told.sight = TumourSight::kPredicted;
      ++track.predicted;
    } else {
      ++track.lost;
      continue;
    }
    Eigen::Matrix<double, 3, 2> responses;
    responses << by_rib_cage, by_diaphragm;
    // The offset, then what each view's sightings are off by.
    const Eigen::Index shared = correction.mean.size() - kCorrections;
    Eigen::MatrixXd carried = Eigen::MatrixXd::Zero(3 + shared, correction.mean.size());
    carried.topLeftCorner<3, kCorrections>() = corrections[m];
    carried.bottomRightCorner(shared, shared).setIdentity();
    Eigen::VectorXd offset_m = carried * correction.mean;
    Eigen::MatrixXd covariance = carried * correction.covariance * carried.transpose();
    covariance.topLeftCorner<3, 3>() += responses * moment.covariance * responses.transpose() +
                                        correction.left_m2 * Eigen::Matrix3d::Identity();
    // What is seen now counts beside what is known from all.
    for (const SeenPlace& place : seen[m]) {
      const Eigen::Matrix2d noise =
          place.covariance_m2 + std::max(correction.left_m2, kFloorM * kFloorM) * Eigen::Matrix2d::Identity();
      Eigen::MatrixXd slope(2, 3 + shared);
      slope << place.across, shared_of(place, shared);
      const Eigen::MatrixXd gain =
          covariance * slope.transpose() * (slope * covariance * slope.transpose() + noise).inverse();
      offset_m += gain * (place.offset_m - slope * offset_m);
      covariance -= (gain * slope * covariance).eval();
    }
    const Vector3 in_patient_m = rest_m + moved_m[m] + offset_m.head<3>();
    told.place_m = fit.pose * in_patient_m;
    told.covariance = turn * covariance.topLeftCorner<3, 3>() * turn.transpose();
  }
  return track;
}

std::string track_csv(const TumourTrack& track) {
  constexpr double kMillimetres = 1000;
  std::string text = "time_s,x_mm,y_mm,z_mm,error_x_mm,error_y_mm,error_z_mm,sight,views_seen\r\n";
  for (const TumourMoment& moment : track.moments) {
    text += exact_text(moment.time_s);
    const bool told = moment.sight != TumourSight::kLost;
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      text += "," + (told ? number_text(kMillimetres * moment.place_m[axis], 6) : std::string());
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      text += "," + (told ? number_text(kMillimetres * std::sqrt(moment.covariance(axis, axis)), 3)
                          : std::string());
    }
    text += std::string(",") + name_of(moment.sight) + "," + std::to_string(moment.views_seen) + "\r\n";
  }
  return text;
}

}  // namespace kiroku::sim
