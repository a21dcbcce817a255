#include "sim/respiration/beam_tracking.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <unordered_set>

#include <Eigen/Cholesky>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/length_unit.h"

namespace kiroku::sim {
namespace {

constexpr double kMostPlaces = 1e6;
// What a place is predicted from: the changes since so many moments of the last second.
constexpr int kTaps = 10;
constexpr double kTapS = 0.1;
// After so long, what was learnt counts 1/e.
constexpr double kMemoryS = 20;
// Keeps the fit determined where a breath repeats exactly; against squares of millimetres.
constexpr double kRidgeMm2 = 1e-3;
constexpr double kLeastJudgedS = 10;

double degrees(double radians) { return radians * 180 / std::numbers::pi; }

/// Least squares of one axis, learnt as time goes on.
class AxisPredictor {
 public:
  using Features = Eigen::Matrix<double, kTaps + 1, 1>;

  explicit AxisPredictor(double forgetting) : forgetting_(forgetting) {}
  void learn(const Features& features, double change_mm) {
    squares_ = forgetting_ * squares_ + features * features.transpose();
    products_ = forgetting_ * products_ + change_mm * features;
  }
  [[nodiscard]] double predict(const Features& features) const {
    const Squares determined = squares_ + kRidgeMm2 * Squares::Identity();
    return features.dot(determined.ldlt().solve(products_).eval());
  }

 private:
  using Squares = Eigen::Matrix<double, kTaps + 1, kTaps + 1>;
  double forgetting_;
  Squares squares_ = Squares::Zero();
  Features products_ = Features::Zero();
};

std::size_t steps_of(double time_s, double step_s) {
  return static_cast<std::size_t>(std::max(1L, std::lround(time_s / step_s)));
}

/// The changes of one axis from earlier moments to `at`, mm, and a constant.
AxisPredictor::Features features_at(const std::vector<Vector3>& points_m, std::size_t at, std::size_t tap,
                                    Eigen::Index axis) {
  AxisPredictor::Features features;
  for (int k = 0; k < kTaps; ++k) {
    const std::size_t earlier = at - static_cast<std::size_t>(k + 1) * tap;
    features[k] = kMmPerM * (points_m[at][axis] - points_m[earlier][axis]);
  }
  features[kTaps] = 1;
  return features;
}

/// The places, no two of which are nearer to each other than a cell's side or so: as many as a volume needs.
std::vector<Vector3> thinned(const std::vector<Vector3>& points_m, double cell_m) {
  struct Hash {
    std::size_t operator()(const std::array<long, 3>& cell) const {
      return static_cast<std::size_t>(cell[0] * 73856093L ^ cell[1] * 19349663L ^ cell[2] * 83492791L);
    }
  };
  std::unordered_set<std::array<long, 3>, Hash> seen;
  std::vector<Vector3> kept;
  for (const Vector3& point : points_m) {
    const std::array<long, 3> cell{std::lround(point.x() / cell_m), std::lround(point.y() / cell_m),
                                   std::lround(point.z() / cell_m)};
    if (seen.insert(cell).second) kept.push_back(point);
  }
  return kept;
}

/// Voxels whose centre is within a radius of one of the places: a field.
class Swept {
 public:
  Swept(const std::vector<Vector3>& points_m, double radius_m, double voxel_m)
      : voxel_m_(voxel_m), radius_m_(radius_m), places_m_(thinned(points_m, voxel_m / 4)) {
    low_ = high_ = places_m_.front();
    for (const Vector3& place : places_m_) {
      low_ = low_.cwiseMin(place);
      high_ = high_.cwiseMax(place);
    }
    low_ -= Vector3::Constant(radius_m + voxel_m);
    for (int axis = 0; axis < 3; ++axis) {
      size_[static_cast<std::size_t>(axis)] =
          static_cast<std::size_t>(std::ceil((high_[axis] + radius_m + voxel_m - low_[axis]) / voxel_m)) + 1;
    }
    covered_.assign(size_[0] * size_[1] * size_[2], false);
    for (const Vector3& place : places_m_) cover(place);
  }

  /// The places, thinned to a quarter of a voxel.
  [[nodiscard]] const std::vector<Vector3>& places_m() const { return places_m_; }
  [[nodiscard]] double volume_m3() const {
    return static_cast<double>(std::ranges::count(covered_, true)) * voxel_m_ * voxel_m_ * voxel_m_;
  }

 private:
  [[nodiscard]] std::size_t index(const std::array<std::size_t, 3>& cell) const {
    return (cell[2] * size_[1] + cell[1]) * size_[0] + cell[0];
  }
  void cover(const Vector3& place) {
    std::array<std::size_t, 3> first{}, last{};
    for (int axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<std::size_t>(axis);
      first[i] = static_cast<std::size_t>(
          std::max(0.0, std::floor((place[axis] - radius_m_ - low_[axis]) / voxel_m_)));
      last[i] =
          std::min(size_[i] - 1, static_cast<std::size_t>((place[axis] + radius_m_ - low_[axis]) / voxel_m_));
    }
    for (std::size_t z = first[2]; z <= last[2]; ++z) {
      for (std::size_t y = first[1]; y <= last[1]; ++y) {
        for (std::size_t x = first[0]; x <= last[0]; ++x) {
          const Vector3 centre = low_ + voxel_m_ * Vector3(double(x) + 0.5, double(y) + 0.5, double(z) + 0.5);
          if ((centre - place).squaredNorm() <= radius_m_ * radius_m_) covered_[index({x, y, z})] = true;
        }
      }
    }
  }

  double voxel_m_, radius_m_;
  std::vector<Vector3> places_m_;
  Vector3 low_, high_;
  std::array<std::size_t, 3> size_{};
  std::vector<bool> covered_;
};

/// Centres of the voxels of a ball about zero.
std::vector<Vector3> ball(double radius_m, double voxel_m) {
  std::vector<Vector3> voxels;
  const auto reach = static_cast<int>(std::ceil(radius_m / voxel_m));
  for (int z = -reach; z <= reach; ++z) {
    for (int y = -reach; y <= reach; ++y) {
      for (int x = -reach; x <= reach; ++x) {
        const Vector3 centre = voxel_m * Vector3(x, y, z);
        if (centre.norm() <= radius_m) voxels.push_back(centre);
      }
    }
  }
  return voxels;
}

/// What the beam is on for: places within a distance of one that has many others around it.
struct Gate {
  Vector3 centre_m;
  double reach_m = 0;
  [[nodiscard]] bool is_open(const Vector3& place_m) const { return (place_m - centre_m).norm() <= reach_m; }
};

/// The narrowest that is open for this part of the time.
Gate gate_of(const std::vector<Vector3>& points_m, double duty) {
  const auto open = static_cast<std::ptrdiff_t>(
      std::clamp(std::lround(duty * double(points_m.size())), 1L, static_cast<long>(points_m.size())));
  Gate gate{points_m.front(), INFINITY};
  std::vector<double> distances(points_m.size());
  for (const Vector3& centre : thinned(points_m, std::max(1e-5, excursion_m({1, points_m}) / 100))) {
    std::ranges::transform(points_m, distances.begin(),
                           [&](const Vector3& point) { return (point - centre).norm(); });
    std::ranges::nth_element(distances, distances.begin() + (open - 1));
    const double reach_m = distances[static_cast<std::size_t>(open - 1)];
    if (reach_m < gate.reach_m) gate = {centre, reach_m};
  }
  return gate;
}

/// How much of the tumour the beam met while it was on.
class Coverage {
 public:
  Coverage(double radius_m, double margin_m, double voxel_m)
      : margin_m_(margin_m), field_m_(radius_m + margin_m), tumour_(ball(radius_m, voxel_m)) {}
  /// The field is balls around `places_m`, one at least.
  void count(const Vector3& tumour_m, const std::vector<Vector3>& places_m) {
    all_ += tumour_.size();
    double nearest_m = INFINITY;
    for (const Vector3& place : places_m) nearest_m = std::min(nearest_m, (tumour_m - place).norm());
    if (nearest_m <= margin_m_) {
      covered_ += tumour_.size();
      return;
    }
    for (const Vector3& voxel : tumour_) {
      const bool met = std::ranges::any_of(places_m, [&](const Vector3& place) {
        return (tumour_m + voxel - place).squaredNorm() <= field_m_ * field_m_;
      });
      covered_ += met ? 1 : 0;
    }
  }
  [[nodiscard]] double part() const { return all_ == 0 ? 0 : double(covered_) / double(all_); }

 private:
  double margin_m_, field_m_;
  std::vector<Vector3> tumour_;
  std::size_t covered_ = 0, all_ = 0;
};

void require_finite(double value, const char* what, double least, double most) {
  if (value >= least && value <= most) return;
  throw Error(std::string(what) + " is " + number_text(value) + "; it must be from " + number_text(least) +
              " to " + number_text(most));
}

}  // namespace

SampledPath sampled(const TimedPath& path, double rate_hz, std::optional<double> breaths_s) {
  const double duration_s = breaths_s.value_or(path.times_s.back() - path.times_s.front());
  const double places = std::floor(duration_s * rate_hz * (1 + 1e-12)) + 1;
  if (!(places >= 3))
    throw Error("a path of " + number_text(duration_s) + " s is shorter than two of its steps");
  if (places > kMostPlaces)
    throw Error("a path of " + number_text(duration_s) +
                " s has more than a million places; take a lower rate");
  SampledPath result{1 / rate_hz, {}};
  for (std::size_t i = 0; i < static_cast<std::size_t>(places); ++i) {
    const double time_s = path.times_s.front() + double(i) / rate_hz;
    result.points_m.push_back(breaths_s ? path.place_in_breath(time_s)
                                        : path.place_at(std::min(time_s, path.times_s.back())).value());
  }
  return result;
}

double excursion_m(const SampledPath& path) {
  // The two that are furthest apart are among those that lie outermost in one of many directions.
  constexpr int kDirections = 200;
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  double greatest = 0;
  for (int i = 0; i < kDirections; ++i) {
    const double z = (i + 0.5) / kDirections, across = std::sqrt(1 - z * z);
    const Vector3 direction(across * std::cos(golden * i), across * std::sin(golden * i), z);
    const auto along = [&](const Vector3& point) { return direction.dot(point); };
    const auto [least, most] = std::ranges::minmax_element(path.points_m, {}, along);
    greatest = std::max(greatest, (*most - *least).norm());
  }
  return greatest;
}

SampledPath scaled_to(const SampledPath& path, double excursion) {
  const double now = excursion_m(path);
  if (!(now > 0)) throw Error("the path does not move, so no excursion can be given to it");
  Vector3 middle = Vector3::Zero();
  for (const Vector3& point : path.points_m) middle += point / double(path.points_m.size());
  SampledPath result = path;
  for (Vector3& point : result.points_m) point = middle + excursion / now * (point - middle);
  return result;
}

GimbalAngles gimbal_angles(const BeamHead& head, const Vector3& place_m) {
  const double angle = head.gantry_deg * std::numbers::pi / 180;
  const Vector3 to_source(std::sin(angle), -std::cos(angle), 0);
  const Vector3 aside(std::cos(angle), std::sin(angle), 0), to_head = Vector3::UnitZ();
  const Vector3 ray = place_m - (head.isocenter_m + head.source_axis_m * to_source);
  const double depth = -ray.dot(to_source);
  if (!(depth > 0)) throw Error("a place of the tumour is not in front of the source; look at the isocentre");
  return {degrees(std::atan2(ray.dot(aside), depth)), degrees(std::atan2(ray.dot(to_head), depth))};
}

std::vector<Vector3> predicted(const SampledPath& path, double latency_s) {
  const std::size_t ahead = steps_of(latency_s, path.step_s), tap = steps_of(kTapS, path.step_s);
  const std::size_t needed = static_cast<std::size_t>(kTaps) * tap;
  const std::vector<Vector3>& points = path.points_m;
  std::vector<Vector3> result = points;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    AxisPredictor predictor(std::exp(-path.step_s / kMemoryS));
    for (std::size_t at = needed + ahead; at < points.size(); ++at) {
      predictor.learn(features_at(points, at - ahead, tap, axis),
                      kMmPerM * (points[at][axis] - points[at - ahead][axis]));
      result[at][axis] += predictor.predict(features_at(points, at, tap, axis)) / kMmPerM;
    }
  }
  return result;
}

LatencyError latency_error(const SampledPath& path, double latency_s) {
  const std::size_t ahead = steps_of(latency_s, path.step_s), first = steps_of(kLearningS, path.step_s);
  if (double(path.points_m.size()) * path.step_s < kLearningS + latency_s + kLeastJudgedS) {
    throw Error("a path of " + number_text(double(path.points_m.size()) * path.step_s) +
                " s is too short to learn from and to judge: it takes 10 s of each, and the latency");
  }
  const std::vector<Vector3> foreseen = predicted(path, latency_s);
  std::vector<double> delayed_mm, predicted_mm;
  for (std::size_t at = first; at + ahead < path.points_m.size(); ++at) {
    const Vector3& then = path.points_m[at + ahead];
    delayed_mm.push_back(kMmPerM * (path.points_m[at] - then).norm());
    predicted_mm.push_back(kMmPerM * (foreseen[at] - then).norm());
  }
  return {double(ahead) * path.step_s, spread_of(std::move(delayed_mm)), spread_of(std::move(predicted_mm))};
}

BeamFields beam_fields(const SampledPath& path, const BeamFieldTerms& terms) {
  require_finite(terms.tumour_m3, "the tumour's volume (m3)", 1e-9, 1e-2);
  require_finite(terms.margin_m, "the margin (m)", 0, 0.1);
  require_finite(terms.duty, "the gate's part of the time", 1e-3, 1);
  const double radius_m = std::cbrt(3 * terms.tumour_m3 / (4 * std::numbers::pi));
  const double field_m = radius_m + terms.margin_m;
  constexpr double kVoxelsOfRadius = 20, kLeastVoxelM = 0.00025, kMostVoxelM = 0.001;
  const double voxel_m = std::clamp(field_m / kVoxelsOfRadius, kLeastVoxelM, kMostVoxelM);
  // What is further is no tumour's way, and would take more voxels than there is memory for.
  constexpr double kMostExcursionM = 0.3, kMostFarM = 100;
  const auto is_near = [](const Vector3& place) { return place.cwiseAbs().maxCoeff() < kMostFarM; };
  if (!std::ranges::all_of(path.points_m, is_near) || excursion_m(path) > kMostExcursionM) {
    throw Error("the path goes over " + number_text(1000 * excursion_m(path), 3) +
                " mm, further than a tumour does (300 mm); look at its unit");
  }
  if (path.points_m.size() < 10)
    throw Error("a path of fewer than ten places cannot be planned on and judged");
  const std::size_t half = path.points_m.size() / 2;
  const std::vector<Vector3> planned(path.points_m.begin(), path.points_m.begin() + std::ptrdiff_t(half));
  const Gate gate = gate_of(planned, terms.duty);
  std::vector<Vector3> gated;
  std::ranges::copy_if(planned, std::back_inserter(gated),
                       [&](const Vector3& place) { return gate.is_open(place); });
  const Swept covering(planned, field_m, voxel_m), gating(gated, field_m, voxel_m),
      following({Vector3::Zero()}, field_m, voxel_m);
  BeamFields fields;
  fields.tumour_m3 = terms.tumour_m3;
  fields.covering_m3 = covering.volume_m3();
  fields.gating_m3 = gating.volume_m3();
  fields.following_m3 = following.volume_m3();

  const double tumour_voxel_m = radius_m / 8;
  Coverage of_covering(radius_m, terms.margin_m, tumour_voxel_m), of_gating = of_covering,
                                                                  of_following = of_covering;
  const std::size_t ahead = steps_of(terms.latency_s, path.step_s);
  const std::vector<Vector3> foreseen = predicted(path, terms.latency_s);
  constexpr std::size_t kMostMoments = 500;
  const std::size_t every = std::max<std::size_t>(1, half / kMostMoments);
  std::size_t moments = 0, open = 0;
  for (std::size_t at = std::max(half, ahead); at < path.points_m.size(); at += every) {
    const Vector3& place = path.points_m[at];
    ++moments;
    of_covering.count(place, covering.places_m());
    of_following.count(place, {foreseen[at - ahead]});
    if (!gate.is_open(path.points_m[at - ahead])) continue;
    ++open;
    of_gating.count(place, gating.places_m());
  }
  fields.duty = double(open) / double(std::max<std::size_t>(1, moments));
  fields.covering_covered = of_covering.part();
  fields.gating_covered = of_gating.part();
  fields.following_covered = of_following.part();
  return fields;
}

}  // namespace kiroku::sim
