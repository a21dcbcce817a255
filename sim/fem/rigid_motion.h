// Motions that no element resists and no constraint prevents. Pure functions, thread-safe.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "sim/fem/constraints.h"
#include "sim/mesh/mesh_topology.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// What can still move as a rigid body, in a sentence a part: "the body can move along x and turn about z",
/// "the part of 12 tetrahedra with node 7 can turn about the direction (0.71, 0.71, 0)". Empty where
/// everything is held.
///
/// A part is what hangs together by whole faces. Parts that share a node move alike there, so that hinges are
/// found too. A piece of the mesh with more than kMostHingedParts parts is judged by the factorisation alone.
std::vector<std::string> free_rigid_motions(const TetMesh& mesh, const Faces& faces,
                                            const Constraints& constraints);
inline constexpr std::size_t kMostHingedParts = 100;

/// Whether the constraints of these nodes leave one rigid body that they are part of no motion.
bool hold_still(const TetMesh& mesh, std::span<const std::uint32_t> nodes, const Constraints& constraints);

}  // namespace kiroku::sim
