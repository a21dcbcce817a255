// Volumes of fields that are known.
#include "sim/respiration/irradiation_field.h"

#include <numbers>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

constexpr double kPi = std::numbers::pi;

/// A cube of 2 cm, all of it tumour.
class CubeTumour : public testing::Test {
 protected:
  CubeTumour() {
    for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) tumour_.tetrahedra.push_back(t);
  }
  [[nodiscard]] Eigen::VectorXd moved(const Vector3& by_m) const {
    Eigen::VectorXd displacement_m(static_cast<Eigen::Index>(3 * mesh_.nodes.size()));
    for (std::size_t node = 0; node < mesh_.nodes.size(); ++node)
      displacement_m.segment<3>(static_cast<Eigen::Index>(3 * node)) = by_m;
    return displacement_m;
  }
  TetMesh mesh_ = test::tet_grid({2, 2, 2}, {0.02, 0.02, 0.02});
  Tumour tumour_;
};

/// A box widened by m: its faces, edges and corners.
double widened_m3(double a, double b, double c, double m) {
  return a * b * c + 2 * m * (a * b + b * c + a * c) + kPi * m * m * (a + b + c) + 4.0 / 3 * kPi * m * m * m;
}

TEST_F(CubeTumour, CoversThePathOrOnlyTheTumour) {
  std::vector<Eigen::VectorXd> phases;
  for (int i = 0; i <= 20; ++i) phases.push_back(moved({0, 0, 0.001 * i}));
  const IrradiationField field = irradiation_field(mesh_, tumour_, phases, 0.005);
  EXPECT_NEAR(field.tumour_m3, 8e-6, 1e-12);
  EXPECT_NEAR(field.conventional_m3 / widened_m3(0.02, 0.02, 0.04, 0.005), 1, 0.03);
  EXPECT_NEAR(field.tracking_m3 / widened_m3(0.02, 0.02, 0.02, 0.005), 1, 0.03);
  EXPECT_NEAR(field.ratio(), widened_m3(0.02, 0.02, 0.02, 0.005) / widened_m3(0.02, 0.02, 0.04, 0.005), 0.01);
}

TEST_F(CubeTumour, WithoutMotionTrackingGainsNothing) {
  const IrradiationField field = irradiation_field(mesh_, tumour_, {moved(Vector3::Zero())}, 0.003);
  EXPECT_DOUBLE_EQ(field.ratio(), 1);
}

TEST_F(CubeTumour, WithoutAMarginTheFieldIsTheTumour) {
  const IrradiationField field = irradiation_field(mesh_, tumour_, {moved({0, 0.013, 0})}, 0);
  EXPECT_NEAR(field.tracking_m3 / field.tumour_m3, 1, 0.1);
}

TEST_F(CubeTumour, MarginsWithoutSenseAreRefused) {
  EXPECT_THROW(static_cast<void>(irradiation_field(mesh_, tumour_, {moved(Vector3::Zero())}, -0.001)), Error);
  EXPECT_THROW(static_cast<void>(irradiation_field(mesh_, tumour_, {moved(Vector3::Zero())}, std::nan(""))),
               Error);
}

}  // namespace
}  // namespace kiroku::sim
