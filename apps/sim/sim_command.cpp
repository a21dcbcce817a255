#include "apps/sim/sim_command.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/output_file.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/model/static_model.h"

namespace kiroku::apps {
namespace {

struct Request {
  std::string model, output;
  bool json = false;
};

struct Largest {
  double displacement_m = 0, von_mises_pa = 0;
};

Largest largest_of(const sim::StaticResult& result) {
  Largest largest;
  const Eigen::VectorXd& displacement_m = result.solution.displacement_m;
  for (Eigen::Index at = 0; at < displacement_m.size(); at += 3) {
    largest.displacement_m = std::max(largest.displacement_m, displacement_m.segment<3>(at).norm());
  }
  for (const sim::SymmetricTensor& stress_pa : result.stress_pa) {
    largest.von_mises_pa = std::max(largest.von_mises_pa, sim::von_mises(stress_pa));
  }
  return largest;
}

void print_result(const Request& request, const sim::StaticModel& model, const sim::StaticResult& result) {
  const Largest largest = largest_of(result);
  const std::size_t tetrahedra =
      result.cut_mesh ? result.cut_mesh->tetrahedra.size() : model.mesh.tetrahedra.size();
  const double units = sim::units_per_metre(model.unit);
  const char* const unit = model.unit == sim::LengthUnit::kMetre ? "m" : "mm";
  if (request.json) {
    std::vector<std::string> warnings = model.warnings;
    warnings.insert(warnings.end(), result.warnings.begin(), result.warnings.end());
    const auto vector = [](const sim::Vector3& v) { return nlohmann::ordered_json{v.x(), v.y(), v.z()}; };
    print_json({{"file", request.output},
                {"nodes", model.mesh.nodes.size()},
                {"tetrahedra", tetrahedra},
                {"tetrahedra_cut_out", model.mesh.tetrahedra.size() - tetrahedra},
                {"volume_lost_m3", result.volume_lost_m3},
                {"unknowns", result.unknowns},
                {"length_unit", unit},
                {"largest_displacement", largest.displacement_m * units},
                {"largest_von_mises_stress_pa", largest.von_mises_pa},
                {"load_n", vector(result.load_n)},
                {"reaction_n", vector(result.reaction_n)},
                {"warnings", warnings}});
    return;
  }
  const auto text = [](const sim::Vector3& v) {
    return "(" + number_text(v.x(), 4) + ", " + number_text(v.y(), 4) + ", " + number_text(v.z(), 4) + ")";
  };
  if (result.cut_mesh) {
    std::cout << "cuts took " << model.mesh.tetrahedra.size() - tetrahedra << " tetrahedra out; "
              << number_text(result.volume_lost_m3 * 1e9, 4) << " mm3 of the body were lost\n";
  }
  std::cout << printable(request.output) << ": " << model.mesh.nodes.size() << " nodes, " << tetrahedra
            << " tetrahedra; largest displacement " << number_text(largest.displacement_m * units, 4) << " "
            << unit << ", largest von Mises stress " << number_text(largest.von_mises_pa, 4) << " Pa\n"
            << "  loads in total     " << text(result.load_n) << " N\n"
            << "  reactions in total " << text(result.reaction_n) << " N\n";
}

int run(const Request& request) {
  if (std::filesystem::path(request.output).extension() != ".vtu") {
    throw UsageError("--output is '" + request.output +
                     "': its ending must be .vtu, the only format written");
  }
  const sim::StaticModel model = sim::read_static_model(request.model);
  if (!request.json) {
    for (const std::string& warning : model.warnings) print_error("kiroku", "warning: " + warning);
  }
  const sim::StaticResult result = sim::solve(model);
  if (!request.json) {
    for (const std::string& warning : result.warnings) print_error("kiroku", "warning: " + warning);
  }
  const std::string text = sim::vtu_text(model, result);
  OutputFile file(request.output);
  file.write(bytes_of(text));
  file.commit(OutputFile::Durability::kEventually);
  print_result(request, model, result);
  return kDone;
}

}  // namespace

Command& add_sim_command(Command& program) {
  Command& sim = program.add_command("sim", "simulates soft tissue");
  add_sim_volume_command(sim);
  add_sim_mesh_command(sim);
  add_sim_respire_command(sim);
  add_sim_beam_command(sim);
  add_sim_drr_command(sim);
  add_sim_fit_command(sim);
  Command& command = sim.add_command("solve", "one static solve: displacement, reaction force, stress");
  const auto request = std::make_shared<Request>();
  command.argument("MODEL", request->model, "the model (.json): mesh, materials, what is fixed, what pulls");
  command.required_option("-o,--output", "FILE", request->output, "where to (.vtu), for ParaView");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "The model is {\"mesh\": \"liver.msh\", \"length_unit\": \"mm\", \"materials\": [{\"region\": \"all\", "
      "\"young_modulus_pa\": 5000, \"poisson_ratio\": 0.45}], \"fixed\": [{\"box\": [[0, 0, 0], [10, 50, "
      "50]]}], "
      "\"forces\": [{\"nodes\": [17, 18], \"force_n\": [0, 0, -0.5]}], \"gravity_m_s2\": [0, -9.81, 0]}. "
      "Meshes: .msh (2.2, "
      "4.1), .vtk, .veg, sought beside the model. Nodes are numbered from 0; 'displacement' of what is fixed "
      "is in the "
      "mesh's unit, null leaves a component free; a force is that of all its nodes together, shared evenly. "
      "\"cuts\": [{\"blade\": [{\"tip\": [40, 20, 30], \"heel\": [40, 20, 60]}, {\"tip\": [40, 50, 30], "
      "\"heel\": [40, 50, 60]}]}] cuts the body first, along the surface that the blade's edge sweeps from "
      "pose "
      "to pose.");
  command.example("kiroku sim solve liver.json -o liver.vtu", "solves, and writes what ParaView opens");
  command.on_run([request] { return run(*request); });
  return sim;
}

}  // namespace kiroku::apps
