#include "sim/align/outline_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "sim/align/border.h"

namespace kiroku::sim {
namespace {

/// A normal of the outline, and what the picture says along it.
struct Line {
  Vector3 view_m;
  Eigen::Matrix<double, 1, 6> derivative;  // of the outline along the normal
  double angle = 0;                        // about the silhouette's middle: neighbours along the outline
  Border border;
};

std::vector<Line> lines_of(const ColourCells& cells, const OrganSurface& surface, const Pinhole& pinhole,
                           const Camera& camera, const Outline& outline, const ColourModel& model,
                           int reach) {
  const Vector3 middle = camera.view_m(surface.middle_m);
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (const OutlinePoint& point : outline.points) centre += point.pixel / double(outline.points.size());
  std::vector<Line> lines;
  lines.reserve(outline.points.size());
  for (const OutlinePoint& point : outline.points) {
    Line& line = lines.emplace_back();
    line.view_m = point.view_m;
    line.derivative = point.outward.transpose() * pinhole.derivative(point.view_m, middle, surface.radius_m);
    line.angle = std::atan2(point.pixel.y() - centre.y(), point.pixel.x() - centre.x());
    line.border = seek_border(cells, model, point, reach);
  }
  std::ranges::sort(lines, {}, &Line::angle);
  return lines;
}

struct Normal {
  MotionCovariance information = MotionCovariance::Zero();
  Motion pull = Motion::Zero();
  Motion swelling = Motion::Zero();  // the pull of a border that is a pixel too far outside everywhere
  std::vector<double> residuals;
  double scale_px = 0;
};

Normal normal_of(const std::vector<Line>& lines) {
  Normal normal;
  for (const Line& line : lines) {
    if (line.border.supported) normal.residuals.push_back(line.border.off_px);
  }
  if (normal.residuals.size() < kLeastLines / 2) return normal;
  normal.scale_px = scale_of(normal.residuals);
  constexpr double kTukey = 4.685;
  for (const Line& line : lines) {
    if (!line.border.supported) continue;
    const double variance = normal.scale_px * normal.scale_px + line.border.variance_px2;
    const double weight = tukey(line.border.off_px, kTukey * std::sqrt(variance)) / variance;
    normal.information += weight * line.derivative.transpose() * line.derivative;
    normal.pull += weight * line.derivative.transpose() * line.border.off_px;
    normal.swelling += weight * line.derivative.transpose();
  }
  return normal;
}

MotionCovariance inverse(const MotionCovariance& of) { return of.ldlt().solve(MotionCovariance::Identity()); }

/// In each direction what the better of two informations says, and no more, as their errors may be the same.
MotionCovariance better_known(const MotionCovariance& a, const MotionCovariance& b) {
  const Eigen::LLT<MotionCovariance> root(b);
  const MotionCovariance lower = root.matrixL();
  const MotionCovariance half = lower.triangularView<Eigen::Lower>().solve(a);
  const MotionCovariance relative = lower.triangularView<Eigen::Lower>().solve(half.transpose());
  const Eigen::SelfAdjointEigenSolver<MotionCovariance> directions(relative);
  const MotionCovariance axes = lower * directions.eigenvectors();
  return inverse(axes * directions.eigenvalues().cwiseMax(1).asDiagonal() * axes.transpose());
}

void judge(const ColourCells& cells, const Silhouette& silhouette, const Outline& outline,
           const ColourModel& model, const std::vector<Line>& lines, OutlineFit& fit) {
  fit.lines = lines.size();
  fit.share_in_picture = outline.share_in_picture;
  double seen = 0, supported = 0, square = 0, of_supported = 0;
  for (const Line& line : lines) {
    if (line.border.covered) continue;
    seen += 1;
    supported += line.border.supported ? 1 : 0;
    const double off = line.border.supported ? std::min(std::abs(line.border.off_px), kWorstPx) : kWorstPx;
    square += off * off;
    if (line.border.supported) of_supported += off * off;
  }
  fit.seen = seen / double(lines.size());
  // Some are seen, as normal_of() had enough that show a border.
  fit.supported = supported / seen;
  fit.misfit_px = std::sqrt(square / seen);
  fit.border_px = supported > 0 ? std::sqrt(of_supported / supported) : kWorstPx;
  double with = 0, all = 0;
  constexpr int kStep = 2;
  for (int y = 0; y < silhouette.height; y += kStep) {
    for (int x = 0; x < silhouette.width; x += kStep) {
      if (!(silhouette.at(x, y) > 0)) continue;
      const std::uint16_t cell = cells.at(x * silhouette.shrink, y * silhouette.shrink);
      if (cell == ColourCells::kCovered) continue;
      all += 1;
      if (model.evidence[cell] > 0) with += 1;
    }
  }
  fit.agreement = all > 0 ? with / all : 0;
}

}  // namespace

std::optional<OutlineFit> fit_outline(const ColourCells& cells, const OrganSurface& surface,
                                      const Pinhole& pinhole, const Expected& expected,
                                      const ColourModel* model, const OutlineFitOptions& options) {
  OutlineFit fit;
  fit.camera = expected.camera;
  const MotionCovariance expectation = inverse(expected.covariance_m2);
  const double ring_px = std::max(20.0, 0.5 * pinhole.focal_px * surface.radius_m /
                                            std::max(0.01, -expected.camera.view_m(surface.middle_m).z()));
  ColourModel own;
  for (int round = 0; round <= options.rounds; ++round) {
    const auto silhouette =
        silhouette_of(surface, fit.camera, pinhole, cells.width, cells.height, options.shrink);
    if (!silhouette) return {};
    const Outline outline =
        outline_of(surface, fit.camera, pinhole, *silhouette, options.spacing_px, kMarginPx);
    if (outline.points.size() < kLeastLines || outline.share_in_picture < kLeastOutlineShare) return {};
    if (model == nullptr) own = colours_of(cells, *silhouette, ring_px);
    const ColourModel& colours = model != nullptr ? *model : own;
    constexpr double kLeastReach = 7;
    const int reach = static_cast<int>(
        std::max(kLeastReach, options.reach_px * (1 - double(round) / std::max(1, options.rounds))));
    const std::vector<Line> lines = lines_of(cells, surface, pinhole, fit.camera, outline, colours, reach);
    const Normal normal = normal_of(lines);
    if (normal.scale_px == 0) return {};
    const double shared = correlation_length(normal.residuals);
    const Motion from_expected = motion_between(surface, expected.camera, fit.camera);
    if (round == options.rounds) {
      judge(cells, *silhouette, outline, colours, lines, fit);
      // What residuals cannot show: a border seen so far outside, or inside, all along.
      constexpr double kSwellingPx = 0.5, kFloor = 1e-6;
      const MotionCovariance covariance =
          inverse(normal.information + kFloor * normal.information.trace() * MotionCovariance::Identity());
      const Motion swollen = kSwellingPx * covariance * normal.swelling;
      fit.covariance_m2 =
          better_known(inverse(shared * covariance + swollen * swollen.transpose()), expectation);
      return fit;
    }
    const Motion step = (normal.information / shared + expectation)
                            .ldlt()
                            .solve(Motion(normal.pull / shared - expectation * from_expected));
    if (!step.allFinite()) return {};
    // A step longer than the lines reach is beyond what they know.
    const double longest_m =
        2 * options.reach_px / pinhole.focal_px * -fit.camera.view_m(surface.middle_m).z();
    const double scale = std::min(1.0, longest_m / std::max(1e-12, step.norm()));
    fit.camera = after_motion(surface, fit.camera, scale * step);
    fit.step_m = scale * step.norm();
  }
  return {};
}

}  // namespace kiroku::sim
