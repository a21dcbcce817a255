#include "trainer/exclusion/patient_organ.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/number_text.h"
#include "base/printable.h"
#include "sim/meshing/mesh_recipe.h"
#include "sim/model/body_model.h"

namespace kiroku::trainer {
namespace {

using sim::JsonField;
using sim::Vector3;

constexpr sim::Rgb kOrganColour{168, 84, 72};
constexpr double kHapticRateHz = 1000;

std::string name_in(const JsonField& document, const std::filesystem::path& file) {
  constexpr std::size_t kLongest = 40;
  const std::optional<JsonField> given = document.optional_member("name");
  const std::string name = given ? given->text() : file.stem().string();
  const bool sound = !name.empty() && name.size() <= kLongest && name != "a" && name != "b" && name != "c" &&
                     !first_unprintable(name);
  if (!sound) {
    const std::string what =
        "is '" + name + "': an organ's name is 1 to 40 bytes without control characters, and not a, b or c";
    given ? given->fail(what) : document.fail("has no name, and the file's " + what);
  }
  return name;
}

Vector3 direction(const JsonField& field) {
  const Vector3 given = field.vector();
  if (given.norm() < 1e-6) field.fail("has no direction");
  return given.normalized();
}

/// What the document asks for, else those that are usual.
std::vector<Approach> approaches_in(const std::optional<JsonField>& exclusion, const sim::TetMesh& mesh) {
  const auto lifts = exclusion ? exclusion->optional_member("lifts") : std::nullopt;
  const auto away = exclusion ? exclusion->optional_member("away") : std::nullopt;
  if (lifts.has_value() != away.has_value())
    exclusion->fail("has one of 'lifts' and 'away': give both, or none");
  if (!lifts) {
    const auto usual = usual_approaches(mesh);
    return {usual.begin(), usual.end()};
  }
  Approach approach{direction(*lifts), direction(*away)};
  approach.away -= approach.away.dot(approach.lifts) * approach.lifts;
  if (approach.away.norm() < 0.1)
    away->fail("is the way the organ is lifted: it must lead from the trainee on");
  approach.away.normalize();
  return {approach};
}

OrganTaskRequest request_in(const std::optional<JsonField>& exclusion, double units_per_metre) {
  OrganTaskRequest request;
  if (!exclusion) return request;
  if (const auto eye = exclusion->optional_member("eye")) request.eye_m = eye->vector() / units_per_metre;
  if (const auto line = exclusion->optional_member("line")) {
    const std::vector<JsonField> ends = line->elements(2);
    request.line_m = {ends[0].vector() / units_per_metre, ends[1].vector() / units_per_metre};
  }
  return request;
}

}  // namespace

PatientOrgan read_patient_organ(const std::filesystem::path& file,
                                const std::function<void(const std::string&)>& step) {
  const nlohmann::json parsed = JsonField::parse(sim::read_document(file), file.string());
  const JsonField document(parsed, file.string());
  document.expect_object({"name", "mesh", "volume", "length_unit", "materials", "fixed", "exclusion"});
  PatientOrgan organ;
  organ.object.name = name_in(document, file);
  organ.object.tissue = kOrganColour;
  sim::BodyReader reader(document, file.parent_path(), sim::recipe_mesh_maker(step));
  sim::BodyModel body = reader.take();
  if (body.mesh.nodes.size() < kLeastObjectNodes || body.mesh.nodes.size() > kMostObjectNodes) {
    throw UsageError("the mesh of " + file.string() + " has " + std::to_string(body.mesh.nodes.size()) +
                     " vertices: fingertips need " + std::to_string(kLeastObjectNodes) + " to " +
                     std::to_string(kMostObjectNodes));
  }
  const std::optional<JsonField> exclusion = document.optional_member("exclusion");
  if (exclusion) exclusion->expect_object({"lifts", "away", "eye", "line", "damage_pa", "friction"});
  const std::vector<Approach> approaches = approaches_in(exclusion, body.mesh);
  const OrganTaskRequest request = request_in(exclusion, sim::units_per_metre(body.unit));
  if (!body.constraints.displacement_m().isZero(0))
    document.member("fixed").fail("moves what it holds: an organ to push aside is held where it is");
  if (step) step("looking for what it hides");
  std::optional<ExclusionTask> task;
  std::string why_not;
  for (const Approach& approach : approaches) {
    organ.object.constraints = body.constraints;
    if (!body.constraints.any()) {
      for (const std::size_t node : held_by_rule(body.mesh, approach.away))
        organ.object.constraints.prescribe(node, Vector3::Zero(), "the organ's far end");
    }
    OrganTask found = organ_task(body.mesh, organ.object.constraints, approach, request);
    task = found.task;
    if (task) break;
    why_not += (why_not.empty() ? "" : "; ") + found.why_not;
  }
  if (!task) {
    throw Error(file.string() + ": behind " + organ.object.name + ", " + why_not +
                ". Give 'line', 'eye', 'lifts' and 'away' in 'exclusion'");
  }
  organ.task = *task;
  if (exclusion) {
    if (const auto damage = exclusion->optional_member("damage_pa")) {
      organ.task.damage_pa = damage->number();
      if (organ.task.damage_pa < 1) damage->fail("must be 1 or more");
    }
    if (const auto friction = exclusion->optional_member("friction")) {
      organ.task.friction = friction->number();
      if (organ.task.friction < 0 || organ.task.friction > kMostFriction)
        friction->fail("must be 0 (fingers glide) to " + number_text(kMostFriction));
    }
  }
  organ.object.mesh = std::move(body.mesh);
  organ.object.materials = std::move(body.materials);
  organ.warnings = std::move(body.warnings);
  return organ;
}

void require_haptic_rate(const ExclusionBody& body, std::size_t fingers, double measured_hz) {
  if (measured_hz >= kHapticRateHz) return;
  throw Error("the mesh of " + body.object().name + " is too large to be felt on this machine: with " +
              std::to_string(fingers) + (fingers == 1 ? " finger" : " fingers") + " forces came at " +
              number_text(measured_hz, 3) + " Hz, and a hand needs 1000; make it of fewer than " +
              std::to_string(body.object().mesh.nodes.size()) + " vertices");
}

}  // namespace kiroku::trainer
