#include "sim/drr/attenuation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

TEST(Attenuation, IsTheTablesAtItsEnergies) {
  // NISTIR 5632: water 0.2059 cm2/g at 60 keV, 0.02219 at 10 MeV.
  EXPECT_NEAR(Attenuation(60).water_per_m(), 20.59, 1e-9);
  EXPECT_NEAR(Attenuation(10000).water_per_m(), 2.219, 1e-9);
  EXPECT_NEAR(Attenuation(20).water_per_m(), 80.96, 1e-9);
  EXPECT_NEAR(Attenuation(20000).water_per_m(), 1.813, 1e-9);
  // Between two energies, between both.
  const double between = Attenuation(70).water_per_m();
  EXPECT_GT(between, 18.37);
  EXPECT_LT(between, 20.59);
}

TEST(Attenuation, IsOneLineAtTheEnergyOfTheCt) {
  const Attenuation at_ct(Attenuation::kCtEnergyKev);
  for (const double hu : {-1000.0, -800.0, 0.0, 40.0, 1500.0, 3000.0}) {
    EXPECT_NEAR(at_ct.per_m(hu), at_ct.water_per_m() * (1 + hu / 1000), 1e-12) << hu;
  }
  EXPECT_EQ(at_ct.per_m(-2000), 0);
}

TEST(Attenuation, BoneFadesFasterThanWaterAsTheEnergyGrows) {
  const auto bone_to_water = [](double energy_kev) {
    const Attenuation attenuation(energy_kev);
    return attenuation.per_m(1200) / attenuation.per_m(0);
  };
  EXPECT_GT(bone_to_water(40), bone_to_water(70));
  EXPECT_GT(bone_to_water(70), bone_to_water(120));
  EXPECT_GT(bone_to_water(120), bone_to_water(2000));
  // Cortical bone by its table at 1 MeV: 0.06566 * 1.92 / 0.07072.
  const double bone_hu = 1000 * ((0.3148 * 1.92) / 0.2059 - 1);  // as it would be at 60 keV: more than at 70
  EXPECT_LT(Attenuation(1000).per_m(bone_hu) / Attenuation(1000).water_per_m(), 2.2);
}

TEST(Attenuation, RefusesEnergiesBeyondTheTables) {
  EXPECT_THROW(Attenuation(19), Error);
  EXPECT_THROW(Attenuation(20001), Error);
  EXPECT_THROW(Attenuation(std::nan("")), Error);
}

}  // namespace
}  // namespace kiroku::sim
