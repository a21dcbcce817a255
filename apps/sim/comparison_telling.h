// What was compared, for a person at a terminal or as JSON for a program. Functions; not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "apps/kiroku/stamped_file.h"
#include "apps/sim/compared_ct.h"
#include "apps/sim/comparison_request.h"
#include "apps/sim/keeping.h"
#include "apps/sim/plan_at_hand.h"
#include "viewer/compare/comparison.h"

namespace kiroku::apps {

/// A document that was written, and what proves it.
struct MadeComparison {
  std::filesystem::path document;
  crypto::Sha256Digest digest{};
  std::vector<Stamp> stamps;
  bool in_log = false;
};

/// Of an output or of what is kept (`keeping`, else null) with so many pictures; the exit status.
int tell_comparison(const ComparisonRequest& request, const compare::Comparison& comparison,
                    const PlanAtHand& at_hand, const compare::Provenance& provenance,
                    const PatientNumbers& numbers, const MadeComparison& made, std::uint64_t pictures,
                    const Keeping* keeping);

/// The planned steps and what was found of them, with the moments between which they may lie, and whether the
/// case names (`named`) another plan.
void tell_steps(const compare::Comparison& comparison, const PlanAtHand& at_hand,
                const std::optional<crypto::Sha256Digest>& named, bool json);

}  // namespace kiroku::apps
