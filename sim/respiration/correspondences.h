// Places that a program found to be the same in two CTs of one patient, and a lung that follows them. Pure
// functions, thread-safe.
//
// Source: the smoothest motion of the mesh that meets the places, as a thin-plate spline is (Bookstein, IEEE
// Transactions on Pattern Analysis 11, 1989), made least on the mesh itself:
//   sum w_i |x(p_i) - q_i|^2 + (n/V) L^4 sum_f A_f/h_f |F_a - F_b|^2.
// F are the deformation gradients of the two elements at an inner face f of area A, whose centres are h
// apart. An even stretch of each lung costs nothing. Places closer than L to each other are smoothed. The
// weights w are those of Geman and McClure, in turn with the motion, so that wrong places lose their say.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sim/mesh/tet_mesh.h"
#include "sim/respiration/landmarks.h"
#include "sim/respiration/mesh_point.h"

namespace kiroku::sim {

struct Correspondences {
  std::vector<Vector3> first_m, second_m;  // in the patient coordinates of their own CT
};

/// A table of six columns in millimetres (left, back, head): where a place is in the first CT and where in
/// the second. Its first line names the columns as the writer likes. kiroku::Error with the line for another
/// number of columns and what is no number, and for a table without rows.
Correspondences parse_correspondences(std::string_view text, const std::string& name);

/// Of several files, one after the other.
Correspondences read_correspondences(const std::vector<std::filesystem::path>& files);

struct CorrespondenceUse {
  std::size_t given = 0;
  std::size_t outside = 0;  // more than kCorrespondenceReachM outside the lung
  std::size_t refused = 0;  // do not agree with the motion that the others tell
  Spread left_m;            // distance of the motion from the places that count
};
inline constexpr double kCorrespondenceReachM = 0.005;

struct CorrespondenceFit {
  std::vector<Vector3> places_m;  // (|V|), in the second CT
  std::vector<LocatedPoint> agreed;
  CorrespondenceUse use;
};

/// `near_m` (|V|): about where the lung is in the second CT, to within 20 mm or so. kiroku::Error where less
/// than half of the correspondences are in the lung, or less than half of these agree with each other. Same
/// input, same bits.
CorrespondenceFit follow_correspondences(const TetMesh& mesh, const Correspondences& given,
                                         const std::vector<Vector3>& near_m);

}  // namespace kiroku::sim
