// Volumes whose radiographs are known, and measures of how two radiographs differ.
#pragma once

#include <cmath>
#include <functional>

#include "sim/drr/ct_projector.h"

namespace kiroku::test {

/// Cubes of voxels around the origin, HU by the place of their centres.
inline sim::Volume volume_of(std::size_t size, double spacing_m,
                             const std::function<double(const sim::Vector3&)>& hu_at) {
  sim::Volume volume;
  volume.grid.size = {size, size, size};
  volume.grid.spacing_m = sim::Vector3::Constant(spacing_m);
  volume.grid.origin_m = sim::Vector3::Constant(-0.5 * spacing_m * (double(size) - 1));
  for (std::size_t k = 0; k < size; ++k) {
    for (std::size_t j = 0; j < size; ++j) {
      for (std::size_t i = 0; i < size; ++i) {
        volume.hu.push_back(
            static_cast<float>(hu_at(volume.grid.patient_m({double(i), double(j), double(k)}))));
      }
    }
  }
  return volume;
}

/// A smooth body that is the same from no two sides and ends in air 45 mm from the origin.
inline double smooth_body_hu(const sim::Vector3& at) {
  const auto blob = [&](const sim::Vector3& centre, const sim::Vector3& radii, double hu) {
    return hu * std::exp(-(at - centre).cwiseQuotient(radii).squaredNorm());
  };
  const double fading = std::max(1 - std::pow(at.cwiseAbs().maxCoeff() / 0.045, 6), 0.0);
  return -1000 + fading * (blob({0.004, -0.006, 0.002}, {0.028, 0.022, 0.03}, 900) +
                           blob({-0.016, 0.01, 0.012}, {0.008, 0.007, 0.009}, 800) +
                           blob({0.015, 0.012, -0.016}, {0.007, 0.01, 0.006}, 1200));
}

/// A detector of 128 x 96 pixels that sees some 100 x 75 mm at the origin.
inline sim::ProjectionGeometry small_geometry(double gantry_deg) {
  return sim::ProjectionGeometry(
      sim::GantrySetup{1, 1.5, sim::Vector3::Zero(), gantry_deg, {128, 96}, {0.15, 0.1125}});
}

inline double greatest(const sim::ProjectionImage& image) {
  return double(*std::max_element(image.values.begin(), image.values.end()));
}
inline double sum(const sim::ProjectionImage& image) {
  double total = 0;
  for (const float value : image.values) total += double(value);
  return total;
}
/// Largest difference of a pixel to the greatest value of `b`.
inline double largest_difference(const sim::ProjectionImage& a, const sim::ProjectionImage& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    most = std::max(most, std::abs(double(a.values[i]) - double(b.values[i])));
  }
  return most / greatest(b);
}
/// Zero-mean normalised cross-correlation.
inline double zncc(const sim::ProjectionImage& a, const sim::ProjectionImage& b) {
  const double n = double(a.values.size()), mean_a = sum(a) / n, mean_b = sum(b) / n;
  double ab = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double x = double(a.values[i]) - mean_a, y = double(b.values[i]) - mean_b;
    ab += x * y;
    aa += x * x;
    bb += y * y;
  }
  return ab / std::sqrt(aa * bb);
}

}  // namespace kiroku::test
