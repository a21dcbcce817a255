#include "sim/render/colour_map.h"

#include <cmath>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {
namespace {

/// CIE 1976 L*, a*, b* of an sRGB colour under D65.
Vector3 lab(const Rgb& colour) {
  Vector3 linear;
  for (int c = 0; c < 3; ++c) {
    const double v = colour[static_cast<std::size_t>(c)] / 255.0;
    linear[c] = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  }
  Eigen::Matrix3d to_xyz;
  to_xyz << 0.4124, 0.3576, 0.1805, 0.2126, 0.7152, 0.0722, 0.0193, 0.1192, 0.9505;
  const Vector3 xyz = (to_xyz * linear).cwiseQuotient(Vector3(0.9505, 1, 1.089));
  const auto f = [](double t) { return t > 0.008856 ? std::cbrt(t) : 7.787 * t + 16.0 / 116; };
  return {116 * f(xyz.y()) - 16, 500 * (f(xyz.x()) - f(xyz.y())), 200 * (f(xyz.y()) - f(xyz.z()))};
}

TEST(ColourMap, GrowsEvenlyInLightness) {
  constexpr int kSteps = 16;
  for (int i = 0; i < kSteps; ++i) {
    const Vector3 from = lab(viridis(double(i) / kSteps)), to = lab(viridis(double(i + 1) / kSteps));
    // From L* 15 to 91 in even steps.
    EXPECT_NEAR(to.x() - from.x(), 76.0 / kSteps, 1.3) << i;
  }
  EXPECT_EQ(viridis(-1), viridis(0));
  EXPECT_EQ(viridis(2), viridis(1));
}

}  // namespace
}  // namespace kiroku::sim
