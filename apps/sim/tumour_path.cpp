#include "apps/sim/tumour_path.h"

#include "base/error.h"
#include "base/number_text.h"
#include "sim/respiration/line_plot.h"

namespace kiroku::apps {
namespace {

constexpr double kMmPerM = 1000;

double across_ray_mm(const sim::Vector3& offset_m, const sim::Vector3& ray) {
  return kMmPerM * (offset_m - offset_m.dot(ray) * ray).norm();
}

}  // namespace

PlaceError place_error_mm(const sim::Vector3& place_m, const sim::Vector3& measured_m,
                          const sim::Vector3& source_m) {
  const sim::Vector3 offset = place_m - measured_m;
  return {kMmPerM * offset.norm(), across_ray_mm(offset, (measured_m - source_m).normalized())};
}

PositionError error_of(const sim::TimedPath& path, const sim::TimedPath& measured,
                       const sim::Vector3& source_m, const std::string& file) {
  PositionError error;
  for (std::size_t i = 0; i < measured.times_s.size(); ++i) {
    const auto place = path.place_at(measured.times_s[i]);
    if (!place) continue;
    const PlaceError there = place_error_mm(*place, measured.points_m[i], source_m);
    error.times_s.push_back(measured.times_s[i]);
    error.in_space_mm.push_back(there.in_space_mm);
    error.across_ray_mm.push_back(there.across_ray_mm);
  }
  if (error.times_s.empty()) {
    throw Error("cannot use " + file + ": none of its moments is among those of --path, " +
                number_text(path.times_s.front()) + " to " + number_text(path.times_s.back()) + " s");
  }
  error.spread_mm = sim::spread_of(error.in_space_mm);
  return error;
}

std::string plot_of(const PositionError& error) {
  sim::LinePlot plot{"Path from the measured places", "time, s", "mm", {}};
  plot.lines.push_back({"in space", error.times_s, error.in_space_mm});
  plot.lines.push_back({"as the radiograph shows it", error.times_s, error.across_ray_mm});
  return sim::plot_svg(plot);
}

std::optional<double> seen_error_mm(const sim::Vector3& place_m, const sim::RadiographPosition& seen,
                                    const sim::ProjectionGeometry& geometry) {
  if (!geometry.project(place_m)) return std::nullopt;
  const sim::SourceRay ray = geometry.ray(seen.column, seen.row);
  return across_ray_mm(place_m - ray.origin_m, ray.direction);
}

}  // namespace kiroku::apps
