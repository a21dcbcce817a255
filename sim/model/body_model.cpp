#include "sim/model/body_model.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/mesh_check.h"
#include "sim/mesh/mesh_reader.h"

namespace kiroku::sim {
namespace {

/// No organ is longer, and none that is operated on is shorter.
constexpr double kLongestOrganM = 2.5, kShortestOrganM = 0.001;
/// What a box may miss its nodes by, of the mesh's longest side: files are written with rounded numbers.
constexpr double kBoxTolerance = 1e-9;

std::string vector_text(const Vector3& vector) {
  return "[" + number_text(vector.x()) + ", " + number_text(vector.y()) + ", " + number_text(vector.z()) +
         "]";
}

std::string listed(const std::vector<std::int32_t>& numbers) {
  constexpr std::size_t kMost = 12;
  std::string text;
  for (std::size_t i = 0; i < std::min(numbers.size(), kMost); ++i) {
    text += (i == 0 ? "" : ", ") + std::to_string(numbers[i]);
  }
  return text + (numbers.size() > kMost ? ", ..." : "");
}

}  // namespace

std::string read_document(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw IoError("read", file, errno);
  std::error_code unknown;
  if (std::filesystem::is_directory(file, unknown)) throw IoError("read", file, EISDIR);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

BodyReader::BodyReader(const JsonField& document, const std::filesystem::path& folder,
                       const MeshMaker& maker) {
  read_mesh_and_unit(document, folder, maker);
  read_materials(document.member("materials"));
  model_.constraints = Constraints(model_.mesh.nodes.size());
  if (const auto fixed = document.optional_member("fixed")) {
    for (const JsonField& entry : fixed->elements()) read_fixed(entry);
  }
  if (const auto gravity = document.optional_member("gravity_m_s2")) {
    model_.gravity_m_s2 = gravity->vector();
    if (density_assumed_ && !model_.gravity_m_s2.isZero(0)) {
      warn("a material has no density_kg_m3: 1000 was taken for its weight");
    }
  }
}

void BodyReader::read_mesh_file(const JsonField& mesh, const std::filesystem::path& folder) {
  if (mesh.text().empty()) mesh.fail("names no file");
  MeshFile file = read_mesh(folder / mesh.text(), model_.unit);
  model_.mesh = std::move(file.mesh);
  for (const auto& [kind, count] : file.dropped) {
    warn(std::to_string(count) + " " + kind +
         " of the mesh file were left out: only 4-node tetrahedra are used");
  }
  if (file.turned)
    warn("the mesh file counts the corners of its tetrahedra the other way round; they were turned");
}

void BodyReader::read_mesh_and_unit(const JsonField& document, const std::filesystem::path& folder,
                                    const MeshMaker& maker) {
  const JsonField unit = document.member("length_unit");
  const std::string unit_name = unit.text();
  if (unit_name != "mm" && unit_name != "m") unit.fail("is '" + unit_name + "': it must be \"mm\" or \"m\"");
  model_.unit = unit_name == "mm" ? LengthUnit::kMillimetre : LengthUnit::kMetre;
  const JsonField mesh = document.member("mesh");
  if (maker && mesh.is_object()) {
    model_.mesh = maker(mesh, document, folder, model_.warnings);
  } else {
    read_mesh_file(mesh, folder);
  }
  for (const MeshFinding& finding : check_mesh(model_.mesh)) {
    if (prevents_solving(finding.fault)) mesh.fail("names a mesh that is not sound: " + finding.text);
    warn(finding.text);
  }
  used_ = nodes_in_use(model_.mesh);
  const Extent extent = extent_of(model_.mesh);
  longest_side_m_ = extent.longest_side_m();
  if (longest_side_m_ > kLongestOrganM || longest_side_m_ < kShortestOrganM) {
    const Vector3 size_m = extent.greatest - extent.least;
    warn("the mesh is " + number_text(longest_side_m_, 3) + " m long (" + number_text(size_m.x(), 3) + " x " +
         number_text(size_m.y(), 3) + " x " + number_text(size_m.z(), 3) +
         " m), strange for an organ: is length_unit \"" + unit_name + "\" right?");
  }
}

void BodyReader::read_materials(const JsonField& materials) {
  const std::vector<std::int32_t> regions = regions_of(model_.mesh);
  std::map<std::int64_t, std::string> path_of;  // of each region that is named
  std::optional<Material> everywhere;
  for (const JsonField& entry : materials.elements()) {
    entry.expect_object({"region", "young_modulus_pa", "poisson_ratio", "density_kg_m3"});
    Material material{entry.member("young_modulus_pa").number(), entry.member("poisson_ratio").number()};
    if (const auto density = entry.optional_member("density_kg_m3")) {
      material.density_kg_m3 = density->number();
    } else {
      density_assumed_ = true;
    }
    if (const MaterialProblem found = problem_of(material); !found.problem.empty()) {
      entry.member(found.property.c_str()).fail(found.problem);
    }
    const JsonField region = entry.member("region");
    if (region.is_text()) {
      if (region.text() != "all")
        region.fail("is '" + region.text() + "': it must be \"all\" or a region's number");
      if (everywhere) region.fail("is \"all\" a second time");
      everywhere = material;
      continue;
    }
    const std::int64_t number = region.integer();
    if (!std::ranges::binary_search(regions, number)) {
      region.fail("is " + std::to_string(number) + ", which the mesh does not have; it has " +
                  listed(regions));
    }
    if (const auto [known, fresh] = path_of.emplace(number, region.path()); !fresh) {
      region.fail("is " + std::to_string(number) + " again, as " + known->second);
    }
    model_.materials.emplace(static_cast<std::int32_t>(number), material);
  }
  for (const std::int32_t region : regions) {
    if (model_.materials.contains(region)) continue;
    if (!everywhere) materials.fail("has none for region " + std::to_string(region) + " of the mesh");
    model_.materials.emplace(region, *everywhere);
  }
}

std::vector<std::size_t> BodyReader::selected(const JsonField& entry) const {
  if (entry.has("nodes") == entry.has("box")) entry.fail("must have either 'nodes' or 'box'");
  return entry.has("nodes") ? named_nodes(entry.member("nodes")) : nodes_in_box(entry.member("box"));
}

std::vector<std::size_t> BodyReader::named_nodes(const JsonField& list) const {
  std::vector<std::size_t> nodes;
  std::vector<bool> named(model_.mesh.nodes.size());
  for (const JsonField& element : list.elements()) {
    const std::int64_t number = element.integer();
    if (number < 0 || static_cast<std::uint64_t>(number) >= named.size()) {
      element.fail("is " + std::to_string(number) + ": nodes are numbered from 0 to " +
                   std::to_string(named.size() - 1));
    }
    const auto node = static_cast<std::size_t>(number);
    if (named[node]) element.fail("names node " + std::to_string(node) + " a second time");
    named[node] = true;
    nodes.push_back(node);
  }
  if (nodes.empty()) list.fail("names no node");
  return nodes;
}

std::vector<std::size_t> BodyReader::nodes_in_box(const JsonField& box) const {
  const std::vector<JsonField> corners = box.elements(2);
  const Vector3 least = corners[0].vector(), greatest = corners[1].vector();
  if ((least.array() > greatest.array()).any()) {
    box.fail("has its corners the wrong way round: the first must not be greater in any coordinate");
  }
  const double units = units_per_metre(model_.unit);
  const Vector3 slack_m = Vector3::Constant(kBoxTolerance * longest_side_m_);
  const Vector3 least_m = least / units - slack_m, greatest_m = greatest / units + slack_m;
  std::vector<std::size_t> nodes;
  for (std::size_t node = 0; node < model_.mesh.nodes.size(); ++node) {
    const auto& at = model_.mesh.nodes[node].array();
    if (used_[node] && (at >= least_m.array()).all() && (at <= greatest_m.array()).all())
      nodes.push_back(node);
  }
  if (nodes.empty()) {
    const Extent extent = extent_of(model_.mesh);
    box.fail("holds no node; the mesh reaches from " + vector_text(extent.least * units) + " to " +
             vector_text(extent.greatest * units));
  }
  return nodes;
}

void BodyReader::read_fixed(const JsonField& entry) {
  entry.expect_object({"nodes", "box", "displacement"});
  std::array<std::optional<double>, 3> displacement{0.0, 0.0, 0.0};
  if (const auto given = entry.optional_member("displacement")) {
    const std::vector<JsonField> components = given->elements(3);
    std::ranges::transform(components, displacement.begin(), &JsonField::number_or_null);
    if (std::ranges::none_of(displacement, &std::optional<double>::has_value))
      given->fail("fixes no component");
  }
  const std::vector<std::size_t> nodes = selected(entry);
  try {
    for (const std::size_t node : nodes) {
      for (std::size_t component = 0; component < 3; ++component) {
        if (!displacement[component]) continue;
        model_.constraints.prescribe(node, component, *displacement[component] / units_per_metre(model_.unit),
                                     entry.path());
      }
    }
  } catch (const Error& contradiction) {
    entry.fail(std::string("contradicts another: ") + contradiction.what());
  }
}

}  // namespace kiroku::sim
