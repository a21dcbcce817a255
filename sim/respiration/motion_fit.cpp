#include "sim/respiration/motion_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "base/error.h"
#include "sim/respiration/number_table.h"

namespace kiroku::sim {
namespace {

/// Unknowns in this order: rib cage's amplitude and phase, diaphragm's phase, then its amplitude (1) or its
/// motion along x, y and z (3).
constexpr Eigen::Index kRibCage = 0, kRibCagePhase = 1, kDiaphragmPhase = 2, kDiaphragm = 3;

class TumourFit {
 public:
  TumourFit(const BreathingModel& model, const std::vector<ProjectionGeometry>& views,
            const std::vector<RadiographPosition>& positions, bool direction)
      : model_(model), views_(views), positions_(positions), columns_(direction ? 3 : 1) {
    const MeshPoint centre = centre_of(model.mesh, model.needed_tumour());
    rest_m_ = centre.mean(model.mesh.nodes);
    const BreathingBody body(model.mesh, model.materials, model.groups, model.slide);
    rib_cage_ = centre.mean(body.response(BoundaryGroup::kRibCage, model.motion.rib_cage.direction));
    diaphragm_.resize(3, columns_);
    for (Eigen::Index axis = 0; axis < columns_; ++axis) {
      const auto along =
          direction ? std::optional<Vector3>(Vector3::Unit(axis)) : model.motion.diaphragm.direction;
      diaphragm_.col(axis) = centre.mean(body.response(BoundaryGroup::kDiaphragm, along));
    }
    own_diaphragm_ =
        direction ? centre.mean(body.response(BoundaryGroup::kDiaphragm, model.motion.diaphragm.direction))
                  : Vector3(diaphragm_.col(0));
    for (std::size_t view = 0; view < views.size(); ++view) {
      const auto middle = views[view].project(rest_m_);
      if (!middle) {
        throw Error("the tumour is not in front of the source of geometry " + std::to_string(view + 1) +
                    ": is it that of this patient?");
      }
      // Pixels a metre at the tumour's depth, by a metre's small part along each axis.
      constexpr double kPartM = 1e-4;
      double squares = 0;
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const auto beside = views[view].project(rest_m_ + kPartM * Vector3::Unit(axis));
        if (!beside) throw Error("the tumour touches the source of geometry " + std::to_string(view + 1));
        squares += std::pow(beside->column - middle->column, 2) + std::pow(beside->row - middle->row, 2);
      }
      pixels_per_m_.push_back(std::sqrt(squares / 2) / kPartM);
    }
  }

  [[nodiscard]] Eigen::Index unknowns() const { return kDiaphragm + columns_; }
  [[nodiscard]] Eigen::Index residuals() const { return static_cast<Eigen::Index>(2 * positions_.size()); }

  /// (2 m), m: column and row of each position, at the tumour's depth.
  [[nodiscard]] Eigen::VectorXd residual_m(const Eigen::VectorXd& unknown) const {
    return residual_of(unknown[kRibCage] * rib_cage_, unknown[kRibCagePhase],
                       diaphragm_ * unknown.tail(columns_), unknown[kDiaphragmPhase]);
  }
  [[nodiscard]] Eigen::VectorXd own_residual_m() const {
    return residual_of(model_.motion.rib_cage.amplitude_m * rib_cage_, model_.motion.rib_cage.phase_s,
                       model_.motion.diaphragm.amplitude_m * own_diaphragm_, model_.motion.diaphragm.phase_s);
  }

  /// Central differences; exact where it is linear, as in amplitudes.
  [[nodiscard]] Eigen::MatrixXd derivative(const Eigen::VectorXd& unknown) const {
    constexpr double kStep = 1e-5;
    Eigen::MatrixXd derivative(residuals(), unknowns());
    for (Eigen::Index i = 0; i < unknowns(); ++i) {
      Eigen::VectorXd more = unknown, less = unknown;
      more[i] += kStep;
      less[i] -= kStep;
      derivative.col(i) = (residual_m(more) - residual_m(less)) / (2 * kStep);
    }
    return derivative;
  }

  /// What is given and not sought has no slope: the rib cage where the direction is sought.
  [[nodiscard]] bool sought(Eigen::Index unknown) const {
    return columns_ == 1 || (unknown != kRibCage && unknown != kRibCagePhase);
  }

  /// Newton's steps on the least squares, damped; of the amplitudes alone where the phases stay.
  void descend(Eigen::VectorXd& unknown, bool phases) const {
    constexpr int kMostSteps = 60;
    constexpr double kMostDamping = 1e10;
    double damping = 1e-3, cost = residual_m(unknown).squaredNorm();
    for (int step = 0; step < kMostSteps; ++step) {
      Eigen::MatrixXd slope = derivative(unknown);
      for (Eigen::Index i = 0; i < unknowns(); ++i) {
        if (!sought(i) || (!phases && (i == kRibCagePhase || i == kDiaphragmPhase))) slope.col(i).setZero();
      }
      const Eigen::MatrixXd normal = slope.transpose() * slope;
      const Eigen::VectorXd right = -slope.transpose() * residual_m(unknown);
      const double before = cost;
      while (damping < kMostDamping) {
        Eigen::MatrixXd damped = normal;
        damped.diagonal() += damping * normal.diagonal();
        damped.diagonal().array() += 1e-14 * std::max(normal.diagonal().maxCoeff(), 1e-300);
        const Eigen::VectorXd next = unknown + damped.ldlt().solve(right);
        const double next_cost = residual_m(next).squaredNorm();
        if (!(next_cost < cost)) {
          damping *= 10;
          continue;
        }
        unknown = next;
        cost = next_cost;
        damping = std::max(damping / 100, 1e-12);
        break;
      }
      if (before - cost <= 1e-14 * before) return;
    }
  }

 private:
  /// What is given and not sought.
  static double baseline_m(const GroupMotion& motion, double time_s) {
    return motion.baseline_m + motion.drift_m_per_s * time_s;
  }
  [[nodiscard]] Eigen::VectorXd residual_of(const Vector3& rib_cage_m, double rib_cage_s,
                                            const Vector3& diaphragm_m, double diaphragm_s) const {
    Eigen::VectorXd residual_m(residuals());
    for (std::size_t i = 0; i < positions_.size(); ++i) {
      const RadiographPosition& seen = positions_[i];
      const Vector3 place_m = rest_m_ + model_.waveform.at(seen.time_s + rib_cage_s) * rib_cage_m +
                              model_.waveform.at(seen.time_s + diaphragm_s) * diaphragm_m +
                              baseline_m(model_.motion.rib_cage, seen.time_s) * rib_cage_ +
                              baseline_m(model_.motion.diaphragm, seen.time_s) * own_diaphragm_;
      const auto projected = views_[seen.view].project(place_m);
      // Behind the source lies nothing that a step may go to.
      constexpr double kFarPixels = 1e9;
      const auto row = static_cast<Eigen::Index>(2 * i);
      residual_m[row] = (projected ? projected->column - seen.column : kFarPixels) / pixels_per_m_[seen.view];
      residual_m[row + 1] = (projected ? projected->row - seen.row : kFarPixels) / pixels_per_m_[seen.view];
    }
    return residual_m;
  }

  const BreathingModel& model_;
  const std::vector<ProjectionGeometry>& views_;
  const std::vector<RadiographPosition>& positions_;
  Eigen::Index columns_;
  Vector3 rest_m_ = Vector3::Zero(), rib_cage_ = Vector3::Zero(), own_diaphragm_ = Vector3::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic> diaphragm_;
  std::vector<double> pixels_per_m_;
};

/// What the positions leave open, found where the normal equations are nearly singular.
void refuse_undetermined(const Eigen::MatrixXd& slope, const std::vector<Eigen::Index>& sought) {
  constexpr double kSingular = 1e-10;  // of squares: five digits are lost
  const Eigen::VectorXd lengths = slope.colwise().norm();
  const auto name = [&](Eigen::Index column) -> std::string {
    const Eigen::Index unknown = sought[static_cast<std::size_t>(column)];
    if (unknown == kRibCage) return "the rib cage's amplitude";
    if (unknown == kRibCagePhase) return "the rib cage's phase";
    return unknown == kDiaphragmPhase ? "the diaphragm's phase" : "the diaphragm's motion";
  };
  const double greatest = lengths.maxCoeff();
  Eigen::MatrixXd scaled = slope;
  for (Eigen::Index i = 0; i < slope.cols(); ++i) {
    if (lengths[i] > 1e-9 * greatest) {
      scaled.col(i) /= lengths[i];
      continue;
    }
    throw Error(std::string("these positions do not determine ") + name(i) +
                ": it hardly moves the tumour in these views");
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> decomposition(scaled.transpose() * scaled);
  if (decomposition.eigenvalues()[0] > kSingular * decomposition.eigenvalues().tail<1>()[0]) return;
  Eigen::Index first = 0, second = 0;
  Eigen::VectorXd weights = decomposition.eigenvectors().col(0).cwiseAbs();
  weights.maxCoeff(&first);
  weights[first] = 0;
  weights.maxCoeff(&second);
  throw Error(std::string("these positions do not determine ") + name(first) + " apart from " + name(second) +
              ": both move the tumour alike in these views; add a view from another side");
}

/// Amplitudes not negative, phases of a sine from 0 to a cycle.
void normalise(GroupMotion& motion, const Waveform& waveform) {
  if (!waveform.periodic()) return;
  const double cycle_s = waveform.duration_s();
  if (motion.amplitude_m < 0) {
    motion.amplitude_m = -motion.amplitude_m;
    motion.phase_s += cycle_s / 2;
  }
  motion.phase_s -= cycle_s * std::floor(motion.phase_s / cycle_s);
}

}  // namespace

std::vector<RadiographPosition> parse_positions(std::string_view text, const std::string& name,
                                                std::size_t views, std::size_t least) {
  const NumberTable table = NumberTable::parse(text, name);
  const std::size_t times = table.needed_column("time_s"), columns = table.needed_column("column"),
                    rows = table.needed_column("row");
  const auto named = table.column("view");
  if (!named && views > 1)
    throw Error("cannot use " + name + ": it has no column 'view', which says which geometry a line is of");
  std::vector<RadiographPosition> positions;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    RadiographPosition position{table.at(row, times), 0, table.at(row, columns), table.at(row, rows)};
    if (named) {
      const double view = table.at(row, *named);
      if (!(view >= 1 && view <= static_cast<double>(views)) || view != std::floor(view)) {
        table.fail(row, "is of view " + table.word(row, *named) + ", and geometries are counted from 1 to " +
                            std::to_string(views));
      }
      position.view = static_cast<std::size_t>(view) - 1;
    }
    positions.push_back(position);
  }
  if (positions.size() < least) {
    throw Error("cannot use " + name + ": it has " + std::to_string(positions.size()) + " positions; " +
                std::to_string(least) + " at least are needed");
  }
  return positions;
}

MotionFitResult fit_motion(const BreathingModel& model, const std::vector<ProjectionGeometry>& views,
                           const std::vector<RadiographPosition>& positions,
                           const MotionFitOptions& options) {
  if (options.direction && views.size() < 2)
    throw Error(
        "the diaphragm's direction cannot be found from one view: give a second, or leave it as it is");
  const TumourFit fit(model, views, positions, options.direction);
  const bool periodic = model.waveform.periodic();
  // A sine's phase is sought all around; a trace's in so far as it may lag.
  constexpr int kStarts = 8;
  constexpr double kMostLagS = 2;
  const double from_s = periodic ? 0 : -kMostLagS,
               span_s = periodic ? model.waveform.duration_s() : 2 * kMostLagS;
  struct Start {
    double cost;
    Eigen::VectorXd unknown;
  };
  std::vector<Start> starts;
  for (int rib_cage = 0; rib_cage < (options.direction ? 1 : kStarts); ++rib_cage) {
    for (int diaphragm = 0; diaphragm < kStarts; ++diaphragm) {
      Eigen::VectorXd unknown = Eigen::VectorXd::Zero(fit.unknowns());
      if (options.direction) unknown[kRibCage] = model.motion.rib_cage.amplitude_m;
      unknown[kRibCagePhase] =
          options.direction ? model.motion.rib_cage.phase_s : from_s + span_s * rib_cage / kStarts;
      unknown[kDiaphragmPhase] = from_s + span_s * diaphragm / kStarts;
      fit.descend(unknown, false);
      starts.push_back({fit.residual_m(unknown).squaredNorm(), unknown});
    }
  }
  std::ranges::stable_sort(starts, {}, &Start::cost);
  constexpr std::size_t kDescents = 6;
  Eigen::VectorXd unknown = starts.front().unknown;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < kDescents; ++i) {
    Eigen::VectorXd tried = starts[i].unknown;
    fit.descend(tried, true);
    const double cost = fit.residual_m(tried).squaredNorm();
    if (!(cost < least)) continue;
    least = cost;
    unknown = tried;
  }
  std::vector<Eigen::Index> sought;
  for (Eigen::Index i = 0; i < fit.unknowns(); ++i) {
    if (fit.sought(i)) sought.push_back(i);
  }
  const Eigen::MatrixXd slope = fit.derivative(unknown)(Eigen::all, sought);
  refuse_undetermined(slope, sought);

  MotionFitResult result;
  result.motion = model.motion;
  result.motion.rib_cage.amplitude_m = unknown[kRibCage];
  result.motion.rib_cage.phase_s = unknown[kRibCagePhase];
  result.motion.diaphragm.phase_s = unknown[kDiaphragmPhase];
  result.motion.diaphragm.amplitude_m = unknown[kDiaphragm];
  if (options.direction) {
    const Vector3 moved_m = unknown.tail<3>();
    result.motion.diaphragm.amplitude_m = moved_m.norm();
    result.motion.diaphragm.direction = moved_m.normalized();
    // A sine half a cycle later along the opposite direction is the same: the one nearer to the model's is
    // meant.
    const Vector3 meant = model.motion.diaphragm.direction.value_or(-Vector3::UnitZ());
    if (periodic && meant.dot(moved_m) < 0) {
      result.motion.diaphragm.direction = Vector3(-moved_m.normalized());
      result.motion.diaphragm.phase_s += model.waveform.duration_s() / 2;
    }
  }
  normalise(result.motion.rib_cage, model.waveform);
  normalise(result.motion.diaphragm, model.waveform);

  const auto lengths = [](const Eigen::VectorXd& residual_m) {
    std::vector<double> lengths_m;
    for (Eigen::Index i = 0; i < residual_m.size(); i += 2)
      lengths_m.push_back(residual_m.segment<2>(i).norm());
    return lengths_m;
  };
  result.residuals_m = lengths(fit.residual_m(unknown));
  result.residual_m = spread_of(result.residuals_m);
  result.before_m = spread_of(lengths(fit.own_residual_m())).mean;
  const double freedom = static_cast<double>(std::max<Eigen::Index>(fit.residuals() - slope.cols(), 1));
  const Eigen::MatrixXd covariance = least / freedom * (slope.transpose() * slope).inverse();
  for (std::size_t i = 0; i < sought.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const double error = std::sqrt(std::max(covariance(at, at), 0.0));
    double& of = sought[i] == kRibCage          ? result.rib_cage_m
                 : sought[i] == kRibCagePhase   ? result.rib_cage_s
                 : sought[i] == kDiaphragmPhase ? result.diaphragm_s
                                                : result.diaphragm_m;
    of = std::max(of, error);  // of a direction's components the greatest
  }
  return result;
}

}  // namespace kiroku::sim
