// What is known of a procedure before it begins: who, what, by whom, when it was planned. Values; functions
// are pure and thread-safe. All of it is patient data: it goes into sealed files and nowhere else.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/bytes.h"
#include "base/utc_time.h"
#include "recorder/vitals/patient_number.h"

namespace kiroku::recorder {

/// A person's name (HL7 XPN and XCN, DICOM PN), its parts in UTF-8.
struct PersonName {
  std::string family, given;  // given: with further ones, "John Q"
  std::string as_sent;        // whole: "Yamada^Tarou=山田^太郎=やまだ^たろう"
  [[nodiscard]] bool empty() const { return as_sent.empty(); }
  bool operator==(const PersonName&) const = default;
};

struct StaffMember {
  std::string
      role;  // as sent, or "attending", "surgeon", "performing", "requesting" after the field it came from
  std::string id;
  PersonName name;
  bool operator==(const StaffMember&) const = default;
};

/// Whatever is not known is empty.
struct ProcedureData {
  std::string patient_id, patient_id_issuer;
  PersonName patient;
  std::string birth_date;  // "1980-01-15", or less of it
  std::string sex;         // as sent: "M", "F", "O", …
  std::string visit;       // number of the visit or admission
  std::string description, code, coding_system;
  std::string procedure_id, accession, study_uid;
  std::string planned;  // "2026-08-05T09:15:00+02:00"; without zone where none was stated
  std::string location;
  std::vector<StaffMember> staff;

  std::string origin;  // "hl7", "worklist", "hl7+hl7": who said so
  std::string chosen;  // why these data and no others, one sentence
  /// All by which messages name the patient, where they say so: monitors may name them by another one. Not
  /// in the subject file.
  std::vector<PatientNumber> numbers = {};

  bool operator==(const ProcedureData&) const = default;
};

/// What `data` leaves empty, as `more` has it, which must be of the same patient.
void complete(ProcedureData& data, const ProcedureData& more);

/// Whether nothing says that they are two patients: the same number, and no two issuers or days of birth that
/// differ. Where neither has a number, the same name as it was sent; two without either may be anybody.
bool may_be_same_patient(const ProcedureData& one, const ProcedureData& other);

/// The subject file's text (docs/reference/format-streams.md): one JSON object, what is empty left out.
Bytes subject_json(const ProcedureData& data);
/// What a subject file says of patient and procedure, as far as it is written so.
ProcedureData data_of_subject(ByteView subject);
/// Whether nothing says that they are two procedures of two patients, or of one: accession number, study or
/// planned time tell two of one patient apart.
bool may_be_same_procedure(const ProcedureData& one, const ProcedureData& other);

/// Adds those of `more` that are not the same patient's same procedure as one that is there already.
void add_unknown(std::vector<ProcedureData>& list, std::vector<ProcedureData> more);
/// In the order of the planned times as they are written, what has none first; at most so many.
void order_by_plan(std::vector<ProcedureData>& list, std::size_t most);
/// Stands for a procedure while it says the same: 32 hexadecimal digits of a hash of all but `chosen`.
std::string key_of(const ProcedureData& data);

/// "2026-08-05" of "20260805", "2026-08" of "202608"; anything else as it is.
std::string iso_date(std::string_view digits);

/// What is planned further ahead of a case's beginning is not taken by itself: whoever lies there now is
/// hardly that patient.
inline constexpr std::chrono::hours kFurthestAhead{1};

/// Within which a time lies of which no more is said: a day, an hour.
struct TimeSpan {
  UtcTime earliest, latest;
  bool operator==(const TimeSpan&) const = default;
};
/// How near to `at` a time may lie of which no more is known than `within`; absent: nothing is.
UtcTime::duration least_distance(const std::optional<TimeSpan>& within, UtcTime at);

/// What is known of whoever something is planned for: nothing against it; nothing, but a case about them has
/// ended since, so that it keeps nobody waiting; a person must say whether it is still to come; or it is
/// over, or they have left since.
enum class Standing { kOpen, kRecorded, kDoubtful, kDone };
/// Of a procedure, and of when it is planned. Null: each is open.
using StandingOf = std::function<Standing(const ProcedureData& data, std::optional<UtcTime> planned)>;

/// Why nobody is taken by itself although somebody may be meant: a person chooses.
enum class Doubt {
  kNone,
  kTwoPlanned,       // two patients are planned equally near
  kSeveralThere,     // several were placed in the room, and none of them has left
  kMayBeGone,        // somebody came after the one who is left, and was seen off alone
  kLeftMeanwhile,    // somebody has left the room since the case began
  kToldLate,         // a message that came late says that they left, or are planned no more
  kTwoWays,          // messages and worklist name two patients
  kTooEarly,         // what is planned nearest lies more than kFurthestAhead ahead
  kTimeUnclear,      // an appointment or a step may be meant whose time is not stated, or cannot be read
  kLeftAlready,      // whoever is planned nearest left before, or what is planned was called off
  kRecordedAlready,  // what is planned nearest was recorded here, and its case was ended
  kOtherVisit,       // a message of another visit says that the patient left or is elsewhere
  kOneNumber,        // messages give the patient's number to somebody else, too
  kNobodyNamed,      // somebody left the room whom the message does not name
  kNotKept,          // more was told of this room than is kept, or it cannot be read any more
  kOneAppointment,   // messages use the number of what is planned nearest for somebody or something else, too
  kStatusUnclear,    // nobody can tell whether what is planned nearest is booked
  kEarlierOpen,      // what was planned before has neither been recorded, nor has its patient left
  kRecordElsewhere,  // a record says that whoever is in the room is elsewhere, and no event does
  kRecordAlone,      // a record says that somebody is in the room, and no event does
  kOnlyRegistered,   // whoever is there was registered there alone, and somebody else is planned
  kNewborn,          // whoever is there is newborn, and somebody left the room since they came
  kRegisteredElsewhere,  // whoever is in the room is registered elsewhere since, and did not go there
  kRoomUnclear,          // a change does not say whether what is planned nearest is in this room still
  kNotSeenOff,           // somebody else was there, or planned there, and nothing says that this is over
  kUnnamed,              // what is planned now names no patient
  kRecordAgainstPlan,    // a record alone says that somebody is there of whom no plan is known, and somebody
                         // else is planned
  kRecordedHere,         // a case about whoever is there ended since they came
};
/// Half a sentence without anything of a patient; "" of kNone.
std::string_view words_of(Doubt doubt);

/// What messages say against the patient whom they named for a case that runs.
enum class Objection {
  kNone,
  kOver,          // nothing, nor will they: the operation is done, or the patient has left as patients do
  kAnotherThere,  // somebody else is in the room
  kSeveralThere,  // somebody else is in the room, and the patient has not left it
  kTakenBack,     // what brought the patient there, or planned the operation, was called off
  kOtherIdentity  // the patient goes by another number, name or day of birth
};
/// A sentence without anything of a patient; "" of those that are none.
std::string_view words_of(Objection objection);

/// Whom a case is about, or why that is not known.
struct ProcedureChoice {
  std::optional<ProcedureData> data;
  Doubt doubt = Doubt::kNone;
  bool is_by_plan = false;  // nobody was placed in the room: it is planned
  /// Of whoever is there: since then a case that ended was of this stay.
  std::optional<UtcTime> stays_since = {};
};

/// What is planned nearest to a moment.
struct NearestPlan {
  std::optional<std::size_t> index;  // the last one of those that are equally near; absent: none is near
  bool is_far_ahead = false;         // by more than kFurthestAhead
  /// Those that are as near as that one, itself among them.
  std::vector<std::size_t> equally_near;
};
/// Of the times that are not further from `at` than `window`.
NearestPlan nearest(const std::vector<std::optional<UtcTime>>& times, UtcTime at,
                    std::chrono::nanoseconds window);

}  // namespace kiroku::recorder
