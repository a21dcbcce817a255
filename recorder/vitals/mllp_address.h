// Addresses at which messages are waited for: `mllp://ADDRESS[:PORT]`, `mllps://` for TLS. Pure, thread-safe.
#pragma once

#include "recorder/source/source_address.h"
#include "recorder/vitals/mllp_server.h"

namespace kiroku::recorder {

/// Options of the address: `idle=SECONDS` (3600), `connections=N` (64); for TLS `certificate=PEM`, `key=PEM`,
/// `clients=PEM` (mllp_server.h); and `zone=`, which is the caller's. Throws kiroku::UsageError for others, a
/// port that is none, and TLS without certificate.
MllpServer::Options mllp_server_options(const SourceAddress& address);

}  // namespace kiroku::recorder
