// An endoscope before an organ: where its tip is, what its lens shows, and the light at its tip. Pure,
// thread-safe.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "base/error.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/render/lens.h"
#include "sim/render/scene.h"

namespace kiroku::sim {

struct Endoscope {
  /// From the tip to the tissue in the picture's middle; its light is set for it.
  double distance_m = 0.08;
  /// Across the disc that it shows.
  double field_deg = 70;
  /// k1 and k2 of its barrel distortion, as lens.h has them.
  std::array<double, 2> bend{-0.25, 0.05};
  /// Of one's own, instead of the field and the bend. Such a picture is shown to its corners.
  std::optional<LensCalibration> calibration;
};

/// The axis of an endoscope meets nothing: whatever its lens is.
class NoTissueOnAxis : public UsageError {
 public:
  using UsageError::UsageError;
};

/// Makes a scene what the endoscope shows along the axis of the scene's camera, of the mesh's surface as it
/// is displaced (3 |V|, or empty for none). Throws NoTissueOnAxis, and kiroku::UsageError for a lens that
/// none has.
void look_through(const Endoscope& endoscope, const TetMesh& mesh, std::span<const double> displacement_m,
                  Scene& scene);

}  // namespace kiroku::sim
