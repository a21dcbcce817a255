// Finding sealed plans: one by what a case says of it, or all there are. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "crypto/hash.h"

namespace kiroku::compare {

/// The NAME.seal.json with this hash in `folder` or up to three folders below it; nothing where there is
/// none. Links below `folder` are not followed.
std::optional<std::filesystem::path> find_sealed_plan(const std::filesystem::path& folder,
                                                      const crypto::Sha256Digest& seal);

struct SealedPlanFile {
  std::filesystem::path file;  // NAME.seal.json
  crypto::Sha256Digest seal{};
  std::string name;  // as its file says, in UTF-8; may be empty
};
/// Those that find_sealed_plan() would find, by their files' paths. What is no seal is left out.
std::vector<SealedPlanFile> sealed_plans(const std::filesystem::path& folder);

}  // namespace kiroku::compare
