#include "sim/mesh/mesh_builder.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/error.h"

namespace kiroku::sim {
namespace {

/// Unknowns are three a node and are counted in 32 bits.
constexpr std::size_t kMostNodes = std::numeric_limits<std::int32_t>::max() / 3;
/// A node takes at least seven characters ("1 0 0 0"), a tetrahedron as many.
constexpr std::size_t kLeastBytes = 7;

}  // namespace

MeshBuilder::MeshBuilder(const MeshCursor& cursor, LengthUnit unit)
    : cursor_(cursor), units_per_metre_(sim::units_per_metre(unit)) {}

void MeshBuilder::reserve_nodes(std::uint64_t count) {
  file_.mesh.nodes.reserve(file_.mesh.nodes.size() +
                           std::min<std::uint64_t>(count, cursor_.remaining() / kLeastBytes + 1));
}

void MeshBuilder::reserve_tetrahedra(std::uint64_t count) {
  const std::uint64_t possible = std::min<std::uint64_t>(count, cursor_.remaining() / kLeastBytes + 1);
  file_.mesh.tetrahedra.reserve(tetrahedra() + possible);
  file_.mesh.regions.reserve(tetrahedra() + possible);
}

void MeshBuilder::add_node(std::int64_t number, const Vector3& in_file_units) {
  std::vector<Vector3>& nodes = file_.mesh.nodes;
  if (nodes.size() >= kMostNodes) cursor_.fail("it has more than " + std::to_string(kMostNodes) + " nodes");
  const auto index = static_cast<std::uint32_t>(nodes.size());
  if (nodes.empty()) first_number_ = number;
  if (!node_of_number_ && distance(first_number_, number) != index) {
    node_of_number_.emplace();
    for (std::uint32_t i = 0; i < index; ++i)
      node_of_number_->emplace(static_cast<std::int64_t>(static_cast<std::uint64_t>(first_number_) + i), i);
  }
  if (node_of_number_ && !node_of_number_->emplace(number, index).second) {
    cursor_.fail("two nodes have the number " + std::to_string(number));
  }
  nodes.emplace_back(in_file_units / units_per_metre_);
}

std::uint32_t MeshBuilder::node_of(std::int64_t number) const {
  if (node_of_number_) {
    const auto found = node_of_number_->find(number);
    if (found != node_of_number_->end()) return found->second;
  } else if (const std::uint64_t index = distance(first_number_, number); index < file_.mesh.nodes.size()) {
    return static_cast<std::uint32_t>(index);
  }
  cursor_.fail("tetrahedron " + std::to_string(tetrahedra()) + " (counted from 0) names the node " +
               std::to_string(number) + ", which is not there");
}

void MeshBuilder::add_tetrahedron(const std::array<std::int64_t, 4>& numbers, std::int32_t region) {
  Tetrahedron corners{};
  std::ranges::transform(numbers, corners.begin(), [this](std::int64_t number) { return node_of(number); });
  file_.mesh.tetrahedra.push_back(corners);
  file_.mesh.regions.push_back(region);
}

void MeshBuilder::drop(const std::string& kind) {
  const auto known = std::ranges::find(file_.dropped, kind, &std::pair<std::string, std::size_t>::first);
  if (known != file_.dropped.end()) {
    ++known->second;
  } else {
    file_.dropped.emplace_back(kind, 1);
  }
}

MeshFile MeshBuilder::finish() {
  TetMesh& mesh = file_.mesh;
  if (mesh.tetrahedra.empty()) {
    std::string others;
    for (const auto& [kind, count] : file_.dropped) {
      others += (others.empty() ? ", only " : ", ") + std::to_string(count) + " " + kind;
    }
    throw Error("cannot read " + cursor_.name() + ": it holds no 4-node tetrahedra" + others);
  }
  file_.turned = true;
  for (std::size_t t = 0; t < mesh.tetrahedra.size() && file_.turned; ++t) {
    file_.turned = signed_volume_m3(mesh, t) < 0;
  }
  if (file_.turned) {
    for (Tetrahedron& corners : mesh.tetrahedra) std::swap(corners[2], corners[3]);
  }
  return std::move(file_);
}

std::int32_t region_number(std::int64_t number, const MeshCursor& cursor) {
  if (number < std::numeric_limits<std::int32_t>::min() ||
      number > std::numeric_limits<std::int32_t>::max()) {
    cursor.fail("the region " + std::to_string(number) + " does not fit into 32 bits");
  }
  return static_cast<std::int32_t>(number);
}

}  // namespace kiroku::sim
