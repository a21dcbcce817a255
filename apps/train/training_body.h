// What is pushed aside, made for a command: told on the terminal while it takes long. Not thread-safe.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "trainer/exclusion/exclusion_body.h"
#include "trainer/exclusion/patient_organ.h"

namespace kiroku::apps {

/// Object A or B. `damage_pa` where it is not the usual; `most_s` of an attempt. Throws what make_object()
/// does.
std::shared_ptr<const trainer::ExclusionBody> make_object_body(trainer::ObjectKind kind, std::size_t vertices,
                                                               std::optional<double> damage_pa,
                                                               double most_s);

/// An organ of a CT; what is odd about it is a warning on standard error. Throws what read_patient_organ()
/// does.
std::shared_ptr<const trainer::ExclusionBody> make_patient_body(const std::filesystem::path& file,
                                                                std::optional<double> damage_pa,
                                                                double most_s);

}  // namespace kiroku::apps
