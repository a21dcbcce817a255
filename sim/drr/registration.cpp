#include "sim/drr/registration.h"

#include <array>
#include <cmath>

#include "base/error.h"

namespace kiroku::sim {
namespace {

/// Sums of a normalised cross-correlation.
struct Correlation {
  double n = 0, a = 0, b = 0, ab = 0, aa = 0, bb = 0;
  void add(double x, double y) {
    n += 1;
    a += x;
    b += y;
    ab += x * y;
    aa += x * x;
    bb += y * y;
  }
  [[nodiscard]] double value() const {
    const double variances = (aa - a * a / n) * (bb - b * b / n);
    return variances > 0 ? (ab - a * b / n) / std::sqrt(variances) : 0;
  }
};

using Parameters = std::array<double, 6>;  // translation, m; rotation, rad

Eigen::Isometry3d motion_of(const Parameters& at, const Vector3& centre_m) {
  return rigid_motion({at[0], at[1], at[2]}, {at[3], at[4], at[5]}, centre_m);
}

/// A level of the search: pixels, and the steps it begins and ends with as parts of a pixel.
struct Level {
  std::size_t most_pixels;
  double first_step, last_step;
};
constexpr std::array<Level, 3> kLevels{{{64, 2, 0.5}, {128, 1, 0.25}, {256, 0.5, 0.125}}};
/// A turn moves what is so far from the centre as a shift does.
constexpr double kLeverM = 0.1;
constexpr std::size_t kMostRounds = 40;

}  // namespace

double gradient_correlation(const ProjectionImage& a, const ProjectionImage& b) {
  if (a.columns != b.columns || a.rows != b.rows) {
    throw Error("one picture has " + std::to_string(a.columns) + " x " + std::to_string(a.rows) +
                " pixels, the other " + std::to_string(b.columns) + " x " + std::to_string(b.rows));
  }
  if (a.columns < 2 || a.rows < 2) throw Error("pictures of fewer than 2 x 2 pixels cannot be compared");
  Correlation along, down;
  for (std::size_t row = 0; row + 1 < a.rows; ++row) {
    for (std::size_t column = 0; column + 1 < a.columns; ++column) {
      const std::size_t at = row * a.columns + column;
      along.add(double(a.values[at + 1]) - double(a.values[at]),
                double(b.values[at + 1]) - double(b.values[at]));
      down.add(double(a.values[at + a.columns]) - double(a.values[at]),
               double(b.values[at + b.columns]) - double(b.values[at]));
    }
  }
  return (along.value() + down.value()) / 2;
}

ProjectionImage binned(const ProjectionImage& image, std::size_t factor) {
  ProjectionImage result{image.columns / factor, image.rows / factor, {}};
  for (std::size_t row = 0; row < result.rows; ++row) {
    for (std::size_t column = 0; column < result.columns; ++column) {
      double sum = 0;
      for (std::size_t i = 0; i < factor * factor; ++i) {
        sum +=
            double(image.values[(row * factor + i / factor) * image.columns + column * factor + i % factor]);
      }
      result.values.push_back(static_cast<float>(sum / double(factor * factor)));
    }
  }
  return result;
}

Eigen::Isometry3d rigid_motion(const Vector3& translation_m, const Vector3& rotation_rad,
                               const Vector3& centre_m) {
  const double angle = rotation_rad.norm();
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.translate(centre_m + translation_m);
  if (angle > 0) motion.rotate(Eigen::AngleAxisd(angle, rotation_rad / angle));
  motion.translate(-centre_m);
  return motion;
}

Registration register_rigidly(const ProjectionImage& radiograph, const ProjectionGeometry& geometry,
                              const Vector3& centre_m,
                              const std::function<ProjectionImage(const ProjectionGeometry&)>& project,
                              const std::function<void(std::size_t, std::size_t)>& progress) {
  const std::array<RegistrationView, 1> views{{{radiograph, geometry}}};
  return register_rigidly(views, centre_m, project, progress);
}

Registration register_rigidly(std::span<const RegistrationView> views, const Vector3& centre_m,
                              const std::function<ProjectionImage(const ProjectionGeometry&)>& project,
                              const std::function<void(std::size_t, std::size_t)>& progress) {
  for (const auto& [radiograph, geometry] : views) {
    if (radiograph.columns == geometry.columns() && radiograph.rows == geometry.rows()) continue;
    throw Error("the radiograph has " + std::to_string(radiograph.columns) + " x " +
                std::to_string(radiograph.rows) + " pixels, the geometry " +
                std::to_string(geometry.columns()) + " x " + std::to_string(geometry.rows()) +
                "; give the geometry that it was made with");
  }
  Registration result;
  const auto similarity = [&](std::span<const RegistrationView> seen, const Parameters& at) {
    double sum = 0;
    for (const auto& [radiograph, geometry] : seen) {
      ++result.projections;
      sum += gradient_correlation(radiograph, project(geometry.of_moved_patient(motion_of(at, centre_m))));
    }
    return sum / static_cast<double>(seen.size());
  };
  Parameters best{};
  result.similarity_before = similarity(views, best);
  for (std::size_t number = 0; number < kLevels.size(); ++number) {
    const Level& level = kLevels[number];
    std::vector<RegistrationView> coarse;
    for (const auto& [radiograph, geometry] : views) {
      const std::size_t factor =
          std::max<std::size_t>(std::min(geometry.columns(), geometry.rows()) / level.most_pixels, 1);
      coarse.push_back({binned(radiograph, factor), geometry.binned(factor)});
    }
    // What a pixel is at the patient.
    const PixelPoint centre = coarse.front().geometry.project(centre_m).value_or(PixelPoint{0, 0, 1});
    const double pixel_m = centre.depth_m * coarse.front().geometry.pixel_rays().along_row.norm();
    double value = similarity(coarse, best);
    double step_m = level.first_step * pixel_m;
    for (std::size_t round = 0; round < kMostRounds && step_m >= level.last_step * pixel_m; ++round) {
      if (progress) progress(number * kMostRounds + round, kLevels.size() * kMostRounds);
      const Parameters before = best;
      const auto try_at = [&](const Parameters& at) {
        const double found = similarity(coarse, at);
        if (!(found > value)) return false;
        value = found;
        best = at;
        return true;
      };
      for (std::size_t i = 0; i < best.size(); ++i) {
        const double step = i < 3 ? step_m : step_m / kLeverM;
        Parameters at = best;
        at[i] += step;
        if (try_at(at)) continue;
        at[i] -= 2 * step;
        try_at(at);
      }
      if (best == before) {
        step_m /= 2;
        continue;
      }
      // Once more the same way: valleys run across the axes.
      Parameters further = best;
      for (std::size_t i = 0; i < best.size(); ++i) further[i] += best[i] - before[i];
      try_at(further);
    }
  }
  result.similarity_after = similarity(views, best);
  // Coarse pixels may have misled it.
  if (result.similarity_after < result.similarity_before) {
    best = {};
    result.similarity_after = result.similarity_before;
  }
  result.translation_m = {best[0], best[1], best[2]};
  result.rotation_rad = {best[3], best[4], best[5]};
  result.motion = motion_of(best, centre_m);
  return result;
}

}  // namespace kiroku::sim
