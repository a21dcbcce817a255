// A body as documents describe it: its mesh, what it is made of, where it is held. Not thread-safe while it
// is read.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "sim/fem/elastic_body.h"
#include "sim/mesh/length_unit.h"
#include "sim/model/json_field.h"

namespace kiroku::sim {

struct BodyModel {
  TetMesh mesh;
  LengthUnit unit = LengthUnit::kMetre;
  Materials materials;
  Constraints constraints{0};
  Vector3 gravity_m_s2 = Vector3::Zero();
  /// What is odd and does not prevent an answer, each a sentence: a mesh of a strange size, in several
  /// pieces, with loose nodes, cells that were left out, a density that was assumed.
  std::vector<std::string> warnings;
};

/// The text of a file. kiroku::IoError.
std::string read_document(const std::filesystem::path& file);

/// Makes the mesh of a document whose "mesh" is no file but an object that says how: from that object, the
/// whole document and its folder. Adds to the warnings. Its errors are those of BodyReader.
using MeshMaker =
    std::function<TetMesh(const JsonField& recipe, const JsonField& document,
                          const std::filesystem::path& folder, std::vector<std::string>& warnings)>;

/// Takes a body from the keys "mesh", "length_unit", "materials", "fixed" and "gravity_m_s2" of a document;
/// docs/reference/simulation.md says what they mean.
class BodyReader {
 public:
  /// kiroku::Error in one sentence with the file and the JSON path; also what read_mesh() throws. The mesh is
  /// sought in the folder; without `maker` it must be a file.
  BodyReader(const JsonField& document, const std::filesystem::path& folder, const MeshMaker& maker = {});

  [[nodiscard]] const BodyModel& model() const { return model_; }
  /// The nodes of the entry's "nodes" or "box", at least one; ascending where a box chose them. Loose nodes
  /// are never in a box.
  [[nodiscard]] std::vector<std::size_t> selected(const JsonField& entry) const;
  /// Whether the node belongs to a tetrahedron.
  [[nodiscard]] bool used(std::size_t node) const { return used_[node]; }
  BodyModel take() { return std::move(model_); }

 private:
  void warn(const std::string& sentence) { model_.warnings.push_back(sentence); }
  void read_mesh_and_unit(const JsonField& document, const std::filesystem::path& folder,
                          const MeshMaker& maker);
  void read_mesh_file(const JsonField& mesh, const std::filesystem::path& folder);
  void read_materials(const JsonField& materials);
  void read_fixed(const JsonField& entry);
  [[nodiscard]] std::vector<std::size_t> named_nodes(const JsonField& list) const;
  [[nodiscard]] std::vector<std::size_t> nodes_in_box(const JsonField& box) const;

  BodyModel model_;
  std::vector<bool> used_;
  double longest_side_m_ = 0;
  bool density_assumed_ = false;
};

}  // namespace kiroku::sim
