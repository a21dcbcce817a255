#include "sim/align/silhouette.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include <Eigen/Geometry>

namespace kiroku::sim {
namespace {

constexpr double kNearestM = 0.003;  // a lens touches what is nearer

/// Twice the area of a triangle, positive where its corners go anticlockwise in a picture whose y goes down.
double twice_area(const std::array<Eigen::Vector2d, 3>& at) {
  return (at[1].y() - at[0].y()) * (at[2].x() - at[0].x()) -
         (at[1].x() - at[0].x()) * (at[2].y() - at[0].y());
}

/// Pixels whose middle is within the triangle, row by row; depth runs evenly in its reciprocal.
void draw(Silhouette& into, const std::array<Eigen::Vector2d, 3>& at, const std::array<double, 3>& depth_m) {
  const Eigen::Vector2d low = at[0].cwiseMin(at[1]).cwiseMin(at[2]),
                        high = at[0].cwiseMax(at[1]).cwiseMax(at[2]);
  if (high.x() < 0 || high.y() < 0 || low.x() > into.width - 1 || low.y() > into.height - 1) return;
  const int top = std::max(0, static_cast<int>(std::ceil(low.y()))),
            bottom = std::min(into.height - 1, static_cast<int>(std::floor(high.y())));
  const double whole = twice_area(at);
  // The reciprocal of depth is linear over the picture.
  const double far0 = 1 / depth_m[0], of1 = 1 / depth_m[1] - far0, of2 = 1 / depth_m[2] - far0;
  const auto [farthest, nearest] = std::minmax({far0, far0 + of1, far0 + of2});
  const Eigen::Vector2d e1 = at[1] - at[0], e2 = at[2] - at[0];
  const double by_x = (of2 * e1.y() - of1 * e2.y()) / whole, by_y = (of1 * e2.x() - of2 * e1.x()) / whole;
  for (int y = top; y <= bottom; ++y) {
    // Where the row enters and leaves; a little more, so that no pixel between two triangles is of neither.
    constexpr double kSeam = 1e-6;
    double enters = high.x(), leaves = low.x();
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector2d &a = at[i], &b = at[(i + 1) % 3];
      if ((a.y() < y && b.y() < y) || (a.y() > y && b.y() > y)) continue;
      if (a.y() == b.y()) {
        enters = std::min({enters, a.x(), b.x()});
        leaves = std::max({leaves, a.x(), b.x()});
        continue;
      }
      const double x = a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
      enters = std::min(enters, x);
      leaves = std::max(leaves, x);
    }
    const int left = std::max(0, static_cast<int>(std::ceil(enters - kSeam))),
              right = std::min(into.width - 1, static_cast<int>(std::floor(leaves + kSeam)));
    float* const row =
        into.depth_m.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(into.width);
    double reciprocal = far0 + by_x * (left - at[0].x()) + by_y * (y - at[0].y());
    for (int x = left; x <= right; ++x, reciprocal += by_x) {
      // In a sliver, rounding would lead far off the plane.
      const auto depth = static_cast<float>(1 / std::clamp(reciprocal, farthest, nearest));
      if (row[x] == 0 || depth < row[x]) row[x] = depth;
    }
  }
}

/// Value and gradient between the pixels.
struct Slope {
  double value = 0;
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
};
Slope slope_at(const cv::Mat& smooth, double x, double y) {
  const int left = std::clamp(static_cast<int>(std::floor(x)), 1, smooth.cols - 3),
            top = std::clamp(static_cast<int>(std::floor(y)), 1, smooth.rows - 3);
  const double s = std::clamp(x - left, 0.0, 1.0), t = std::clamp(y - top, 0.0, 1.0);
  const auto at = [&](int row, int column) { return double(smooth.at<float>(row, column)); };
  const auto between = [&](auto&& of) {
    return (1 - t) * ((1 - s) * of(top, left) + s * of(top, left + 1)) +
           t * ((1 - s) * of(top + 1, left) + s * of(top + 1, left + 1));
  };
  return {between(at),
          {between([&](int row, int column) { return (at(row, column + 1) - at(row, column - 1)) / 2; }),
           between([&](int row, int column) { return (at(row + 1, column) - at(row - 1, column)) / 2; })}};
}

}  // namespace

std::optional<Silhouette> silhouette_of(const OrganSurface& surface, const Camera& camera,
                                        const Pinhole& pinhole, int width, int height, int shrink) {
  Silhouette made;
  made.shrink = shrink;
  made.width = width / shrink;
  made.height = height / shrink;
  made.depth_m.assign(static_cast<std::size_t>(made.width) * static_cast<std::size_t>(made.height), 0);
  std::vector<Eigen::Vector2d> pixels(surface.nodes.size());
  std::vector<double> depth_m(surface.nodes.size());
  for (std::size_t i = 0; i < surface.nodes.size(); ++i) {
    const Vector3 view = camera.view_m(surface.nodes[i]);
    if (!(-view.z() > kNearestM)) return {};
    // The middle of its first pixel is the middle of that many.
    pixels[i] = (pinhole.pixel(view).array() - (shrink - 1) / 2.0) / shrink;
    depth_m[i] = -view.z();
  }
  for (const auto& face : surface.faces) {
    // What faces away lies behind what faces the eye, as the surface is closed and the eye outside of it.
    const std::array<Eigen::Vector2d, 3> at{pixels[face[0]], pixels[face[1]], pixels[face[2]]};
    if (twice_area(at) > 0) draw(made, at, {depth_m[face[0]], depth_m[face[1]], depth_m[face[2]]});
  }
  return made;
}

Outline outline_of(const OrganSurface& surface, const Camera& camera, const Pinhole& pinhole,
                   const Silhouette& silhouette, double spacing_px, double margin_px) {
  // Drawn with room around it, so that the picture's border is none of the organ's.
  constexpr double kSmooth = 1.5;
  cv::Mat covered(silhouette.height, silhouette.width, CV_32F);
  for (int y = 0; y < silhouette.height; ++y) {
    for (int x = 0; x < silhouette.width; ++x) covered.at<float>(y, x) = silhouette.at(x, y) > 0 ? 1.F : 0.F;
  }
  cv::GaussianBlur(covered, covered, {}, kSmooth, kSmooth, cv::BORDER_REPLICATE);
  std::vector<Vector3> views(surface.nodes.size());
  for (std::size_t i = 0; i < views.size(); ++i) views[i] = camera.view_m(surface.nodes[i]);
  std::vector<bool> faces_eye(surface.faces.size());
  for (std::size_t i = 0; i < surface.faces.size(); ++i) {
    const auto& [a, b, c] = surface.faces[i];
    faces_eye[i] = (views[b] - views[a]).cross(views[c] - views[a]).dot(views[a]) < 0;
  }
  const double width = silhouette.width * silhouette.shrink, height = silhouette.height * silhouette.shrink;
  const auto inside_by = [&](const Eigen::Vector2d& pixel, double by) {
    return pixel.x() >= by && pixel.y() >= by && pixel.x() <= width - 1 - by && pixel.y() <= height - 1 - by;
  };
  Outline outline;
  double seen_px = 0, all_px = 0, carried_px = spacing_px / 2;
  for (const OrganSurface::Edge& edge : surface.edges) {
    if (faces_eye[edge.faces[0]] == faces_eye[edge.faces[1]]) continue;
    const Vector3 &a = views[edge.nodes[0]], &b = views[edge.nodes[1]];
    const Eigen::Vector2d from = pinhole.pixel(a), to = pinhole.pixel(b);
    const double length_px = (to - from).norm();
    // Whether an edge beyond the picture is of the outline cannot be seen here; most are.
    if (!inside_by(from, margin_px) && !inside_by(to, margin_px)) all_px += length_px;
    for (double along = carried_px; along < length_px; along += spacing_px) {
      const double share = along / length_px;
      const double depth = 1 / ((1 - share) / -a.z() + share / -b.z());
      OutlinePoint point;
      point.pixel = from + share * (to - from);
      point.view_m = pinhole.place_m(point.pixel, depth);
      point.nodes = edge.nodes;
      point.along = share * depth / -b.z();  // even in the picture is not even on the edge
      if (!inside_by(point.pixel, margin_px)) continue;
      const Eigen::Vector2d small = (point.pixel.array() - (silhouette.shrink - 1) / 2.0) / silhouette.shrink;
      const Slope slope = slope_at(covered, small.x(), small.y());
      const double steepness = slope.gradient.norm();
      // The border is where half is covered; what lies further off it is within the silhouette.
      constexpr double kLeastSteepness = 0.08, kMostOff = 1.2;
      if (steepness < kLeastSteepness) continue;
      const double off = (slope.value - 0.5) / steepness;
      if (std::abs(off) > kMostOff) continue;
      point.outward = -slope.gradient / steepness;
      point.pixel += off * silhouette.shrink * point.outward;
      outline.points.push_back(point);
      seen_px += spacing_px;
    }
    carried_px = std::fmod(carried_px - length_px, spacing_px);
    if (carried_px < 0) carried_px += spacing_px;
  }
  outline.share_in_picture = seen_px > 0 ? seen_px / (seen_px + all_px) : 0;
  return outline;
}

}  // namespace kiroku::sim
