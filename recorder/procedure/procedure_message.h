// What an HL7 v2 message of patient administration (ADT, HL7 v2 chapter 3) or scheduling (SIU, chapter 10)
// says of a procedure. Pure functions, thread-safe.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "recorder/procedure/procedure_data.h"
#include "recorder/vitals/hl7_message.h"

namespace kiroku::recorder {

struct ProcedureMessage {
  enum class Kind {
    kPlaces,  // the patient is here now, or what is known of them has changed: ADT^A01, A02, A04 to A08, A10,
              // …
    kLeaves,  // the patient is gone: ADT^A03, A11, A23, A29
    kAppointment,  // a procedure is planned: SIU^S12, S13, S14, S18 to S24
    kCancels,      // it is planned no more: SIU^S15, S16, S17, S26
    kNothing,      // names no patient, or no appointment: a blocked slot
  };
  Kind kind = Kind::kNothing;
  std::string patient;      // PID-3 with its issuer: the same for the same patient of one sender
  std::string appointment;  // SCH-2, else SCH-1, else patient and time; "" of ADT
  /// Every way to write where it is done: point of care, room, bed of PV1-3, PV1-11 and AIL-3, and those
  /// joined by '^'; resource and its name of AIG-3.
  std::vector<std::string> places;
  std::optional<UtcTime> planned;
  ProcedureData data;
};

/// "ADT^A01", "SIU^S12".
bool is_of_procedures(const std::string& type);

/// `message` must be of such a type; times without zone count by `assumed_zone`.
ProcedureMessage read_procedure_message(const Hl7Message& message, std::chrono::minutes assumed_zone);

}  // namespace kiroku::recorder
