#include "sim/respiration/series_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "sim/drr/registration.h"
#include "sim/respiration/gradient_terms.h"
#include "sim/respiration/series_change.h"

namespace kiroku::sim {
namespace {

constexpr double kSameMomentS = 0.002;
/// Pixels on the lesser side, from coarse to fine, and the steps on each.
struct FitLevel {
  std::size_t most_pixels;
  int steps;
};
constexpr std::array<FitLevel, 3> kFitLevels{{{64, 6}, {128, 4}, {256, 3}}};
/// How far groups are sought to have moved.
constexpr double kMostRibCageM = 0.01, kMostDiaphragmM = 0.03;
/// Nodes of a table are so many pixels apart: edges must not jump between them.
constexpr double kNodePixels = 1;
/// What is known before any picture.
constexpr double kPriorRibCageM = 0.005, kPriorDiaphragmM = 0.02, kPriorShiftM = 0.015,
                 kPriorTurnRad = 10 * 3.14159265358979 / 180, kPriorAcrossM = 0.5;
/// A step of finite differences of the pose, in pixels of the level at the patient; turns as at this lever.
constexpr double kPoseStepPixels = 0.5, kLeverM = 0.1;
/// Unknowns of all moments: the patient's shift along three axes, turns about them, and where the diaphragm
/// points, across its direction.
constexpr std::size_t kFirstTurn = 3, kFirstAcross = 6, kAllUnknowns = 8;
/// The pose is found on so many moments in the smallest pixels.
constexpr std::size_t kPoseMoments = 80;
/// The least correlation of changes that is told as breathing, and how often chance must be exceeded.
constexpr double kLeastChange = 0.05, kTimesChance = 3;

std::vector<SeriesMoment> moments_of(std::span<const SeriesPicture> pictures) {
  std::vector<std::size_t> order(pictures.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return pictures[i].time_s; });
  std::vector<SeriesMoment> moments;
  for (const std::size_t i : order) {
    if (moments.empty() || pictures[i].time_s - moments.back().time_s > kSameMomentS)
      moments.push_back({pictures[i].time_s, {}, {}, Eigen::Matrix2d::Identity(), 0});
    moments.back().pictures.push_back(i);
  }
  return moments;
}

/// All that is done on pixels of one size.
struct SeriesLevel {
  std::vector<ProjectionGeometry> views;
  std::vector<ProjectionImage> images;    // of each picture
  std::vector<std::vector<float>> roots;  // of each view: of its pixels' weights; empty where all count alike
  double pixel_m = 0;                     // at the patient
};

/// Derivatives of the pictures of one view by the pose (and where the diaphragm points), at four states.
struct PoseSlopes {
  std::array<double, 2> rib_cage_m{}, diaphragm_m{};
  std::vector<std::vector<float>> at[2][2];  // by rib cage, by diaphragm; an image an unknown
};

class SeriesFitter {
 public:
  SeriesFitter(const BreathingModel& model, BreathingScene& scene,
               const std::vector<ProjectionGeometry>& views, std::span<const SeriesPicture> pictures,
               const SeriesFitOptions& options)
      : scene_(scene), views_(views), pictures_(pictures), options_(options) {
    check();
    fit_.motion = model.motion;
    fit_.waveform = model.waveform;
    fit_.moments = moments_of(pictures);
    if (fit_.moments.size() < kLeastMoments) {
      throw Error("the series has " + std::to_string(fit_.moments.size()) + " moments; " +
                  std::to_string(kLeastMoments) + " at least are needed to tell a breath");
    }
    if (options.direction && !scene.diaphragm_direction()) scene.point_diaphragm(-Vector3::UnitZ());
    for (std::size_t unknown = options.lies_as_given ? kFirstAcross : 0;
         unknown < (options.direction ? kAllUnknowns : kFirstAcross); ++unknown)
      unknowns_.push_back(unknown);
  }

  SeriesFit run() {
    find_pose();
    if (!fit_.refusal.empty()) return std::move(fit_);
    for (std::size_t number = 0; number < kFitLevels.size(); ++number) {
      if (number > 0 && factor_of(number) == factor_of(number - 1)) continue;
      run_level(number);
    }
    fit_waves();
    judge();
    fit_.translation_m = shift_m_;
    const Eigen::AngleAxisd turn(turn_);
    fit_.rotation_rad = turn.angle() * turn.axis();
    fit_.pose = pose(shift_m_, turn_);
    if (scene_.diaphragm_direction()) fit_.motion.diaphragm.direction = scene_.diaphragm_direction();
    return std::move(fit_);
  }

 private:
  void check() const {
    std::vector<std::size_t> counts(views_.size(), 0);
    for (const SeriesPicture& picture : pictures_) {
      const ProjectionGeometry& geometry = views_.at(picture.view);
      ++counts[picture.view];
      if (picture.image.columns == geometry.columns() && picture.image.rows == geometry.rows()) continue;
      throw Error(picture.name + " has " + std::to_string(picture.image.columns) + " x " +
                  std::to_string(picture.image.rows) + " pixels, the geometry " +
                  std::to_string(geometry.columns()) + " x " + std::to_string(geometry.rows()) +
                  "; give the geometry that it was made with");
    }
    for (std::size_t view = 0; view < counts.size(); ++view) {
      if (counts[view] == 0) throw Error("no picture is of geometry " + std::to_string(view + 1));
    }
  }

  void tell(const std::string& what, std::size_t done, std::size_t all) const {
    if (options_.progress) options_.progress(what, done, all);
  }

  [[nodiscard]] Eigen::Isometry3d pose(const Vector3& shift_m, const Eigen::Matrix3d& turn) const {
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.translate(scene_.middle_m() + shift_m);
    motion.rotate(turn);
    motion.translate(-scene_.middle_m());
    return motion;
  }

  [[nodiscard]] std::size_t factor_of(std::size_t number) const {
    std::size_t side = std::numeric_limits<std::size_t>::max();
    for (const ProjectionGeometry& view : views_) side = std::min({side, view.columns(), view.rows()});
    return std::max<std::size_t>(side / kFitLevels[number].most_pixels, 1);
  }

  [[nodiscard]] SeriesLevel level_of(std::size_t factor) const {
    SeriesLevel level;
    for (const ProjectionGeometry& view : views_) level.views.push_back(view.binned(factor));
    level.images.resize(pictures_.size());
    for_each_part(pictures_.size(), threads(),
                  [&](std::size_t i) { level.images[i] = binned(pictures_[i].image, factor); });
    level.roots.resize(views_.size());
    const auto centre = level.views.front().project(scene_.middle_m());
    if (!centre) throw Error("the lung is not in front of the source: is the geometry that of this patient?");
    level.pixel_m = centre->depth_m * level.views.front().pixel_rays().along_row.norm();
    return level;
  }

  [[nodiscard]] unsigned threads() const { return scene_.ct().options().threads; }

  // The pose, before anything is known of the breathing.

  void find_pose() {
    SeriesPose found = find_series_pose(scene_, views_, pictures_, options_.lies_as_given, options_.progress);
    fit_.similarity_before = found.similarity_before;
    fit_.similarity_posed = found.similarity_after;
    fit_.refusal = std::move(found.refusal);
    fit_.findings = std::move(found.findings);
    fit_.projections += found.projections;
    shift_m_ = found.translation_m;
    turn_ = found.turn;
  }

  // The breathing.

  void run_level(std::size_t number) {
    SeriesLevel level = level_of(factor_of(number));
    const bool first = axes_.empty();
    choose_axes(level);
    damping_ = 1e-3;
    double best = std::numeric_limits<double>::infinity();
    Kept kept;
    for (int step = 0; step <= kFitLevels[number].steps; ++step) {
      tell("fitting in " + std::to_string(level.views.front().columns()) + " x " +
               std::to_string(level.views.front().rows()) + " pixels",
           static_cast<std::size_t>(step), static_cast<std::size_t>(kFitLevels[number].steps));
      make_tables(level);
      if (first && step == 0) look_for_states(level);
      refine_states(level);
      if (step == 0) {
        weigh(level);
        refine_states(level);
      }
      const double misfit = std::accumulate(misfits_.begin(), misfits_.end(), 0.0);
      const bool last = step == kFitLevels[number].steps;
      if (misfit < best) {
        best = misfit;
        kept = {shift_m_, turn_, states_of(), scene_.diaphragm_direction()};
        if (last) {
          finish_level(number);
          return;
        }
        if (unknowns_.empty()) break;
        make_slopes(level);
        collect(level, number + 1 == kFitLevels.size() ? kPoseMoments : fit_.moments.size());
        damping_ = std::max(damping_ / 10, 1e-6);
      } else {
        take_back(kept);
        if (last) break;
        damping_ *= 30;
      }
      if (unknowns_.empty() || !move_pose(level)) break;
    }
    // With the pose that is kept.
    take_back(kept);
    if (tables_shift_m_ != shift_m_ || tables_turn_ != turn_) make_tables(level);
    refine_states(level);
    finish_level(number);
  }

  struct Kept {
    Vector3 shift_m = Vector3::Zero();
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    std::vector<BreathState> states;
    std::optional<Vector3> direction;
  };
  [[nodiscard]] std::vector<BreathState> states_of() const {
    std::vector<BreathState> states;
    for (const SeriesMoment& moment : fit_.moments) states.push_back(moment.state);
    return states;
  }
  void take_back(const Kept& kept) {
    shift_m_ = kept.shift_m;
    turn_ = kept.turn;
    for (std::size_t m = 0; m < fit_.moments.size(); ++m) fit_.moments[m].state = kept.states[m];
    if (options_.direction && kept.direction && kept.direction != scene_.diaphragm_direction())
      scene_.point_diaphragm(*kept.direction);
  }

  /// Once for all steps of a level: their misfits are compared, and each table is wrong between its own
  /// nodes.
  void choose_axes(const SeriesLevel& level) {
    const double step_m = kNodePixels * level.pixel_m;
    double r0 = -kMostRibCageM, r1 = kMostRibCageM, d0 = -kMostDiaphragmM, d1 = kMostDiaphragmM;
    if (!axes_.empty()) {
      // What was found, and a little more.
      r0 = d0 = 1;
      r1 = d1 = -1;
      for (const SeriesMoment& moment : fit_.moments) {
        r0 = std::min(r0, moment.state.rib_cage_m);
        r1 = std::max(r1, moment.state.rib_cage_m);
        d0 = std::min(d0, moment.state.diaphragm_m);
        d1 = std::max(d1, moment.state.diaphragm_m);
      }
      constexpr double kMoreM = 0.003;
      r0 = std::max(r0 - kMoreM, -kMostRibCageM);
      r1 = std::min(r1 + kMoreM, kMostRibCageM);
      d0 = std::max(d0 - kMoreM, -kMostDiaphragmM);
      d1 = std::min(d1 + kMoreM, kMostDiaphragmM);
    }
    axes_ = {StateAxis::covering(r0, r1, 2 * step_m), StateAxis::covering(d0, d1, step_m)};
  }

  void make_tables(const SeriesLevel& level) {
    tables_.clear();
    for (const ProjectionGeometry& view : level.views) {
      tables_.emplace_back(scene_, view.of_moved_patient(pose(shift_m_, turn_)), axes_[0], axes_[1]);
      fit_.projections += axes_[0].count * axes_[1].count + 2;
    }
    tables_shift_m_ = shift_m_;
    tables_turn_ = turn_;
  }

  /// Where the diaphragm must have moved for each moment, by the model's own motion and by nodes of the
  /// table; the rib cage shows less.
  void look_for_states(const SeriesLevel& level) {
    for_each_part(fit_.moments.size(), threads(), [&](std::size_t m) {
      SeriesMoment& moment = fit_.moments[m];
      double best = -std::numeric_limits<double>::infinity();
      BreathingPictures::Looked looked;
      std::vector<BreathState> candidates{by_waveform(moment.time_s)};
      for (std::size_t j = 1; j + 1 < axes_[1].count; ++j) candidates.push_back({0, axes_[1].node(j)});
      for (const BreathState& tried : candidates) {
        double similarity = 0;
        for (const std::size_t picture : moment.pictures) {
          const std::size_t view = pictures_[picture].view;
          tables_[view].look_up(tried, looked);
          similarity += gradient_terms(level.images[picture], looked.value, {}, {}).similarity;
        }
        if (!(similarity > best)) continue;
        best = similarity;
        moment.state = tried;
      }
    });
  }

  /// What the pictures of a moment say of its state alone.
  struct StateTerms {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    double misfit = 0, similarity = 0;
  };
  [[nodiscard]] StateTerms state_terms(const SeriesLevel& level, const SeriesMoment& moment,
                                       const BreathState& state) const {
    StateTerms terms;
    BreathingPictures::Looked looked;
    for (const std::size_t picture : moment.pictures) {
      const std::size_t view = pictures_[picture].view;
      tables_[view].look_up(state, looked);
      const std::array<const float*, 2> slopes{looked.by_rib_cage.data(), looked.by_diaphragm.data()};
      const GradientTerms of = gradient_terms(level.images[picture], looked.value, slopes, level.roots[view]);
      terms.normal += of.normal;
      terms.right += of.right;
      terms.misfit += of.log_misfit;
      terms.similarity += of.similarity / static_cast<double>(moment.pictures.size());
    }
    return terms;
  }

  void refine_states(const SeriesLevel& level) {
    for_each_part(fit_.moments.size(), threads(), [&](std::size_t m) {
      SeriesMoment& moment = fit_.moments[m];
      StateTerms terms = state_terms(level, moment, moment.state);
      constexpr int kSteps = 4;
      for (int step = 0; step < kSteps; ++step) {
        Eigen::Matrix2d normal = terms.normal + prior_of_states();
        Eigen::Vector2d change =
            normal.ldlt().solve(terms.right - prior_of_states() * Eigen::Vector2d(moment.state.rib_cage_m,
                                                                                  moment.state.diaphragm_m));
        // Further than two nodes the table's slope says nothing.
        change[0] = std::clamp(change[0], -2 * axes_[0].step_m, 2 * axes_[0].step_m);
        change[1] = std::clamp(change[1], -2 * axes_[1].step_m, 2 * axes_[1].step_m);
        bool better = false;
        for (int half = 0; half < 3 && !better; ++half, change /= 2) {
          const BreathState tried{
              std::clamp(moment.state.rib_cage_m + change[0], axes_[0].from_m(), axes_[0].to_m()),
              std::clamp(moment.state.diaphragm_m + change[1], axes_[1].from_m(), axes_[1].to_m())};
          const StateTerms there = state_terms(level, moment, tried);
          if (!(there.misfit < terms.misfit)) continue;
          better = true;
          moment.state = tried;
          terms = there;
        }
        if (!better || change.norm() < 0.02 * level.pixel_m) break;
      }
      moment.similarity = terms.similarity;
      moment.covariance = (terms.normal + prior_of_states()).inverse();
      misfits_[m] = terms.misfit;
    });
  }
  static Eigen::Matrix2d prior_of_states() {
    return Eigen::Vector2d(1 / (kPriorRibCageM * kPriorRibCageM), 1 / (kPriorDiaphragmM * kPriorDiaphragmM))
        .asDiagonal();
  }
  /// What is in all pictures and not in the CT (a couch, a tube, the edge of a collimator) loses its say:
  /// pixels where what is left is the same from the first to the last.
  void weigh(SeriesLevel& level) {
    for (std::size_t view = 0; view < views_.size(); ++view) {
      Eigen::VectorXf left;
      float count = 0;
      BreathingPictures::Looked looked;
      const std::size_t columns = level.views[view].columns(), rows = level.views[view].rows();
      for (const SeriesMoment& moment : fit_.moments) {
        for (const std::size_t picture : moment.pictures) {
          if (pictures_[picture].view != view) continue;
          tables_[view].look_up(moment.state, looked);
          const Eigen::VectorXf a = normalised_differences(level.images[picture].values, columns, rows),
                                b = normalised_differences(looked.value, columns, rows);
          if (left.size() == 0) left = Eigen::VectorXf::Zero(a.size());
          left += a - a.dot(b) * b;
          count += 1;
        }
      }
      const auto pixels = static_cast<std::size_t>(left.size()) / 2;
      std::vector<float> squares(pixels), sorted;
      for (std::size_t i = 0; i < pixels; ++i) {
        const float along = left[static_cast<Eigen::Index>(i)] / count,
                    down = left[static_cast<Eigen::Index>(i + pixels)] / count;
        squares[i] = along * along + down * down;
      }
      sorted = squares;
      std::ranges::nth_element(sorted, sorted.begin() + static_cast<std::ptrdiff_t>(pixels / 2));
      // Geman and McClure's weight; a normal deviation is some 1.2 times the median in two directions.
      constexpr float kTimes = 4;
      const float scale = std::max(kTimes * kTimes * sorted[pixels / 2] * 1.44F, 1e-20F);
      std::vector<float>& roots = level.roots[view];
      roots.assign(columns * rows, 0.0F);
      for (std::size_t row = 0; row + 1 < rows; ++row) {
        for (std::size_t column = 0; column + 1 < columns; ++column) {
          roots[row * columns + column] = 1 / (1 + squares[row * (columns - 1) + column] / scale);
        }
      }
    }
  }

  void make_slopes(const SeriesLevel& level) {
    slopes_.assign(views_.size(), {});
    for (std::size_t view = 0; view < views_.size(); ++view) {
      PoseSlopes& slopes = slopes_[view];
      slopes.rib_cage_m = {axes_[0].from_m(), axes_[0].to_m()};
      slopes.diaphragm_m = {axes_[1].from_m(), axes_[1].to_m()};
      const double step_m = kPoseStepPixels * level.pixel_m;
      for (const std::size_t unknown : unknowns_) {
        std::array<std::array<std::array<ProjectionImage, 2>, 2>, 2> images;  // side, rib cage, diaphragm
        for (std::size_t side = 0; side < 2; ++side) {
          const double by_m = side == 0 ? -step_m : step_m;
          Vector3 shift_m = shift_m_;
          Eigen::Matrix3d turn = turn_;
          std::array<double, 2> across_m{};
          if (unknown < kFirstTurn) shift_m[static_cast<Eigen::Index>(unknown)] += by_m;
          if (unknown >= kFirstTurn && unknown < kFirstAcross) {
            const Vector3 axis = Vector3::Unit(static_cast<Eigen::Index>(unknown - kFirstTurn));
            turn = Eigen::AngleAxisd(by_m / kLeverM, axis).toRotationMatrix() * turn_;
          }
          if (unknown >= kFirstAcross) across_m[unknown - kFirstAcross] = by_m;
          const ProjectionGeometry geometry = level.views[view].of_moved_patient(pose(shift_m, turn));
          std::optional<ProjectionImage> still;
          if (unknown < kFirstAcross) still = scene_.still(geometry);
          for (std::size_t r = 0; r < 2; ++r) {
            for (std::size_t d = 0; d < 2; ++d) {
              images[side][r][d] =
                  scene_.moving(geometry, {slopes.rib_cage_m[r], slopes.diaphragm_m[d]}, across_m);
              ++fit_.projections;
              if (still) add_to(images[side][r][d], *still);
            }
          }
        }
        for (std::size_t r = 0; r < 2; ++r) {
          for (std::size_t d = 0; d < 2; ++d) {
            const std::vector<float>&less = images[0][r][d].values, &more = images[1][r][d].values;
            std::vector<float> slope(less.size());
            for (std::size_t i = 0; i < slope.size(); ++i)
              slope[i] = (more[i] - less[i]) / static_cast<float>(2 * step_m);
            slopes.at[r][d].push_back(std::move(slope));
          }
        }
      }
    }
  }

  /// The equations of the pose, with the states eliminated.
  void collect(const SeriesLevel& level, std::size_t most_moments) {
    const auto pose_count = static_cast<Eigen::Index>(unknowns_.size());
    const std::size_t stride = std::max<std::size_t>(fit_.moments.size() / most_moments, 1);
    const std::size_t used = (fit_.moments.size() + stride - 1) / stride;
    std::vector<Eigen::MatrixXd> normals(used);
    std::vector<Eigen::VectorXd> rights(used);
    for_each_part(used, threads(), [&](std::size_t number) {
      const SeriesMoment& moment = fit_.moments[number * stride];
      Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(pose_count + 2, pose_count + 2);
      Eigen::VectorXd right = Eigen::VectorXd::Zero(pose_count + 2);
      BreathingPictures::Looked looked;
      std::vector<std::vector<float>> columns(static_cast<std::size_t>(pose_count));
      for (const std::size_t picture : moment.pictures) {
        const std::size_t view = pictures_[picture].view;
        tables_[view].look_up(moment.state, looked);
        std::vector<const float*> slopes;
        for (std::size_t i = 0; i < columns.size(); ++i) {
          between(slopes_[view], moment.state, i, columns[i]);
          slopes.push_back(columns[i].data());
        }
        slopes.push_back(looked.by_rib_cage.data());
        slopes.push_back(looked.by_diaphragm.data());
        const GradientTerms terms =
            gradient_terms(level.images[picture], looked.value, slopes, level.roots[view]);
        normal += terms.normal;
        right += terms.right;
      }
      const Eigen::Vector2d state(moment.state.rib_cage_m, moment.state.diaphragm_m);
      const Eigen::Matrix2d own = normal.bottomRightCorner<2, 2>() + prior_of_states();
      const Eigen::Vector2d own_right = right.tail<2>() - prior_of_states() * state;
      const Eigen::MatrixXd coupling = normal.topRightCorner(pose_count, 2) * own.inverse();
      normals[number] =
          normal.topLeftCorner(pose_count, pose_count) - coupling * normal.bottomLeftCorner(2, pose_count);
      rights[number] = right.head(pose_count) - coupling * own_right;
    });
    normal_ = Eigen::MatrixXd::Zero(pose_count, pose_count);
    right_ = Eigen::VectorXd::Zero(pose_count);
    votes_ = Eigen::MatrixXd::Zero(pose_count, pose_count);
    voters_ = used;
    for (std::size_t i = 0; i < used; ++i) {
      normal_ += normals[i];
      right_ += rights[i];
    }
    const Eigen::VectorXd mean = right_ / static_cast<double>(used);
    for (const Eigen::VectorXd& right : rights) votes_ += (right - mean) * (right - mean).transpose();
  }

  /// The picture's change by the unknown of that number.
  void between(const PoseSlopes& slopes, const BreathState& state, std::size_t number,
               std::vector<float>& column) const {
    const auto part = [](const std::array<double, 2>& ends, double value) {
      return std::clamp((value - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0);
    };
    const double r = part(slopes.rib_cage_m, state.rib_cage_m),
                 d = part(slopes.diaphragm_m, state.diaphragm_m);
    // A unit of direction moves the diaphragm as far as it goes.
    const double times = unknowns_[number] >= kFirstAcross ? state.diaphragm_m : 1;
    const std::vector<float>&a = slopes.at[0][0][number], &b = slopes.at[0][1][number],
          &c = slopes.at[1][0][number], &e = slopes.at[1][1][number];
    column.resize(a.size());
    const auto wa = static_cast<float>(times * (1 - r) * (1 - d)),
               wb = static_cast<float>(times * (1 - r) * d), wc = static_cast<float>(times * r * (1 - d)),
               we = static_cast<float>(times * r * d);
    for (std::size_t i = 0; i < column.size(); ++i) column[i] = wa * a[i] + wb * b[i] + wc * c[i] + we * e[i];
  }

  /// In units of the unknowns: metres, metres at the lever, parts of the diaphragm's way.
  [[nodiscard]] Eigen::VectorXd prior_of_pose() const {
    Eigen::VectorXd prior(normal_.rows());
    for (std::size_t i = 0; i < unknowns_.size(); ++i) {
      const double deviation = unknowns_[i] < kFirstTurn     ? kPriorShiftM
                               : unknowns_[i] < kFirstAcross ? kLeverM * kPriorTurnRad
                                                             : kPriorAcrossM;
      prior[static_cast<Eigen::Index>(i)] = 1 / (deviation * deviation);
    }
    return prior;
  }

  /// Whether it moves by anything that matters.
  bool move_pose(const SeriesLevel& level) {
    const Eigen::VectorXd prior = prior_of_pose();
    Eigen::MatrixXd normal = normal_;
    normal.diagonal() += damping_ * normal_.diagonal() + prior;
    Eigen::VectorXd change = normal.ldlt().solve(right_);
    constexpr double kMostPixels = 2;
    double longest = 0;
    for (std::size_t i = 0; i < unknowns_.size() && unknowns_[i] < kFirstAcross; ++i)
      longest = std::max(longest, std::abs(change[static_cast<Eigen::Index>(i)]));
    if (longest > kMostPixels * level.pixel_m) change *= kMostPixels * level.pixel_m / longest;
    Eigen::Matrix<double, kAllUnknowns, 1> by = Eigen::Matrix<double, kAllUnknowns, 1>::Zero();
    for (std::size_t i = 0; i < unknowns_.size(); ++i)
      by[static_cast<Eigen::Index>(unknowns_[i])] = change[static_cast<Eigen::Index>(i)];
    shift_m_ += by.head<3>();
    const Vector3 turn = by.segment<3>(kFirstTurn) / kLeverM;
    if (turn.norm() > 0) turn_ = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() * turn_;
    const Eigen::Vector2d across = by.tail<2>();
    if (options_.direction) {
      const std::array<Vector3, 2> axes = scene_.across_diaphragm();
      scene_.point_diaphragm(*scene_.diaphragm_direction() + across[0] * axes[0] + across[1] * axes[1]);
    }
    constexpr double kLeastPixels = 0.02, kLeastAcross = 0.002;
    return longest > kLeastPixels * level.pixel_m || across.norm() > kLeastAcross;
  }

  void finish_level(std::size_t number) {
    double sum = 0;
    for (const SeriesMoment& moment : fit_.moments) sum += moment.similarity;
    fit_.similarity_after = sum / static_cast<double>(fit_.moments.size());
    const bool finest =
        number + 1 == kFitLevels.size() || factor_of(number) == factor_of(kFitLevels.size() - 1);
    if (!finest || options_.lies_as_given || normal_.size() == 0) return;
    // Each moment's vote, so that what neighbouring pixels share is not counted as many.
    Eigen::MatrixXd normal = normal_;
    normal.diagonal() += prior_of_pose();
    const Eigen::MatrixXd inverse = normal.inverse();
    // What the pictures do not say stays as uncertain as it was before.
    const Eigen::MatrixXd prior = prior_of_pose().asDiagonal();
    fit_.pose_covariance = of_pose(inverse * (votes_ + prior) * inverse);
    fit_.pose_uncertainty = of_pose((normal_ / static_cast<double>(voters_) + prior).inverse());
  }
  /// From a covariance of the unknowns.
  static Eigen::Matrix<double, 6, 6> of_pose(const Eigen::MatrixXd& all) {
    Eigen::Matrix<double, 6, 6> covariance = all.topLeftCorner<6, 6>();
    covariance.bottomRows<3>() /= kLeverM;
    covariance.rightCols<3>() /= kLeverM;
    return covariance;
  }

  // What it comes to.

  void fit_waves() {
    std::vector<double> times_s, rib_cage_m, diaphragm_m, rib_cage_weights, diaphragm_weights;
    for (const SeriesMoment& moment : fit_.moments) {
      times_s.push_back(moment.time_s);
      rib_cage_m.push_back(moment.state.rib_cage_m);
      diaphragm_m.push_back(moment.state.diaphragm_m);
      constexpr double kFloorM2 = 1e-8;  // a tenth of a millimetre: nothing is known better
      rib_cage_weights.push_back(1 / (moment.covariance(0, 0) + kFloorM2));
      diaphragm_weights.push_back(1 / (moment.covariance(1, 1) + kFloorM2));
    }
    const double span_s = times_s.back() - times_s.front();
    if (fit_.waveform.periodic()) {
      const double given_s = fit_.waveform.duration_s();
      constexpr double kShorter = 0.6, kLonger = 1.6;
      // Less than a breath tells no cycle.
      if (span_s > kLonger * given_s) {
        fit_.cycle =
            fit_cycle(times_s, diaphragm_m, diaphragm_weights, kShorter * given_s, kLonger * given_s);
        fit_.waveform = Waveform(SineWave{fit_.cycle->cycle_s});
        tell_of_end(given_s, kShorter);
        tell_of_end(given_s, kLonger);
      }
    }
    constexpr double kLeastSpanS = 8;
    const bool drift = span_s > kLeastSpanS;
    if (!drift)
      fit_.findings.push_back("no drift was sought: the series lasts " + number_text(span_s, 3) + " s, and " +
                              number_text(kLeastSpanS) + " s are needed");
    const double cycle_error_s = fit_.cycle ? fit_.cycle->error_s : 0;
    fit_.rib_cage = fit_wave(times_s, rib_cage_m, rib_cage_weights, fit_.waveform, drift, cycle_error_s);
    fit_.diaphragm = fit_wave(times_s, diaphragm_m, diaphragm_weights, fit_.waveform, drift, cycle_error_s);
    take(fit_.rib_cage, fit_.motion.rib_cage);
    take(fit_.diaphragm, fit_.motion.diaphragm);
  }
  /// Where the cycle ends at so many times the given one, the patient's may lie beyond.
  void tell_of_end(double given_s, double times) {
    constexpr double kSame = 1e-3;
    const double end_s = times * given_s;
    if (std::abs(fit_.cycle->cycle_s - end_s) > kSame * end_s) return;
    fit_.findings.push_back("the breath's length ends where the search does, at " + number_text(end_s, 3) +
                            " s, " + number_text(times, 2) + " times the given one of " +
                            number_text(given_s, 3) + " s: the patient's may be " +
                            (times > 1 ? "longer" : "shorter") + "; give one that is nearer to it");
  }
  static void take(const WaveFit& wave, GroupMotion& motion) {
    motion.amplitude_m = wave.amplitude_m;
    motion.phase_s = wave.phase_s;
    motion.baseline_m = wave.baseline_m;
    motion.drift_m_per_s = wave.drift_m_per_s;
  }

  /// What the waveform alone says of the pictures' change, and what it would say by chance.
  void measure_change() {
    const SeriesLevel level = level_of(factor_of(0));
    std::vector<ProjectionGeometry> posed;
    for (const ProjectionGeometry& view : level.views)
      posed.push_back(view.of_moved_patient(pose(shift_m_, turn_)));
    std::vector<MovedPicture> moved;
    for (const SeriesMoment& moment : fit_.moments) {
      const BreathState state = by_waveform(moment.time_s);
      for (const std::size_t picture : moment.pictures)
        moved.push_back({pictures_[picture].view, &level.images[picture], state});
    }
    const SeriesChange change = explained_change(scene_, posed, moved, kNodePixels * level.pixel_m);
    fit_.change = change.explained;
    fit_.change_by_chance = change.by_chance;
  }
  [[nodiscard]] BreathState by_waveform(double time_s) const {
    return {
        std::clamp(fit_.motion.rib_cage.moved_m(fit_.waveform, time_s), -kMostRibCageM, kMostRibCageM),
        std::clamp(fit_.motion.diaphragm.moved_m(fit_.waveform, time_s), -kMostDiaphragmM, kMostDiaphragmM)};
  }

  void judge() {
    measure_change();
    const auto mm = [](double metres) { return number_text(1000 * metres, 2); };
    const std::string numbers = "the waveform moves the diaphragm by " + mm(fit_.diaphragm.amplitude_m) +
                                " +/- " + mm(fit_.diaphragm.amplitude_error_m) + " mm and explains " +
                                number_text(100 * fit_.diaphragm.explained, 2) +
                                " % of where it was seen; the pictures' change and its " + "DRRs' agree to " +
                                number_text(fit_.change, 2) + " (by chance " +
                                number_text(fit_.change_by_chance, 2) + "); gradient correlation " +
                                number_text(fit_.similarity_after, 3);
    if (fit_.similarity_after < kLeastSimilarity) {
      fit_.refusal = "the fit explains too little of the radiographs: " + numbers;
    } else if (fit_.change < kLeastChange || fit_.change < kTimesChance * fit_.change_by_chance ||
               fit_.diaphragm.amplitude_m < 3 * fit_.diaphragm.amplitude_error_m) {
      fit_.refusal =
          "no breathing was found in the series that this waveform describes: the patient does not breathe "
          "in "
          "it, the trace is that of another time, or the cycle is another: " +
          numbers;
    }
    if (fit_.rib_cage.amplitude_m < 2 * fit_.rib_cage.amplitude_error_m) {
      fit_.findings.push_back(
          "these views do not tell how the rib cage breathes: " + mm(fit_.rib_cage.amplitude_m) + " +/- " +
          mm(fit_.rib_cage.amplitude_error_m) + " mm");
    }
    std::size_t at_the_end = 0;
    for (const SeriesMoment& moment : fit_.moments) {
      if (std::abs(moment.state.diaphragm_m) >= kMostDiaphragmM ||
          std::abs(moment.state.rib_cage_m) >= kMostRibCageM)
        ++at_the_end;
    }
    if (at_the_end > 0) {
      fit_.findings.push_back(std::to_string(at_the_end) + " of " + std::to_string(fit_.moments.size()) +
                              " moments end where the search does, " + mm(kMostRibCageM) +
                              " mm of the rib cage or " + mm(kMostDiaphragmM) + " mm of the diaphragm");
    }
  }

  BreathingScene& scene_;
  const std::vector<ProjectionGeometry>& views_;
  std::span<const SeriesPicture> pictures_;
  const SeriesFitOptions& options_;
  SeriesFit fit_;
  Vector3 shift_m_ = Vector3::Zero(), tables_shift_m_ = Vector3::Zero();
  Eigen::Matrix3d turn_ = Eigen::Matrix3d::Identity(), tables_turn_ = Eigen::Matrix3d::Identity();
  std::vector<std::size_t> unknowns_;  // that are sought, ascending
  std::vector<StateAxis> axes_;        // rib cage, diaphragm; empty before the first table
  std::vector<BreathingPictures> tables_;
  std::vector<PoseSlopes> slopes_;
  Eigen::MatrixXd normal_, votes_;
  std::size_t voters_ = 1;
  Eigen::VectorXd right_;
  double damping_ = 1e-3;
  std::vector<double> misfits_ = std::vector<double>(moments_of(pictures_).size(), 0);
};

}  // namespace

SeriesFit fit_series(const BreathingModel& model, BreathingScene& scene,
                     const std::vector<ProjectionGeometry>& views, std::span<const SeriesPicture> pictures,
                     const SeriesFitOptions& options) {
  return SeriesFitter(model, scene, views, pictures, options).run();
}

}  // namespace kiroku::sim
