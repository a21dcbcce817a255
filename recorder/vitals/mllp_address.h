// Addresses at which messages are waited for: `mllp://ADDRESS[:PORT]`, `mllps://` for TLS. Pure, thread-safe.
#pragma once

#include "recorder/source/source_address.h"
#include "recorder/vitals/hl7_patient_part.h"
#include "recorder/vitals/mllp_server.h"
#include "recorder/vitals/sender_list.h"

namespace kiroku::recorder {

/// Options of the address: `allow=ADDRESS[/BITS],…` (or `any`), who may connect; `idle=SECONDS` (3600),
/// `connections=N` (64), `of_address=N` (16); for TLS `certificate=PEM`, `key=PEM`, `clients=PEM`
/// (mllp_server.h); and `zone=`, `sender=` and `locations=`, which are the caller's. Throws
/// kiroku::UsageError for others, a port or an address that is none, and TLS without certificate.
MllpServer::Options mllp_server_options(const SourceAddress& address);

/// `sender=APPLICATION[/FACILITY],…`: whose messages are taken; absent: everybody's. Throws
/// kiroku::UsageError.
SenderList mllp_senders(const SourceAddress& address);

/// `locations=PLACE,…` (PlaceList::parse): of which places messages are recorded; absent: of all. Throws
/// kiroku::UsageError.
PlaceList hl7_places(const SourceAddress& address);

}  // namespace kiroku::recorder
