// Where a picture shows the organ's border along a normal of its outline, and how residuals of many such
// normals are weighed. Functions are pure and thread-safe.
//
// Source: the border is sought by what colours are within and around it, as Stoiber, Pfanne, Strobl, Triebel
// and Albu-Schäffer, "A Sparse Gaussian Approach to Region-Based 6DoF Object Tracking" (ACCV 2020).
#pragma once

#include <cstddef>
#include <vector>

#include "sim/align/colour_model.h"
#include "sim/align/silhouette.h"

namespace kiroku::sim {

// An outline says something where it is this much in the picture.
inline constexpr double kMarginPx = 4;  // of the picture's border, where codecs and lenses are at their worst
inline constexpr std::size_t kLeastLines = 24;
inline constexpr double kLeastOutlineShare = 0.25;

/// What the picture says along a normal.
struct Border {
  double off_px = 0;  // of the border from the outline, outwards
  double variance_px2 = 0;
  bool supported = false;  // it has the organ on its one side and something else on its other
  bool covered = false;    // no border, and cover hides much of the normal
};
/// Within `reach` pixels of the outline's point, inwards and outwards. Each place is as likely as the
/// evidence within it and against what is beyond.
Border seek_border(const ColourCells& cells, const ColourModel& model, const OutlinePoint& point, int reach);

/// Tukey's weight: 0 from `bound` on.
double tukey(double residual, double bound);

/// Of the residuals that count, 1.48 times the median of their sizes; at least 0.4 pixels. At least one.
double scale_of(const std::vector<double>& residuals_px);

/// How many neighbours along the outline say the same as one: 1 + 2 sum of the correlations, until they end.
/// `residuals_px` in their order along the outline, which is closed.
double correlation_length(const std::vector<double>& residuals_px);

}  // namespace kiroku::sim
