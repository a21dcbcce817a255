// What is pushed aside, made for a command: told on the terminal while it takes long. Not thread-safe.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "trainer/exclusion/exclusion_body.h"
#include "trainer/exclusion/patient_organ.h"

namespace kiroku::apps {

/// What a person chose of a task; what is absent is the usual, or what an organ's file says.
struct TaskChoice {
  std::optional<double> damage_pa, friction;
  double most_s = 60;  // of an attempt
};
/// Of --damage and --friction. kiroku::UsageError for what is out of range.
TaskChoice task_choice(const std::optional<std::string>& damage, const std::optional<std::string>& friction,
                       double most_s);

/// Object A or B. Throws what make_object() does.
std::shared_ptr<const trainer::ExclusionBody> make_object_body(trainer::ObjectKind kind, std::size_t vertices,
                                                               const TaskChoice& choice);

/// An organ of a CT; what is odd about it is a warning on standard error. Throws what read_patient_organ()
/// does.
std::shared_ptr<const trainer::ExclusionBody> make_patient_body(const std::filesystem::path& file,
                                                                const TaskChoice& choice);

/// Says on standard error where a simulated trainee finished the task with none of these numbers of fingers
/// (trainer::doubt_about()). Whether it was said.
bool warn_of_doubt(const trainer::ExclusionBody& body, std::span<const std::size_t> fingers);

}  // namespace kiroku::apps
