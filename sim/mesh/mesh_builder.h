// What the readers of all formats share: nodes under the numbers the file gives them, cells kept or counted.
// Not thread-safe.
#pragma once

#include <optional>
#include <unordered_map>

#include "sim/mesh/mesh_cursor.h"
#include "sim/mesh/mesh_reader.h"

namespace kiroku::sim {

class MeshBuilder {
 public:
  /// The cursor says where a refusal was; it must outlive the builder.
  MeshBuilder(const MeshCursor& cursor, LengthUnit unit);

  /// Room for as many, as far as the rest of the file can hold them.
  void reserve_nodes(std::uint64_t count);
  void reserve_tetrahedra(std::uint64_t count);

  /// `number` is the file's own; refused if a node has it already.
  void add_node(std::int64_t number, const Vector3& in_file_units);
  /// Node numbers as the file gives them; refused if one is not there.
  void add_tetrahedron(const std::array<std::int64_t, 4>& numbers, std::int32_t region);
  /// A cell of another kind, named in the plural: "triangles".
  void drop(const std::string& kind);

  [[nodiscard]] std::size_t tetrahedra() const { return file_.mesh.tetrahedra.size(); }
  [[nodiscard]] std::vector<std::int32_t>& regions() { return file_.mesh.regions; }

  /// Refuses a file without tetrahedra; turns those of a file that counts them all the other way round.
  MeshFile finish();

 private:
  [[nodiscard]] std::uint32_t node_of(std::int64_t number) const;

  const MeshCursor& cursor_;
  double units_per_metre_;
  MeshFile file_;
  std::int64_t first_number_ = 0;
  /// Only where the numbers do not count up by one, as they do in most files.
  std::optional<std::unordered_map<std::int64_t, std::uint32_t>> node_of_number_;
};

/// How far a number of a file is from the first, whatever both are; huge where it comes before it.
inline std::uint64_t distance(std::int64_t first, std::int64_t number) {
  return static_cast<std::uint64_t>(number) - static_cast<std::uint64_t>(first);
}

/// A region's number, refused where it does not fit.
std::int32_t region_number(std::int64_t number, const MeshCursor& cursor);

}  // namespace kiroku::sim
