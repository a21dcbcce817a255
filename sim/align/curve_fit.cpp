#include "sim/align/curve_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <thread>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "base/error.h"
#include "base/parallel.h"
#include "sim/align/border.h"
#include "sim/align/polyline.h"

namespace kiroku::sim {
namespace {

using Eigen::Vector2d;

/// A curve as it is compared.
struct Sampled {
  std::vector<Vector2d> pixels;    // evenly along it
  std::vector<Vector2d> tangents;  // of length 1, at these
  std::vector<Vector3> line_m;     // evenly along it; empty for the outline
};

std::vector<Sampled> sampled(const std::vector<DrawnCurve>& curves, double spacing_px) {
  if (curves.empty())
    throw UsageError("no curve is drawn in the picture, so the organ cannot be laid on one");
  std::vector<Sampled> all;
  for (std::size_t i = 0; i < curves.size(); ++i) {
    const DrawnCurve& curve = curves[i];
    const std::string which = "curve " + std::to_string(i + 1);
    const auto is_sound = [](const auto& line) {
      const double length = polyline_length(line);
      return line.size() >= 2 && length > 0 && std::isfinite(length);
    };
    if (!is_sound(curve.pixels)) throw UsageError(which + " in the picture has no length: draw it longer");
    if (!curve.line_m.empty() && !is_sound(curve.line_m))
      throw UsageError("the line on the organ that " + which + " shows has no length: mark it longer");
    Sampled& made = all.emplace_back();
    constexpr std::size_t kLeast = 8, kOnLine = 32;
    const auto count = static_cast<std::size_t>(polyline_length(curve.pixels) / spacing_px) + 1;
    made.pixels = spread_over_polyline(curve.pixels, std::max(kLeast, count));
    for (std::size_t k = 0; k < made.pixels.size(); ++k) {
      const Vector2d way =
          made.pixels[std::min(k + 1, made.pixels.size() - 1)] - made.pixels[k > 0 ? k - 1 : 0];
      made.tangents.push_back(way.normalized());
    }
    // Every marked place stays one, or a bend would be cut off.
    if (curve.line_m.empty()) continue;
    const double step_m = polyline_length(curve.line_m) / double(kOnLine);
    for (std::size_t k = 0; k + 1 < curve.line_m.size(); ++k) {
      const Vector3 way = curve.line_m[k + 1] - curve.line_m[k];
      const int parts = std::max(1, static_cast<int>(std::lround(way.norm() / step_m)));
      for (int part = 0; part < parts; ++part) made.line_m.emplace_back(curve.line_m[k] + part * way / parts);
    }
    made.line_m.push_back(curve.line_m.back());
  }
  return all;
}

/// What one camera makes of the curves.
struct Compared {
  double cost = std::numeric_limits<double>::infinity();  // px^2: mean over the curves of the mean square
  MotionCovariance information = MotionCovariance::Zero();
  Motion pull = Motion::Zero();
  std::vector<double> curve_px2;
  std::vector<MotionCovariance> curve_information;  // of each, weights of sum 1
  std::vector<double> curve_shared;                 // so many neighbours say the same as one
};

class Comparison {
 public:
  Comparison(const OrganSurface& surface, const Pinhole& pinhole, int width, int height,
             const std::vector<Sampled>& curves, const CurveFitOptions& options)
      : surface_(surface),
        pinhole_(pinhole),
        width_(width),
        height_(height),
        curves_(curves),
        options_(options) {}

  /// An infinite cost where a camera does not see the curves. `of_outline`: whether these count.
  [[nodiscard]] Compared operator()(const Camera& camera, bool of_outline) const {
    Compared made;
    std::optional<std::vector<OutlinePoint>> outline;
    if (of_outline && std::ranges::any_of(curves_, &is_outline)) {
      outline =
          outline_around(surface_, camera, pinhole_, width_, height_, options_.spacing_px, options_.shrink);
      if (!outline) return made;
    }
    double sum = 0, counted = 0;
    for (const Sampled& curve : curves_) {
      if (is_outline(curve) && !of_outline) continue;
      Rows rows(*this, camera);
      if (is_outline(curve)) {
        compare_with_outline(curve, *outline, rows);
      } else if (!compare_with_line(curve, camera, rows)) {
        return made;
      }
      made.information += rows.information;
      made.pull += rows.pull;
      made.curve_px2.push_back(rows.square);
      made.curve_information.push_back(rows.information);
      made.curve_shared.push_back(std::min(double(curve.pixels.size()), correlation_length(rows.along)));
      sum += rows.square;
      counted += 1;
    }
    made.cost = sum / counted;
    return made;
  }

  [[nodiscard]] const OrganSurface& surface() const { return surface_; }

 private:
  static bool is_outline(const Sampled& curve) { return curve.line_m.empty(); }

  /// Of one curve.
  struct Rows {
    Rows(const Comparison& of, const Camera& camera)
        : pinhole(of.pinhole_), middle(camera.view_m(of.surface_.middle_m)), radius_m(of.surface_.radius_m) {}
    /// A place of the organ that should come nearer by `off`, along `normal` alone unless it is zero.
    void add(double weight, const Vector3& view_m, const Vector2d& off, const Vector2d& normal) {
      const Eigen::Matrix<double, 2, 6> both = pinhole.derivative(view_m, middle, radius_m);
      square += weight * off.squaredNorm();
      if (normal.isZero()) {
        information += weight * both.transpose() * both;
        pull += weight * both.transpose() * off;
        return;
      }
      const Eigen::Matrix<double, 1, 6> row = normal.transpose() * both;
      information += weight * row.transpose() * row;
      pull += weight * row.transpose() * normal.dot(off);
    }
    const Pinhole& pinhole;
    Vector3 middle;
    double radius_m, square = 0;
    MotionCovariance information = MotionCovariance::Zero();
    Motion pull = Motion::Zero();
    std::vector<double> along;  // residuals at the curve's places, in their order
  };

  /// Whether all of the line is before the eye.
  bool compare_with_line(const Sampled& curve, const Camera& camera, Rows& rows) const {
    constexpr double kNearestM = 0.003;  // a lens touches what is nearer
    std::vector<Vector3> views;
    std::vector<Vector2d> seen;
    for (const Vector3& place : curve.line_m) {
      views.push_back(camera.view_m(place));
      if (!(-views.back().z() > kNearestM)) return false;
      seen.push_back(pinhole_.pixel(views.back()));
    }
    const auto normal_of = [](const NearestOnPolyline& nearest,
                              const std::vector<Vector2d>& line) -> Vector2d {
      if (nearest.is_end) return Vector2d::Zero();
      const Vector2d way = (line[nearest.segment + 1] - line[nearest.segment]).normalized();
      return {-way.y(), way.x()};
    };
    const double each_seen = 0.5 / double(seen.size()), each_drawn = 0.5 / double(curve.pixels.size());
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const NearestOnPolyline nearest = nearest_on_polyline(curve.pixels, seen[i]);
      rows.add(each_seen, views[i], nearest.at - seen[i], normal_of(nearest, curve.pixels));
    }
    for (const Vector2d& pixel : curve.pixels) {
      const NearestOnPolyline nearest = nearest_on_polyline(seen, pixel);
      const Vector2d normal = normal_of(nearest, seen), off = pixel - nearest.at;
      const Vector3 view =
          (1 - nearest.share) * views[nearest.segment] + nearest.share * views[nearest.segment + 1];
      rows.add(each_drawn, view, off, normal);
      rows.along.push_back(normal.isZero() ? off.norm() : normal.dot(off));
    }
    return true;
  }

  void compare_with_outline(const Sampled& curve, const std::vector<OutlinePoint>& outline,
                            Rows& rows) const {
    const double farthest_px = std::min(width_, height_) / 2.0, each = 1 / double(curve.pixels.size());
    // An outline runs along its curve.
    constexpr double kAcross = 0.5;
    for (std::size_t i = 0; i < curve.pixels.size(); ++i) {
      const OutlinePoint* nearest = nullptr;
      double squared = farthest_px * farthest_px;
      for (const OutlinePoint& point : outline) {
        const double here = (curve.pixels[i] - point.pixel).squaredNorm();
        if (here >= squared || std::abs(point.outward.dot(curve.tangents[i])) > kAcross) continue;
        squared = here;
        nearest = &point;
      }
      if (nearest == nullptr) {
        rows.square += each * squared;
        rows.along.push_back(farthest_px);
        continue;
      }
      const Vector2d off = curve.pixels[i] - nearest->pixel;
      rows.add(each, nearest->view_m, off, nearest->outward);
      rows.along.push_back(nearest->outward.dot(off));
    }
  }

  const OrganSurface& surface_;
  const Pinhole& pinhole_;
  int width_, height_;
  const std::vector<Sampled>& curves_;
  const CurveFitOptions& options_;
};

struct Solved {
  Camera camera;
  Compared compared;
};

/// The nearest minimum, by Levenberg and Marquardt.
std::optional<Solved> solved(const Comparison& comparison, const Camera& begin, bool of_outline,
                             int most_rounds) {
  Solved now{begin, comparison(begin, of_outline)};
  if (!std::isfinite(now.compared.cost)) return {};
  constexpr double kLeastDamping = 1e-9, kMostDamping = 1e6, kShortest = 1e-6;
  double damping = 1e-3;
  for (int round = 0; round < most_rounds && damping < kMostDamping; ++round) {
    MotionCovariance damped = now.compared.information;
    damped.diagonal() *= 1 + damping;
    damped.diagonal().array() += kLeastDamping * now.compared.information.trace();
    const Motion step = damped.ldlt().solve(now.compared.pull);
    if (!step.allFinite()) break;
    Solved next;
    next.camera = after_motion(comparison.surface(), now.camera, step);
    next.compared = comparison(next.camera, of_outline);
    if (!(next.compared.cost < now.compared.cost)) {
      damping *= 4;
      continue;
    }
    now = std::move(next);
    damping = std::max(kLeastDamping, damping / 4);
    if (step.norm() < kShortest) break;
  }
  return now;
}

CurveFit concluded(const Solved& solved) {
  CurveFit fit;
  fit.camera = solved.camera;
  fit.misfit_px = std::sqrt(solved.compared.cost);
  MotionCovariance information = MotionCovariance::Zero();
  constexpr double kFloorPx = 0.4, kFloor = 1e-6;
  for (std::size_t i = 0; i < solved.compared.curve_px2.size(); ++i) {
    fit.curve_px.push_back(std::sqrt(solved.compared.curve_px2[i]));
    // A tenth of the fit's misfit at least, as a curve that fits by chance would else decide.
    const double variance =
        std::max({kFloorPx * kFloorPx, solved.compared.curve_px2[i], solved.compared.cost / 100});
    information += solved.compared.curve_information[i] / variance / solved.compared.curve_shared[i];
  }
  information += kFloor * information.trace() * MotionCovariance::Identity();
  fit.covariance_m2 = information.ldlt().solve(MotionCovariance::Identity());
  return fit;
}

/// Its lines' middle where the curves' middle is, as far as their sizes say.
std::optional<Camera> begun(const OrganSurface& surface, const Pinhole& pinhole, const Eigen::Matrix3d& view,
                            const std::vector<Sampled>& curves) {
  Vector2d drawn = Vector2d::Zero();
  Vector3 marked = Vector3::Zero();
  double lines = 0;
  for (const Sampled& curve : curves) {
    if (curve.line_m.empty()) continue;
    lines += 1;
    for (const Vector2d& each : curve.pixels) drawn += each / double(curve.pixels.size());
    for (const Vector3& each : curve.line_m) marked += each / double(curve.line_m.size());
  }
  drawn /= lines;
  marked /= lines;
  double drawn_px2 = 0, marked_m2 = 0;
  for (const Sampled& curve : curves) {
    if (curve.line_m.empty()) continue;
    for (const Vector2d& each : curve.pixels)
      drawn_px2 += (each - drawn).squaredNorm() / double(curve.pixels.size());
    for (const Vector3& each : curve.line_m)
      marked_m2 += (view.topRows<2>() * (each - marked)).squaredNorm() / double(curve.line_m.size());
  }
  if (!(marked_m2 > 0) || !(drawn_px2 > 0)) return {};
  const double depth_m = pinhole.focal_px * std::sqrt(marked_m2 / drawn_px2);
  const Vector3 ray = pinhole.place_m(drawn, 1);
  // The organ turns with the ray that it is seen along.
  const Eigen::Matrix3d to_view =
      Eigen::Quaterniond::FromTwoVectors(-Vector3::UnitZ(), ray.normalized()).toRotationMatrix() * view;
  return camera_before(surface, to_view, ray * depth_m + to_view * (surface.middle_m - marked));
}

}  // namespace

std::optional<std::vector<OutlinePoint>> outline_around(const OrganSurface& surface, const Camera& camera,
                                                        const Pinhole& pinhole, int width, int height,
                                                        double spacing_px, int shrink) {
  // A picture with room around it; whole silhouette pixels wide.
  const int room = (std::min(width, height) / 2 + shrink - 1) / shrink * shrink;
  Pinhole wide = pinhole;
  wide.middle_x += room;
  wide.middle_y += room;
  const auto silhouette = silhouette_of(surface, camera, wide, width + 2 * room, height + 2 * room, shrink);
  if (!silhouette) return {};
  Outline outline = outline_of(surface, camera, wide, *silhouette, spacing_px, kMarginPx);
  for (OutlinePoint& point : outline.points) point.pixel -= Vector2d::Constant(room);
  return std::move(outline.points);
}

std::optional<CurveFit> fit_curves(const OrganSurface& surface, const Pinhole& pinhole, int width, int height,
                                   const Camera& begin, const std::vector<DrawnCurve>& curves,
                                   const CurveFitOptions& options) {
  const std::vector<Sampled> compared = sampled(curves, options.spacing_px);
  const Comparison comparison(surface, pinhole, width, height, compared, options);
  const auto best = solved(comparison, begin, true, options.most_rounds);
  if (!best) return {};
  return concluded(*best);
}

std::vector<CurveFit> find_curves(const OrganSurface& surface, const SearchRange& range,
                                  const Pinhole& pinhole, int width, int height,
                                  const std::vector<DrawnCurve>& curves, const CurveFitOptions& options) {
  const std::vector<Sampled> compared = sampled(curves, options.spacing_px);
  if (std::ranges::all_of(compared, [](const Sampled& curve) { return curve.line_m.empty(); }))
    throw UsageError(
        "no curve in the picture shows a line that is marked on the organ, so there is nowhere to begin: "
        "mark "
        "a ridge or a ligament on it");
  const Comparison comparison(surface, pinhole, width, height, compared, options);
  const unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  // From each start by the lines alone, as an outline must be drawn each time; the best again, better.
  const auto from_each = [&](const Comparison& by, const std::vector<Camera>& begin, bool of_outline,
                             int most_rounds) {
    std::vector<std::optional<Solved>> each(begin.size());
    for_each_part(begin.size(), threads,
                  [&](std::size_t i) { each[i] = solved(by, begin[i], of_outline, most_rounds); });
    std::vector<Solved> found;
    for (auto& one : each) {
      const auto depth_m = [&] { return -one->camera.view_m(surface.middle_m).z(); };
      if (one && depth_m() >= range.nearest_m && depth_m() <= range.farthest_m)
        found.push_back(std::move(*one));
    }
    std::ranges::stable_sort(found, {}, [](const Solved& one) { return one.compared.cost; });
    return found;
  };
  const auto different = [&](const std::vector<Solved>& found, std::size_t most) {
    constexpr double kSame = 0.08;  // of the organ's radius
    return different_places(surface, found, kSame, most);
  };
  const auto best_of = [](const std::vector<Solved>& all, std::size_t most) {
    std::vector<Camera> cameras;
    for (const Solved& each : all) {
      if (cameras.size() < most) cameras.push_back(each.camera);
    }
    return cameras;
  };
  const auto cameras_of = [&](const std::vector<Solved>& all) { return best_of(all, all.size()); };

  std::vector<Camera> starts;
  for (const Eigen::Matrix3d& view : views_within(range)) {
    auto camera = begun(surface, pinhole, view, compared);
    if (!camera) continue;
    set_picture(*camera, pinhole, width, height);
    starts.push_back(*camera);
  }
  constexpr int kFirstRounds = 12;
  constexpr std::size_t kTried = 24, kFinished = 12;
  std::vector<Camera> cameras =
      cameras_of(different(from_each(comparison, starts, false, kFirstRounds), kTried));
  if (std::ranges::any_of(compared, [](const Sampled& curve) { return curve.line_m.empty(); })) {
    // Lines leave much open, which the outline says; where they fit best alone it may be out of reach.
    CurveFitOptions coarse = options;
    coarse.spacing_px *= 2;
    coarse.shrink *= 3;
    const Comparison roughly(surface, pinhole, width, height, compared, coarse);
    constexpr std::size_t kByLines = 800, kByAll = 96;
    const std::vector<Camera> by_lines = best_of(from_each(comparison, starts, false, 0), kByLines),
                              by_all = best_of(from_each(roughly, by_lines, true, 0), kByAll);
    const auto begun_anew = different(from_each(roughly, by_all, true, kFirstRounds), kTried);
    std::ranges::copy(cameras_of(begun_anew), std::back_inserter(cameras));
  }
  std::vector<CurveFit> fits;
  for (const Solved& one : different(from_each(comparison, cameras, true, options.most_rounds), kFinished))
    fits.push_back(concluded(one));
  return fits;
}

}  // namespace kiroku::sim
