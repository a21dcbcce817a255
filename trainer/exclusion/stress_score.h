// A stress by which attempts are scored that does not hang on how fine the mesh is. Pure, thread-safe.
//
// The largest stress of an element grows without bound under refinement where a node is pressed, and where
// stiffness or what is held ends at an edge: linear elasticity has no largest stress there. What little
// tissue has such stress shrinks with the elements, so that the stress which all but a share of the volume
// stays below converges.
#pragma once

#include <span>
#include <vector>

#include "sim/fem/element.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::trainer {

/// Of the body's volume: tissue with more stress than the score has.
inline constexpr double kHighStressShare = 0.01;

/// The von Mises stress that only `share` of the volume exceeds. Stress is smoothed before: averaged over the
/// elements around each node by volume (`stress_at_nodes_pa`, (|V|), as ElasticBody::at_nodes() gives it),
/// and over each element's nodes. `volumes_m3` (|T|), at rest. Linear between the elements at whose volume
/// the share is passed. 0 without elements. Takes about as long as computing the stress.
double stress_of_share_pa(const sim::TetMesh& mesh, std::span<const double> volumes_m3,
                          std::span<const sim::SymmetricTensor> stress_at_nodes_pa,
                          double share = kHighStressShare);

}  // namespace kiroku::trainer
