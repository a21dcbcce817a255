// Files of approving states of a boot: that of an approval key (crypto/approval_key.h), as whoever approves
// gives it, and approvals in a home.
#pragma once

#include <filesystem>

#include "crypto/approval_key.h"
#include "crypto/secret.h"
#include "recorder/device_key/boot_approval.h"

namespace kiroku::apps {

/// Asks for its passphrase if it has one. kiroku::UsageError where others than its owner may do anything with
/// the file, kiroku::Error where it is no such key.
crypto::ApprovalKey load_approval_key(const std::filesystem::path& file);
/// A new file, its owner's alone. kiroku::UsageError where one is there already, which stays as it is.
void save_approval_key(const std::filesystem::path& file, const crypto::Secret& pem);
/// Puts an approval into the folder of a home, made if need be; for all to read whatever the umask. Returns
/// its path.
std::filesystem::path keep_approval(const std::filesystem::path& folder,
                                    const recorder::BootApproval& approval);

}  // namespace kiroku::apps
