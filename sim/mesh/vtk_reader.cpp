// Legacy VTK files, text and binary, versions up to 5.1 ("VTK File Formats", section "Simple Legacy
// Formats").
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "base/ascii.h"
#include "sim/mesh/mesh_builder.h"

namespace kiroku::sim {
namespace {

constexpr std::int64_t kVtkTetrahedron = 10;

/// Plural names by VTK's cell type.
std::string kind_name(std::int64_t type) {
  switch (type) {
    case 1:
    case 2:
      return "points";
    case 3:
    case 4:
      return "lines";
    case 5:
    case 6:
      return "triangles";
    case 7:
      return "polygons";
    case 8:
    case 9:
      return "quadrangles";
    case 11:
    case 12:
      return "hexahedra";
    case 13:
      return "prisms";
    case 14:
      return "pyramids";
    case 24:
      return "10-node tetrahedra";
    default:
      return "cells of type " + std::to_string(type);
  }
}

constexpr std::array<std::string_view, 8> kRegionNames{
    "region", "regions", "material", "label", "labels", "gmsh:physical", "medit:ref", "CellEntityIds"};

struct Type {
  std::string_view name;
  std::size_t bytes;
  bool real;
};
constexpr std::array<Type, 13> kTypes{{{"float", 4, true},
                                       {"double", 8, true},
                                       {"char", 1, false},
                                       {"unsigned_char", 1, false},
                                       {"short", 2, false},
                                       {"unsigned_short", 2, false},
                                       {"int", 4, false},
                                       {"unsigned_int", 4, false},
                                       {"long", 8, false},
                                       {"unsigned_long", 8, false},
                                       {"vtkIdType", 4, false},
                                       {"vtktypeint32", 4, false},
                                       {"vtktypeint64", 8, false}}};

class VtkReader {
 public:
  VtkReader(std::string_view file, const std::string& name, LengthUnit unit)
      : cursor_(file, name), builder_(cursor_, unit) {}

  MeshFile read() {
    if (!cursor_.line().starts_with("# vtk DataFile Version")) {
      cursor_.fail("it is no legacy VTK file: it does not begin with '# vtk DataFile Version'");
    }
    cursor_.line();  // title
    const std::string_view mode = cursor_.word();
    if (same_but_for_case(mode, "BINARY")) {
      cursor_.set_binary(true, std::endian::big);
    } else if (!same_but_for_case(mode, "ASCII")) {
      cursor_.fail("neither ASCII nor BINARY stands there");
    }
    if (!same_but_for_case(cursor_.word(), "DATASET")) cursor_.fail("DATASET was expected");
    if (const std::string_view kind = cursor_.word(); !same_but_for_case(kind, "UNSTRUCTURED_GRID")) {
      cursor_.fail("it is a " + std::string(kind.substr(0, 24)) +
                   ": tetrahedra are read from an UNSTRUCTURED_GRID only");
    }
    while (cursor_.more()) read_section();
    add_cells();
    return builder_.finish();
  }

 private:
  void read_section() {
    const std::string section(cursor_.word());
    if (same_but_for_case(section, "POINTS")) {
      read_points();
    } else if (same_but_for_case(section, "CELLS")) {
      read_cells();
    } else if (same_but_for_case(section, "CELL_TYPES")) {
      types_ =
          whole_numbers(cursor_.text_count("the number of cell types"), type_named("int"), "a cell type");
    } else if (same_but_for_case(section, "CELL_DATA")) {
      attributes_ = cursor_.text_count("the number of cells with data");
      of_cells_ = true;
    } else if (same_but_for_case(section, "POINT_DATA")) {
      attributes_ = cursor_.text_count("the number of points with data");
      of_cells_ = false;
    } else if (same_but_for_case(section, "SCALARS")) {
      read_scalars();
    } else if (same_but_for_case(section, "FIELD")) {
      read_fields();
    } else if (same_but_for_case(section, "VECTORS") || same_but_for_case(section, "NORMALS")) {
      skip_attribute(3);
    } else if (same_but_for_case(section, "TENSORS")) {
      skip_attribute(9);
    } else if (same_but_for_case(section, "METADATA")) {
      skip_metadata();
    } else {
      cursor_.fail("a section was expected, such as POINTS, and not '" + section.substr(0, 24) + "'");
    }
  }

  Type type_named(std::string_view name) const {
    const auto found =
        std::ranges::find_if(kTypes, [&](const Type& type) { return same_but_for_case(type.name, name); });
    if (found == kTypes.end())
      cursor_.fail("the data type '" + std::string(name.substr(0, 24)) + "' is not known");
    return *found;
  }

  /// Values follow on the next line; a count that the rest of the file cannot hold is refused before memory
  /// is asked for.
  void begin_values(std::uint64_t count, const Type& type) {
    cursor_.line();
    const std::size_t least = cursor_.binary() ? type.bytes : 2;
    if (count > (cursor_.remaining() + 1) / least) {
      cursor_.fail("it says that " + std::to_string(count) +
                   " values follow, more than the file has room for");
    }
  }

  std::vector<std::int64_t> whole_numbers(std::uint64_t count, const Type& type, const char* what) {
    begin_values(count, type);
    if (type.real || type.bytes < 4)
      cursor_.fail(std::string(what) + " is not of an integer type of 32 or 64 bits");
    std::vector<std::int64_t> numbers;
    numbers.reserve(count);
    for (std::uint64_t i = 0; i < count; ++i) numbers.push_back(cursor_.integer(type.bytes, what));
    return numbers;
  }

  std::int64_t point(std::size_t bytes) {
    const std::int64_t number = cursor_.integer(bytes, "a point of a cell");
    if (number < 0 || static_cast<std::uint64_t>(number) >= points_) {
      cursor_.fail("a cell names the point " + std::to_string(number) + ", which is not there");
    }
    return number;
  }

  void skip_values(std::uint64_t count, const Type& type) {
    begin_values(count, type);
    if (cursor_.binary()) {
      cursor_.take(count * type.bytes, "an array of data");
      return;
    }
    for (std::uint64_t i = 0; i < count; ++i) {
      if (cursor_.word().empty()) cursor_.fail("the file ends within an array of data");
    }
  }

  /// To the empty line that ends it.
  void skip_metadata() {
    cursor_.line();
    while (cursor_.remaining() > 0 && !cursor_.line().empty()) {
    }
  }

  void read_points() {
    if (points_read_) cursor_.fail("POINTS stands twice");
    points_read_ = true;
    points_ = cursor_.text_count("the number of points");
    const Type type = type_named(cursor_.word());
    if (!type.real) cursor_.fail("points are neither float nor double");
    if (points_ > cursor_.remaining()) cursor_.fail("the number of points is larger than the file");
    begin_values(3 * points_, type);
    builder_.reserve_nodes(points_);
    for (std::uint64_t i = 0; i < points_; ++i) {
      const double x = cursor_.real(type.bytes, "a coordinate"), y = cursor_.real(type.bytes, "a coordinate");
      builder_.add_node(static_cast<std::int64_t>(i), {x, y, cursor_.real(type.bytes, "a coordinate")});
    }
  }

  /// Two shapes: "CELLS n size" with the number of points before the points of each cell; from version 5.1
  /// "CELLS n+1 m", then OFFSETS and CONNECTIVITY.
  void read_cells() {
    if (!offsets_.empty()) cursor_.fail("CELLS stands twice");
    const std::uint64_t first = cursor_.text_count("the number of cells");
    const std::uint64_t second = cursor_.text_count("the number of values of the cells");
    cursor_.line();
    if (!points_read_) cursor_.fail("CELLS stands before POINTS");
    if (next_is("OFFSETS")) {
      cursor_.word();
      offsets_ = whole_numbers(first, type_named(cursor_.word()), "an offset");
      if (!same_but_for_case(cursor_.word(), "CONNECTIVITY")) cursor_.fail("CONNECTIVITY was expected");
      const Type type = type_named(cursor_.word());
      if (type.real || type.bytes < 4)
        cursor_.fail("points of cells are not of an integer type of 32 or 64 bits");
      begin_values(second, type);
      for (std::uint64_t i = 0; i < second; ++i) connectivity_.push_back(point(type.bytes));
      if (offsets_.empty() || offsets_.front() != 0 || offsets_.back() != static_cast<std::int64_t>(second) ||
          !std::ranges::is_sorted(offsets_)) {
        cursor_.fail("the offsets of the cells do not run from 0 to the end of the connectivity");
      }
      return;
    }
    const std::size_t least = cursor_.binary() ? 4 : 2;
    if (second > (cursor_.remaining() + 1) / least || first > second) {
      cursor_.fail("the number of cells is larger than the file has room for");
    }
    offsets_.push_back(0);
    for (std::uint64_t cell = 0; cell < first; ++cell) {
      const std::uint64_t points = cursor_.count(4, "the number of points of a cell");
      if (points > second - std::min<std::uint64_t>(second, connectivity_.size())) {
        cursor_.fail("a cell has more points than CELLS says for all");
      }
      for (std::uint64_t i = 0; i < points; ++i) connectivity_.push_back(point(4));
      offsets_.push_back(static_cast<std::int64_t>(connectivity_.size()));
    }
    if (connectivity_.size() + first != second)
      cursor_.fail("CELLS says another number of values than its cells have");
  }

  [[nodiscard]] bool next_is(std::string_view word) const {
    MeshCursor ahead = cursor_;
    return same_but_for_case(ahead.word(), word);
  }

  void read_scalars() {
    const std::string name(cursor_.word());
    const Type type = type_named(cursor_.word());
    std::uint64_t components = 1;
    const std::string_view rest = cursor_.line();
    if (!rest.empty()) components = static_cast<std::uint64_t>(std::clamp(rest[0] - '0', 1, 4));
    if (next_is("LOOKUP_TABLE")) {
      cursor_.word();
      cursor_.word();
      read_array(name, components, attributes_, type);
    } else {
      cursor_.fail("LOOKUP_TABLE was expected after SCALARS");
    }
  }

  void read_fields() {
    cursor_.word();  // a name
    const std::uint64_t arrays = cursor_.text_count("the number of arrays");
    for (std::uint64_t i = 0; i < arrays; ++i) {
      const std::string name(cursor_.word());
      const std::uint64_t components = cursor_.text_count("the number of components");
      const std::uint64_t tuples = cursor_.text_count("the number of tuples");
      const Type type = type_named(cursor_.word());
      if (components > 1024 || tuples > cursor_.remaining()) cursor_.fail("an array is larger than the file");
      read_array(name, components, tuples, type);
      if (next_is("METADATA")) {
        cursor_.word();
        skip_metadata();
      }
    }
  }

  void skip_attribute(std::uint64_t components) {
    cursor_.word();  // a name
    const Type type = type_named(cursor_.word());
    if (attributes_ > cursor_.remaining()) cursor_.fail("an array is larger than the file");
    skip_values(components * attributes_, type);
  }

  void read_array(const std::string& name, std::uint64_t components, std::uint64_t tuples, const Type& type) {
    const auto rank = std::ranges::find(kRegionNames, name) - kRegionNames.begin();
    const bool regions =
        of_cells_ && components == 1 && rank < region_rank_ && (type.real || type.bytes >= 4);
    if (!regions) {
      skip_values(components * tuples, type);
      return;
    }
    region_rank_ = rank;
    regions_.clear();
    begin_values(tuples, type);
    for (std::uint64_t i = 0; i < tuples; ++i) {
      const double value = type.real ? cursor_.real(type.bytes, "a region")
                                     : static_cast<double>(cursor_.integer(type.bytes, "a region"));
      if (value != std::floor(value) || std::abs(value) > 1e15) {
        cursor_.fail("the cell data '" + name + "' are no whole numbers, as regions must be");
      }
      regions_.push_back(region_number(static_cast<std::int64_t>(value), cursor_));
    }
  }

  void add_cells() {
    const std::size_t cells = offsets_.empty() ? 0 : offsets_.size() - 1;
    if (types_.size() != cells) {
      cursor_.fail("there are " + std::to_string(cells) + " cells and " + std::to_string(types_.size()) +
                   " cell types");
    }
    if (!regions_.empty() && regions_.size() != cells) cursor_.fail("not every cell has a region");
    builder_.reserve_tetrahedra(cells);
    for (std::size_t cell = 0; cell < cells; ++cell) {
      const auto begin = static_cast<std::size_t>(offsets_[cell]);
      const std::size_t points = static_cast<std::size_t>(offsets_[cell + 1]) - begin;
      if (types_[cell] != kVtkTetrahedron) {
        builder_.drop(kind_name(types_[cell]));
        continue;
      }
      if (points != 4)
        cursor_.fail("cell " + std::to_string(cell) + " is a tetrahedron with " + std::to_string(points) +
                     " points");
      std::array<std::int64_t, 4> numbers{};
      std::copy_n(connectivity_.begin() + static_cast<std::ptrdiff_t>(begin), 4, numbers.begin());
      builder_.add_tetrahedron(numbers, regions_.empty() ? 0 : regions_[cell]);
    }
  }

  MeshCursor cursor_;
  MeshBuilder builder_;
  bool points_read_ = false, of_cells_ = false;
  std::uint64_t points_ = 0;
  std::uint64_t attributes_ = 0;  // tuples of the data section being read
  std::vector<std::int64_t> offsets_,
      connectivity_;  // of cell i: connectivity[offsets[i]] to [offsets[i + 1]]
  std::vector<std::int64_t> types_;
  std::ptrdiff_t region_rank_ = static_cast<std::ptrdiff_t>(kRegionNames.size());
  std::vector<std::int32_t> regions_;  // of each cell; empty where the file has none
};

}  // namespace

MeshFile parse_vtk(std::string_view file, const std::string& name, LengthUnit unit) {
  return VtkReader(file, name, unit).read();
}

}  // namespace kiroku::sim
