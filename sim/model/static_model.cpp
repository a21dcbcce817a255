#include "sim/model/static_model.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <utility>

#include "base/error.h"
#include "sim/cutting/blade_path.h"
#include "sim/cutting/cut_body.h"
#include "sim/fem/number_text.h"
#include "sim/mesh/mesh_check.h"
#include "sim/mesh/mesh_reader.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/model/json_field.h"

namespace kiroku::sim {
namespace {

/// No organ is longer, and none that is operated on is shorter.
constexpr double kLongestOrganM = 2.5, kShortestOrganM = 0.001;
/// What a box may miss its nodes by, of the mesh's longest side: files are written with rounded numbers.
constexpr double kBoxTolerance = 1e-9;

std::string read_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in || std::filesystem::is_directory(file)) {
    throw IoError("read", file, std::filesystem::is_directory(file) ? EISDIR : errno);
  }
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::string vector_text(const Vector3& vector) {
  return "[" + number_text(vector.x()) + ", " + number_text(vector.y()) + ", " + number_text(vector.z()) +
         "]";
}

class ModelReader {
 public:
  ModelReader(const JsonField& document, const std::filesystem::path& folder) {
    document.expect_object({"mesh", "length_unit", "materials", "fixed", "forces", "gravity_m_s2", "cuts"});
    read_mesh_and_unit(document, folder);
    read_materials(document.member("materials"));
    model_.constraints = Constraints(model_.mesh.nodes.size());
    model_.force_n = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * model_.mesh.nodes.size()));
    if (const auto fixed = document.optional_member("fixed")) {
      for (const JsonField& entry : fixed->elements()) read_fixed(entry);
    }
    if (const auto forces = document.optional_member("forces")) {
      for (const JsonField& entry : forces->elements()) read_force(entry);
    }
    if (const auto gravity = document.optional_member("gravity_m_s2")) {
      model_.gravity_m_s2 = gravity->vector();
      if (density_assumed_ && !model_.gravity_m_s2.isZero(0)) {
        warn("a material has no density_kg_m3: 1000 was taken for its weight");
      }
    }
    if (const auto cuts = document.optional_member("cuts")) {
      for (const JsonField& entry : cuts->elements()) read_cut(entry);
    }
  }

  StaticModel take() { return std::move(model_); }

 private:
  void warn(const std::string& sentence) { model_.warnings.push_back(sentence); }

  void read_mesh_and_unit(const JsonField& document, const std::filesystem::path& folder) {
    const JsonField unit = document.member("length_unit");
    const std::string unit_name = unit.text();
    if (unit_name != "mm" && unit_name != "m")
      unit.fail("is '" + unit_name + "': it must be \"mm\" or \"m\"");
    model_.unit = unit_name == "mm" ? LengthUnit::kMillimetre : LengthUnit::kMetre;
    const JsonField mesh = document.member("mesh");
    if (mesh.text().empty()) mesh.fail("names no file");
    MeshFile file = read_mesh(folder / mesh.text(), model_.unit);
    model_.mesh = std::move(file.mesh);
    for (const auto& [kind, count] : file.dropped) {
      warn(std::to_string(count) + " " + kind +
           " of the mesh file were left out: only 4-node tetrahedra are used");
    }
    if (file.turned)
      warn("the mesh file counts the corners of its tetrahedra the other way round; they were turned");
    for (const MeshFinding& finding : check_mesh(model_.mesh)) {
      if (prevents_solving(finding.fault)) mesh.fail("names a mesh that is not sound: " + finding.text);
      warn(finding.text);
    }
    used_ = nodes_in_use(model_.mesh);
    const Extent extent = extent_of(model_.mesh);
    longest_side_m_ = extent.longest_side_m();
    if (longest_side_m_ > kLongestOrganM || longest_side_m_ < kShortestOrganM) {
      const Vector3 size_m = extent.greatest - extent.least;
      warn("the mesh is " + number_text(longest_side_m_, 3) + " m long (" + number_text(size_m.x(), 3) +
           " x " + number_text(size_m.y(), 3) + " x " + number_text(size_m.z(), 3) +
           " m), strange for an organ: is length_unit \"" + unit_name + "\" right?");
    }
  }

  void read_materials(const JsonField& materials) {
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

  static std::string listed(const std::vector<std::int32_t>& numbers) {
    constexpr std::size_t kMost = 12;
    std::string text;
    for (std::size_t i = 0; i < std::min(numbers.size(), kMost); ++i) {
      text += (i == 0 ? "" : ", ") + std::to_string(numbers[i]);
    }
    return text + (numbers.size() > kMost ? ", ..." : "");
  }

  /// The nodes of "nodes" or "box"; ascending where a box chose them. Loose nodes are never in a box.
  std::vector<std::size_t> selected(const JsonField& entry) const {
    if (entry.has("nodes") == entry.has("box")) entry.fail("must have either 'nodes' or 'box'");
    return entry.has("nodes") ? named_nodes(entry.member("nodes")) : nodes_in_box(entry.member("box"));
  }

  std::vector<std::size_t> named_nodes(const JsonField& list) const {
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

  std::vector<std::size_t> nodes_in_box(const JsonField& box) const {
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

  void read_fixed(const JsonField& entry) {
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
          model_.constraints.prescribe(node, component,
                                       *displacement[component] / units_per_metre(model_.unit), entry.path());
        }
      }
    } catch (const Error& contradiction) {
      entry.fail(std::string("contradicts another: ") + contradiction.what());
    }
  }

  void read_force(const JsonField& entry) {
    entry.expect_object({"nodes", "box", "force_n"});
    const Vector3 force_n = entry.member("force_n").vector();
    const std::vector<std::size_t> nodes = selected(entry);
    for (const std::size_t node : nodes) {
      if (!used_[node]) {
        entry.fail("pulls at node " + std::to_string(node) + ", which belongs to no tetrahedron");
      }
      model_.force_n.segment<3>(static_cast<Eigen::Index>(3 * node)) +=
          force_n / static_cast<double>(nodes.size());
    }
  }

  void read_cut(const JsonField& entry) {
    entry.expect_object({"blade"});
    const JsonField blade = entry.member("blade");
    const double units = units_per_metre(model_.unit);
    std::vector<BladePose> path;
    for (const JsonField& pose : blade.elements()) {
      pose.expect_object({"tip", "heel"});
      path.push_back({pose.member("tip").vector() / units, pose.member("heel").vector() / units});
    }
    try {
      model_.cuts.push_back(sweep_surfaces(path));
    } catch (const Error& refused) {
      blade.fail(std::string("cannot be swept: ") + refused.what());
    }
  }

  StaticModel model_;
  std::vector<bool> used_;
  double longest_side_m_ = 0;
  bool density_assumed_ = false;
};

Vector3 sum_over_nodes(const Eigen::VectorXd& forces_n) {
  Vector3 sum = Vector3::Zero();
  for (Eigen::Index at = 0; at < forces_n.size(); at += 3) sum += forces_n.segment<3>(at);
  return sum;
}

StaticResult solved(const StaticModel& model, const ElasticBody& body) {
  const Eigen::VectorXd force_n = body.borne_n(model.force_n) + body.weight_n(model.gravity_m_s2);
  StaticResult result;
  result.solution = body.solve(force_n);
  result.stress_pa = body.stress_pa(result.solution.displacement_m);
  result.load_n = sum_over_nodes(force_n);
  result.reaction_n = sum_over_nodes(result.solution.reaction_force_n);
  result.unknowns = body.unknowns();
  const double units = units_per_metre(model.unit);
  if (!(result.solution.displacement_m * units).allFinite() || !result.load_n.allFinite() ||
      !result.reaction_n.allFinite()) {
    throw Error("the solution is not finite: a force, a displacement or a modulus is out of all proportion");
  }
  return result;
}

}  // namespace

StaticModel read_static_model(const std::filesystem::path& file) {
  const nlohmann::json document = JsonField::parse(read_text(file), file.string());
  return ModelReader(JsonField(document, file.string()), file.parent_path()).take();
}

StaticResult solve(const StaticModel& model) {
  if (model.cuts.empty()) {
    return solved(model, ElasticBody(model.mesh, model.materials, model.constraints));
  }
  CutBody body(model.mesh, model.materials, model.constraints);
  double volume_lost_m3 = 0;
  std::vector<std::string> warnings;
  for (std::size_t cut = 0; cut < model.cuts.size(); ++cut) {
    const std::string name = "cuts[" + std::to_string(cut) + "]";
    std::size_t removed = 0;
    for (const SweepSurface& sweep : model.cuts[cut]) {
      const CutBody::Step step = body.cut(sweep);
      removed += step.cut.change.removed.size();
      volume_lost_m3 += step.cut.volume_lost_m3;
      for (const std::string& sentence : step.fallen) warnings.push_back("after " + name + " " + sentence);
    }
    if (removed == 0) warnings.push_back(name + " meets no edge of the mesh");
  }
  StaticResult result = solved(model, body.body());
  result.cut_mesh = body.shape().remaining();
  std::vector<SymmetricTensor> stress_pa;
  for (std::uint32_t t = 0; t < result.stress_pa.size(); ++t) {
    if (body.shape().present(t)) stress_pa.push_back(result.stress_pa[t]);
  }
  result.stress_pa = std::move(stress_pa);
  result.volume_lost_m3 = volume_lost_m3;
  result.warnings = std::move(warnings);
  return result;
}

std::string vtu_text(const StaticModel& model, const StaticResult& result) {
  const Eigen::VectorXd displacement = result.solution.displacement_m * units_per_metre(model.unit);
  std::vector<double> stress_pa, von_mises_pa;
  stress_pa.reserve(6 * result.stress_pa.size());
  von_mises_pa.reserve(result.stress_pa.size());
  for (const SymmetricTensor& stress : result.stress_pa) {
    stress_pa.insert(stress_pa.end(), stress.begin(), stress.end());
    von_mises_pa.push_back(von_mises(stress));
  }
  const auto values = [](const Eigen::VectorXd& vector) {
    return std::span(vector.data(), static_cast<std::size_t>(vector.size()));
  };
  return vtu_text(
      result.cut_mesh ? *result.cut_mesh : model.mesh, model.unit,
      {{"displacement", {"X", "Y", "Z"}, values(displacement)},
       {"reaction_force", {"X", "Y", "Z"}, values(result.solution.reaction_force_n)}},
      {{"stress", {"XX", "YY", "ZZ", "XY", "YZ", "XZ"}, stress_pa}, {"von_mises_stress", {}, von_mises_pa}});
}

}  // namespace kiroku::sim
