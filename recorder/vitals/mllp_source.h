// Vital signs that monitors send by HL7 over MLLP, and the same messages from a file.
#pragma once

#include <memory>

#include "recorder/vitals/vital_source.h"

namespace kiroku::recorder {

/// Opens `mllp://ADDRESS[:PORT]`, or `mllps://` for TLS, and waits there for monitors (port 2575 where none
/// is given). Options: `allow=ADDRESS[/BITS],…` or `allow=any`, which an address that the network reaches
/// needs unless it asks for certificates; `sender=MSH-3[/MSH-4],…`; `locations=PV1-3,…`, of which places
/// messages are recorded; `zone=+05:30|UTC|local` by which times
/// without zone count (local), `idle=SECONDS` (3600), `connections=N` (64), `of_address=N` (16); for TLS
/// `certificate=PEM`, `key=PEM`, `clients=PEM` (mllp_server.h).
///
/// A message is acknowledged once its lines are in the queue to the recorder. When that holds kMllpQueueBytes
/// of lines, connections are read no further until there is room: nothing is lost, monitors wait. What was
/// acknowledged is recorded also when the end is asked for. Throws kiroku::UsageError: an address or port
/// that cannot be listened on, TLS files that cannot be used.
std::unique_ptr<VitalSource> open_mllp_source(const SourceAddress& address, const CaseClock& clock);

inline constexpr std::size_t kMllpQueueBytes = 16U << 20;

/// Opens `FILE.hl7`: messages one after the other, with or without MLLP framing and batch envelopes. They
/// count from the first message's time (MSH-7); one without time, or with an earlier one, counts as the one
/// before. Options: `speed=max`, `zone=…`, `locations=…`. Throws kiroku::Error for a file that cannot be
/// read, holds no message, or is longer than 1 GiB.
std::unique_ptr<VitalSource> open_hl7_file_source(const SourceAddress& address);

}  // namespace kiroku::recorder
