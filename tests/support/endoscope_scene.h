// An organ as an endoscope sees it, rendered with its place known in every picture: textured, lit from beside
// the lens, before fat and muscle, with tools, smoke, highlights and noise where they are asked for. Fixed
// seeds: the same pictures everywhere.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "sim/align/organ_surface.h"
#include "sim/mesh/tet_grid.h"
#include "sim/render/surface_renderer.h"

namespace kiroku::test {

/// Like a liver: 16 cm wide, thick on its right, its left lobe thin, its lower border slanted and notched.
/// The same shape of however many cells.
inline sim::TetMesh liver_like_mesh(const std::array<std::uint32_t, 3>& cells) {
  sim::TetMesh mesh = sim::tet_grid(cells, {2, 2, 2});
  for (sim::Vector3& node : mesh.nodes) {
    sim::Vector3 at = node - sim::Vector3::Ones();
    const double shell = at.cwiseAbs().maxCoeff();
    if (shell > 0) at *= 1 - 0.5 * shell + 0.6 * shell * shell / at.norm();
    const double thin = 1 - 0.4 * at.x();
    at.y() = at.y() * thin + 0.3 * at.x() * at.x();
    at.z() *= 1 - 0.3 * at.x();
    at.z() += 0.3 * at.x();
    if (at.z() < 0.3) at.z() += 0.35 * std::exp(-std::pow((at.x() - 0.25) / 0.18, 2)) * (0.3 - at.z());
    node = at.cwiseProduct(sim::Vector3(0.08, 0.028, 0.05));
  }
  return mesh;
}

/// Like a kidney: 11 cm high, bent.
inline sim::TetMesh kidney_like_mesh(const std::array<std::uint32_t, 3>& cells) {
  sim::TetMesh mesh = sim::tet_grid(cells, {2, 2, 2});
  for (sim::Vector3& node : mesh.nodes) {
    sim::Vector3 at = node - sim::Vector3::Ones();
    const double shell = at.cwiseAbs().maxCoeff();
    if (shell > 0) at *= shell / at.norm();
    at.x() += 0.9 * at.z() * at.z();
    node = at.cwiseProduct(sim::Vector3(0.025, 0.025, 0.055));
  }
  return mesh;
}

/// Soft spots of about that size, -1 to 1, no two places alike.
inline double spots(const sim::Vector3& at_m, double size_m) {
  const sim::Vector3 p = at_m / size_m;
  return (std::sin(5.1 * p.x() + 1.7 * std::sin(2.3 * p.z() + 0.4)) *
              std::cos(4.3 * p.z() + 1.9 * std::sin(1.7 * p.y())) +
          std::sin(3.7 * p.y() + 2.1 * std::sin(2.9 * p.x()) + 1.3 * p.z())) /
         2;
}

struct EndoscopeScene {
  static constexpr int kWidth = 640, kHeight = 480;
  static constexpr double kFieldDeg = 60;

  /// `clip`: a picture of a real operation. The organ then has its light and dark, and the wall behind its
  /// colours.
  explicit EndoscopeScene(const sim::TetMesh& mesh, std::optional<sim::Picture> clip = {})
      : surface_(sim::organ_surface(mesh)), renderer_(mesh, sim::GpuUse::kOff), clip_(std::move(clip)) {
    double mean = 0;
    if (clip_) {
      for (const std::uint8_t value : clip_->rgb) mean += value / double(clip_->rgb.size());
    }
    for (const sim::Vector3& node : mesh.nodes) {
      double light = 1 + 0.16 * spots(node, 0.03) + 0.14 * spots(node, 0.014);
      if (clip_) {
        const auto [red, green, blue] = clip_at({node.x() / 0.1, node.z() / 0.1});
        light = std::clamp((red + green + blue) / 3 / mean, 0.65, 1.5);
      }
      const double red = 158 * light, green = (64 + 8 * spots(node, 0.05)) * light, blue = 54 * light;
      colours_.push_back({level(red), level(green), level(blue)});
    }
  }

  struct Look {
    sim::Camera camera;
    bool organ = true;
    std::vector<double> displacement_m;  // (3 |V|), of the organ's nodes; empty for none
    std::vector<sim::MarkedSolid> tools;
    double smoke = 0;  // 0 to 1: how much of the picture is smoke alone
    double noise = 4;  // standard deviation, of 255
    double shine = 1;  // 0: dull; the larger, the more of the organ shines
    std::uint32_t seed = 1;
  };

  /// The camera that looks from so many degrees aside and above, at that distance, turned about its axis,
  /// with the organ's middle so far aside in the picture (1: by half of its lesser side).
  [[nodiscard]] sim::Camera camera(double azimuth_deg, double elevation_deg, double distance_m,
                                   double roll_deg,
                                   const Eigen::Vector2d& aside = Eigen::Vector2d::Zero()) const {
    constexpr double kRadians = std::numbers::pi / 180;
    sim::Camera made =
        sim::camera_looking_at({surface_.middle_m, 0.05}, {azimuth_deg, elevation_deg}, kWidth, kHeight);
    const double half = std::tan(kFieldDeg / 2 * kRadians);
    const Eigen::Matrix3d turn = (Eigen::AngleAxisd(roll_deg * kRadians, sim::Vector3::UnitZ()) *
                                  Eigen::AngleAxisd(std::atan(half * aside.x()), sim::Vector3::UnitY()) *
                                  Eigen::AngleAxisd(-std::atan(half * aside.y()), sim::Vector3::UnitX()))
                                     .toRotationMatrix();
    made.eye_m = surface_.middle_m + distance_m * made.to_view.row(2).transpose();
    made.to_view = turn.transpose() * made.to_view;
    made.half_extent = sim::half_extent_of(kFieldDeg, kWidth, kHeight);
    return made;
  }

  /// A shaft that comes to a place in the view's axes, from the picture's right border unless `from` says
  /// another direction.
  static sim::MarkedSolid tool(const sim::Camera& camera, const sim::Vector3& tip_view_m,
                               const sim::Vector3& from = {0.9, -0.2, 0.45},
                               const sim::Rgb& colour = {150, 152, 158}) {
    sim::MarkedSolid made;
    const sim::Vector3 towards = from.normalized();
    constexpr double kHalfLengthM = 0.15;
    made.solid.shape = sim::Capsule{0.004, kHalfLengthM};
    made.solid.pose.position_m =
        camera.eye_m + camera.to_view.transpose() * (tip_view_m + kHalfLengthM * towards);
    made.solid.pose.orientation =
        Eigen::Quaterniond::FromTwoVectors(sim::Vector3::UnitZ(), camera.to_view.transpose() * towards);
    made.solid.colour = colour;
    made.mark = 1;
    return made;
  }

  sim::Picture picture(const Look& look) {
    sim::SurfaceScene scene;
    scene.camera = look.camera;
    scene.width = kWidth;
    scene.height = kHeight;
    scene.to_light = {-0.15, 0.2, 1};
    scene.node_colours = colours_;
    scene.solids = look.tools;
    scene.shows_body = look.organ;
    // What differs between a black and a white background is background.
    scene.background = {0, 0, 0};
    const sim::Picture on_black = renderer_.render(look.displacement_m, scene).picture;
    scene.background = {255, 255, 255};
    const sim::Picture on_white = renderer_.render(look.displacement_m, scene).picture;
    scene.node_colours.assign(colours_.size(), {255, 255, 255});
    scene.to_light = {0, 0, 1};
    const sim::Picture shade = renderer_.render(look.displacement_m, scene).picture;
    sim::Picture made(kWidth, kHeight);
    std::mt19937 random(look.seed);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double s = (2.0 * x + 1) / kWidth - 1, t = 1 - (2.0 * y + 1) / kHeight;
        const double fall_off = 1 - 0.35 * (s * s + t * t) / 2;
        const auto behind = background(look.camera, s, t);
        const double shine =
            look.shine * highlight(look.camera, s, t, shade.pixel(x, y)[1], on_black.pixel(x, y), look.shine);
        const double veil = std::clamp(look.smoke * (1 + 0.25 * spots({s, t, 0.1 * look.seed}, 0.8)), 0.0,
                                       look.smoke >= 1 ? 1 : 0.97);
        for (std::size_t c = 0; c < 3; ++c) {
          const double front = on_black.pixel(x, y)[c];
          const double through = (on_white.pixel(x, y)[c] - front) / 255.0;
          double value = (front + through * behind[c]) * fall_off;
          value += shine * (250 - value);
          value += veil * (195 - value);
          made.pixel(x, y)[c] = level(value + look.noise * normal(random));
        }
      }
    }
    return made;
  }

 private:
  static std::uint8_t level(double value) {
    return static_cast<std::uint8_t>(std::clamp(value + 0.5, 0.0, 255.0));
  }

  /// Near to normal: the sum of four even ones, of variance 1.
  static double normal(std::mt19937& random) {
    const auto bits = static_cast<std::uint32_t>(random());
    const double sum =
        double(bits & 0xffU) + double(bits >> 8U & 0xffU) + double(bits >> 16U & 0xffU) + double(bits >> 24U);
    return (sum / 255 - 2) * std::sqrt(3.0);
  }

  /// Fat and muscle on a wall behind the organ.
  [[nodiscard]] std::array<double, 3> background(const sim::Camera& camera, double s, double t) const {
    const sim::Vector3 view(s * camera.half_extent.x(), t * camera.half_extent.y(), -1);
    const sim::Vector3 ray = camera.to_view.transpose() * view;
    constexpr double kWallM = 0.06;
    const double along = (kWallM - camera.eye_m.y()) / ray.y();
    const double far = along > 0 ? std::min(along, 1.0) : 1.0;
    const sim::Vector3 at = camera.eye_m + far * ray;
    if (clip_) {
      const auto [red, green, blue] = clip_at({at.x() / 0.16, at.z() / 0.16});
      const double light = std::clamp(0.24 / far, 0.3, 1.2);
      return {light * red, light * green, light * blue};
    }
    const double fat = 0.5 + 0.5 * std::tanh(3 * spots(at, 0.09));
    const double light = (0.75 + 0.15 * spots(at, 0.02)) * std::clamp(0.24 / far, 0.3, 1.2);
    return {light * (fat * 222 + (1 - fat) * 178), light * (fat * 184 + (1 - fat) * 104),
            light * (fat * 120 + (1 - fat) * 98)};
  }

  /// Where the wet surface faces the light, broken up by its texture.
  static double highlight(const sim::Camera& camera, double s, double t, std::uint8_t shade,
                          const std::uint8_t* on_black, double shine) {
    if (on_black[0] <= on_black[2] + 20) return 0;  // none of the organ
    const sim::Vector3 ray =
        camera.to_view.transpose() * sim::Vector3(s * camera.half_extent.x(), t * camera.half_extent.y(), -1);
    const double facing = shade / 255.0 + 0.02 * spots(0.1 * (camera.eye_m + ray), 0.004);
    return std::clamp((facing - 0.985 + 0.02 * (shine - 1)) / 0.02, 0.0, 0.9 / std::max(1.0, shine));
  }

  /// The clip's picture, spread over the plane and mirrored at its borders; between its pixels evenly.
  [[nodiscard]] std::array<double, 3> clip_at(const Eigen::Vector2d& at) const {
    const auto folded = [](double value, int size) {
      const double turn = std::abs(std::remainder(value + 0.5, 2.0)) * (size - 1.001);
      return std::clamp(turn, 0.0, size - 1.001);
    };
    const double x = folded(at.x(), clip_->width), y = folded(at.y(), clip_->height);
    const int left = static_cast<int>(x), top = static_cast<int>(y);
    const double a = x - left, b = y - top;
    std::array<double, 3> colour{};
    for (std::size_t c = 0; c < 3; ++c) {
      colour[c] = (1 - b) * ((1 - a) * clip_->pixel(left, top)[c] + a * clip_->pixel(left + 1, top)[c]) +
                  b * ((1 - a) * clip_->pixel(left, top + 1)[c] + a * clip_->pixel(left + 1, top + 1)[c]);
    }
    return colour;
  }

  sim::OrganSurface surface_;
  sim::SurfaceRenderer renderer_;
  std::optional<sim::Picture> clip_;
  std::vector<sim::Rgb> colours_;
};

}  // namespace kiroku::test
