#include "sim/drr/attenuation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::sim {
namespace {

struct TableRow {
  double energy_kev, water, bone;  // mu / rho, cm2/g
};
constexpr std::array<TableRow, 26> kTable{
    {{20, 0.8096, 4.001},       {30, 0.3756, 1.331},      {40, 0.2683, 0.6655},     {50, 0.2269, 0.4242},
     {60, 0.2059, 0.3148},      {80, 0.1837, 0.2229},     {100, 0.1707, 0.1855},    {150, 0.1505, 0.1480},
     {200, 0.1370, 0.1309},     {300, 0.1186, 0.1113},    {400, 0.1061, 0.09908},   {500, 0.09687, 0.09022},
     {600, 0.08956, 0.08332},   {800, 0.07865, 0.07308},  {1000, 0.07072, 0.06566}, {1250, 0.06323, 0.05871},
     {1500, 0.05754, 0.05346},  {2000, 0.04942, 0.04607}, {3000, 0.03969, 0.03745}, {4000, 0.03403, 0.03257},
     {5000, 0.03031, 0.02946},  {6000, 0.02770, 0.02734}, {8000, 0.02429, 0.02467}, {10000, 0.02219, 0.02314},
     {15000, 0.01941, 0.02132}, {20000, 0.01813, 0.02068}}};
/// 1 cm2/g of 1 g/cm3 is 1/cm.
constexpr double kPerMetre = 100;
constexpr double kWaterDensity = 1.0, kBoneDensity = 1.92;  // g/cm3

double interpolated(double energy_kev, double TableRow::*column) {
  const auto above = std::ranges::lower_bound(kTable, energy_kev, {}, &TableRow::energy_kev);
  if (above->energy_kev == energy_kev) return (*above).*column;
  const auto below = above - 1;
  const double part =
      std::log(energy_kev / below->energy_kev) / std::log(above->energy_kev / below->energy_kev);
  return (*below).*column * std::pow((*above).*column / ((*below).*column), part);
}

double water_at(double energy_kev) {
  return kPerMetre * kWaterDensity * interpolated(energy_kev, &TableRow::water);
}
double bone_at(double energy_kev) {
  return kPerMetre * kBoneDensity * interpolated(energy_kev, &TableRow::bone);
}

}  // namespace

Attenuation::Attenuation(double energy_kev) : energy_kev_(energy_kev) {
  if (!(energy_kev >= kLeastEnergyKev && energy_kev <= kGreatestEnergyKev)) {
    throw Error("the energy is " + number_text(energy_kev) + " keV; it must be from " +
                number_text(kLeastEnergyKev) + " to " + number_text(kGreatestEnergyKev) + " keV");
  }
  water_per_m_ = water_at(energy_kev);
  below_per_m_ = water_per_m_ / 1000;
  const double bone_hu = 1000 * (bone_at(kCtEnergyKev) / water_at(kCtEnergyKev) - 1);
  above_per_m_ = (bone_at(energy_kev) - water_per_m_) / bone_hu;
}

}  // namespace kiroku::sim
