// Gmsh's formats MSH 2.2 and 4.1, text and binary (Gmsh reference manual, "MSH file format" and "Legacy
// formats").
#include <algorithm>
#include <array>
#include <map>

#include "sim/mesh/mesh_builder.h"

namespace kiroku::sim {
namespace {

struct ElementKind {
  const char* name;  // plural
  std::size_t nodes;
};

constexpr std::int64_t kGmshTetrahedron = 4;

/// By Gmsh's element type, from 1.
constexpr std::array<ElementKind, 19> kElementKinds{{
    {"lines", 2},
    {"triangles", 3},
    {"quadrangles", 4},
    {"4-node tetrahedra", 4},
    {"hexahedra", 8},
    {"prisms", 6},
    {"pyramids", 5},
    {"3-node lines", 3},
    {"6-node triangles", 6},
    {"9-node quadrangles", 9},
    {"10-node tetrahedra", 10},
    {"27-node hexahedra", 27},
    {"18-node prisms", 18},
    {"14-node pyramids", 14},
    {"points", 1},
    {"8-node quadrangles", 8},
    {"20-node hexahedra", 20},
    {"15-node prisms", 15},
    {"13-node pyramids", 13},
}};

class MshReader {
 public:
  MshReader(std::string_view file, const std::string& name, LengthUnit unit)
      : cursor_(file, name), builder_(cursor_, unit) {}

  MeshFile read() {
    read_format();
    while (cursor_.more()) {
      const std::string_view section = cursor_.word();
      if (section == "$Nodes") {
        version_ == Version::k22 ? read_nodes_22() : read_nodes_41();
      } else if (section == "$Elements") {
        if (!nodes_read_) cursor_.fail("$Elements stands before $Nodes");
        version_ == Version::k22 ? read_elements_22() : read_elements_41();
      } else if (section == "$Entities" && version_ == Version::k41) {
        read_entities();
      } else if (section.size() > 1 && section[0] == '$' && !section.starts_with("$End")) {
        cursor_.skip_past("$End" + std::string(section.substr(1)));
        continue;
      } else {
        cursor_.fail("a section was expected, such as $Nodes");
      }
      if (cursor_.word() != "$End" + std::string(section.substr(1))) {
        cursor_.fail("$End" + std::string(section.substr(1)) +
                     " was expected: the count in its section is wrong");
      }
    }
    choose_regions();
    return builder_.finish();
  }

 private:
  enum class Version { k22, k41 };
  // Widths in binary files: int, size_t, double.
  static constexpr std::size_t kInt = 4, kSize = 8, kReal = 8;

  void read_format() {
    if (cursor_.word() != "$MeshFormat")
      cursor_.fail("it is no MSH file: it does not begin with $MeshFormat");
    const std::string_view version = cursor_.word();
    if (version == "2.2" || version == "2") {
      version_ = Version::k22;
    } else if (version == "4.1") {
      version_ = Version::k41;
    } else {
      cursor_.fail("it is of version '" + std::string(version.substr(0, 8)) + "'; save it as MSH 4.1 or 2.2");
    }
    const std::int64_t type = cursor_.text_integer("the file type");
    if (type != 0 && type != 1) cursor_.fail("the file type is neither 0 (text) nor 1 (binary)");
    if (cursor_.text_integer("the data size") != 8) cursor_.fail("the data size is not 8");
    if (type == 1) {
      cursor_.line();
      const std::string_view one = cursor_.take(kInt, "the binary number one");
      const bool little = one == std::string_view("\1\0\0\0", 4);
      if (!little && one != std::string_view("\0\0\0\1", 4)) cursor_.fail("the binary number one is another");
      cursor_.set_binary(true, little ? std::endian::little : std::endian::big);
    }
    if (cursor_.word() != "$EndMeshFormat") cursor_.fail("$EndMeshFormat was expected");
  }

  /// The end of the line that holds a section's header: binary data begins after it.
  void begin_data() {
    if (cursor_.binary()) cursor_.line();
  }

  Vector3 coordinates() {
    const double x = cursor_.real(kReal, "a coordinate"), y = cursor_.real(kReal, "a coordinate");
    return {x, y, cursor_.real(kReal, "a coordinate")};
  }

  const ElementKind& element_kind(std::int64_t type) const {
    if (type < 1 || type > static_cast<std::int64_t>(kElementKinds.size())) {
      cursor_.fail("elements of type " + std::to_string(type) + " are not known");
    }
    return kElementKinds[static_cast<std::size_t>(type - 1)];
  }

  void read_nodes_22() {
    nodes_read_ = true;
    const std::uint64_t count = cursor_.text_count("the number of nodes");
    begin_data();
    builder_.reserve_nodes(count);
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::int64_t number = cursor_.integer(kInt, "the number of a node");
      builder_.add_node(number, coordinates());
    }
  }

  void read_elements_22() {
    const std::uint64_t count = cursor_.text_count("the number of elements");
    begin_data();
    builder_.reserve_tetrahedra(count);
    for (std::uint64_t i = 0; i < count;) {
      std::int64_t type = 0;
      std::uint64_t follow = 1, tags = 0;
      if (cursor_.binary()) {
        type = cursor_.integer(kInt, "the type of an element");
        follow = cursor_.count(kInt, "the number of elements of one type");
        tags = cursor_.count(kInt, "the number of tags");
        if (follow == 0 || follow > count - i) cursor_.fail("a block of elements is larger than the section");
      } else {
        cursor_.text_integer("the number of an element");
        type = cursor_.text_integer("the type of an element");
        tags = cursor_.text_count("the number of tags");
      }
      const ElementKind& kind = element_kind(type);
      for (std::uint64_t j = 0; j < follow; ++j, ++i) {
        if (cursor_.binary()) cursor_.integer(kInt, "the number of an element");
        std::int64_t physical = 0, elementary = 0;
        for (std::uint64_t tag = 0; tag < tags; ++tag) {
          const std::int64_t value = cursor_.integer(kInt, "a tag");
          if (tag == 0) physical = value;
          if (tag == 1) elementary = value;
        }
        read_element(type, kind, kInt, physical, elementary);
      }
    }
  }

  void read_element(std::int64_t type, const ElementKind& kind, std::size_t width, std::int64_t physical,
                    std::int64_t elementary) {
    if (type != kGmshTetrahedron) {
      for (std::size_t i = 0; i < kind.nodes; ++i) cursor_.integer(width, "a node of an element");
      builder_.drop(kind.name);
      return;
    }
    std::array<std::int64_t, 4> numbers{};
    for (std::int64_t& number : numbers) number = cursor_.integer(width, "a node of a tetrahedron");
    builder_.add_tetrahedron(numbers, region_number(physical, cursor_));
    elementary_.push_back(region_number(elementary, cursor_));
  }

  /// Keeps the first physical group of each volume.
  void read_entities() {
    std::array<std::uint64_t, 4> counts{};
    begin_data();
    for (std::uint64_t& count : counts) count = cursor_.count(kSize, "the number of entities");
    for (std::size_t dimension = 0; dimension < counts.size(); ++dimension) {
      for (std::uint64_t i = 0; i < counts[dimension]; ++i) {
        const std::int64_t tag = cursor_.integer(kInt, "the tag of an entity");
        for (int coordinate = 0; coordinate < (dimension == 0 ? 3 : 6); ++coordinate) {
          cursor_.real(kReal, "a bound of an entity");
        }
        const std::uint64_t groups = cursor_.count(kSize, "the number of physical groups");
        for (std::uint64_t group = 0; group < groups; ++group) {
          const std::int64_t physical = cursor_.integer(kInt, "a physical group");
          if (dimension == 3 && group == 0) physical_of_volume_[tag] = physical;
        }
        const std::uint64_t bounding =
            dimension == 0 ? 0 : cursor_.count(kSize, "the number of bounding entities");
        for (std::uint64_t b = 0; b < bounding; ++b) cursor_.integer(kInt, "a bounding entity");
      }
    }
  }

  void read_nodes_41() {
    nodes_read_ = true;
    begin_data();
    const std::uint64_t blocks = cursor_.count(kSize, "the number of blocks of nodes");
    const std::uint64_t all = cursor_.count(kSize, "the number of nodes");
    cursor_.count(kSize, "the least number of a node");
    cursor_.count(kSize, "the greatest number of a node");
    builder_.reserve_nodes(all);
    std::uint64_t seen = 0;
    std::vector<std::int64_t> numbers;
    for (std::uint64_t block = 0; block < blocks; ++block) {
      const std::int64_t dimension = cursor_.integer(kInt, "the dimension of a block of nodes");
      cursor_.integer(kInt, "the entity of a block of nodes");
      const bool parametric = cursor_.integer(kInt, "whether nodes have parameters") != 0;
      const std::uint64_t count = cursor_.count(kSize, "the number of nodes of a block");
      if (dimension < 0 || dimension > 3)
        cursor_.fail("a block of nodes has a dimension that is none of 0 to 3");
      if (count > all - seen) cursor_.fail("the blocks hold more nodes than the section says");
      seen += count;
      numbers.clear();
      for (std::uint64_t i = 0; i < count; ++i) {
        numbers.push_back(cursor_.integer(kSize, "the number of a node"));
      }
      for (const std::int64_t number : numbers) {
        const Vector3 position = coordinates();
        for (std::int64_t i = 0; parametric && i < dimension; ++i)
          cursor_.real(kReal, "a parameter of a node");
        builder_.add_node(number, position);
      }
    }
    if (seen != all) cursor_.fail("the blocks hold fewer nodes than the section says");
  }

  void read_elements_41() {
    begin_data();
    const std::uint64_t blocks = cursor_.count(kSize, "the number of blocks of elements");
    const std::uint64_t all = cursor_.count(kSize, "the number of elements");
    cursor_.count(kSize, "the least number of an element");
    cursor_.count(kSize, "the greatest number of an element");
    builder_.reserve_tetrahedra(all);
    std::uint64_t seen = 0;
    for (std::uint64_t block = 0; block < blocks; ++block) {
      cursor_.integer(kInt, "the dimension of a block of elements");
      const std::int64_t entity = cursor_.integer(kInt, "the entity of a block of elements");
      const std::int64_t type = cursor_.integer(kInt, "the type of a block of elements");
      const std::uint64_t count = cursor_.count(kSize, "the number of elements of a block");
      if (count > all - seen) cursor_.fail("the blocks hold more elements than the section says");
      seen += count;
      const ElementKind& kind = element_kind(type);
      const auto physical = physical_of_volume_.find(entity);
      for (std::uint64_t i = 0; i < count; ++i) {
        cursor_.integer(kSize, "the number of an element");
        read_element(type, kind, kSize, physical == physical_of_volume_.end() ? 0 : physical->second, entity);
      }
    }
    if (seen != all) cursor_.fail("the blocks hold fewer elements than the section says");
  }

  void choose_regions() {
    std::vector<std::int32_t>& regions = builder_.regions();
    if (std::ranges::all_of(regions, [](std::int32_t physical) { return physical == 0; }))
      regions = elementary_;
  }

  MeshCursor cursor_;
  MeshBuilder builder_;
  Version version_ = Version::k22;
  bool nodes_read_ = false;
  std::map<std::int64_t, std::int64_t> physical_of_volume_;  // by the entity's tag
  std::vector<std::int32_t> elementary_;                     // of each tetrahedron
};

}  // namespace

MeshFile parse_msh(std::string_view file, const std::string& name, LengthUnit unit) {
  return MshReader(file, name, unit).read();
}

}  // namespace kiroku::sim
