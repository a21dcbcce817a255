// What an HL7 v2 message of patient administration (ADT, HL7 v2 chapter 3) or scheduling (SIU, chapter 10)
// says of a procedure. Pure functions, thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "recorder/procedure/procedure_data.h"
#include "recorder/vitals/assumed_zone.h"
#include "recorder/vitals/hl7_message.h"
#include "recorder/vitals/patient_number.h"

namespace kiroku::recorder {

/// What an appointment says of one place alone (AIL, AIG): when it is needed, and for which service. An
/// appointment may need several places, each at its own time.
struct PlannedPlace {
  std::vector<std::string> spellings;            // as ProcedureMessage::places
  std::optional<UtcTime> planned;                // absent: nothing says when
  bool is_time_unclear = false;                  // a time or an offset is stated that cannot be read
  std::string planned_text, location;            // as ProcedureData has them
  std::string description, code, coding_system;  // "": those of the appointment
  std::optional<TimeSpan> within = {};           // all that is stated of an unclear time
};

/// Who gave a number (EI.2, EI.3); empty: it does not say.
struct Assigner {
  std::string name, id;
  bool operator==(const Assigner&) const = default;
};

struct ProcedureMessage {
  enum class Kind {
    kPlaces,  // the patient is here now: ADT^A01, A02, A04, A06, A07, A10, A12, A13, A17, A22, A33, A52; or
              // is known to be: A08
    kFacts,   // every other event of ADT: what is known of the patient has changed, or where they may come to
              // be, and nothing of where they are
    kLeaves,  // the patient is gone: ADT^A03, A11, A23, A29, on leave: A21, A53
    kDeparts,  // gone from the places that it names: ADT^A09, A32; naming none, from where they were: also
               // where PV1-45 of ADT^A08 says that they were discharged
    kAppointment,  // a procedure is planned: SIU^S12, S13, S14, S18 to S24
    kCancels,      // it is planned no more: SIU^S15, S16, S17, S26, or SCH-25 says so
    kNothing,      // names no patient, or no appointment: a blocked slot
  };
  Kind kind = Kind::kNothing;
  /// Of kPlaces: the event says where the patient went. Others (A08) only state where they are known to be.
  bool moves = false;
  /// Stands for who sent it (MSH-3, MSH-4), in few characters; "" of nobody.
  std::string sender;
  /// By the sender's clock, which nothing but itself is to be compared with: when it was told (EVN-2, else
  /// MSH-7), and when what it tells of happened (EVN-6 of who moves, else then).
  std::optional<UtcTime> told, happened;
  std::string patient;   // PID-3 with its issuer: the same for the same patient of one sender
  std::string replaces;  // MRG-1 likewise: what the patient was called before (A18, A40, A47, …)
  /// All of PID-2, PID-3 and PID-18; of MRG-1 and MRG-4.
  std::vector<PatientNumber> numbers, replaced_numbers;
  std::string appointment;     // SCH-2, else SCH-1, else patient and time; "" of ADT
  std::string placer, filler;  // SCH-1, SCH-2
  bool is_over = false;        // the appointment was kept, and is done with: SCH-25
  /// Every way to write where it is done: point of care, room, bed of PV1-11, else PV1-3, and of AIL-3, and
  /// those joined by '^'; resource and its name of AIG-3. Of who departs, all that they may have left.
  std::vector<std::string> places;
  std::optional<UtcTime> planned;  // when the appointment begins
  ProcedureData data;
  std::vector<PlannedPlace> planned_places;  // in their order
  /// A time is stated that cannot be read, or that says no hour: then it lies `within`.
  bool is_time_unclear = false;
  std::optional<TimeSpan> within = {};
  std::string facility = {};  // MSH-4: a number without an issuer is a number there
  std::string visit = {};     // PV1-19
  /// The patient goes, or is elsewhere, whatever visit they were there for: ADT^A06, A07, A10.
  bool is_of_any_visit = false;
  bool cancels_move = false;     // the patient is where they were, and never was where they went: ADT^A12
  bool is_of_record = false;     // it corrects the record, and is no event of the patient: ADT^A08
  bool books = false;            // the appointment is booked, or moved to another time: SIU^S12, S13
  bool corrects = false;         // what is known of the patient: ADT^A08, A31
  bool names_resources = false;  // of SIU: rooms, services or persons, or what is taken out of them
  bool leaves_unnamed = false;   // of kNothing: somebody left or departed whom it does not name
  bool registers = false;        // of `moves`: where a stay is registered, and not that somebody went there:
                                 // ADT^A01, A04, A06, A07, A13, A22, A52
  Assigner placer_by = {}, filler_by = {};  // of the numbers of the appointment
  bool names_rooms = false;  // of SIU: rooms (AIL), or what is taken out of them: PV1 says nothing of them
  bool is_status_unclear = false;  // of SIU: SCH-25 says neither that it is booked nor that it is not
  bool says_no_status = false;     // of SIU: SCH-25 is empty
  /// PV1-11 says where they are, and this is the bed that is kept (PV1-3); else empty.
  std::vector<std::string> kept_bed = {};
  std::string account = {};                // PID-18, with its issuer
  std::vector<std::string> prior = {};     // PV1-6 of ADT^A12: where they never were
  std::optional<UtcTime> discharged = {};  // PV1-45, where that is why they are gone (ADT^A08)
  bool swaps_beds = false;                 // ADT^A17
  bool cancels_departing = false;          // ADT^A33
  bool rebooks = false;                    // SIU^S13, which leaves what it does not state as it was
  /// Of SIU: it states what changes, by action codes of its resources or by its event (S18 to S22); else all
  /// the resources that it names are those that there are.
  bool is_update = false;
  bool adds_rooms = false;                  // of is_update: each room that it names is added
  std::vector<std::string> taken_out = {};  // of SIU: places that are the appointment's no more
  bool are_rooms_unclear = false;           // of SIU: it may be in fewer rooms than it was, or not
  bool takes_back = false;  // of who leaves: they never came, or their record is none: ADT^A11, A23, A29, A32
};

/// "ADT^A01", "SIU^S12".
bool is_of_procedures(const std::string& type);

/// A message that swaps (A17) or merges patients names several, and an appointment may be of several; beyond
/// so many the rest is not read.
inline constexpr std::size_t kMostPatients = 16;
/// Of ways to write a place; of more no further places are read.
inline constexpr std::size_t kMostPlaces = 256;

/// Whether the numbers by which it names the patient, and names them before, are among those that are kept:
/// not where one is too long.
bool has_its_numbers(const ProcedureMessage& message);
/// Whether both name an appointment by one number, of one who gives them: by its namespace, or where one of
/// them states none, its sender. Systems name it by either number, or by both. Nothing where the numbers
/// agree and it is not known who gave them.
std::optional<bool> same_number_of_appointment(const ProcedureMessage& a, const ProcedureMessage& b);

/// What the message says of each patient that it names, in its order; one that names nobody is one, too.
/// `message` must be of such a type; times without zone count as MSH-7 states, else by `assumed_zone`.
std::vector<ProcedureMessage> read_procedure_messages(const Hl7Message& message,
                                                      const AssumedZone& assumed_zone);

}  // namespace kiroku::recorder
