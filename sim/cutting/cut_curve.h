// A cut as it is drawn on an organ: a curve on its surface, how deep, and which way. Pure functions,
// thread-safe; the same input gives the same bits.
//
// Source: incisions of chosen depth that are changed on the picture afterwards, Figures 4c and 5c of
// "Interactive Volume Manipulation for Supporting Preoperative Planning"; centripetal Catmull-Rom curves
// (Yuksel, Schaefer and Keyser, "Parameterization and applications of Catmull-Rom curves", 2011), which have
// neither cusps nor loops between two handles.
#pragma once

#include <optional>
#include <vector>

#include "sim/cutting/sweep_surface.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

struct CutCurve {
  std::vector<Vector3> handles_m;  // two at least; what is between them is brought to the surface
  bool smooth = true;  // a Catmull-Rom curve through the handles; else straight from each to the next
  std::vector<double> depth_m;  // one for all handles or one for each, evenly changing between two
  std::optional<Vector3>
      direction;  // into the organ, of any length but zero; absent: along the inward normal
};

/// The blade's edge along the curve: tips at their depth, heels `edge_m` from them outside, the first and the
/// last pose at the outer handles and the others evenly between, about `spacing_m` apart. What
/// sweep_surfaces() takes. Lengths in m; the mesh is the organ at rest.
///
/// kiroku::Error in one sentence that names the handle, counted from 0: fewer than two or more than 100; not
/// finite; at the place of the one before; farther from the surface than two of its edges; a depth that is
/// not positive or not less than the edge; as many depths as neither one nor the handles; a direction without
/// length, or that leads along the surface or out of it.
std::vector<BladePose> blade_along(const CutCurve& curve, const TetMesh& mesh, double edge_m,
                                   double spacing_m);

/// The points of the mesh's surface that are nearest to these. kiroku::Error where it has none.
std::vector<Vector3> on_surface(const TetMesh& mesh, const std::vector<Vector3>& points_m);

}  // namespace kiroku::sim
