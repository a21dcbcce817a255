// 'kiroku recover --from-store': how far a store has a case whose appliance is gone, as this home's device
// states it (archive/format/store_statement.h). One thread.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/kiroku/verify_extras.h"
#include "apps/verify/judging.h"

namespace kiroku::apps {

struct FromStoreRequest {
  std::optional<std::string> case_name, appliance, output;
  bool force = false;
  JudgingRequest judging;
  /// Whether anything was said that is for this alone.
  [[nodiscard]] bool says_anything() const {
    return appliance || output || force || !judging.names_nothing();
  }
};

/// Gets the case, verifies it, states, and puts the statement into the store. The exit status. Throws
/// kiroku::Error.
int state_from_store(const FromStoreRequest& request, const std::optional<std::string>& asked_home,
                     const VerifyExtras& extras, bool json);

}  // namespace kiroku::apps
