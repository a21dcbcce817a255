// A lung brought to a second surface of it as a whole: by an even stretch of all of it, then of each lung by
// itself. A breath may double a lung, and nothing finer finds its place from there. Pure, thread-safe.
//
// Source: iterated closest points along normals (Chen and Medioni, "Object modelling by registration of
// multiple range images", Image and Vision Computing 10, 1992), both ways and with an affine motion. It
// begins from three places (as both lie; with centres that meet; with moments along the axes that agree, too)
// and takes the one that ends nearest.
#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "sim/respiration/lung_surface.h"
#include "sim/respiration/sliding_boundary.h"
#include "sim/volume/distance_field.h"

namespace kiroku::sim {

struct StretchFit {
  Eigen::Affine3d whole = Eigen::Affine3d::Identity();  // of all of the lung
  std::vector<Vector3> places_m;  // (|V|), in the second CT: each lung by its own stretch
};

/// Parts that hold less than a tenth of the surface go with the whole. Same input, same bits.
StretchFit fit_stretch(const TetMesh& mesh, const LungSurface& surface, const DistanceField& second,
                       const SurfacePoints& points);

/// How far a lung with nodes at `places_m` (|V|) is from the second surface, m: mean of the distances along
/// normals both ways, each at most 30 mm, which is also what counts where nothing looks the same way.
double both_ways_m(const LungSurface& surface, const DistanceField& second, const SurfacePoints& points,
                   const std::vector<Vector3>& places_m);

}  // namespace kiroku::sim
