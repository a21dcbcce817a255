// Identities that did not come from a file of this machine. Functions are thread-safe.
#pragma once

#include <limits>
#include <string>

#include "crypto/age_recipient.h"

namespace kiroku::crypto {

/// What whoever brings an identity may ask of this machine.
struct IdentityLimits {
  int work_factor = 22;  // log2 of scrypt's N: 2^N KiB of memory
  std::size_t keys = std::numeric_limits<std::size_t>::max();
};
/// Of somebody over the network: what `age -p` asks for (256 MiB), and as many keys as a person has.
inline constexpr IdentityLimits kLimitsOfStrangers{.work_factor = 18, .keys = 16};

/// What load_identity_file() does with a file's content; `name` stands in errors, and is what the passphrase
/// is asked for. Throws kiroku::Error for what is beyond `limits`, before the work.
AgeIdentities read_identities(Secret content, const std::string& name, const AskPassphrase& ask_passphrase,
                              const IdentityLimits& limits = {});

}  // namespace kiroku::crypto
