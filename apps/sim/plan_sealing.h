// Freezing a plan: its seal written beside it, entered into the appliance log, and time-stamped. Not
// thread-safe.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "apps/kiroku/plan_seal.h"

namespace kiroku::apps {

/// kiroku::UsageError where the plan has a seal beside it, which is never replaced, and where none may be
/// written there: in a case (apps/common/output_place.h).
void require_unsealed(const std::filesystem::path& plan);

struct SealedPlan {
  std::filesystem::path file;  // liver.seal.json of liver.json
  PlanSeal seal;
  crypto::Sha256Digest digest{};  // of the seal's file
  std::vector<Stamp> stamps;
};

/// Seals a plan that was read: `name` is its own. `enter` writes the digest into the appliance log, once the
/// seal is on the disk. Of the home's authorities those named are asked, all where none is; tokens are judged
/// under `trust`. What require_unsealed(), seal_of_plan() and Authorities throw, and `enter`; a Refusal where
/// the home's disk has no room.
SealedPlan seal_plan_file(const Home& home, const std::filesystem::path& plan, const std::string& name,
                          const std::vector<std::string>& authorities, const timestamp::TrustStore& trust,
                          const std::function<void(const crypto::Sha256Digest&)>& enter);

}  // namespace kiroku::apps
