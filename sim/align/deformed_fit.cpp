#include "sim/align/deformed_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include <Eigen/Cholesky>

#include "base/error.h"
#include "sim/align/border.h"
#include "sim/align/surface_points.h"

namespace kiroku::sim {
namespace {

/// Tissue that is so far from where the fit has it counts half.
constexpr double kTissueBoundPx = 1.5;
constexpr std::size_t kLeastPoints = SurfacePoints::kLeastPoints;

/// A derivative of a picture's measure, of nodes that are weighted.
void add_node(const DeformableOrgan& organ, const OrganShape& shape,
              const Eigen::Matrix<double, 2, 3>& pixel_of, std::uint32_t node, double weight,
              Eigen::Ref<Eigen::Matrix2Xd> into) {
  into.leftCols(organ.unknowns()) += weight * pixel_of * organ.derivative(shape, node);
}

PixelDerivative derivative_of(const DeformableOrgan& organ, const OrganShape& shape, const Camera& camera,
                              const Pinhole& pinhole, const Vector3& view_m, const std::uint32_t* nodes,
                              const double* weights, std::size_t count) {
  PixelDerivative made{pinhole.pixel(view_m), Eigen::Matrix2Xd::Zero(2, organ.unknowns() + 6)};
  const OrganSurface& rest = organ.surface();
  const Eigen::Matrix<double, 2, 6> by_motion =
      pinhole.derivative(view_m, camera.view_m(rest.middle_m), rest.radius_m);
  const Eigen::Matrix<double, 2, 3> by_place = by_motion.leftCols<3>() * camera.to_view;
  for (std::size_t i = 0; i < count; ++i)
    add_node(organ, shape, by_place, nodes[i], weights[i], made.by_unknowns);
  made.by_unknowns.rightCols<6>() = by_motion;
  return made;
}

/// What the picture says, linear about where the fit stands; rows weighted by the root of their weights.
struct Evidence {
  Eigen::MatrixXd rows;  // (measures x unknowns + 6)
  Eigen::VectorXd off;
  Eigen::VectorXd swelling;  // the pull of a border that is a pixel too far outside everywhere
  double scale_px = 0;       // of the residuals that count
};

Evidence evidence_of_tissue(const DeformableOrgan& organ, const OrganShape& shape, const Camera& camera,
                            const Pinhole& pinhole, const std::vector<TrackedTissue>& tissue, double bound_px,
                            DeformedFit& fit) {
  // Errors of flow are shared by neighbours: of so many points one counts.
  constexpr double kShared = 4, kNormal = 1.4826, kExplainedPx = 1.5, kLeastPx = 0.5, kMostPx = 1;
  Evidence evidence;
  const Eigen::Index columns = organ.unknowns() + 6;
  evidence.rows.resize(2 * static_cast<Eigen::Index>(tissue.size()), columns);
  evidence.off.resize(evidence.rows.rows());
  std::vector<double> sizes;
  for (std::size_t i = 0; i < tissue.size(); ++i) {
    const PixelDerivative at = pixel_derivative(organ, shape, camera, pinhole, tissue[i].place);
    const auto row = 2 * static_cast<Eigen::Index>(i);
    evidence.rows.middleRows<2>(row) = at.by_unknowns;
    evidence.off.segment<2>(row) = tissue[i].pixel - at.pixel;
    sizes.push_back(evidence.off.segment<2>(row).norm());
  }
  fit.points = tissue.size();
  if (tissue.empty()) return evidence;
  std::vector<double> sorted = sizes;
  std::ranges::sort(sorted);
  // The median length of two components of variance 1 is 1.18.
  evidence.scale_px = std::clamp(kNormal / std::sqrt(2.0) * sorted[sorted.size() / 2], kLeastPx, kMostPx);
  double agree = 0, square = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    // Cauchy's weight. How exact a point is does not depend on how far off a point may be and still count.
    const double share = sizes[i] / std::max(bound_px, evidence.scale_px);
    const double weight = 1 / (1 + share * share) / (evidence.scale_px * evidence.scale_px) / kShared;
    const auto row = 2 * static_cast<Eigen::Index>(i);
    evidence.rows.middleRows<2>(row) *= std::sqrt(weight);
    evidence.off.segment<2>(row) *= std::sqrt(weight);
    if (sizes[i] > kExplainedPx) continue;
    agree += 1;
    square += sizes[i] * sizes[i];
  }
  fit.points_agree = agree / double(sizes.size());
  fit.points_misfit_px = agree > 0 ? std::sqrt(square / agree) : 0;
  return evidence;
}

/// Nothing where hardly any of the outline is in the picture, or shows no border.
std::optional<Evidence> evidence_of_outline(const ColourCells& cells, const DeformableOrgan& organ,
                                            const OrganShape& shape, const Camera& camera,
                                            const Pinhole& pinhole, const Silhouette& silhouette,
                                            const ColourModel& colours, const DeformedFitOptions& options,
                                            int reach, DeformedFit& fit) {
  const Outline outline =
      outline_of(shape.surface, camera, pinhole, silhouette, options.spacing_px, kMarginPx);
  fit.lines = outline.points.size();
  if (fit.lines < kLeastLines || outline.share_in_picture < kLeastOutlineShare) return {};
  struct Line {
    const OutlinePoint* point = nullptr;
    Border border;
    double angle = 0;
  };
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const OutlinePoint& point : outline.points) middle += point.pixel / double(fit.lines);
  std::vector<Line> lines;
  double seen = 0, supported = 0, square = 0;
  for (const OutlinePoint& point : outline.points) {
    Line line{&point, seek_border(cells, colours, point, reach),
              std::atan2(point.pixel.y() - middle.y(), point.pixel.x() - middle.x())};
    seen += line.border.covered ? 0 : 1;
    if (!line.border.supported) continue;
    supported += 1;
    square += line.border.off_px * line.border.off_px;
    lines.push_back(line);
  }
  fit.seen_outline = seen / double(fit.lines);
  fit.supported = seen > 0 ? supported / seen : 0;
  fit.border_px = supported > 0 ? std::sqrt(square / supported) : kWorstPx;
  if (lines.size() < kLeastLines / 2) return {};
  std::ranges::sort(lines, {}, &Line::angle);
  std::vector<double> residuals;
  for (const Line& line : lines) residuals.push_back(line.border.off_px);
  Evidence evidence;
  evidence.scale_px = scale_of(residuals);
  const double shared = correlation_length(residuals);
  const auto count = static_cast<Eigen::Index>(lines.size());
  evidence.rows.resize(count, organ.unknowns() + 6);
  evidence.off.resize(count);
  evidence.swelling = Eigen::VectorXd::Zero(organ.unknowns() + 6);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto& [point, border, angle] = lines[static_cast<std::size_t>(i)];
    const std::array<double, 2> weights{1 - point->along, point->along};
    const PixelDerivative at =
        derivative_of(organ, shape, camera, pinhole, point->view_m, point->nodes.data(), weights.data(), 2);
    constexpr double kTukey = 4.685;
    const double variance = evidence.scale_px * evidence.scale_px + border.variance_px2;
    const double weight = tukey(border.off_px, kTukey * std::sqrt(variance)) / variance / shared;
    const Eigen::RowVectorXd row = point->outward.transpose() * at.by_unknowns;
    evidence.rows.row(i) = std::sqrt(weight) * row;
    evidence.off[i] = std::sqrt(weight) * border.off_px;
    evidence.swelling += weight * row.transpose();
  }
  return evidence;
}

Eigen::MatrixXd inverted(const Eigen::MatrixXd& of) {
  return of.ldlt().solve(Eigen::MatrixXd::Identity(of.rows(), of.cols()));
}

/// Whether an edge of the surface is longer or shorter than tissue bears.
bool is_torn(const OrganSurface& rest, const OrganSurface& displaced) {
  // Single short edges of a mesh say little: the worst of a hundred counts.
  constexpr double kLongest = 2, kShortest = 0.4, kShare = 0.01;
  double beyond = 0;
  for (const OrganSurface::Edge& edge : rest.edges) {
    const auto [a, b] = edge.nodes;
    const double stretch =
        (displaced.nodes[a] - displaced.nodes[b]).norm() / (rest.nodes[a] - rest.nodes[b]).norm();
    if (stretch > kLongest || stretch < kShortest) beyond += 1;
  }
  return beyond > kShare * double(rest.edges.size());
}

double largest_m(const std::vector<Vector3>& a, const std::vector<Vector3>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, (a[i] - b[i]).norm());
  return largest;
}

/// One fit.
class Search {
 public:
  Search(const ColourCells& cells, const DeformableOrgan& organ, const Pinhole& pinhole, const Expected& pose,
         const std::vector<TrackedTissue>& tissue, const ColourModel* model,
         const DeformedFitOptions& options)
      : cells_(cells),
        organ_(organ),
        pinhole_(pinhole),
        pose_(pose),
        expectation_(inverted(pose.covariance_m2)),
        tissue_(tissue),
        model_(model),
        options_(options) {}

  DeformedFit run(const Eigen::VectorXd& begin) {
    fit_.camera = pose_.camera;
    fit_.coefficients = begin;
    fit_.expected = Eigen::VectorXd::Ones(organ_.unknowns());
    fit_.shape = organ_.shape(begin);
    // First the tissue alone: it knows where it went when the outline is still far off.
    // With a wide scale at first, or what is pulled far would be taken for points that got lost.
    constexpr int kTissueRounds = 7;
    constexpr double kWidestPx = 32;
    if (tissue_.size() >= kLeastPoints) {
      for (int round = 0; round < kTissueRounds; ++round) {
        if (!is_before_eye()) return refused(WhyUnfitted::kNotInPicture);
        step({evidence_of_tissue(organ_, fit_.shape, fit_.camera, pinhole_, tissue_,
                                 std::max(kTissueBoundPx, kWidestPx / double(1 << round)), fit_)});
      }
    }
    const double ring_px =
        std::max(20.0, 0.5 * pinhole_.focal_px * organ_.surface().radius_m /
                           std::max(0.01, -fit_.camera.view_m(organ_.surface().middle_m).z()));
    ColourModel own;
    for (int round = 0;; ++round) {
      const auto silhouette = silhouette_of(fit_.shape.surface, fit_.camera, pinhole_, cells_.width,
                                            cells_.height, options_.shrink);
      if (!silhouette) return refused(WhyUnfitted::kNotInPicture);
      if (model_ == nullptr) own = colours_of(cells_, *silhouette, ring_px);
      constexpr double kLeastReach = 7;
      const int reach = static_cast<int>(
          std::max(kLeastReach, options_.reach_px * (1 - double(round) / std::max(1, options_.rounds))));
      const auto outline = evidence_of_outline(cells_, organ_, fit_.shape, fit_.camera, pinhole_, *silhouette,
                                               model_ != nullptr ? *model_ : own, options_, reach, fit_);
      const Evidence points =
          evidence_of_tissue(organ_, fit_.shape, fit_.camera, pinhole_, tissue_, kTissueBoundPx, fit_);
      if (!outline) {
        constexpr double kLeastSeen = 0.3;
        if (fit_.lines < kLeastLines) return refused(WhyUnfitted::kNotInPicture);
        return refused(fit_.seen_outline < kLeastSeen ? WhyUnfitted::kHidden
                                                      : WhyUnfitted::kOutlineUnexplained);
      }
      if (round == options_.rounds) {
        conclude({*outline, points}, *silhouette);
        return fit_;
      }
      step({*outline, points});
    }
  }

 private:
  DeformedFit refused(WhyUnfitted why) {
    fit_.why = why;
    return fit_;
  }

  [[nodiscard]] bool is_before_eye() const {
    return std::ranges::all_of(fit_.shape.surface.nodes, [&](const Vector3& node) {
      constexpr double kNearestM = 0.003;
      return -fit_.camera.view_m(node).z() > kNearestM;
    });
  }

  [[nodiscard]] Eigen::MatrixXd information(const std::vector<Evidence>& all) const {
    const Eigen::Index unknowns = organ_.unknowns();
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(unknowns + 6, unknowns + 6);
    for (const Evidence& evidence : all) sum += evidence.rows.transpose() * evidence.rows;
    sum.diagonal().head(unknowns) += fit_.expected.cwiseAbs2().cwiseInverse();
    sum.bottomRightCorner<6, 6>() += expectation_;
    return sum;
  }

  void step(const std::vector<Evidence>& all) {
    const Eigen::Index unknowns = organ_.unknowns();
    const Eigen::MatrixXd covariance = inverted(information(all));
    expect(covariance);
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(unknowns + 6);
    for (const Evidence& evidence : all) pull += evidence.rows.transpose() * evidence.off;
    pull.head(unknowns) -= fit_.coefficients.cwiseQuotient(fit_.expected.cwiseAbs2());
    pull.tail<6>() -= expectation_ * motion_between(organ_.surface(), pose_.camera, fit_.camera);
    const Eigen::VectorXd way = information(all).ldlt().solve(pull);
    if (!way.allFinite()) return;
    // A step beyond what lines reach, or a line tangent to a turn, knows, is shortened.
    constexpr double kFarthestM = 0.02;
    double share = std::min(1.0, kFarthestM / std::max(1e-12, way.tail<6>().norm()));
    for (int halving = 0; halving < 8; ++halving, share /= 2) {
      const Eigen::VectorXd next = fit_.coefficients + share * way.head(unknowns);
      OrganShape shape = organ_.shape(next);
      if (largest_m(shape.displacement_m, fit_.shape.displacement_m) > kFarthestM) continue;
      fit_.coefficients = next;
      fit_.shape = std::move(shape);
      fit_.camera = after_motion(organ_.surface(), fit_.camera, share * way.tail<6>());
      return;
    }
  }

  /// The size of each patch's force from what the picture determines of it: hands and tools pull at few
  /// places. Never less than was expected beforehand, so that what is not seen is not claimed to be small
  /// because what is seen is.
  void expect(const Eigen::MatrixXd& covariance) {
    fit_.determined = 0;
    for (Eigen::Index patch = 0; patch < organ_.unknowns(); patch += 3) {
      const double size = fit_.expected[patch];
      const double determined =
          std::max(0.0, 3 - covariance.diagonal().segment<3>(patch).sum() / (size * size));
      fit_.determined += determined;
      constexpr double kMost = 10, kLeastDetermined = 0.1;
      if (determined > kLeastDetermined)
        fit_.expected.segment<3>(patch).setConstant(
            std::clamp(fit_.coefficients.segment<3>(patch).norm() / std::sqrt(determined), 1.0, kMost));
    }
  }

  void conclude(const std::vector<Evidence>& all, const Silhouette& silhouette) {
    const Eigen::Index unknowns = organ_.unknowns();
    Eigen::MatrixXd covariance = inverted(information(all));
    fit_.determined = double(unknowns) -
                      covariance.diagonal().head(unknowns).cwiseQuotient(fit_.expected.cwiseAbs2()).sum();
    // What residuals cannot show: a border seen so far outside, or inside, all along.
    constexpr double kSwellingPx = 0.5;
    const Eigen::VectorXd swollen = kSwellingPx * covariance * all.front().swelling;
    covariance += swollen * swollen.transpose();
    // What the model is wrong by: a share of each displacement, as linear elements, held and stiff as the
    // plan has them, are not the tissue; and everywhere a little, as the organ is not held exactly there.
    constexpr double kModelShare = 0.15, kHeldM = 0.001;
    const Eigen::MatrixXd of_coefficients = covariance.topLeftCorner(unknowns, unknowns);
    bool any_told = false;
    for (std::uint32_t node = 0; node < fit_.shape.surface.nodes.size(); ++node) {
      const Eigen::Matrix3Xd derivative = organ_.derivative(fit_.shape, node);
      const double model_m = std::hypot(kHeldM, kModelShare * fit_.shape.displacement_m[node].norm());
      fit_.covariance_m2.emplace_back(derivative * of_coefficients * derivative.transpose() +
                                      model_m * model_m * Eigen::Matrix3d::Identity());
      fit_.seen.push_back(is_seen(fit_.shape.surface.nodes[node], silhouette));
      any_told = any_told || (fit_.seen.back() && fit_.told(node));
    }
    fit_.why = verdict(any_told);
  }

  [[nodiscard]] bool is_seen(const Vector3& node_m, const Silhouette& silhouette) const {
    const Vector3 view = fit_.camera.view_m(node_m);
    const Eigen::Vector2d pixel = pinhole_.pixel(view);
    if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= cells_.width - 1 &&
          pixel.y() <= cells_.height - 1))
      return false;
    const int x = static_cast<int>(pixel.x()), y = static_cast<int>(pixel.y());
    if (cells_.at(x, y) == ColourCells::kCovered) return false;
    const int column = std::min(silhouette.width - 1, x / silhouette.shrink),
              row = std::min(silhouette.height - 1, y / silhouette.shrink);
    constexpr double kBehindM = 0.003;
    return silhouette.at(column, row) > 0 && -view.z() <= silhouette.at(column, row) + kBehindM;
  }

  [[nodiscard]] WhyUnfitted verdict(bool any_told) const {
    constexpr double kLeastSeen = 0.3, kLeastSupported = 0.85, kMostBorderPx = 2, kLeastAgree = 0.5;
    if (fit_.seen_outline < kLeastSeen) return WhyUnfitted::kHidden;
    if (fit_.supported < kLeastSupported || fit_.border_px > kMostBorderPx)
      return WhyUnfitted::kOutlineUnexplained;
    if (fit_.points >= kLeastPoints && fit_.points_agree < kLeastAgree)
      return WhyUnfitted::kTissueUnexplained;
    if (is_torn(organ_.surface(), fit_.shape.surface)) return WhyUnfitted::kTorn;
    return any_told ? WhyUnfitted::kFitted : WhyUnfitted::kNothingTold;
  }

  const ColourCells& cells_;
  const DeformableOrgan& organ_;
  const Pinhole& pinhole_;
  const Expected& pose_;
  MotionCovariance expectation_;
  const std::vector<TrackedTissue>& tissue_;
  const ColourModel* model_;
  const DeformedFitOptions& options_;
  DeformedFit fit_;
};

}  // namespace

const char* name_of(WhyUnfitted why) {
  switch (why) {
    case WhyUnfitted::kFitted:
      return "fitted";
    case WhyUnfitted::kNotInPicture:
      return "not-in-picture";
    case WhyUnfitted::kHidden:
      return "hidden";
    case WhyUnfitted::kOutlineUnexplained:
      return "outline-unexplained";
    case WhyUnfitted::kTissueUnexplained:
      return "tissue-unexplained";
    case WhyUnfitted::kTorn:
      return "torn";
    case WhyUnfitted::kNothingTold:
      return "nothing-told";
  }
  return "nothing-told";
}

PixelDerivative pixel_derivative(const DeformableOrgan& organ, const OrganShape& shape, const Camera& camera,
                                 const Pinhole& pinhole, const SurfacePlace& place) {
  return derivative_of(organ, shape, camera, pinhole, camera.view_m(place_m(shape.surface, place)),
                       organ.surface().faces[place.face].data(), place.weights.data(), 3);
}

DeformedFit fit_deformed(const ColourCells& cells, const DeformableOrgan& organ, const Pinhole& pinhole,
                         const Expected& pose, const Eigen::VectorXd& begin,
                         const std::vector<TrackedTissue>& tissue, const ColourModel* model,
                         const DeformedFitOptions& options) {
  if (begin.size() != 0 && begin.size() != organ.unknowns())
    throw UsageError("the fit begins with " + std::to_string(begin.size()) + " coefficients, the organ has " +
                     std::to_string(organ.unknowns()));
  for (const TrackedTissue& each : tissue) {
    if (each.place.face >= organ.surface().faces.size())
      throw UsageError("tissue was followed at face " + std::to_string(each.place.face) + ", the organ has " +
                       std::to_string(organ.surface().faces.size()));
  }
  Search search(cells, organ, pinhole, pose, tissue, model, options);
  return search.run(begin.size() == 0 ? Eigen::VectorXd::Zero(organ.unknowns()) : begin);
}

}  // namespace kiroku::sim
