// A plan with its files as they are now. Not thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "apps/kiroku/plan_seal.h"
#include "crypto/hash.h"
#include "sim/plan/plan.h"

namespace kiroku::apps {

/// A plan's files as they are now, and whether a seal beside it fits them.
struct FilesAtHand {
  PlanSeal files;
  crypto::Sha256Digest seal{};
  bool sealed = false;
  std::filesystem::path seal_file;
};
/// Of a plan (.json) of that name, of whichever kind. kiroku::Error as seal_of_plan().
FilesAtHand files_at_hand(const std::filesystem::path& plan, const std::string& name);

struct PlanAtHand : FilesAtHand {
  sim::Plan plan;
};

/// The plan itself, of whichever kind, where `named` is its seal, which must be what was sealed; else
/// `named`. kiroku::Error for a seal whose files are others now.
std::filesystem::path plan_file_of(const std::filesystem::path& named);
/// Whether the plan, or the one that this seal names, is a lung that breathes; no file is hashed.
/// kiroku::UsageError for a seal that is none.
bool is_breathing(const std::filesystem::path& named);

/// Of a plan (.json), or of a sealed one (.seal.json), which must be what was sealed: comparing with
/// something else would say nothing. Nothing once the plan's errors are told (plan_reading.h). kiroku::Error
/// for a seal whose files are others now.
std::optional<PlanAtHand> read_plan_at_hand(const std::filesystem::path& named, bool json);

}  // namespace kiroku::apps
