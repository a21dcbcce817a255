// How a computed radiograph should change so that its gradient correlation with a measured one rises: one
// Gauss-Newton step of least squares on normalised differences of neighbouring pixels. Pure, thread-safe.
//
// With a the radiograph's differences along rows (and, likewise, down columns), b those of the DRR, both
// without their weighted mean and of length 1, c their correlation: |a - s b|^2 is least at s = c and then
// 1 - c^2. So the greatest correlation is where this is least, and its Gauss-Newton step has the matrix
// c^2 J^T J and the right side c J^T a, J the derivative of b. Both follow from the inner products of all
// pictures with each other.
#pragma once

#include <span>

#include <Eigen/Core>

#include "sim/drr/ct_projector.h"

namespace kiroku::sim {

struct GradientTerms {
  double similarity = 0;   // gradient correlation; weighted where weights were given
  double log_misfit = 0;   // ln (1 - c^2) of both directions; what a fit makes small
  Eigen::MatrixXd normal;  // divided by the misfit's variance: the information on what is sought
  Eigen::VectorXd right;
};

/// Neighbouring differences share noise and model errors: so many count as one.
inline constexpr double kSharedDifferences = 8;

/// `derivatives` are pictures of the same size as both, the change of `computed` by each unknown; `roots` of
/// the pixels' weights, too, or empty.
GradientTerms gradient_terms(const ProjectionImage& measured, std::span<const float> computed,
                             std::span<const float* const> derivatives, std::span<const float> roots);

/// Differences along rows, then down columns, each without its mean and divided by its length and the root of
/// two, so that the inner product of two pictures is their gradient correlation.
Eigen::VectorXf normalised_differences(std::span<const float> image, std::size_t columns, std::size_t rows);

}  // namespace kiroku::sim
