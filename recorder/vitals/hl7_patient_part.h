// Of which patient and place a message speaks: one gateway may send for every bed of a hospital, and HL7 lets
// one message hold the observations of several patients. Pure functions, thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "recorder/vitals/hl7_message.h"
#include "recorder/vitals/patient_number.h"

namespace kiroku::recorder {

/// Whether CX-5 says that a number is an account's or a visit's.
bool is_type_of_account(const std::string& type);
/// Of a list of identifiers (CX) the medical record number where one is said to be that, else the first that
/// is not said to be an account's, else the first; `older` (PID-2, MRG-4, before v2.3) where the list is
/// empty.
Hl7Field chosen_identifier(const Hl7Field& list, const Hl7Field& older);
/// What a component says before its first '&': the namespace of an issuer.
std::string first_subcomponent(const Hl7Field& component, const Hl7Separators& separators);

/// A number as CX has it; `is_of_account` where the field says so, whatever CX-5 does.
PatientNumber number_of(const Hl7Field& cx, bool is_of_account, const Hl7Separators& separators);
/// Adds those of a list of identifiers.
void take_numbers(std::vector<PatientNumber>& into, const Hl7Field& list, bool is_of_account,
                  const Hl7Separators& separators);
/// All of PID-3, PID-2 and PID-18, the chosen_identifier() first: of many some are not kept.
std::vector<PatientNumber> numbers_of(const Hl7Segment& pid, const Hl7Separators& separators);

/// The segments of one patient.
struct PatientPart {
  std::size_t begin = 0, end = 0;  // of Hl7Message::segments()
  /// Point of care, room and bed of PV1-3, or of PV1-11 where PV1-3 names none: "SURG^OR1", "^^ICU&BED9"; ""
  /// where neither does.
  std::string place;
  /// Every way to write the places of PV1-3 and PV1-11: components, their subcomponents, and all of them
  /// joined.
  std::vector<std::string> spellings;
  std::string patient, issuer;  // chosen_identifier() of PID-3 and PID-2: to be compared, never to be told
  std::vector<PatientNumber> numbers;  // likewise: all of them
  bool observes = false;               // holds an OBX
};

/// In their order, together all of the message; one at least. A part begins with a PID, or with a PV1 behind
/// observations or another PV1.
std::vector<PatientPart> patient_parts(const Hl7Message& message);

/// Which places' messages are taken. Immutable; thread-safe.
class PlaceList {
 public:
  /// Takes every place.
  PlaceList() = default;
  /// Places as PatientPart::spellings has them, upper and lower case alike; several separated by commas, with
  /// %26 for '&', %2C for ',' and %25 for '%'. Throws kiroku::UsageError, naming `source`, for a list with an
  /// empty place.
  static PlaceList parse(std::string_view text, const std::string& source);
  [[nodiscard]] bool takes_all() const { return places_.empty(); }
  [[nodiscard]] bool takes(const PatientPart& part) const;

 private:
  std::vector<std::string> places_;  // in lower case
};

}  // namespace kiroku::recorder
