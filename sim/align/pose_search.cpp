#include "sim/align/pose_search.h"

#include <algorithm>
#include <cmath>
#include <thread>

#include <Eigen/Geometry>

#include "base/parallel.h"

namespace kiroku::sim {
namespace {

/// For each kind and row, how many pixels of that kind are left of a column.
class KindCounts {
 public:
  explicit KindCounts(const KindsOfColour& kinds)
      : width_(kinds.width),
        height_(kinds.height),
        left_(static_cast<std::size_t>(kinds.height) * row_size()) {
    for (int y = 0; y < height_; ++y) {
      Count* row = left_.data() + static_cast<std::size_t>(y) * row_size();
      for (int x = 0; x < width_; ++x) {
        std::copy_n(row, KindsOfColour::kKinds, row + KindsOfColour::kKinds);
        row += KindsOfColour::kKinds;
        const std::uint8_t kind = kinds.kind[static_cast<std::size_t>(y * width_ + x)];
        if (kind != KindsOfColour::kCovered) ++row[kind];
      }
      for (int k = 0; k < KindsOfColour::kKinds; ++k) all_[static_cast<std::size_t>(k)] += row[k];
    }
  }
  using Count = int;
  using Counts = std::array<Count, KindsOfColour::kKinds>;
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] const Counts& all() const { return all_; }
  /// Adds the kinds of the row from column `from` up to but without `to`, both within the picture.
  void add(int y, int from, int to, Counts& counts) const {
    const Count* const row = left_.data() + static_cast<std::size_t>(y) * row_size();
    const Count* const a = row + static_cast<std::ptrdiff_t>(from) * KindsOfColour::kKinds;
    const Count* const b = row + static_cast<std::ptrdiff_t>(to) * KindsOfColour::kKinds;
    for (std::size_t k = 0; k < counts.size(); ++k) counts[k] += b[k] - a[k];
  }

 private:
  [[nodiscard]] std::size_t row_size() const {
    return static_cast<std::size_t>(width_ + 1) * KindsOfColour::kKinds;
  }
  int width_, height_;
  std::vector<Count> left_;
  Counts all_{};
};

/// In nats a pixel, of belonging to the silhouette and kind of colour.
class MutualInformation {
 public:
  explicit MutualInformation(const KindCounts::Counts& all) : all_(all) {
    for (const auto count : all) pixels_ += count;
    times_log_.resize(static_cast<std::size_t>(pixels_) + 1);
    for (std::size_t n = 2; n < times_log_.size(); ++n) times_log_[n] = double(n) * std::log(double(n));
    for (const auto count : all) whole_ += of(count);
    whole_ -= of(pixels_);
  }
  [[nodiscard]] double operator()(const KindCounts::Counts& within) const {
    KindCounts::Count covered = 0;
    double sum = 0;
    for (std::size_t k = 0; k < all_.size(); ++k) {
      covered += within[k];
      sum += of(within[k]) + of(all_[k] - within[k]);
    }
    if (covered <= 0 || covered >= pixels_) return 0;
    return (sum - of(covered) - of(pixels_ - covered) - whole_) / pixels_;
  }

 private:
  [[nodiscard]] double of(KindCounts::Count count) const {
    return times_log_[static_cast<std::size_t>(count)];
  }
  KindCounts::Counts all_;
  KindCounts::Count pixels_ = 0;
  std::vector<double> times_log_;  // n log n
  double whole_ = 0;
};

/// A silhouette by its rows, about its own middle.
struct Template {
  Eigen::Matrix3d to_view;
  double depth_m = 0;
  struct Run {
    int y, from, to;
  };
  std::vector<Run> runs;
  double area = 0;
};

std::optional<Template> template_of(const OrganSurface& surface, const Eigen::Matrix3d& to_view, double field,
                                    int side) {
  Template made;
  made.to_view = to_view;
  // So that all of it is in a square picture of that side.
  constexpr double kRoom = 1.02;
  const Pinhole pinhole{side / 2.0 / field, (side - 1) / 2.0, (side - 1) / 2.0};
  made.depth_m = kRoom * surface.reach_m * std::sqrt(1 + 1 / (field * field));
  const auto drawn =
      silhouette_of(surface, camera_before(surface, to_view, {0, 0, -made.depth_m}), pinhole, side, side, 1);
  if (!drawn) return {};
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side;) {
      if (!(drawn->at(x, y) > 0)) {
        ++x;
        continue;
      }
      const int from = x;
      while (x < side && drawn->at(x, y) > 0) ++x;
      made.runs.push_back({y - side / 2, from - side / 2, x - side / 2});
      made.area += x - from;
    }
  }
  return made;
}

struct Hypothesis {
  double information = 0;
  Camera camera;
};

/// The organ seen from a direction, its middle off the picture's: it turns with the ray that it is seen
/// along.
Camera camera_off_axis(const OrganSurface& surface, const Template& of, double x, double y, double depth_m) {
  const Vector3 ray(x, y, -1);
  const Eigen::Matrix3d turn =
      Eigen::Quaterniond::FromTwoVectors(-Vector3::UnitZ(), ray.normalized()).toRotationMatrix();
  return camera_before(surface, turn * of.to_view, ray.normalized() * depth_m);
}

constexpr int kEachRow = 2, kShift = 4;

/// The rows of a silhouette at another size, every second one, about its middle.
std::vector<Template::Run> scaled_rows(const Template& of, double scale) {
  std::vector<Template::Run> rows;
  const int first = static_cast<int>(std::floor(scale * of.runs.front().y)) / kEachRow * kEachRow - kEachRow,
            last = static_cast<int>(std::ceil(scale * (of.runs.back().y + 1))) + kEachRow;
  auto run = of.runs.begin();
  for (int y = first; y <= last; y += kEachRow) {
    const auto source = static_cast<int>(std::lround(y / scale));
    while (run != of.runs.end() && run->y < source) ++run;
    for (auto same = run; same != of.runs.end() && same->y == source; ++same)
      rows.push_back({y, static_cast<int>(std::lround(scale * same->from)),
                      static_cast<int>(std::lround(scale * same->to))});
  }
  return rows;
}

/// The best place of one silhouette over the picture.
Hypothesis best_place(const KindCounts& counts, const MutualInformation& information_of,
                      const OrganSurface& surface, const Template& of, int side, double field,
                      const Pinhole& pinhole, const SearchRange& range) {
  Hypothesis best;
  constexpr double kSizeStep = 1.2, kLeastInPicture = 0.45;
  const double template_focal = side / 2.0 / field;
  for (double depth_m = range.nearest_m; depth_m <= range.farthest_m; depth_m *= kSizeStep) {
    // Larger by as much as it is nearer and the picture's focal length longer.
    const double scale = of.depth_m / depth_m * pinhole.focal_px / template_focal;
    const double area = of.area * scale * scale, pixels = double(counts.width()) * counts.height();
    constexpr double kLeastArea = 0.04, kMostArea = 1.5;
    if (area < kLeastArea * pixels || area > kMostArea * pixels) continue;
    const std::vector<Template::Run> rows = scaled_rows(of, scale);
    for (int middle_y = 0; middle_y < counts.height(); middle_y += kShift) {
      for (int middle_x = 0; middle_x < counts.width(); middle_x += kShift) {
        KindCounts::Counts within{};
        int covered = 0;
        for (const Template::Run& run : rows) {
          const int y = middle_y + run.y;
          if (y < 0 || y >= counts.height()) continue;
          const int from = std::clamp(middle_x + run.from, 0, counts.width()),
                    to = std::clamp(middle_x + run.to, 0, counts.width());
          if (from >= to) continue;
          counts.add(y, from, to, within);
          covered += to - from;
        }
        if (covered * kEachRow < kLeastInPicture * area) continue;
        for (std::size_t k = 0; k < within.size(); ++k)
          within[k] = std::min(within[k] * kEachRow, counts.all()[k]);
        const double information = information_of(within);
        if (information <= best.information) continue;
        best.information = information;
        best.camera = camera_off_axis(surface, of, (middle_x - pinhole.middle_x) / pinhole.focal_px,
                                      (pinhole.middle_y - middle_y) / pinhole.focal_px, depth_m);
      }
    }
  }
  return best;
}

constexpr int kTemplateSide = 48;
constexpr double kTemplateField = 0.4;

unsigned cores() { return std::max(1U, std::thread::hardware_concurrency()); }

}  // namespace

struct PoseSearch::Bank {
  std::vector<Template> templates;
};

PoseSearch::PoseSearch(const OrganSurface& surface, const SearchRange& range)
    : surface_(surface), range_(range), bank_(std::make_unique<Bank>()) {
  for (const Eigen::Matrix3d& view : views_within(range)) {
    auto drawn = template_of(surface, view, kTemplateField, kTemplateSide);
    if (drawn && !drawn->runs.empty()) bank_->templates.push_back(std::move(*drawn));
  }
}

PoseSearch::~PoseSearch() = default;

std::vector<OutlineFit> PoseSearch::find(const Picture& picture, const Cover& cover, const ColourCells& cells,
                                         const Pinhole& pinhole) const {
  constexpr int kLesserSide = 60;
  const int shrink = std::max(1, std::min(picture.width, picture.height) / kLesserSide);
  const KindCounts counts(kinds_of_colour(picture, cover, shrink));
  const MutualInformation information_of(counts.all());
  // A silhouette's middle lies between two pixels.
  const Pinhole small{pinhole.focal_px / shrink, (pinhole.middle_x + 0.5) / shrink,
                      (pinhole.middle_y + 0.5) / shrink};
  std::vector<Hypothesis> hypotheses(bank_->templates.size());
  for_each_part(hypotheses.size(), cores(), [&](std::size_t i) {
    hypotheses[i] = best_place(counts, information_of, surface_, bank_->templates[i], kTemplateSide,
                               kTemplateField, small, range_);
  });
  std::erase_if(hypotheses, [](const Hypothesis& each) { return each.information <= 0; });
  std::ranges::stable_sort(hypotheses, std::greater{}, &Hypothesis::information);
  constexpr std::size_t kTried = 48;
  if (hypotheses.size() > kTried) hypotheses.resize(kTried);

  const double unknown_m = 0.5 * range_.farthest_m;
  const MotionCovariance unknown_m2 = unknown_m * unknown_m * MotionCovariance::Identity();
  const auto fitted = [&](const std::vector<Camera>& from, const OutlineFitOptions& options) {
    std::vector<std::optional<OutlineFit>> each(from.size());
    for_each_part(from.size(), cores(), [&](std::size_t i) {
      each[i] = fit_outline(cells, surface_, pinhole, {from[i], unknown_m2}, nullptr, options);
    });
    std::vector<OutlineFit> fits;
    for (const auto& fit : each) {
      if (fit) fits.push_back(*fit);
    }
    std::ranges::stable_sort(fits, {}, &OutlineFit::misfit_px);
    return fits;
  };
  const auto cameras_of = [](const auto& all) {
    std::vector<Camera> cameras;
    for (const auto& each : all) cameras.push_back(each.camera);
    return cameras;
  };

  std::vector<Camera> cameras = cameras_of(hypotheses);
  for (Camera& camera : cameras) set_picture(camera, pinhole, picture.width, picture.height);
  OutlineFitOptions coarse;
  coarse.spacing_px = 12;
  coarse.shrink = 4;
  coarse.reach_px = std::min(picture.width, picture.height) / 14.0;
  // The best few to their end.
  constexpr std::size_t kFinished = 12;
  constexpr double kNearlySame = 0.04, kSame = 0.08;
  const std::vector<OutlineFit> begun =
      different_places(surface_, fitted(cameras, coarse), kNearlySame, kFinished);
  OutlineFitOptions fine;
  fine.rounds = 10;
  fine.spacing_px = 5;
  return different_places(surface_, fitted(cameras_of(begun), fine), kSame, kFinished);
}

}  // namespace kiroku::sim
