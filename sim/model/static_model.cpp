#include "sim/model/static_model.h"

#include <utility>

#include "base/error.h"
#include "sim/cutting/blade_path.h"
#include "sim/cutting/cut_shape.h"
#include "sim/fem/corotational_body.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/model/json_field.h"

namespace kiroku::sim {
namespace {

void read_force(const JsonField& entry, const BodyReader& body, Eigen::VectorXd& total_n) {
  entry.expect_object({"nodes", "box", "force_n"});
  const Vector3 force_n = entry.member("force_n").vector();
  const std::vector<std::size_t> nodes = body.selected(entry);
  for (const std::size_t node : nodes) {
    if (!body.used(node)) {
      entry.fail("pulls at node " + std::to_string(node) + ", which belongs to no tetrahedron");
    }
    total_n.segment<3>(static_cast<Eigen::Index>(3 * node)) += force_n / static_cast<double>(nodes.size());
  }
}

Vector3 sum_over_nodes(const Eigen::VectorXd& forces_n) {
  Vector3 sum = Vector3::Zero();
  for (Eigen::Index at = 0; at < forces_n.size(); at += 3) sum += forces_n.segment<3>(at);
  return sum;
}

std::vector<SweepSurface> read_cut(const JsonField& entry, LengthUnit unit) {
  entry.expect_object({"blade"});
  const JsonField blade = entry.member("blade");
  const double units = units_per_metre(unit);
  std::vector<BladePose> path;
  for (const JsonField& pose : blade.elements()) {
    pose.expect_object({"tip", "heel"});
    path.push_back({pose.member("tip").vector() / units, pose.member("heel").vector() / units});
  }
  try {
    return sweep_surfaces(path);
  } catch (const Error& refused) {
    blade.fail(std::string("cannot be swept: ") + refused.what());
  }
}

/// Fills in what follows from a solved body.
template <typename Body>
void take_solution(const StaticModel& model, const ElasticBody& linear, const Body& body,
                   StaticResult& result) {
  const Eigen::VectorXd force_n = linear.borne_n(model.force_n) + linear.weight_n(model.gravity_m_s2);
  result.solution = body.solve(force_n);
  result.stress_pa = body.stress_pa(result.solution.displacement_m);
  result.unknowns = linear.unknowns();
  result.load_n = sum_over_nodes(force_n);
  result.reaction_n = sum_over_nodes(result.solution.reaction_force_n);
}

void solve_linear_or_turned(const StaticModel& model, const TetMesh& mesh, StaticResult& result) {
  if (model.corotational) {
    const CorotationalBody body(mesh, model.materials, model.constraints);
    take_solution(model, body.linear(), body, result);
  } else {
    const ElasticBody body(mesh, model.materials, model.constraints);
    take_solution(model, body, body, result);
  }
}

void solve_cut(const StaticModel& model, StaticResult& result) {
  CutShape shape(model.mesh, model.constraints);
  for (std::size_t cut = 0; cut < model.cuts.size(); ++cut) {
    const std::string name = "cuts[" + std::to_string(cut) + "]";
    std::size_t removed = 0;
    for (const SweepSurface& sweep : model.cuts[cut]) {
      const CutShape::Step step = shape.cut(sweep);
      removed += step.cut.change.removed.size();
      result.volume_lost_m3 += step.cut.volume_lost_m3;
      for (const std::string& sentence : step.fallen)
        result.warnings.push_back(std::string("after ").append(name).append(" ").append(sentence));
    }
    if (removed == 0) result.warnings.push_back(name + " meets no edge of the mesh");
  }
  // What has fallen off bears nothing and is not solved for.
  solve_linear_or_turned(model, shape.bearing(), result);
  std::vector<SymmetricTensor> stress_pa;
  std::size_t next = 0;
  for (std::uint32_t t = 0; t < model.mesh.tetrahedra.size(); ++t) {
    if (!shape.geometry().present(t)) continue;
    stress_pa.push_back(shape.bears(t) ? result.stress_pa[next++] : SymmetricTensor::Zero());
  }
  result.stress_pa = std::move(stress_pa);
  result.cut_mesh = shape.geometry().remaining();
}

}  // namespace

StaticModel read_static_model(const std::filesystem::path& file) {
  const nlohmann::json whole = JsonField::parse(read_document(file), file.string());
  const JsonField document(whole, file.string());
  document.expect_object(
      {"mesh", "length_unit", "materials", "fixed", "forces", "gravity_m_s2", "corotational", "cuts"});
  BodyReader body(document, file.parent_path());
  StaticModel model;
  model.force_n = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * body.model().mesh.nodes.size()));
  if (const auto forces = document.optional_member("forces")) {
    for (const JsonField& entry : forces->elements()) read_force(entry, body, model.force_n);
  }
  if (const auto corotational = document.optional_member("corotational"))
    model.corotational = corotational->boolean();
  if (const auto cuts = document.optional_member("cuts")) {
    for (const JsonField& entry : cuts->elements()) model.cuts.push_back(read_cut(entry, body.model().unit));
  }
  static_cast<BodyModel&>(model) = body.take();
  return model;
}

StaticResult solve(const StaticModel& model) {
  StaticResult result;
  if (model.cuts.empty()) {
    solve_linear_or_turned(model, model.mesh, result);
  } else {
    solve_cut(model, result);
  }
  const double units = units_per_metre(model.unit);
  if (!(result.solution.displacement_m * units).allFinite() || !result.load_n.allFinite() ||
      !result.reaction_n.allFinite()) {
    throw Error("the solution is not finite: a force, a displacement or a modulus is out of all proportion");
  }
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
