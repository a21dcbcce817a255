#include "sim/align/outline_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace kiroku::sim {
namespace {

constexpr double kMarginPx = 4;  // of the picture's border, where codecs and lenses are at their worst
constexpr std::size_t kLeastLines = 24;
constexpr double kLeastShare = 0.25;  // of the outline, in the picture

/// What the picture says along a normal.
struct Line {
  Vector3 view_m;
  Eigen::Matrix<double, 1, 6> derivative;  // of the outline along the normal
  double off_px = 0;                       // of the border, outwards
  double variance_px2 = 0;
  double angle = 0;  // about the silhouette's middle: neighbours along the outline
  bool supported = false, covered = false;
};

/// The border along one normal: each place is as likely as the evidence within it and against what is beyond.
void seek_border(const ColourCells& cells, const ColourModel& model, const OutlinePoint& point, int reach,
                 Line& line) {
  constexpr double kShared = 0.25;  // neighbouring pixels say the same: of four, one counts
  const int count = 2 * reach + 1;
  std::vector<double> evidence(static_cast<std::size_t>(count), 0);
  std::vector<bool> shows_tissue(static_cast<std::size_t>(count), false);
  int covered = 0;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d at = point.pixel + (i - reach) * point.outward;
    const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
    if (x < 0 || y < 0 || x >= cells.width || y >= cells.height) continue;
    const std::uint16_t cell = cells.at(x, y);
    if (cell == ColourCells::kCovered) {
      ++covered;
      continue;
    }
    evidence[static_cast<std::size_t>(i)] = model.evidence[cell];
    shows_tissue[static_cast<std::size_t>(i)] = true;
  }
  double all = 0;
  for (const double each : evidence) all += each;
  // Before sample k: k samples are within.
  std::vector<double> score(static_cast<std::size_t>(count) + 1);
  double within = 0, best = -1e300;
  std::size_t best_at = 0;
  for (std::size_t k = 0; k < score.size(); ++k) {
    score[k] = kShared * (within - (all - within));
    if (score[k] > best) {
      best = score[k];
      best_at = k;
    }
    if (k < evidence.size()) within += evidence[k];
  }
  double sum = 0, mean = 0, square = 0;
  for (std::size_t k = 0; k < score.size(); ++k) {
    const double weight = std::exp(score[k] - best), at = double(k) - reach - 0.5;
    sum += weight;
    mean += weight * at;
    square += weight * at * at;
  }
  line.off_px = mean / sum;
  line.variance_px2 = std::max(0.0, square / sum - line.off_px * line.off_px);
  // A border has the organ on its one side and something else on its other.
  constexpr int kSides = 6;
  constexpr double kClear = 0.35;
  const int at = static_cast<int>(best_at);
  double inner = 0, outer = 0;
  int inner_count = 0, outer_count = 0;
  const auto add = [&](int i, double& side, int& samples) {
    if (!shows_tissue[static_cast<std::size_t>(i)]) return;
    side += evidence[static_cast<std::size_t>(i)];
    ++samples;
  };
  for (int i = std::max(0, at - kSides); i < at; ++i) add(i, inner, inner_count);
  for (int i = at; i < std::min(count, at + kSides); ++i) add(i, outer, outer_count);
  line.supported =
      inner_count >= 3 && outer_count >= 3 && inner > kClear * inner_count && outer < -kClear * outer_count;
  constexpr double kMuch = 0.3;
  line.covered = !line.supported && covered >= kMuch * count;
}

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
    seek_border(cells, model, point, reach, line);
  }
  std::ranges::sort(lines, {}, &Line::angle);
  return lines;
}

double tukey(double residual, double bound) {
  const double share = residual / bound;
  if (std::abs(share) >= 1) return 0;
  const double left = 1 - share * share;
  return left * left;
}

/// Of the residuals that count: 1.48 times the median of their sizes.
double scale_of(const std::vector<double>& residuals) {
  constexpr double kNormal = 1.4826, kLeastPx = 0.4;
  std::vector<double> sizes;
  for (const double each : residuals) sizes.push_back(std::abs(each));
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return std::max(kLeastPx, kNormal * *middle);
}

/// How many neighbours along the outline say the same as one: 1 + 2 sum of the correlations, until they end.
double correlation_length(const std::vector<double>& residuals) {
  double mean = 0, power = 0;
  const std::size_t count = residuals.size();
  for (const double each : residuals) mean += each / double(count);
  for (const double each : residuals) power += (each - mean) * (each - mean);
  if (power <= 0) return 1;
  double length = 1;
  for (std::size_t lag = 1; lag < count / 3; ++lag) {
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i)
      sum += (residuals[i] - mean) * (residuals[(i + lag) % count] - mean);
    if (sum / power < 0.05) break;
    length += 2 * sum / power;
  }
  return length;
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
    if (line.supported) normal.residuals.push_back(line.off_px);
  }
  if (normal.residuals.size() < kLeastLines / 2) return normal;
  normal.scale_px = scale_of(normal.residuals);
  constexpr double kTukey = 4.685;
  for (const Line& line : lines) {
    if (!line.supported) continue;
    const double variance = normal.scale_px * normal.scale_px + line.variance_px2;
    const double weight = tukey(line.off_px, kTukey * std::sqrt(variance)) / variance;
    normal.information += weight * line.derivative.transpose() * line.derivative;
    normal.pull += weight * line.derivative.transpose() * line.off_px;
    normal.swelling += weight * line.derivative.transpose();
  }
  return normal;
}

/// The motion that leads from the expected camera to this one, as far as it is small.
Motion motion_between(const OrganSurface& surface, const Camera& from, const Camera& to) {
  Motion motion;
  motion.head<3>() = to.view_m(surface.middle_m) - from.view_m(surface.middle_m);
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(to.to_view * from.to_view.transpose()));
  motion.tail<3>() = surface.radius_m * turn.angle() * turn.axis();
  return motion;
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
    if (line.covered) continue;
    seen += 1;
    supported += line.supported ? 1 : 0;
    const double off = line.supported ? std::min(std::abs(line.off_px), kWorstPx) : kWorstPx;
    square += off * off;
    if (line.supported) of_supported += off * off;
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
    if (outline.points.size() < kLeastLines || outline.share_in_picture < kLeastShare) return {};
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
