// The file of an approval key (crypto/approval_key.h), as whoever approves states of a boot gives it.
#pragma once

#include <filesystem>

#include "crypto/approval_key.h"

namespace kiroku::apps {

/// Asks for its passphrase if it has one. kiroku::UsageError where others than its owner may do anything with
/// the file, kiroku::Error where it is no such key.
crypto::ApprovalKey load_approval_key(const std::filesystem::path& file);

}  // namespace kiroku::apps
