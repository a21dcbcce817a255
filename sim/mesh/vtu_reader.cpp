#include "sim/mesh/vtu_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <pugixml.hpp>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/mesh_reader.h"

namespace kiroku::sim {
namespace {

constexpr double kVtuTetrahedron = 10;
/// What nodes of the same mesh may differ by, of its longest side: files are written with rounded numbers.
constexpr double kSamePlace = 1e-5;

class VtuReader {
 public:
  VtuReader(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  VtuFile read(LengthUnit unit) {
    const pugi::xml_node piece = find_piece();
    points_ = count_of(piece, "NumberOfPoints");
    cells_ = count_of(piece, "NumberOfCells");
    read_arrays(piece.child("PointData"), points_, file_.point_data);
    read_arrays(piece.child("CellData"), cells_, file_.cell_data);
    read_points(piece.child("Points"), unit);
    read_cells(piece.child("Cells"));
    read_regions(piece);
    return std::move(file_);
  }

 private:
  [[noreturn]] void fail_at(std::ptrdiff_t offset, const std::string& sentence) const {
    const auto end = text_.begin() + std::clamp<std::ptrdiff_t>(offset, 0, std::ssize(text_));
    throw Error("cannot read " + name_ + ", line " +
                std::to_string(1 + std::count(text_.begin(), end, '\n')) + ": " + sentence);
  }
  [[noreturn]] void fail(const pugi::xml_node& node, const std::string& sentence) const {
    fail_at(node.offset_debug(), sentence);
  }

  pugi::xml_node find_piece() {
    const pugi::xml_parse_result parsed = document_.load_buffer(text_.data(), text_.size());
    const pugi::xml_node file = document_.child("VTKFile"), grid = file.child("UnstructuredGrid");
    if (!file) fail_at(parsed.offset, "it is no VTK file: it has no <VTKFile>");
    if (!parsed && text_.find("<AppendedData") != std::string_view::npos) {
      fail_at(parsed.offset, "its arrays are not in text form: write the file as text (ASCII)");
    }
    if (!parsed) fail_at(parsed.offset, std::string("it is no XML: ") + parsed.description());
    const pugi::xml_node piece = grid.child("Piece");
    if (!piece) fail(file, "it holds no unstructured grid");
    if (const pugi::xml_node second = piece.next_sibling("Piece")) {
      fail(second, "its grid is in several pieces: write it as one");
    }
    return piece;
  }

  [[nodiscard]] std::size_t count_of(const pugi::xml_node& node, const char* name) const {
    const std::string_view text = node.attribute(name).value();
    std::size_t count = 0;
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), count);
    if (text.empty() || failure != std::errc() || end != text.data() + text.size()) {
      fail(node,
           std::string(name) + " of <" + node.name() + "> is '" + std::string(text) + "', which is no count");
    }
    return count;
  }

  [[nodiscard]] VtuArray read_array(const pugi::xml_node& node, std::size_t items) const {
    VtuArray array;
    const std::string name = node.attribute("Name").as_string("without a name");
    if (std::string_view(node.attribute("format").value()) != "ascii") {
      fail(node, "the array '" + name + "' is not in text form: write the file as text (ASCII)");
    }
    if (node.attribute("NumberOfComponents")) array.components = count_of(node, "NumberOfComponents");
    const std::string_view body = node.child_value();
    // Every number takes two bytes at least, so that a count cannot ask for more than the file holds.
    array.values.reserve(body.size() / 2 + 1);
    const char *at = body.data(), *const end = at + body.size();
    while (true) {
      while (at < end && (*at == ' ' || *at == '\n' || *at == '\t' || *at == '\r')) ++at;
      if (at == end) break;
      double value = 0;
      const auto [next, failure] = std::from_chars(at, end, value);
      if (failure != std::errc() || !std::isfinite(value)) {
        fail(node, "value " + std::to_string(array.values.size()) + " of the array '" + name +
                       "' is no finite number");
      }
      array.values.push_back(value);
      at = next;
    }
    array.values.shrink_to_fit();
    if (items != kAnyCount && (array.components == 0 || array.values.size() % array.components != 0 ||
                               array.values.size() / array.components != items)) {
      fail(node, "the array '" + name + "' has " + std::to_string(array.values.size()) + " values, not " +
                     std::to_string(array.components) + " for each of " + std::to_string(items));
    }
    return array;
  }

  void read_arrays(const pugi::xml_node& parent, std::size_t items,
                   std::map<std::string, VtuArray>& into) const {
    for (const pugi::xml_node& node : parent.children("DataArray")) {
      into[node.attribute("Name").value()] = read_array(node, items);
    }
  }

  void read_points(const pugi::xml_node& parent, LengthUnit unit) {
    const pugi::xml_node node = parent.child("DataArray");
    if (!node) fail(parent, "it has no points");
    const VtuArray array = read_array(node, points_);
    if (array.components != 3) fail(node, "its points have not three coordinates");
    const double units = units_per_metre(unit);
    for (std::size_t at = 0; at < array.values.size(); at += 3) {
      file_.mesh.nodes.emplace_back(Vector3(array.values[at], array.values[at + 1], array.values[at + 2]) /
                                    units);
    }
  }

  void read_cells(const pugi::xml_node& parent) {
    std::map<std::string, VtuArray> arrays;
    read_arrays(parent, kAnyCount, arrays);
    const std::vector<double>&connectivity = arrays["connectivity"].values,
          &offsets = arrays["offsets"].values, &types = arrays["types"].values;
    if (offsets.size() != cells_ || types.size() != cells_) {
      fail(parent, "not every cell has offset and type");
    }
    if (cells_ == 0) fail(parent, "it has no tetrahedra");
    for (std::size_t cell = 0; cell < cells_; ++cell) {
      if (types[cell] != kVtuTetrahedron || offsets[cell] != 4 * static_cast<double>(cell + 1) ||
          connectivity.size() < 4 * (cell + 1)) {
        fail(parent, "cell " + std::to_string(cell) + " is no 4-node tetrahedron");
      }
      Tetrahedron corners{};
      for (std::size_t i = 0; i < 4; ++i) {
        const double node = connectivity[4 * cell + i];
        if (!(node >= 0 && node < static_cast<double>(points_)) || node != std::floor(node)) {
          fail(parent, "cell " + std::to_string(cell) + " names node " + number_text(node) + " of " +
                           std::to_string(points_));
        }
        corners[i] = static_cast<std::uint32_t>(node);
      }
      file_.mesh.tetrahedra.push_back(corners);
    }
  }

  void read_regions(const pugi::xml_node& piece) {
    file_.mesh.regions.assign(cells_, 0);
    const auto region = file_.cell_data.find("region");
    if (region == file_.cell_data.end()) return;
    for (std::size_t cell = 0; cell < cells_; ++cell) {
      const double value = region->second.values[cell];
      if (region->second.components != 1 || value != std::floor(value) || std::abs(value) > 2e9) {
        fail(piece.child("CellData"), "the region of cell " + std::to_string(cell) + " is no whole number");
      }
      file_.mesh.regions[cell] = static_cast<std::int32_t>(value);
    }
  }

  static constexpr std::size_t kAnyCount = ~std::size_t{0};
  std::string_view text_;
  const std::string& name_;
  pugi::xml_document document_;
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
