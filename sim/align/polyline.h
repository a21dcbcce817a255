// Lines of straight pieces, in a picture or in space: of at least two places. Functions are pure.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

namespace kiroku::sim {

template <typename Place>
double polyline_length(const std::vector<Place>& line) {
  double length = 0;
  for (std::size_t i = 1; i < line.size(); ++i) length += (line[i] - line[i - 1]).norm();
  return length;
}

/// `count` places, at least two, spread evenly over its length, both ends among them.
template <typename Place>
std::vector<Place> spread_over_polyline(const std::vector<Place>& line, std::size_t count) {
  std::vector<double> upto{0};
  for (std::size_t i = 1; i < line.size(); ++i) upto.push_back(upto.back() + (line[i] - line[i - 1]).norm());
  std::vector<Place> places;
  std::size_t segment = 1;
  for (std::size_t i = 0; i < count; ++i) {
    const double at = upto.back() * double(i) / double(count - 1);
    while (segment + 1 < line.size() && upto[segment] < at) ++segment;
    const double length = upto[segment] - upto[segment - 1];
    const double share = length > 0 ? std::clamp((at - upto[segment - 1]) / length, 0.0, 1.0) : 0;
    places.push_back(line[segment - 1] + share * (line[segment] - line[segment - 1]));
  }
  return places;
}

/// The place of a polyline that is nearest to another place.
struct NearestOnPolyline {
  std::size_t segment = 0;  // from that place of the line to the next
  double share = 0;         // along the segment
  Eigen::Vector2d at = Eigen::Vector2d::Zero();
  double squared_px2 = std::numeric_limits<double>::infinity();
  bool is_end = false;  // of the polyline, and the other place lies beyond it
};
inline NearestOnPolyline nearest_on_polyline(const std::vector<Eigen::Vector2d>& line,
                                             const Eigen::Vector2d& place) {
  NearestOnPolyline nearest;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Eigen::Vector2d way = line[i + 1] - line[i];
    const double length2 = way.squaredNorm();
    const double along = length2 > 0 ? (place - line[i]).dot(way) / length2 : 0;
    const double share = std::clamp(along, 0.0, 1.0);
    const Eigen::Vector2d at = line[i] + share * way;
    const double squared = (place - at).squaredNorm();
    if (squared >= nearest.squared_px2) continue;
    nearest = {i, share, at, squared, (i == 0 && along < 0) || (i + 2 == line.size() && along > 1)};
  }
  return nearest;
}

}  // namespace kiroku::sim
