// What a body is made of. Pure functions, thread-safe.
#pragma once

#include <string>

namespace kiroku::sim {

/// Isotropic and linearly elastic.
struct Material {
  double young_modulus_pa = 0;  // E > 0
  double poisson_ratio = 0;     // -1 < nu < 0.5
  double density_kg_m3 = 1000;  // >= 0; only weight asks for it. Soft tissue: 1,000 to 1,060

  /// Lame's first parameter, E nu / ((1 + nu) (1 - 2 nu)).
  [[nodiscard]] double lame_lambda_pa() const {
    return young_modulus_pa * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio));
  }
  /// The shear modulus, E / (2 (1 + nu)).
  [[nodiscard]] double shear_modulus_pa() const { return young_modulus_pa / (2 * (1 + poisson_ratio)); }
};

/// Why nothing can be computed with it, as the end of a sentence that begins with the property's name:
/// property "poisson_ratio", problem "is 0.5: ...". Empty for a sound one.
struct MaterialProblem {
  std::string property, problem;
};
MaterialProblem problem_of(const Material& material);

}  // namespace kiroku::sim
