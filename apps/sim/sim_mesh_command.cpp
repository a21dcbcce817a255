// 'kiroku sim volume' and 'kiroku sim mesh': from a CT to tetrahedra.
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/kiroku/output_file.h"
#include "apps/sim/number_option.h"
#include "apps/sim/sim_command.h"
#include "apps/sim/volume_request.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/meshing/mesh_recipe.h"

namespace kiroku::apps {
namespace {

struct MeshCommandRequest {
  VolumeRequest volume;
  std::string output;
  std::optional<std::string> threshold, labels, organ, contours, vertices, pieces, unit;
  std::vector<std::string> regions;
};

nlohmann::ordered_json json_vector(const sim::Vector3& v) { return {v.x(), v.y(), v.z()}; }

std::string triple_text(const sim::Vector3& v, const char* between) {
  return number_text(v.x(), 5) + between + number_text(v.y(), 5) + between + number_text(v.z(), 5);
}

nlohmann::ordered_json volume_json(const sim::VolumeFile& file, const sim::HuRange& range) {
  const sim::Grid& grid = file.volume.grid;
  nlohmann::ordered_json object{{"format", file.format},
                                {"size", grid.size},
                                {"spacing_mm", json_vector(1000 * grid.spacing_m)},
                                {"origin_mm", json_vector(1000 * grid.origin_m)},
                                {"direction",
                                 {json_vector(grid.direction.col(0)), json_vector(grid.direction.col(1)),
                                  json_vector(grid.direction.col(2))}},
                                {"orientation", sim::orientation_code(grid)},
                                {"least_hu", range.least},
                                {"greatest_hu", range.greatest},
                                {"padding_voxels", file.padding_voxels}};
  if (!file.series_uid.empty()) object["series"] = file.series_uid;
  if (!file.patient_position.empty()) object["patient_position"] = file.patient_position;
  object["findings"] = file.findings;
  return object;
}

int run_volume(const VolumeRequest& request) {
  const sim::VolumeFile file = sim::read_volume(request.path, request.options());
  const sim::HuRange range = sim::range_of(file.volume);
  if (request.json) {
    print_json(volume_json(file, range));
    return kDone;
  }
  const sim::Grid& grid = file.volume.grid;
  const sim::Vector3 size(double(grid.size[0]), double(grid.size[1]), double(grid.size[2]));
  std::cout << printable(request.path) << ": " << file.format << ", " << triple_text(size, " x ")
            << " voxels of " << triple_text(1000 * grid.spacing_m, " x ") << " mm\n"
            << "  orientation  " << sim::orientation_code(grid) << " (where columns, rows and slices run to)"
            << (file.patient_position.empty() ? "" : ", patient position " + printable(file.patient_position))
            << "\n"
            << "  first voxel  (" << triple_text(1000 * grid.origin_m, ", ") << ") mm left, back, head\n"
            << "  values       " << number_text(double(range.least)) << " to "
            << number_text(double(range.greatest)) << " HU\n";
  if (!file.series_uid.empty()) std::cout << "  series       " << printable(file.series_uid) << "\n";
  for (const std::string& finding : file.findings) std::cout << "  " << printable(finding) << "\n";
  return kDone;
}

void check_output(const std::string& output) {
  const auto ending = std::filesystem::path(output).extension();
  if (ending != ".msh" && ending != ".vtu") {
    throw UsageError("--output is '" + output +
                     "': its ending must be .msh (for sim solve, Gmsh) or .vtu (for ParaView)");
  }
}

sim::MeshRecipe recipe_of(const MeshCommandRequest& request) {
  sim::MeshRecipe recipe;
  recipe.volume = request.volume.path;
  recipe.reading = request.volume.options();
  if (request.threshold) recipe.threshold = sim::parse_hu_interval(*request.threshold);
  recipe.labels = request.labels;
  recipe.organ = request.organ;
  for (const std::string& text : request.regions) recipe.regions.push_back(sim::parse_region_labels(text));
  recipe.contours = request.contours;
  if (request.vertices) recipe.nodes = parse_count(*request.vertices, "--vertices", 1, sim::kMostMeshNodes);
  if (request.pieces) recipe.pieces = parse_count(*request.pieces, "--pieces", 1, sim::kMostMeshNodes);
  return recipe;
}

std::string name_of(const sim::RecipeMesh& answer, std::int32_t region) {
  const auto found = answer.region_names.find(region);
  return found == answer.region_names.end() ? "" : found->second;
}

void print_mesh(const MeshCommandRequest& request, const sim::RecipeMesh& answer, const std::string& unit) {
  const sim::OrganMesh& result = answer.made;
  const sim::MeshQuality& quality = result.quality;
  if (request.volume.json) {
    nlohmann::ordered_json regions = nlohmann::ordered_json::array();
    for (const auto& [region, measures] : quality.regions) {
      regions.push_back({{"region", region},
                         {"name", name_of(answer, region)},
                         {"tetrahedra", measures.tetrahedra},
                         {"volume_ml", 1e6 * measures.volume_m3}});
    }
    print_json({{"file", request.output},
                {"length_unit", unit},
                {"nodes", result.mesh.nodes.size()},
                {"tetrahedra", result.mesh.tetrahedra.size()},
                {"volume_ml", 1e6 * quality.volume_m3},
                {"regions", regions},
                {"cell_mm", 1000 * result.cell_m},
                {"quality",
                 {{"least_dihedral_deg", quality.least_dihedral_deg},
                  {"greatest_dihedral_deg", quality.greatest_dihedral_deg},
                  {"median_least_dihedral_deg", quality.median_least_dihedral_deg},
                  {"below_12_deg", quality.below_12_deg},
                  {"greatest_radius_edge_ratio", quality.greatest_radius_edge},
                  {"median_radius_edge_ratio", quality.median_radius_edge},
                  {"least_volume_mm3", 1e9 * quality.least_volume_m3},
                  {"greatest_volume_mm3", 1e9 * quality.greatest_volume_m3}}},
                {"removed",
                 {{"voxel_parts", result.voxels.parts},
                  {"voxels", result.voxels.voxels},
                  {"islands", result.cleaned.islands},
                  {"island_tetrahedra", result.cleaned.island_tetrahedra},
                  {"hinge_tetrahedra", result.cleaned.hinge_tetrahedra},
                  {"split_nodes", result.cleaned.split_nodes}}},
                {"volume", volume_json(answer.volume, answer.hu)},
                {"warnings", answer.findings}});
    return;
  }
  std::cout << printable(request.output) << ": " << result.mesh.nodes.size() << " vertices, "
            << result.mesh.tetrahedra.size() << " tetrahedra, " << number_text(1e6 * quality.volume_m3, 4)
            << " ml, in " << unit << "\n";
  for (const auto& [region, measures] : quality.regions) {
    std::cout << "  region " << region << "  " << printable(name_of(answer, region)) << ": "
              << measures.tetrahedra << " tetrahedra, " << number_text(1e6 * measures.volume_m3, 4)
              << " ml\n";
  }
  std::cout << "  dihedral angles " << number_text(quality.least_dihedral_deg, 3) << " to "
            << number_text(quality.greatest_dihedral_deg, 4) << " degrees, " << quality.below_12_deg
            << " tetrahedra below 12; radius to shortest edge at most "
            << number_text(quality.greatest_radius_edge, 3) << "\n";
  if (result.cleaned.islands + result.cleaned.hinge_tetrahedra + result.cleaned.split_nodes > 0) {
    std::cout << "  removed " << result.cleaned.islands << " islands of " << result.cleaned.island_tetrahedra
              << " tetrahedra and " << result.cleaned.hinge_tetrahedra << " tetrahedra at hinges; split "
              << result.cleaned.split_nodes << " nodes\n";
  }
}

int run_mesh(const MeshCommandRequest& request) {
  check_output(request.output);
  const std::string unit = request.unit.value_or("mm");
  const sim::RecipeMesh answer = [&] {
    StepLine line;
    return sim::make_mesh(recipe_of(request), [&](const std::string& step) { line.show(step); });
  }();
  if (!request.volume.json) {
    for (const std::string& finding : answer.findings) print_error("kiroku", "warning: " + finding);
  }
  const sim::LengthUnit length_unit = unit == "m" ? sim::LengthUnit::kMetre : sim::LengthUnit::kMillimetre;
  const sim::TetMesh& mesh = answer.made.mesh;
  const std::string text = std::filesystem::path(request.output).extension() == ".vtu"
                               ? sim::vtu_text(mesh, length_unit, {}, {})
                               : sim::msh_text(mesh, length_unit, answer.region_names);
  OutputFile output(request.output);
  output.write(bytes_of(text));
  output.commit(OutputFile::Durability::kEventually);
  print_mesh(request, answer, unit);
  return kDone;
}

}  // namespace

void add_sim_volume_command(Command& sim) {
  Command& command =
      sim.add_command("volume", "what a CT is: size, orientation, values, what is odd about it");
  const auto request = std::make_shared<VolumeRequest>();
  add_volume_options(command, *request);
  command.explain(
      "Values are Hounsfield units, places are in the patient: left, back and head (DICOM's LPS), whatever "
      "the file "
      "counts in. Padding, where nothing was measured, is taken for air and counted.");
  command.example("kiroku sim volume ct/", "reads the one series of the folder");
  command.example("kiroku sim volume ct/ --series 3192 --json", "the series whose UID ends so, for a script");
  command.on_run([request] { return run_volume(*request); });
}

void add_sim_mesh_command(Command& sim) {
  Command& command = sim.add_command("mesh", "tetrahedra of an organ from a CT, for sim solve");
  const auto request = std::make_shared<MeshCommandRequest>();
  add_volume_options(command, request->volume);
  command.option("--threshold", "A:B", request->threshold, "what is from A to B HU");
  command.option("--labels", "FILE", request->labels,
                 "what a segmentation labels (.nii.gz, ...); placed by its own header");
  command.option(
      "--organ", "NAME", request->organ,
      "one organ of TotalSegmentator's labels: liver, left-kidney, ...; 'lung' is found without labels too");
  command.option("--region", "NAME=LABELS", request->regions, "a region of the mesh: vessels=64,70-72");
  command.option("--contours", "XML", request->contours,
                 "radiologists' outlines (LIDC) as the region 'tumour'");
  command.option("--vertices", "N", request->vertices, "how many, within 15 %", "5000");
  command.option("--pieces", "N", request->pieces, "parts that are kept, the largest", "1; lung 2, ribs 24");
  command.choice("--length-unit", {"mm", "m"}, request->unit, "of the mesh", "mm");
  command.required_option("-o,--output", "FILE", request->output, "where to: .msh, or .vtu for ParaView");
  command.explain(
      "Regions touch without gaps and share their vertices; their numbers are those of a model's materials. "
      "They count "
      "from 1 in the order --organ, --region, --contours; with --labels alone each label is a region of its "
      "own number. "
      "The largest part that hangs together is kept. No angle between faces is below 8 degrees. The same "
      "input makes "
      "the same bytes.");
  command.example("kiroku sim mesh ct/ --labels organs.nii.gz --organ liver --region vessels=64 -o liver.msh",
                  "two materials in one mesh");
  command.example(
      "kiroku sim mesh ct/ --labels organs.nii.gz --organ lung --contours 069.xml --vertices 20000 -o "
      "lung.msh",
      "both lungs with the tumour");
  command.example("kiroku sim mesh ct/ --organ lung -o lung.msh",
                  "the lungs by their air, without a segmentation");
  command.example("kiroku sim mesh bone.nrrd --threshold 300:3000 --vertices 2000 -o bone.vtu",
                  "without a segmentation");
  command.on_run([request] { return run_mesh(*request); });
}

}  // namespace kiroku::apps
