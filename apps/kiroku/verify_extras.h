// What kiroku adds to verifying beside kiroku-verify: the home's keys and log, and decoders.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "apps/verify/verify_command.h"

namespace kiroku::apps {

/// `asked_home` is what --home said; it is read when a command runs.
VerifyExtras verify_extras(const std::shared_ptr<std::optional<std::string>>& asked_home);

}  // namespace kiroku::apps
