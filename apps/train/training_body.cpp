#include "apps/train/training_body.h"

#include <utility>

#include "apps/common/command_line.h"
#include "apps/common/step_line.h"
#include "apps/sim/number_option.h"
#include "trainer/exclusion/task_trial.h"

namespace kiroku::apps {
namespace {

std::shared_ptr<const trainer::ExclusionBody> body_of(StepLine& line, trainer::OrganObject object,
                                                      trainer::ExclusionTask task, const TaskChoice& choice) {
  if (choice.damage_pa) task.damage_pa = *choice.damage_pa;
  if (choice.friction) task.friction = *choice.friction;
  task.most_s = choice.most_s;
  line.show("computing the compliance of " + object.name);
  return std::make_shared<const trainer::ExclusionBody>(std::move(object), task);
}

}  // namespace

TaskChoice task_choice(const std::optional<std::string>& damage, const std::optional<std::string>& friction,
                       double most_s) {
  constexpr double kMostPascals = 1e9;
  TaskChoice choice;
  if (damage) choice.damage_pa = parse_number(*damage, "--damage", 1, kMostPascals);
  if (friction) choice.friction = parse_number(*friction, "--friction", 0, trainer::kMostFriction);
  choice.most_s = most_s;
  return choice;
}

std::shared_ptr<const trainer::ExclusionBody> make_object_body(trainer::ObjectKind kind, std::size_t vertices,
                                                               const TaskChoice& choice) {
  StepLine line;
  line.show("making object " + trainer::name_of(kind));
  trainer::OrganObject object =
      trainer::make_object(kind, vertices, [&](const std::string& step) { line.show(step); });
  return body_of(line, std::move(object), trainer::exclusion_task(kind), choice);
}

std::shared_ptr<const trainer::ExclusionBody> make_patient_body(const std::filesystem::path& file,
                                                                const TaskChoice& choice) {
  trainer::PatientOrgan organ = [&] {
    StepLine line;
    line.show("making " + file.string());
    return trainer::read_patient_organ(file, [&](const std::string& step) { line.show(step); });
  }();
  for (const std::string& warning : organ.warnings) print_error("kiroku", "warning: " + warning);
  StepLine line;
  return body_of(line, std::move(organ.object), organ.task, choice);
}

bool warn_of_doubt(const trainer::ExclusionBody& body, std::span<const std::size_t> fingers) {
  const std::string doubt = [&] {
    StepLine line;
    line.show("trying whether " + body.object().name + " can be pushed aside");
    return trainer::doubt_about(body, fingers);
  }();
  if (doubt.empty()) return false;
  print_error("kiroku", "warning: " + doubt);
  return true;
}

}  // namespace kiroku::apps
