// How the tetrahedra of a mesh hang together. Functions are pure and thread-safe; time grows linearly with
// the mesh.
#pragma once

#include <array>
#include <optional>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// A face of a tetrahedron: the three nodes seen anticlockwise from outside it.
struct Face {
  std::array<std::uint32_t, 3> nodes;
  std::uint32_t tetrahedron;
};

/// Which faces are the body's own surface and which lie between two tetrahedra.
struct Faces {
  std::vector<Face> surface;                              // belong to one tetrahedron
  std::vector<std::array<std::uint32_t, 2>> between;      // the two tetrahedra of each inner face
  std::vector<std::array<std::uint32_t, 3>> overcrowded;  // nodes of faces of three tetrahedra or more
};
Faces faces_of(const TetMesh& mesh);

/// Opposite each corner of a tetrahedron of positive volume, the corners of its face, anticlockwise from
/// outside.
inline constexpr std::array<std::array<std::size_t, 3>, 4> kFaceCorners{
    {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

/// For each tetrahedron the one beyond the face opposite each of its corners; itself where there is none.
using Neighbours = std::vector<std::array<std::uint32_t, 4>>;  // (|T|)
Neighbours neighbours_of(const TetMesh& mesh, const Faces& faces);

/// Parts, numbered from 0 in the order of their first tetrahedron.
struct Parts {
  std::size_t count = 0;
  std::vector<std::uint32_t> of_tetrahedron;  // (|T|)
};
/// Tetrahedra that hang together by whole faces: each such part resists every deformation, while two parts
/// that share a node or an edge only can still turn about it.
Parts face_connected_parts(const TetMesh& mesh, const Faces& faces);
/// Tetrahedra that hang together by nodes at least.
Parts node_connected_parts(const TetMesh& mesh);

}  // namespace kiroku::sim
