// 'kiroku plan template' and 'kiroku plan adapt': a plan for one organ, on another patient's.
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/kiroku/output_file.h"
#include "apps/sim/plan_command.h"
#include "apps/sim/plan_reading.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/meshing/mesh_recipe.h"
#include "sim/model/json_field.h"
#include "sim/plan/plan_template.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct TemplateRequest {
  std::string plan, patient, landmarks, output;
  bool json = false, force = false;
};

void expect_free(const TemplateRequest& request) {
  if (!request.force && fs::exists(request.output)) {
    throw UsageError("'" + request.output +
                     "' is there already: name another file, or give --force to replace it");
  }
}

void write_document(const std::string& name, const std::string& text) {
  OutputFile output(name);
  output.write(bytes_of(text));
  output.commit(OutputFile::Durability::kEventually);
}

int make_template(const TemplateRequest& request) {
  expect_free(request);
  const auto plan = read_plan_and_tell(request.plan, request.json);
  if (!plan) return kRefused;
  const sim::PlanLandmarks landmarks = sim::read_plan_landmarks(request.landmarks);
  const auto document = nlohmann::ordered_json::parse(sim::read_document(request.plan));
  write_document(request.output, sim::plan_template(document, *plan, landmarks).dump(1) + "\n");
  if (request.json) {
    print_json({{"file", request.output}, {"landmarks", landmarks.size()}, {"steps", plan->steps.size()}});
  } else {
    std::cout << printable(request.output) << ": a template of " << plan->steps.size() << " steps with "
              << landmarks.size() << " landmarks\n";
  }
  return kDone;
}

void print_fits(const sim::AdaptedPlan& adapted) {
  std::vector<std::vector<std::string>> rows{{"landmark", "beside affine", "missed by the others"}};
  for (const sim::LandmarkFit& fit : adapted.fits) {
    rows.push_back({printable(fit.name), number_text(fit.affine_m * sim::kMmPerM, 3) + " mm",
                    fit.left_out_m ? number_text(*fit.left_out_m * sim::kMmPerM, 3) + " mm" : "not known"});
  }
  std::cout << format_table(rows, "lrr", 2);
}

int adapt(const TemplateRequest& request) {
  expect_free(request);
  const fs::path patient = request.patient;
  if (fs::weakly_canonical(fs::absolute(request.output).parent_path()) !=
      fs::weakly_canonical(fs::absolute(patient).parent_path())) {
    throw UsageError("--output is '" + request.output +
                     "': the plan names its mesh from where it lies, so it must be "
                     "beside " +
                     request.patient);
  }
  const sim::PlanLandmarks landmarks = sim::read_plan_landmarks(request.landmarks);
  const std::string text = sim::read_document(patient);
  const nlohmann::json document = sim::JsonField::parse(text, patient.string());
  const sim::MeshMaker maker = [](const sim::JsonField& recipe, const sim::JsonField& whole,
                                  const fs::path& folder, std::vector<std::string>& warnings) {
    StepLine line;
    return sim::recipe_mesh_maker([&](const std::string& step) { line.show(step); })(recipe, whole, folder,
                                                                                     warnings);
  };
  const sim::BodyModel body =
      sim::BodyReader(sim::JsonField(document, patient.string()), patient.parent_path(), maker).take();
  const sim::AdaptedPlan adapted = sim::adapt_template(sim::read_document(request.plan), request.plan,
                                                       nlohmann::ordered_json::parse(text), body, landmarks);
  const std::string made = adapted.document.dump(1) + "\n";
  // What the spline made of it must still be a plan.
  const sim::PlanReading reading = sim::read_plan_text(made, request.output, maker);
  for (const std::string& error : reading.errors) print_error("kiroku", error);
  if (!reading.plan)
    throw Error("the template does not suit this organ, for what is told above: " + request.output +
                " is not written");
  write_document(request.output, made);
  std::vector<std::string> warnings = adapted.warnings;
  warnings.insert(warnings.end(), reading.plan->body.warnings.begin(), reading.plan->body.warnings.end());
  if (request.json) {
    nlohmann::ordered_json fits = nlohmann::ordered_json::array();
    for (const sim::LandmarkFit& fit : adapted.fits) {
      fits.push_back({{"landmark", fit.name}, {"beside_affine_mm", fit.affine_m * sim::kMmPerM}});
      if (fit.left_out_m) fits.back()["missed_by_the_others_mm"] = *fit.left_out_m * sim::kMmPerM;
    }
    print_json({{"file", request.output},
                {"landmarks", fits},
                {"unused", adapted.unused},
                {"warnings", warnings},
                {"furthest_to_surface_mm", adapted.furthest_to_surface_m * sim::kMmPerM}});
    return kDone;
  }
  for (const std::string& warning : warnings) print_error("kiroku", "warning: " + warning);
  for (const std::string& name : adapted.unused)
    print_error("kiroku",
                "warning: the landmark '" + name + "' is not used: only one of the two organs has it");
  print_fits(adapted);
  std::cout << printable(request.output) << ": " << reading.plan->steps.size()
            << " steps; to suit the surface, tools were moved by up to "
            << number_text(adapted.furthest_to_surface_m * sim::kMmPerM, 3) << " mm\n";
  return kDone;
}

}  // namespace

void add_plan_template_commands(Command& plan) {
  Command& saved = plan.add_command("template", "saves a plan as a template for other patients' organs");
  const auto saving = std::make_shared<TemplateRequest>();
  saved.argument("PLAN", saving->plan, "the plan (.json)");
  saved.required_option("--landmarks", "FILE", saving->landmarks, "places on its organ, by name (.json)");
  saved.required_option("-o,--output", "FILE", saving->output, "the template (.json)");
  saved.flag("-f,--force", saving->force, "replaces FILE");
  saved.flag("--json", saving->json, "prints one JSON object instead");
  saved.explain(
      "Landmarks are four or more places that every such organ has, not all in one plane: "
      "{\"length_unit\": \"mm\", \"landmarks\": {\"hilum\": [12, -3, 40], ...}}. The template has tools, "
      "steps "
      "and landmarks, and how far from the organ each tool comes; no mesh and no CT.");
  saved.example("kiroku plan template lobe.json --landmarks places.json -o lobe.template.json", "saves it");
  saved.on_run([saving] { return make_template(*saving); });

  Command& adapted = plan.add_command("adapt", "makes a plan for a patient's organ from a template");
  const auto adapting = std::make_shared<TemplateRequest>();
  adapted.argument("TEMPLATE", adapting->plan, "the template (.json)");
  adapted.argument("PATIENT", adapting->patient,
                   "the patient's organ: mesh, materials, what is fixed (.json)");
  adapted.required_option("--landmarks", "FILE", adapting->landmarks,
                          "the same places on that organ (.json)");
  adapted.required_option("-o,--output", "FILE", adapting->output, "the plan (.json), beside PATIENT");
  adapted.flag("-f,--force", adapting->force, "replaces FILE");
  adapted.flag("--json", adapting->json, "prints one JSON object instead");
  adapted.explain(
      "A thin-plate spline through the landmarks takes tools along and turns them; each comes as far from "
      "the "
      "surface as on the template's organ. Tools and depths keep their size. Told of each landmark: how far "
      "it "
      "lies beside the best affine mapping, and how far the spline of the others misses it. Refused: fewer "
      "than "
      "four landmarks, landmarks in one plane, a mirror image.");
  adapted.example("kiroku plan adapt lobe.template.json patient.json --landmarks places.json -o lobe.json",
                  "makes the patient's plan");
  adapted.on_run([adapting] { return adapt(*adapting); });
}

}  // namespace kiroku::apps
