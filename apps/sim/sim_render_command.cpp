// 'kiroku sim render' and 'kiroku sim transfer': shaded pictures of a CT, deformed with a mesh.
#include <filesystem>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/sim/picture_options.h"
#include "apps/sim/sim_command.h"
#include "apps/sim/volume_request.h"
#include "base/error.h"
#include "base/number_text.h"
#include "media/output_file.h"
#include "sim/mesh/mesh_reader.h"
#include "sim/mesh/vtu_reader.h"
#include "sim/render/ct_mesh.h"
#include "sim/render/lettering.h"
#include "sim/volume/volume_reader.h"

namespace kiroku::apps {
namespace {

struct Request {
  VolumeRequest volume;
  std::string output;
  std::optional<std::string> mesh, unit, displacement, stress, caption;
  PictureOptions picture;
  bool force = false;
};

/// What is deformed, and by how much.
struct Body {
  sim::TetMesh mesh;
  std::vector<double> displacement_m;  // (3 |V|), or empty
  std::vector<double> stress_pa;       // (|T|), or empty
};

/// The mesh with the displacement and stress that a .vtu has; one that was cut is that of the .vtu itself.
Body read_body(const Request& request, const sim::Grid& grid) {
  if (request.stress && !request.displacement)
    throw UsageError("--stress shows what a solve computed: give its --displacement too");
  Body body;
  if (!request.mesh && !request.displacement) {
    body.mesh = sim::mesh_of(grid);
    return body;
  }
  const sim::LengthUnit unit =
      request.unit.value_or("mm") == "m" ? sim::LengthUnit::kMetre : sim::LengthUnit::kMillimetre;
  if (request.mesh) body.mesh = sim::read_mesh(*request.mesh, unit).mesh;
  if (!request.displacement) return body;
  const sim::VtuFile computed = sim::read_vtu(*request.displacement, unit);
  if (request.mesh && computed.mesh.nodes.size() != body.mesh.nodes.size()) {
    throw Error("the displacement " + *request.displacement + " is of " +
                std::to_string(computed.mesh.nodes.size()) + " nodes, the mesh " + *request.mesh + " has " +
                std::to_string(body.mesh.nodes.size()) +
                ": give the mesh that was solved, or leave --mesh out");
  }
  body.mesh = computed.mesh;
  for (const sim::Vector3& by : sim::displacement_of(computed, *request.displacement, unit))
    body.displacement_m.insert(body.displacement_m.end(), by.data(), by.data() + 3);
  const auto stress = computed.cell_data.find("von_mises_stress");
  if (stress != computed.cell_data.end()) body.stress_pa = stress->second.values;
  if (request.stress && body.stress_pa.empty()) {
    throw Error("--stress cannot be shown: " + *request.displacement +
                " has no cell data 'von_mises_stress', as 'kiroku sim solve' writes them");
  }
  return body;
}

void add_stress(const Request& request, const Body& body, sim::Scene& scene) {
  if (!request.stress) return;
  scene.stress.emplace();
  scene.stress->at_nodes_pa = sim::at_nodes(body.mesh, body.stress_pa);
  if (*request.stress != "auto") {
    scene.stress->largest_pa = parse_number(*request.stress, "--stress", 1e-9, 1e12);
    return;
  }
  scene.stress->largest_pa = *std::ranges::max_element(scene.stress->at_nodes_pa);
  if (!(scene.stress->largest_pa > 0)) throw Error("--stress cannot be shown: there is none in the mesh");
}

sim::Picture draw(const Request& request, std::string& renderer) {
  StepLine line;
  line.show("reading the CT");
  const sim::VolumeFile file = sim::read_volume(request.volume.path, request.volume.options());
  const Body body = read_body(request, file.volume.grid);
  const sim::Ball ball = sim::ball_around(body.mesh);
  sim::Scene scene = request.picture.scene(ball, body.mesh, body.displacement_m);
  add_stress(request, body, scene);
  const sim::TransferFunction transfer =
      request.picture.transfer_function(request.mesh || request.displacement ? "liver" : "skin");
  line.show("preparing the CT");
  const auto shaded = std::make_shared<const sim::ShadedVolume>(
      sim::shade(file.volume, sim::extent_of(body.mesh), request.picture.shading()));
  warn_of_nodes_outside(body.mesh, file.volume.grid);
  line.show("drawing");
  sim::VolumeRenderer volume_renderer(shaded, transfer, request.picture.engine_choice());
  volume_renderer.set_mesh(body.mesh);
  sim::Picture picture = volume_renderer.render(body.displacement_m, scene);
  if (!volume_renderer.notice().empty()) print_error("kiroku", "warning: " + volume_renderer.notice());
  renderer = volume_renderer.renderer();
  if (request.caption || scene.stress) {
    sim::Lettering lettering;
    if (request.caption) sim::draw_caption(lettering, picture, "", *request.caption);
    if (scene.stress) sim::draw_stress_scale(lettering, picture, scene.stress->largest_pa);
  }
  return picture;
}

int run(const Request& request) {
  if (std::filesystem::path(request.output).extension() != ".png")
    throw UsageError("--output is '" + request.output +
                     "': its ending must be .png, the only format written");
  media::OutputFile output(request.output, request.force);
  std::string renderer;
  const sim::Picture picture = draw(request, renderer);
  output.write(media::png_of(view_of(picture)));
  output.commit();
  if (request.volume.json) {
    print_json({{"file", request.output},
                {"width", picture.width},
                {"height", picture.height},
                {"renderer", renderer}});
  } else {
    std::cout << printable(request.output) << ": " << picture.width << "x" << picture.height << " pixels, by "
              << printable(renderer) << "\n";
  }
  return kDone;
}

}  // namespace

void add_sim_render_command(Command& sim) {
  Command& command = sim.add_command("render", "a shaded picture of a CT, deformed and cut with a mesh");
  const auto request = std::make_shared<Request>();
  add_volume_options(command, request->volume);
  command.option("--mesh", "FILE", request->mesh, "shows what is in this mesh; without one, the whole CT");
  command.choice("--length-unit", {"mm", "m"}, request->unit, "of the mesh", "mm");
  command.option("--displacement", "VTU", request->displacement,
                 "of a solve or a plan's frame: how the mesh is deformed");
  command.option("--stress", "PA", request->stress,
                 "tints tissue by the von Mises stress of --displacement; PA is what the last colour stands "
                 "for, or 'auto'");
  request->picture.add_to(command, "liver; skin without --mesh");
  command.option("--caption", "TEXT", request->caption, "words at the lower border");
  command.required_option("-o,--output", "FILE", request->output, "where to (.png)");
  command.flag("--force", request->force, "replaces a file that is there");
  command.explain(
      "The CT itself is shown where the displaced tetrahedra bring it; a cut shows what is inside. "
      "'kiroku sim transfer' prints a transfer function to be edited.");
  command.example("kiroku sim render ct/ -o patient.png", "the patient's skin, from the front");
  command.example("kiroku sim render ct/ --transfer bone --view 30,10 -o bones.png",
                  "the skeleton, a little from the left");
  command.example(
      "kiroku sim render ct/ --mesh liver.msh --displacement liver.vtu --stress auto -o liver.png",
      "a solved liver with its stress");
  command.on_run([request] { return run(*request); });
}

void add_sim_transfer_command(Command& sim) {
  Command& command = sim.add_command("transfer", "prints a transfer function, to be edited");
  const auto name = std::make_shared<std::string>();
  command.choice_argument("NAME", sim::transfer_function_names(), *name, "whose tissue it shows");
  command.explain(
      "opacity_per_mm is the share of light that 1 mm of tissue takes; between points all runs straight.");
  command.example("kiroku sim transfer liver > mine.json", "to be given as --transfer mine.json");
  command.on_run([name] {
    std::cout << sim::transfer_function_text(*name);
    return kDone;
  });
}

}  // namespace kiroku::apps
