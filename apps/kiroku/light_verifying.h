// Comparing the light of a display in a case's pictures with the case's ledger, for a person.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "apps/verify/verify_command.h"

namespace kiroku::apps {

/// For VerifyExtras::read_light. `asked_home` is what --home said; it is read when a command runs.
ReadLight light_reading(const std::shared_ptr<std::optional<std::string>>& asked_home);

}  // namespace kiroku::apps
