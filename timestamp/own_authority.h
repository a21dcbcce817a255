// Which certificates are of a recorder's own authority, so that time under them is self-issued.
//
// A token is self-issued if any of these holds, and outside time only if none does:
//  - a valid path leads from its signer to a certificate that the verifier holds as the recorder's own;
//  - a certificate of the path that was found, its trusted end included, has the public key of one of those;
//  - one of them bears the name of every embedded authority's CA, as subject or as issuer;
//  - the token states the embedded authority's policy.
// The first one is the rule. The others can only lower what a token is worth, never raise it: they catch a
// root of a recorder that was trusted as an outside one by mistake, or signed by an outside CA. Whoever holds
// the key can leave the name and the policy away, but a root under which tokens are outside time must be one
// that the verifier trusts as such.
//
// Pure functions over certificates that are only read; thread-safe.
#pragma once

#include <vector>

#include "timestamp/asn1_objects.h"

namespace kiroku::timestamp {

/// Whether a certificate has the public key of one of `own`, or bears kEmbeddedRootName.
bool is_own_authority(const X509* certificate, const std::vector<Certificate>& own);

}  // namespace kiroku::timestamp
