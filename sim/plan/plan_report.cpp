#include "sim/plan/plan_report.h"

#include <algorithm>
#include <initializer_list>

#include <nlohmann/json.hpp>

#include "base/csv_field.h"
#include "base/number_text.h"
#include "sim/mesh/mesh_writer.h"

namespace kiroku::sim {
namespace {

void add_row(std::string& table, std::initializer_list<std::string> first,
             std::initializer_list<double> numbers) {
  bool begins = true;
  const auto add = [&](const std::string& field) {
    table += (begins ? "" : ",") + field;
    begins = false;
  };
  for (const std::string& field : first) add(csv_field(field));
  for (const double number : numbers) add(exact_text(number));
  table += "\r\n";
}

const char* unit_name(LengthUnit unit) { return unit == LengthUnit::kMetre ? "m" : "mm"; }

std::string step_name(const Plan& plan, const PlanRun& run) {
  return run.figures().empty() ? "before" : plan.steps[run.frame().step].where;
}

}  // namespace

std::string frame_vtu(const Plan& plan, const PlanRun& run) {
  const PlanFrame& frame = run.frame();
  const Eigen::VectorXd displacement = frame.displacement_m * units_per_metre(plan.body.unit);
  std::vector<double> stress_pa, von_mises_pa;
  stress_pa.reserve(6 * frame.stress_pa.size());
  von_mises_pa.reserve(frame.stress_pa.size());
  for (const SymmetricTensor& stress : frame.stress_pa) {
    stress_pa.insert(stress_pa.end(), stress.begin(), stress.end());
    von_mises_pa.push_back(von_mises(stress));
  }
  return vtu_text(
      run.mesh(), plan.body.unit,
      {{"displacement",
        {"X", "Y", "Z"},
        std::span(displacement.data(), static_cast<std::size_t>(displacement.size()))}},
      {{"stress", {"XX", "YY", "ZZ", "XY", "YZ", "XZ"}, stress_pa}, {"von_mises_stress", {}, von_mises_pa}});
}

PlanTables::PlanTables(const Plan& plan) : plan_(plan) {
  const std::string unit = unit_name(plan.body.unit);
  forces_ =
      "time_s,step,tool,force_x_n,force_y_n,force_z_n,torque_x_nm,torque_y_nm,torque_z_nm,normal_n,"
      "tangential_n,nodes\r\n";
  stress_ = "time_s,step,largest_displacement_" + unit + ",largest_von_mises_pa,at_x_" + unit + ",at_y_" +
            unit + ",at_z_" + unit + ",mean_von_mises_pa\r\n";
  tools_ = "time_s,step,tool,x_" + unit + ",y_" + unit + ",z_" + unit + ",qw,qx,qy,qz\r\n";
}

void PlanTables::add(const PlanRun& run) {
  const PlanFrame& frame = run.frame();
  const std::string time = exact_text(frame.time_s);
  const std::string step = step_name(plan_, run);
  const double units = units_per_metre(plan_.body.unit);
  for (std::size_t tool = 0; tool < plan_.tools.size(); ++tool) {
    if (!frame.poses[tool]) continue;
    const std::string& name = plan_.tools[tool].tool.name;
    const Vector3 position = frame.poses[tool]->position_m * units;
    const Eigen::Quaterniond& turn = frame.poses[tool]->orientation;
    add_row(tools_, {time, step, name},
            {position.x(), position.y(), position.z(), turn.w(), turn.x(), turn.y(), turn.z()});
    if (plan_.tools[tool].kind == ToolKind::kScalpel) continue;
    const auto add_force = [&](const std::string& feels, const ToolForce& felt) {
      add_row(forces_, {time, step, feels},
              {felt.force_n.x(), felt.force_n.y(), felt.force_n.z(), felt.torque_nm.x(), felt.torque_nm.y(),
               felt.torque_nm.z(), felt.normal_n, felt.tangential_n, static_cast<double>(felt.nodes)});
    };
    add_force(name, frame.tools[tool]);
    for (std::size_t which = 0; closes(plan_.tools[tool].kind) && which < kJaws; ++which)
      add_force(jaw_name(name, which), frame.grips[tool].grip.jaws[which]);
  }
  double largest_m = 0, largest_pa = 0, sum_pa_m3 = 0, volume_m3 = 0;
  Vector3 place = Vector3::Zero();
  for (Eigen::Index at = 0; at < frame.displacement_m.size(); at += 3)
    largest_m = std::max(largest_m, frame.displacement_m.segment<3>(at).norm());
  const TetMesh& mesh = run.mesh();
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const double stress_pa = von_mises(frame.stress_pa[t]), element_m3 = signed_volume_m3(mesh, t);
    sum_pa_m3 += stress_pa * element_m3;
    volume_m3 += element_m3;
    if (stress_pa <= largest_pa) continue;
    largest_pa = stress_pa;
    place.setZero();
    for (const std::uint32_t node : mesh.tetrahedra[t]) place += mesh.nodes[node] / 4 * units;
  }
  add_row(stress_, {time, step},
          {largest_m * units, largest_pa, place.x(), place.y(), place.z(), sum_pa_m3 / volume_m3});
}

std::string steps_json(const Plan& plan, const PlanRun& run, const std::optional<std::string>& stopped) {
  const double units = units_per_metre(plan.body.unit);
  nlohmann::ordered_json steps = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < run.figures().size(); ++i) {
    const PlanStep& step = plan.steps[i];
    const StepFigures& figures = run.figures()[i];
    nlohmann::ordered_json tools = nlohmann::ordered_json::object();
    for (std::size_t tool = 0; tool < plan.tools.size(); ++tool) {
      if (figures.most_nodes[tool] == 0) continue;
      tools[plan.tools[tool].tool.name] = {{"largest_force_n", figures.largest_force_n[tool]},
                                           {"most_nodes", figures.most_nodes[tool]}};
      if (!closes(plan.tools[tool].kind)) continue;
      auto& grasper = tools[plan.tools[tool].tool.name];
      grasper["largest_squeeze_n"] = figures.largest_squeeze_n[tool];
      grasper["slipped"] = figures.slipped_m[tool] * units;
    }
    nlohmann::ordered_json entry{{"step", step.where},
                                 {"do", name_of(step.action)},
                                 {"begins_s", figures.begins_s},
                                 {"duration_s", step.duration_s},
                                 {"frames", figures.frames},
                                 {"largest_displacement", figures.largest_displacement_m * units},
                                 {"largest_von_mises_pa", figures.largest_von_mises_pa},
                                 {"deepest_penetration", figures.deepest_penetration_m * units},
                                 {"tools", tools},
                                 {"remarks", figures.remarks}};
    if (step.action == PlanAction::kCut) {
      entry["tetrahedra_removed"] = figures.tetrahedra_removed;
      entry["volume_lost"] = figures.volume_lost_m3 * units * units * units;
    }
    steps.push_back(std::move(entry));
  }
  nlohmann::ordered_json document{{"plan", plan.name},
                                  {"length_unit", unit_name(plan.body.unit)},
                                  {"nodes", plan.body.mesh.nodes.size()},
                                  {"tetrahedra", plan.body.mesh.tetrahedra.size()},
                                  {"warnings", plan.body.warnings},
                                  {"steps", steps}};
  if (stopped) document["stopped"] = *stopped;
  return document.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace kiroku::sim
