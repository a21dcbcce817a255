// Identities that did not come from a file of this machine. Functions are thread-safe.
#pragma once

#include <string>

#include "crypto/age_recipient.h"

namespace kiroku::crypto {

/// What passphrase_identity() does at most where nothing else is said: 4 GiB.
inline constexpr int kUsualMaximumWorkFactor = 22;

/// What load_identity_file() does with a file's content; `name` stands in errors, and is what the passphrase
/// is asked for. More work for it than `maximum_work_factor` (log2; each step doubles memory and time) is
/// refused before it is done.
AgeIdentities read_identities(Secret content, const std::string& name, const AskPassphrase& ask_passphrase,
                              int maximum_work_factor = kUsualMaximumWorkFactor);

}  // namespace kiroku::crypto
