// How far a computed path of a tumour is from where the tumour was measured or seen. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/drr/projection_geometry.h"
#include "sim/respiration/landmarks.h"
#include "sim/respiration/motion_fit.h"
#include "sim/respiration/timed_path.h"

namespace kiroku::apps {

struct PositionError {
  std::vector<double> times_s, in_space_mm, across_ray_mm;
  sim::Spread spread_mm;  // in space
};
/// How far a place is from where it was measured, in space and across the ray that shows it.
struct PlaceError {
  double in_space_mm = 0, across_ray_mm = 0;
};
PlaceError place_error_mm(const sim::Vector3& place_m, const sim::Vector3& measured_m,
                          const sim::Vector3& source_m);

/// At those moments of `measured` that the path knows. kiroku::Error, naming the file `measured` came from,
/// where there is none.
PositionError error_of(const sim::TimedPath& path, const sim::TimedPath& measured,
                       const sim::Vector3& source_m, const std::string& file);
/// As a picture (SVG).
std::string plot_of(const PositionError& error);

/// How far the place is from where a radiograph shows the tumour, across the ray and at the tumour's depth,
/// mm. Nothing where the place is not in front of the source.
std::optional<double> seen_error_mm(const sim::Vector3& place_m, const sim::RadiographPosition& seen,
                                    const sim::ProjectionGeometry& geometry);

}  // namespace kiroku::apps
