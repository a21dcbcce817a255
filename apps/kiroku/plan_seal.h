// What freezes a plan before the operation: a list of its files with their hashes
// (docs/reference/format-plans.md, "Sealed plans"), whose own hash stands in the appliance log and, if one
// was recorded by it, in a case.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/kiroku/home.h"
#include "apps/kiroku/stamped_file.h"
#include "crypto/hash.h"

namespace kiroku::apps {

struct SealedFile {
  std::string role, name;  // the name from the seal's folder on
  std::uint64_t bytes = 0;
  crypto::Sha256Digest sha256{};
};

struct PlanSeal {
  std::string plan;  // the plan's own name
  std::vector<SealedFile> files;
};

/// The seal's file, byte for byte the same for the same plan.
std::string plan_seal_text(const PlanSeal& seal);
/// kiroku::UsageError, naming `name_for_errors`, for what is no such file.
PlanSeal parse_plan_seal(std::string_view text, const std::string& name_for_errors);

/// Size and hash of a file as it is now. kiroku::IoError.
SealedFile hashed(const std::string& role, const std::string& name, const std::filesystem::path& path);

/// For find_record(): the entry that states this seal.
std::function<bool(const archive::LogEntryBody&)> states_seal(const crypto::Sha256Digest& seal);

/// The hash of the seal in `file`. kiroku::UsageError if it is none, or the home's log does not have it.
crypto::Sha256Digest require_sealed(const Home& home, const std::filesystem::path& file);

}  // namespace kiroku::apps
