#include "sim/fem/material.h"

#include <cmath>

#include "base/number_text.h"

namespace kiroku::sim {

MaterialProblem problem_of(const Material& material) {
  const double e = material.young_modulus_pa, nu = material.poisson_ratio;
  if (!std::isfinite(e) || e <= 0) {
    return {"young_modulus_pa", "is " + number_text(e) + ": stiffness must be greater than 0"};
  }
  if (nu == 0.5) {
    return {"poisson_ratio",
            "is 0.5: material without any change of volume cannot be computed; take 0.49, or 0.45 for soft "
            "tissue"};
  }
  if (!(nu > -1 && nu < 0.5)) {
    return {"poisson_ratio", "is " + number_text(nu) + ": it must lie between -1 and 0.5, both excluded"};
  }
  if (!std::isfinite(material.lame_lambda_pa()) || !(material.shear_modulus_pa() > 0)) {
    return {"young_modulus_pa", "is " + number_text(e) + ": that is out of all proportion"};
  }
  if (!std::isfinite(material.density_kg_m3) || material.density_kg_m3 < 0) {
    return {"density_kg_m3", "is " + number_text(material.density_kg_m3) + ": it must not be negative"};
  }
  return {};
}

}  // namespace kiroku::sim
