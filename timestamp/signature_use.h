// On which algorithms a token rests, and until when its certificates are valid: what a policy of algorithms
// asks. Pure functions over certificates that are only read; thread-safe.
#pragma once

#include <vector>

#include "timestamp/asn1_objects.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {

/// The token's own signature, over `token_hash`, then that on each certificate of `path` below the last one,
/// which is trusted for itself. `path`: signer first, not empty.
std::vector<SignatureUse> signatures_on(crypto::HashAlgorithm token_hash,
                                        const std::vector<Certificate>& path);
/// When the first certificate of `path` ends; nothing where one of them states no time.
std::optional<UtcTime> end_of(const std::vector<Certificate>& path);

}  // namespace kiroku::timestamp
