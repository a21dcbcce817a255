#include "apps/train/training_body.h"

#include <utility>

#include "apps/common/command_line.h"
#include "apps/common/step_line.h"

namespace kiroku::apps {
namespace {

std::shared_ptr<const trainer::ExclusionBody> body_of(StepLine& line, trainer::OrganObject object,
                                                      trainer::ExclusionTask task,
                                                      std::optional<double> damage_pa, double most_s) {
  if (damage_pa) task.damage_pa = *damage_pa;
  task.most_s = most_s;
  line.show("computing how " + object.name + " gives way");
  return std::make_shared<const trainer::ExclusionBody>(std::move(object), task);
}

}  // namespace

std::shared_ptr<const trainer::ExclusionBody> make_object_body(trainer::ObjectKind kind, std::size_t vertices,
                                                               std::optional<double> damage_pa,
                                                               double most_s) {
  StepLine line;
  line.show("making object " + trainer::name_of(kind));
  trainer::OrganObject object =
      trainer::make_object(kind, vertices, [&](const std::string& step) { line.show(step); });
  return body_of(line, std::move(object), trainer::exclusion_task(kind), damage_pa, most_s);
}

std::shared_ptr<const trainer::ExclusionBody> make_patient_body(const std::filesystem::path& file,
                                                                std::optional<double> damage_pa,
                                                                double most_s) {
  trainer::PatientOrgan organ = [&] {
    StepLine line;
    line.show("making " + file.string());
    return trainer::read_patient_organ(file, [&](const std::string& step) { line.show(step); });
  }();
  for (const std::string& warning : organ.warnings) print_error("kiroku", "warning: " + warning);
  StepLine line;
  return body_of(line, std::move(organ.object), organ.task, damage_pa, most_s);
}

}  // namespace kiroku::apps
