// What can be wrong with a mesh. Functions are pure and thread-safe.
#pragma once

#include <string>
#include <vector>

#include "sim/mesh/mesh_topology.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

enum class MeshFault {
  kInvertedTetrahedron,  // negative volume, among others that are positive
  kFlatTetrahedron,      // no volume to speak of, or one node twice
  kCrowdedFace,          // of three tetrahedra or more: they overlap
  kLooseNode,            // belongs to no tetrahedron
  kSeveralPieces,        // that share no node
  kNonManifoldEdge,      // more than two faces of the surface meet in it
  kNonManifoldNode,      // tetrahedra meet in it that do not hang together by faces around it
};

struct MeshFinding {
  MeshFault fault;
  std::size_t count = 0;  // how many there are
  /// "2 tetrahedra are inverted: 5, 17"; at most kMostNamed of them are named. Numbers count from 0.
  std::string text;
};
inline constexpr std::size_t kMostNamed = 8;

/// A tetrahedron is flat below this ratio of its volume to a sixth of the cube of its longest edge.
inline constexpr double kFlatRatio = 1e-8;

/// One finding a fault, in the order of the enumeration; none for a sound mesh.
std::vector<MeshFinding> check_mesh(const TetMesh& mesh);

/// Inverted and flat elements and crowded faces leave nothing to compute with; the others can be lived with.
bool prevents_solving(MeshFault fault);
/// Only the findings that do, for which the rest need not be looked for.
std::vector<MeshFinding> check_for_solving(const TetMesh& mesh, const Faces& faces);

}  // namespace kiroku::sim
