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
    kPlaces,  // the patient is here now, or what is known of them has changed: ADT^A01, A02, A04, A06 to A08,
              // A10, …
    kFacts,  // what is known of the patient has changed, and nothing of where they are: ADT^A28, A31, A40, …;
             // or where they may come to be, or may no more: ADT^A05, A14 to A16, A25 to A27, A38
    kLeaves,       // the patient is gone: ADT^A03, A11, A23, A29
    kAppointment,  // a procedure is planned: SIU^S12, S13, S14, S18 to S24
    kCancels,      // it is planned no more: SIU^S15, S16, S17, S26, or SCH-25 says so
    kNothing,      // names no patient, or no appointment: a blocked slot
  };
  Kind kind = Kind::kNothing;
  /// Of kPlaces: the event says where the patient went. Others (A08) only state where they are known to be.
  bool moves = false;
  std::string patient;      // PID-3 with its issuer: the same for the same patient of one sender
  std::string replaces;     // MRG-1 likewise: what the patient was called before (A18, A40, A47, …)
  std::string appointment;  // SCH-2, else SCH-1, else patient and time; "" of ADT
  /// Every way to write where it is done: point of care, room, bed of PV1-3, PV1-11 and AIL-3, and those
  /// joined by '^'; resource and its name of AIG-3.
  std::vector<std::string> places;
  std::optional<UtcTime> planned;
  ProcedureData data;
};

/// "ADT^A01", "SIU^S12".
bool is_of_procedures(const std::string& type);

/// A message that swaps (A17) or merges patients names several, and an appointment may be of several; beyond
/// so many the rest is not read.
inline constexpr std::size_t kMostPatients = 16;

/// What the message says of each patient that it names, in its order; one that names nobody is one, too.
/// `message` must be of such a type; times without zone count by `assumed_zone`.
std::vector<ProcedureMessage> read_procedure_messages(const Hl7Message& message,
                                                      std::chrono::minutes assumed_zone);

}  // namespace kiroku::recorder
