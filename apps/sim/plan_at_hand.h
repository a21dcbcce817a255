// A plan with its files as they are now. Not thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "apps/kiroku/plan_seal.h"
#include "crypto/hash.h"
#include "sim/plan/plan.h"

namespace kiroku::apps {

/// The plan, its files as they are now, and whether a seal beside it fits them.
struct PlanAtHand {
  sim::Plan plan;
  PlanSeal files;
  crypto::Sha256Digest seal{};
  bool sealed = false;
  std::filesystem::path seal_file;
};

/// Of a plan (.json), or of a sealed one (.seal.json), which must be what was sealed: comparing with
/// something else would say nothing. Nothing once the plan's errors are told (plan_reading.h). kiroku::Error
/// for a seal whose files are others now.
std::optional<PlanAtHand> read_plan_at_hand(const std::filesystem::path& named, bool json);

}  // namespace kiroku::apps
