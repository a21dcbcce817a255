// In whose zone the times of an HL7 v2 message are that state none. Pure, thread-safe.
#pragma once

#include <chrono>
#include <optional>

#include "recorder/vitals/assumed_zone.h"
#include "recorder/vitals/hl7_message.h"
#include "recorder/vitals/hl7_time.h"

namespace kiroku::recorder {

/// The zone that MSH-7 states, which HL7 has hold throughout the message (chapter 2, MSH-7); nothing where it
/// states none.
std::optional<std::chrono::minutes> stated_zone(const Hl7Message& message);

/// By what its times count that state no zone and may lie days away: as MSH-7 states, else by `assumed`.
/// Where that is how far the assumed zone is from UTC when the message was sent, the sender's clocks are
/// taken to go as those of the assumed zone, which knows when they change.
AssumedZone zone_of(const Hl7Message& message, const AssumedZone& assumed);

}  // namespace kiroku::recorder
