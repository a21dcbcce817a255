// Identities that did not come from a file of this machine. Functions are thread-safe.
#pragma once

#include <string>

#include "crypto/age_recipient.h"

namespace kiroku::crypto {

/// What load_identity_file() does with a file's content; `name` stands in errors, and is what the passphrase
/// is asked for.
AgeIdentities read_identities(Secret content, const std::string& name, const AskPassphrase& ask_passphrase);

}  // namespace kiroku::crypto
