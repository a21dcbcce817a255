#include "sim/mesh/vtu_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "base/error.h"
#include "sim/fem/number_text.h"
#include "sim/mesh/mesh_cursor.h"
#include "sim/mesh/mesh_reader.h"

namespace kiroku::sim {
namespace {

constexpr double kTetrahedronType = 10;
/// What nodes of the same mesh may differ by, of its longest side: files are written with rounded numbers.
constexpr double kSamePlace = 1e-5;

/// The value of NAME="..." in a tag.
std::optional<std::string_view> attribute(std::string_view tag, std::string_view name) {
  const std::string begin = " " + std::string(name) + "=";
  const std::size_t at = tag.find(begin);
  if (at == std::string_view::npos || at + begin.size() >= tag.size()) return std::nullopt;
  const char quote = tag[at + begin.size()];
  if (quote != '"' && quote != '\'') return std::nullopt;
  const std::size_t from = at + begin.size() + 1, to = tag.find(quote, from);
  if (to == std::string_view::npos) return std::nullopt;
  return tag.substr(from, to - from);
}

bool is_element(std::string_view tag, std::string_view name) {
  return tag.starts_with(name) && (tag.size() == name.size() || tag[name.size()] == ' ' ||
                                   tag[name.size()] == '\n' || tag[name.size()] == '/');
}

class VtuReader {
 public:
  VtuReader(std::string_view text, const std::string& name)
      : cursor_(text, name), vtk_(text.find("<VTKFile") != std::string_view::npos) {}

  VtuFile read(LengthUnit unit) {
    find_grid();
    while (true) {
      const std::string_view tag = next_tag();
      if (is_element(tag, "/Piece")) break;
      if (is_element(tag, "PointData")) read_arrays("/PointData", tag, points_, file_.point_data);
      if (is_element(tag, "CellData")) read_arrays("/CellData", tag, cells_, file_.cell_data);
      if (is_element(tag, "Points")) read_points(unit);
      if (is_element(tag, "Cells")) read_cells();
    }
    finish();
    return std::move(file_);
  }

 private:
  std::string_view next_tag() {
    cursor_.until("<");
    return cursor_.until(">");
  }

  std::size_t count_of(std::string_view tag, std::string_view name) {
    const std::string_view text = attribute(tag, name).value_or("");
    std::size_t count = 0;
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), count);
    if (text.empty() || failure != std::errc() || end != text.data() + text.size()) {
      cursor_.fail(std::string(name) + " of <" + std::string(tag.substr(0, tag.find(' '))) + "> is '" +
                   std::string(text) + "', which is no count");
    }
    return count;
  }

  void find_grid() {
    if (!vtk_) cursor_.fail("it is no VTK file: it has no <VTKFile>");
    bool grid = false;
    while (true) {
      const std::string_view tag = next_tag();
      grid = grid || is_element(tag, "UnstructuredGrid");
      if (is_element(tag, "Piece")) {
        if (!grid) cursor_.fail("it holds no unstructured grid");
        points_ = count_of(tag, "NumberOfPoints");
        cells_ = count_of(tag, "NumberOfCells");
        return;
      }
    }
  }

  VtuArray read_array(std::string_view tag, std::size_t items) {
    VtuArray array;
    const std::string name(attribute(tag, "Name").value_or("without a name"));
    if (attribute(tag, "format").value_or("") != "ascii") {
      cursor_.fail("the array '" + name + "' is not in text form: write the file as text (ASCII)");
    }
    if (attribute(tag, "NumberOfComponents")) array.components = count_of(tag, "NumberOfComponents");
    const std::string_view body = cursor_.until("</DataArray>");
    // Every number takes two bytes at least, so that a count cannot ask for more than the file holds.
    array.values.reserve(body.size() / 2 + 1);
    const char *at = body.data(), *const end = at + body.size();
    while (true) {
      while (at < end && (*at == ' ' || *at == '\n' || *at == '\t' || *at == '\r')) ++at;
      if (at == end) break;
      double value = 0;
      const auto [next, failure] = std::from_chars(at, end, value);
      if (failure != std::errc() || !std::isfinite(value)) {
        cursor_.fail("value " + std::to_string(array.values.size()) + " of the array '" + name +
                     "' is no finite number");
      }
      array.values.push_back(value);
      at = next;
    }
    array.values.shrink_to_fit();
    if (items != kAnyCount && (array.components == 0 || array.values.size() % array.components != 0 ||
                               array.values.size() / array.components != items)) {
      cursor_.fail("the array '" + name + "' has " + std::to_string(array.values.size()) + " values, not " +
                   std::to_string(array.components) + " for each of " + std::to_string(items));
    }
    return array;
  }

  void read_arrays(std::string_view closing, std::string_view opening, std::size_t items,
                   std::map<std::string, VtuArray>& into) {
    if (opening.ends_with("/")) return;
    for (std::string_view tag = next_tag(); !is_element(tag, closing); tag = next_tag()) {
      if (is_element(tag, "DataArray")) {
        const std::string name(attribute(tag, "Name").value_or(""));
        into[name] = read_array(tag, items);
      }
    }
  }

  void read_points(LengthUnit unit) {
    for (std::string_view tag = next_tag(); !is_element(tag, "/Points"); tag = next_tag()) {
      if (!is_element(tag, "DataArray")) continue;
      const VtuArray array = read_array(tag, points_);
      if (array.components != 3) cursor_.fail("its points have not three coordinates");
      const double units = units_per_metre(unit);
      file_.mesh.nodes.clear();
      for (std::size_t at = 0; at < array.values.size(); at += 3) {
        file_.mesh.nodes.emplace_back(Vector3(array.values[at], array.values[at + 1], array.values[at + 2]) /
                                      units);
      }
    }
  }

  void read_cells() {
    std::map<std::string, VtuArray> arrays;
    read_arrays("/Cells", "", kAnyCount, arrays);
    const std::vector<double>&connectivity = arrays["connectivity"].values,
          &offsets = arrays["offsets"].values, &types = arrays["types"].values;
    if (offsets.size() != cells_ || types.size() != cells_)
      cursor_.fail("not every cell has offset and type");
    for (std::size_t cell = 0; cell < cells_; ++cell) {
      if (types[cell] != kTetrahedronType || offsets[cell] != 4 * static_cast<double>(cell + 1) ||
          connectivity.size() < 4 * (cell + 1)) {
        cursor_.fail("cell " + std::to_string(cell) + " is no 4-node tetrahedron");
      }
      Tetrahedron corners{};
      for (std::size_t i = 0; i < 4; ++i) {
        const double node = connectivity[4 * cell + i];
        if (!(node >= 0 && node < static_cast<double>(points_)) || node != std::floor(node)) {
          cursor_.fail("cell " + std::to_string(cell) + " names node " + number_text(node) + " of " +
                       std::to_string(points_));
        }
        corners[i] = static_cast<std::uint32_t>(node);
      }
      file_.mesh.tetrahedra.push_back(corners);
    }
  }

  void finish() {
    if (file_.mesh.nodes.size() != points_) cursor_.fail("it has no points");
    if (file_.mesh.tetrahedra.empty()) cursor_.fail("it has no tetrahedra");
    file_.mesh.regions.assign(cells_, 0);
    const auto region = file_.cell_data.find("region");
    if (region == file_.cell_data.end()) return;
    for (std::size_t cell = 0; cell < cells_; ++cell) {
      const double value = region->second.values[cell];
      if (region->second.components != 1 || value != std::floor(value) || std::abs(value) > 2e9) {
        cursor_.fail("the region of cell " + std::to_string(cell) + " is no whole number");
      }
      file_.mesh.regions[cell] = static_cast<std::int32_t>(value);
    }
  }

  static constexpr std::size_t kAnyCount = ~std::size_t{0};
  MeshCursor cursor_;
  bool vtk_;
  VtuFile file_;
  std::size_t points_ = 0, cells_ = 0;
};

}  // namespace

VtuFile parse_vtu(std::string_view text, const std::string& name, LengthUnit unit) {
  return VtuReader(text, name).read(unit);
}

VtuFile read_vtu(const std::filesystem::path& file, LengthUnit unit) {
  return parse_vtu(read_mesh_text(file), file.string(), unit);
}

std::vector<Vector3> displacement_of(const VtuFile& file, const std::string& name, LengthUnit unit) {
  const auto found = file.point_data.find("displacement");
  if (found == file.point_data.end() || found->second.components != 3) {
    throw Error(
        "cannot use " + name +
        ": it has no point data 'displacement' of three components; take a file of 'kiroku sim solve'");
  }
  std::vector<Vector3> displacement_m(file.mesh.nodes.size());
  for (std::size_t node = 0; node < displacement_m.size(); ++node)
    displacement_m[node] = Vector3(&found->second.values[3 * node]) / units_per_metre(unit);
  return displacement_m;
}

std::vector<Vector3> read_displacement(const std::filesystem::path& file, const TetMesh& mesh,
                                       LengthUnit unit) {
  const VtuFile computed = read_vtu(file, unit);
  std::vector<Vector3> displacement_m = displacement_of(computed, file.string(), unit);
  if (computed.mesh.nodes.size() != mesh.nodes.size()) {
    throw Error("cannot use " + file.string() + ": it has " + std::to_string(computed.mesh.nodes.size()) +
                " nodes, the mesh " + std::to_string(mesh.nodes.size()) +
                "; name the mesh that it was computed on");
  }
  const double tolerance_m = kSamePlace * extent_of(mesh).longest_side_m();
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (!((computed.mesh.nodes[node] - mesh.nodes[node]).cwiseAbs().maxCoeff() <= tolerance_m)) {
      throw Error("cannot use " + file.string() + ": its node " + std::to_string(node) +
                  " is not where that of the mesh is; name the mesh that it was computed on, in its unit");
    }
  }
  return displacement_m;
}

}  // namespace kiroku::sim
