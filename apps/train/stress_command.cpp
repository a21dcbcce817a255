#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/sim/number_option.h"
#include "apps/train/output_folder.h"
#include "apps/train/train_command.h"
#include "apps/train/training_body.h"
#include "base/error.h"
#include "base/number_text.h"
#include "media/png.h"
#include "trainer/exclusion/hand_forces.h"
#include "trainer/exclusion/lift_picture.h"
#include "trainer/exclusion/lifted_object.h"
#include "trainer/exclusion/opened_object.h"

namespace kiroku::apps {
namespace {

using Json = nlohmann::ordered_json;
using trainer::LiftManner;

struct Request {
  std::string output, lift = "10", vertices = "4000";
  std::optional<std::string> object, friction;
  bool force = false, json = false;
};

/// The same lift of the object, and of one that has its softest stiffness throughout where it has several.
struct Lift {
  std::size_t fingers = 1;
  LiftManner manner = LiftManner::kSpread;
  trainer::LiftedObject lifted;
  std::optional<trainer::LiftedObject> uniform;
  double visible_share = 0;  // of the line
};

/// Stiffness of one kind only, the least there is.
sim::Materials softest(sim::Materials materials) {
  double least_pa = materials.begin()->second.young_modulus_pa;
  for (const auto& [region, material] : materials) least_pa = std::min(least_pa, material.young_modulus_pa);
  for (auto& [region, material] : materials) material.young_modulus_pa = least_pa;
  return materials;
}

Json lift_json(const trainer::ExclusionBody& body, const Lift& lift) {
  const trainer::LiftedObject& lifted = lift.lifted;
  Json row{{"fingers", lift.fingers},
           {"manner", trainer::name_of(lift.manner)},
           {"largest_von_mises_pa", lifted.largest_von_mises_pa},
           {"von_mises_95_percent_pa", lifted.von_mises_95_pa},
           {"von_mises_99_percent_pa", lifted.high_von_mises_pa},
           {"forces_n", lifted.forces_n},
           {"wrist_force_n", lifted.wrist_n},
           {"visible_share", lift.visible_share}};
  if (!lift.uniform) return row;
  const sim::TetMesh& mesh = body.object().mesh;
  const trainer::StressPeak peak = trainer::peak_away(mesh, lifted);
  const double uniform_pa = trainer::peak_away(mesh, *lift.uniform).von_mises_pa;
  row["away_from_fingers"] = {
      {"largest_von_mises_pa", peak.von_mises_pa},
      {"at_interface", bool{trainer::at_interface(mesh, body.object().materials)[peak.tetrahedron]}},
      {"of_uniform_object_pa", uniform_pa}};
  return row;
}

/// Both manners, one to five fingers; one finger is of no manner and stands once.
std::vector<Lift> lifts_of(const trainer::ExclusionBody& body, double height_m) {
  StepLine line;
  const trainer::ExclusionTask& task = body.task();
  const trainer::OrganObject& object = body.object();
  const sim::Materials soft = softest(object.materials);
  const bool has_several = std::ranges::any_of(object.materials, [&](const auto& material) {
    return material.second.young_modulus_pa != soft.at(material.first).young_modulus_pa;
  });
  std::unique_ptr<sim::ElasticBody> uniform_body;
  std::unique_ptr<sim::ContactBody> uniform;
  if (has_several) {
    uniform_body = std::make_unique<sim::ElasticBody>(object.mesh, soft, object.constraints);
    uniform = std::make_unique<sim::ContactBody>(*uniform_body);
  }
  sim::SurfaceRenderer renderer(object.mesh, sim::GpuUse::kOff);
  trainer::VisibilityMeter meter(renderer, task, 640, 480);
  std::vector<Lift> lifts;
  for (const LiftManner manner : {LiftManner::kSpread, LiftManner::kTogether}) {
    for (std::size_t fingers = manner == LiftManner::kSpread ? 1 : 2;
         fingers <= trainer::kMostExclusionFingers; ++fingers) {
      line.show("lifting with " + std::to_string(fingers) + ", " + trainer::name_of(manner));
      Lift lift;
      lift.fingers = fingers;
      lift.manner = manner;
      lift.lifted = trainer::lift_border(body.contact(), task, fingers, manner, height_m);
      if (lift.lifted.wrist_n == 0) {
        throw UsageError("fingertips do not touch the border of object " + object.name + " with " +
                         std::to_string(fingers) + (fingers == 1 ? " finger" : " fingers, ") +
                         (fingers == 1 ? "" : trainer::name_of(manner)) +
                         ": lift further (--lift), or take a finer mesh (--vertices)");
      }
      if (uniform) lift.uniform = trainer::lift_border(*uniform, task, fingers, manner, height_m);
      const Eigen::VectorXd& displacement_m = lift.lifted.displacement_m;
      lift.visible_share =
          meter.visible_share({displacement_m.data(), static_cast<std::size_t>(displacement_m.size())});
      lifts.push_back(std::move(lift));
    }
  }
  return lifts;
}

std::string in_kpa(double pa) { return number_text(pa / 1e3, 3) + " kPa"; }

/// All under one scale: what 99 % of the tissue stays below in the most stressed of them, up to the next
/// 4 kPa (the scale has four steps).
double scale_pa(const std::vector<Lift>& lifts) {
  double most_pa = 0;
  for (const Lift& lift : lifts) most_pa = std::max(most_pa, lift.lifted.high_von_mises_pa);
  return 4e3 * std::ceil(most_pa / 4e3);
}

Bytes png(const sim::Picture& picture) {
  return media::png_of({picture.width, picture.height, 3, picture.rgb});
}

/// A row for each manner, a column for each number of fingers.
sim::Picture sheet(const trainer::ExclusionBody& body, const std::vector<Lift>& lifts) {
  std::vector<trainer::CaptionedPicture> cells;
  for (const Lift& lift : lifts) {
    // Where one finger that lies together would stand, the scale does.
    if (lift.manner == LiftManner::kTogether && lift.fingers == 2) cells.emplace_back();
    cells.push_back(
        {std::to_string(lift.fingers) +
             (lift.fingers == 1 ? " finger" : " fingers, " + trainer::name_of(lift.manner)) +
             ": 95 % below " + in_kpa(lift.lifted.von_mises_95_pa),
         trainer::picture_from_below(body.object().mesh, body.task(), lift.lifted, scale_pa(lifts))});
  }
  return trainer::sheet_of(cells, trainer::kMostExclusionFingers, scale_pa(lifts));
}

/// Three fingers side by side; the stiff parts lie about the object's middle plane.
sim::Picture cut_open(const trainer::ExclusionBody& body, const std::vector<Lift>& lifts) {
  const Lift& shown = *std::ranges::find(lifts, std::size_t{3}, &Lift::fingers);
  const double top_pa = scale_pa(lifts);
  const auto cell = [&](const std::string& caption, const trainer::LiftedObject& lifted) {
    return trainer::CaptionedPicture{
        caption,
        trainer::picture_cut_open(body.object().mesh, body.task(), lifted, top_pa, sim::Vector3::Zero())};
  };
  return trainer::sheet_of(
      {cell("with stiff parts", shown.lifted), cell("as soft throughout", *shown.uniform)}, 2, top_pa);
}

int run(const Request& request) {
  constexpr double kMostMillimetres = 50;
  const double lift_m = parse_number(request.lift, "--lift", 0.5, kMostMillimetres) / 1e3;
  const std::size_t vertices =
      parse_count(request.vertices, "--vertices", trainer::kLeastObjectNodes, trainer::kMostObjectNodes);
  const OutputFolder folder(request.output, {"stress.json", "stress.png", "cut.png"}, request.force);
  const auto body =
      make_object_body(trainer::object_kind(request.object.value_or("a")), vertices,
                       task_choice(std::nullopt, request.friction, trainer::ExclusionTask().most_s));
  const std::vector<Lift> lifts = lifts_of(*body, lift_m);
  Json rows = Json::array();
  std::string text =
      "  fingers, manner  largest stress, 95 % and 99 % of the tissue below  forces of the fingers  of all  "
      "line in sight\n";
  for (const Lift& lift : lifts) {
    rows.push_back(lift_json(*body, lift));
    const auto [least, most] = std::ranges::minmax(lift.lifted.forces_n);
    text += "  " + std::to_string(lift.fingers) +
            (lift.fingers == 1 ? "" : ", " + trainer::name_of(lift.manner)) + "  " +
            in_kpa(lift.lifted.largest_von_mises_pa) + ", " + in_kpa(lift.lifted.von_mises_95_pa) + ", " +
            in_kpa(lift.lifted.high_von_mises_pa) + "  " + number_text(least, 3) + " to " +
            number_text(most, 3) + " N  " + number_text(lift.lifted.wrist_n, 3) + " N  " +
            number_text(100 * lift.visible_share, 3) + " %\n";
    if (const Json& row = rows.back(); row.contains("away_from_fingers")) {
      const Json& away = row["away_from_fingers"];
      text += "      away from fingers and ends: " + in_kpa(away["largest_von_mises_pa"].get<double>()) +
              (away["at_interface"].get<bool>() ? " where stiffness changes" : " within one stiffness") +
              "; " + in_kpa(away["of_uniform_object_pa"].get<double>()) + " if all were as soft\n";
    }
  }
  const Json report{{"object", body->object().name},
                    {"vertices", body->object().mesh.nodes.size()},
                    {"tetrahedra", body->object().mesh.tetrahedra.size()},
                    {"lift_m", lift_m},
                    {"friction", body->task().friction},
                    {"scale_pa", scale_pa(lifts)},
                    {"lifts", rows}};
  folder.write("stress.json", report.dump(2) + "\n");
  folder.write("stress.png", png(sheet(*body, lifts)));
  if (lifts.front().uniform) folder.write("cut.png", png(cut_open(*body, lifts)));
  if (request.json) {
    Json told = report;
    told["folder"] = request.output;
    print_json(told);
  } else {
    std::cout << printable(request.output) << ": object " << body->object().name << ", its border lifted by "
              << number_text(1e3 * lift_m, 3) << " mm\n"
              << text;
  }
  return kDone;
}

}  // namespace

void add_train_stress_command(Command& train) {
  Command& command =
      train.add_command("stress", "stress of an object by number and manner of the fingers that lift it");
  const auto request = std::make_shared<Request>();
  command.required_option("-o,--output", "DIR", request->output, "where to");
  command.choice("--object", {"a", "b"}, request->object,
                 "like a liver, or like a lung with its bronchus and artery", "a");
  command.option("--lift", "MM", request->lift, "how far fingertips lift the border, 0.5 to 50 mm");
  command.option("--vertices", "N", request->vertices, "of the object's mesh");
  command.option("--friction", "MU", request->friction,
                 "of a fingertip on the organ: the most force along its surface, in pressing ones; 0 glides",
                 "0.5");
  command.flag("-f,--force", request->force, "replaces what an earlier run left in DIR");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "One to five fingertips lift the object's border equally far: side by side along it (spread), and each "
      "close to the next (together). Writes DIR/stress.json with stress and forces of each, and stress.png, "
      "pictures of all under one scale. Where stiffness changes within the object, also cut.png: the object "
      "cut open, beside one that is as soft throughout.");
  command.example("kiroku train stress -o stress", "object A, lifted by a centimetre");
  command.example("kiroku train stress --object b -o lung", "object B, with its stiff bronchus and artery");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
