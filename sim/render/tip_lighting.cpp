#include "sim/render/tip_lighting.h"

#include <algorithm>
#include <cmath>

namespace kiroku::sim {
namespace {

constexpr double kSoftBorder = 0.01;

/// From the picture's middle: 1 on the disc's border.
double from_middle(int width, int height, int x, int y) {
  const double radius = std::min(width, height) / 2.0;
  return std::hypot(x + 0.5 - width / 2.0, y + 0.5 - height / 2.0) / radius;
}

}  // namespace

double linear_light(double encoded) { return std::pow(std::max(encoded, 0.0), kPictureGamma); }
double encoded_light(double linear) { return std::pow(std::max(linear, 0.0), 1 / kPictureGamma); }
Vector3 linear_light(const Rgb& colour) {
  constexpr double kWhite = 255;
  return {linear_light(colour[0] / kWhite), linear_light(colour[1] / kWhite),
          linear_light(colour[2] / kWhite)};
}

TipRay tip_ray(const TipLight& light, const Vector3& view_m) {
  const Vector3 towards = light.at_m - view_m;
  const double distance_m = std::max(towards.norm(), 1e-9);
  return {towards / distance_m, std::pow(light.working_distance_m / distance_m, 2)};
}

double wet_highlight(const Vector3& normal, const Vector3& to_light, const Vector3& to_eye,
                     double roughness) {
  const double falling = normal.dot(to_light);
  if (!(falling > 0)) return 0;
  const Vector3 half = (to_light + to_eye).normalized();
  const double at_half = std::max(normal.dot(half), 0.0), light_at_half = to_light.dot(half);
  const double a2 = std::pow(roughness, 4), spread = at_half * at_half * (a2 - 1) + 1;
  const double fresnel = kWaterReflectance + (1 - kWaterReflectance) * std::pow(1 - light_at_half, 5);
  return a2 * fresnel * falling / (4 * light_at_half * light_at_half * spread * spread);
}

bool is_beyond_disc(int width, int height, int x, int y) { return from_middle(width, height, x, y) >= 1; }

void blacken_beyond_disc(Picture& picture) {
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const double inside = (1 - from_middle(picture.width, picture.height, x, y)) / kSoftBorder;
      if (inside >= 1) continue;
      std::uint8_t* const pixel = picture.pixel(x, y);
      for (int c = 0; c < 3; ++c)
        pixel[c] = static_cast<std::uint8_t>(std::lround(pixel[c] * std::clamp(inside, 0.0, 1.0)));
    }
  }
}

}  // namespace kiroku::sim
