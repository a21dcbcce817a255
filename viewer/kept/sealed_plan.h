// Finding a sealed plan by what a case says of it. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <optional>

#include "crypto/hash.h"

namespace kiroku::compare {

/// The NAME.seal.json with this hash in `folder` or up to three folders below it; nothing where there is
/// none. Links below `folder` are not followed.
std::optional<std::filesystem::path> find_sealed_plan(const std::filesystem::path& folder,
                                                      const crypto::Sha256Digest& seal);

}  // namespace kiroku::compare
