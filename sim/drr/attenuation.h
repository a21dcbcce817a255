// Linear attenuation of X-rays of one energy from Hounsfield units. Pure, thread-safe.
//
// A CT number is mu / mu_water at the energy that the CT was made with, taken as 70 keV (some 120 kVp). Below
// 0 HU a voxel is water and air by volume, above water and cortical bone, so that both parts are linear:
//
//   mu(HU) = mu_water (1 + HU / 1000)                                    HU <= 0, never negative
//   mu(HU) = mu_water + HU / HU_bone (mu_bone - mu_water)                HU > 0
//   HU_bone = 1000 (mu_bone(70 keV) / mu_water(70 keV) - 1)
//
// At 70 keV it is one line. Coefficients: Hubbell and Seltzer, NISTIR 5632 (NIST Standard Reference Database
// 126), liquid water and cortical bone (ICRU-44, 1920 kg/m3), interpolated between the energies of the tables
// by logarithms of both.
#pragma once

namespace kiroku::sim {

class Attenuation {
 public:
  static constexpr double kCtEnergyKev = 70, kLeastEnergyKev = 20, kGreatestEnergyKev = 20000;

  /// kiroku::Error for an energy outside the table's.
  explicit Attenuation(double energy_kev);

  [[nodiscard]] double energy_kev() const { return energy_kev_; }
  [[nodiscard]] double water_per_m() const { return water_per_m_; }
  /// Never negative; finite for what is finite.
  [[nodiscard]] double per_m(double hu) const {
    const double mu = water_per_m_ + hu * (hu > 0 ? above_per_m_ : below_per_m_);
    return mu > 0 ? mu : 0;
  }

 private:
  double energy_kev_, water_per_m_, below_per_m_, above_per_m_;  // the last two for each HU
};

}  // namespace kiroku::sim
