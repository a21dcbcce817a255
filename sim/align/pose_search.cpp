#include "sim/align/pose_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace kiroku::sim {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

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
        ++row[kinds.kind[static_cast<std::size_t>(y * width_ + x)]];
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

double entropy_part(double count, double of) { return count > 0 ? count * std::log(count / of) : 0; }

/// In nats a pixel, of belonging to the silhouette and kind of colour.
double mutual_information(const KindCounts::Counts& within, const KindCounts::Counts& all) {
  double sum = 0, pixels = 0, covered = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    pixels += all[k];
    covered += within[k];
  }
  if (covered <= 0 || covered >= pixels) return 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    sum += entropy_part(within[k], double(all[k]) * covered / pixels) +
           entropy_part(double(all[k]) - within[k], double(all[k]) * (pixels - covered) / pixels);
  }
  return sum / pixels;
}

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

/// Directions spread evenly over a cap of the sphere about z, by the golden angle.
std::vector<Vector3> directions_within(double spread_deg) {
  constexpr int kWholeSphere = 260;
  const double lowest = std::cos(spread_deg * kRadians), turn = std::numbers::pi * (3 - std::sqrt(5.0));
  const int count = std::max(1, static_cast<int>(std::lround(kWholeSphere * (1 - lowest) / 2)));
  std::vector<Vector3> all;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (i + 0.5) / count * (1 - lowest), across = std::sqrt(std::max(0.0, 1 - z * z));
    all.emplace_back(across * std::cos(turn * i), across * std::sin(turn * i), z);
  }
  return all;
}

/// Rows of a view that looks along -`towards`, turned about that by `roll`.
Eigen::Matrix3d view_from(const Vector3& towards, double roll) {
  const Vector3 up = std::abs(towards.z()) < 0.9 ? Vector3::UnitZ() : Vector3::UnitY();
  const Vector3 right = up.cross(towards).normalized();
  Eigen::Matrix3d to_view;
  to_view.row(0) = right;
  to_view.row(1) = towards.cross(right);
  to_view.row(2) = towards;
  return Eigen::AngleAxisd(roll, Vector3::UnitZ()).toRotationMatrix() * to_view;
}

Camera camera_before(const OrganSurface& surface, const Eigen::Matrix3d& to_view,
                     const Vector3& middle_view_m) {
  Camera camera;
  camera.to_view = to_view;
  camera.eye_m = surface.middle_m - to_view.transpose() * middle_view_m;
  return camera;
}

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

/// The best places of one silhouette over the picture.
Hypothesis best_place(const KindCounts& counts, const OrganSurface& surface, const Template& of, int side,
                      double field, double focal, const SearchRange& range) {
  Hypothesis best;
  constexpr int kEachRow = 2, kShift = 4;
  constexpr double kSizeStep = 1.2, kLeastInPicture = 0.45;
  const double template_focal = side / 2.0 / field;
  for (double depth_m = range.nearest_m; depth_m <= range.farthest_m; depth_m *= kSizeStep) {
    // Larger by as much as it is nearer and the picture's focal length longer.
    const double scale = of.depth_m / depth_m * focal / template_focal;
    const double area = of.area * scale * scale, pixels = double(counts.width()) * counts.height();
    constexpr double kLeastArea = 0.04, kMostArea = 1.5;
    if (area < kLeastArea * pixels || area > kMostArea * pixels) continue;
    for (int middle_y = 0; middle_y < counts.height(); middle_y += kShift) {
      for (int middle_x = 0; middle_x < counts.width(); middle_x += kShift) {
        KindCounts::Counts within{};
        double covered = 0;
        int last_row = -1;
        for (const Template::Run& run : of.runs) {
          const int y = middle_y + static_cast<int>(std::lround(scale * run.y));
          // Of a silhouette that is drawn smaller some rows fall together.
          if (y < 0 || y >= counts.height() || y % kEachRow != 0 || y < last_row) continue;
          const int repeats = std::max(1, static_cast<int>(std::ceil(scale)));
          last_row = y;
          for (int row = y; row < std::min(counts.height(), y + repeats); row += kEachRow) {
            const int from = std::clamp(middle_x + static_cast<int>(std::lround(scale * run.from)), 0,
                                        counts.width()),
                      to = std::clamp(middle_x + static_cast<int>(std::lround(scale * run.to)), 0,
                                      counts.width());
            if (from >= to) continue;
            counts.add(row, from, to, within);
            covered += to - from;
          }
        }
        if (covered * kEachRow < kLeastInPicture * area) continue;
        for (auto& count : within) count *= kEachRow;
        for (std::size_t k = 0; k < within.size(); ++k) within[k] = std::min(within[k], counts.all()[k]);
        const double information = mutual_information(within, counts.all());
        if (information <= best.information) continue;
        best.information = information;
        best.camera = camera_off_axis(surface, of, (middle_x - counts.width() / 2.0) / focal,
                                      (counts.height() / 2.0 - middle_y) / focal, depth_m);
      }
    }
  }
  return best;
}

}  // namespace

std::vector<OutlineFit> search_pose(const Picture& picture, const OrganSurface& surface,
                                    const Pinhole& pinhole, const SearchRange& range) {
  constexpr int kLesserSide = 60, kSide = 48;
  const int shrink = std::max(1, std::min(picture.width, picture.height) / kLesserSide);
  const KindCounts counts(kinds_of_colour(picture, shrink));
  const double focal = pinhole.focal_px / shrink, field = 0.4;
  const Eigen::Matrix3d about =
      Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), range.from.normalized()).toRotationMatrix();
  std::vector<Hypothesis> hypotheses;
  constexpr double kRollDeg = 20;
  for (const Vector3& direction : directions_within(range.spread_deg)) {
    for (double roll_deg = 0; roll_deg < 360; roll_deg += kRollDeg) {
      const auto drawn =
          template_of(surface, view_from(about * direction, roll_deg * kRadians), field, kSide);
      if (!drawn) continue;
      const Hypothesis best = best_place(counts, surface, *drawn, kSide, field, focal, range);
      if (best.information > 0) hypotheses.push_back(best);
    }
  }
  std::ranges::sort(hypotheses, std::greater{}, &Hypothesis::information);
  constexpr std::size_t kTried = 48;
  if (hypotheses.size() > kTried) hypotheses.resize(kTried);

  std::vector<OutlineFit> fits;
  const double unknown_m = 0.5 * range.farthest_m;
  for (Hypothesis& hypothesis : hypotheses) {
    hypothesis.camera.half_extent = {picture.width / 2.0 / pinhole.focal_px,
                                     picture.height / 2.0 / pinhole.focal_px};
    const Expected anywhere{hypothesis.camera, unknown_m * unknown_m * MotionCovariance::Identity()};
    constexpr double kCoarse = 12;
    OutlineFitOptions options;
    options.spacing_px = kCoarse;
    options.reach_px = std::min(picture.width, picture.height) / 14.0;
    const auto coarse = fit_outline(picture, surface, pinhole, anywhere, nullptr, options);
    if (coarse) fits.push_back(*coarse);
  }
  std::ranges::sort(fits, {}, &OutlineFit::misfit_px);
  // The best few to their end; what comes to the same place is one.
  constexpr std::size_t kFinished = 12;
  std::vector<OutlineFit> finished;
  for (std::size_t i = 0; i < fits.size() && i < kFinished; ++i) {
    const Expected anywhere{fits[i].camera, unknown_m * unknown_m * MotionCovariance::Identity()};
    const auto fine = fit_outline(picture, surface, pinhole, anywhere, nullptr, {16, 10, 5});
    if (!fine) continue;
    constexpr double kSame = 0.08;  // of the organ's radius
    const bool known = std::ranges::any_of(finished, [&](const OutlineFit& other) {
      return way_between_m(surface, other.camera, fine->camera) < kSame * surface.radius_m;
    });
    if (!known) finished.push_back(*fine);
  }
  std::ranges::sort(finished, {}, &OutlineFit::misfit_px);
  return finished;
}

}  // namespace kiroku::sim
