// How far every point is from the surface of a labelled body. Pure functions, thread-safe.
//
// Source: exact Euclidean distances by lower envelopes of parabolas, axis after axis (Felzenszwalb and
// Huttenlocher, "Distance Transforms of Sampled Functions", Theory of Computing 8, 2012).
#pragma once

#include <vector>

#include "sim/volume/volume.h"

namespace kiroku::sim {

/// (grid.voxels()): from the centre of each voxel to that of the nearest marked one, m; infinite where none
/// is marked. `marked` (grid.voxels()) is not zero where one is.
std::vector<float> distances_m(const Grid& grid, const std::vector<std::uint8_t>& marked);

struct DistanceField {
  Grid grid;
  std::vector<float> distance_m;  // (grid.voxels()), negative inside
};
/// Of what has any label. The surface runs half-way between centres of neighbours inside and outside:
/// distances to centres on the other side, less half a voxel. kiroku::Error where nothing is labelled, or all
/// is.
DistanceField signed_distance(const LabelMap& map);

struct SignedDistance {
  double distance_m = 0;               // negative inside
  Vector3 gradient = Vector3::Zero();  // away from the body; not of length 1 near edges and ridges
};
/// Trilinear between centres; beyond the field as far as the nearest place in it and from there on.
SignedDistance sample(const DistanceField& field, const Vector3& patient_m);

}  // namespace kiroku::sim
