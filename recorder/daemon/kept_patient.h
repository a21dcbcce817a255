// Whom the case of a room is about, as monitors, plans and procedure data name them: kept for the recorder's
// next process in memory alone (kept_memory.h), as what it finds of that case is sealed. Patient data. Pure
// functions, thread-safe.
#pragma once

#include <string>
#include <vector>

#include "base/bytes.h"
#include "recorder/vitals/patient_number.h"

namespace kiroku::recorder {

struct KeptPatient {
  std::string case_id;
  std::string sealed_subject;  // SHA-256 of the case's newest one, in hexadecimal: they are that patient's
  std::vector<PatientNumber> numbers;
  std::vector<std::string> plan_patients;
  std::string about;  // that subject, as far as procedure data say it: JSON as of subject_json(), or ""
};

Bytes kept_bytes(const KeptPatient& kept);
/// Nothing of anybody where it is none.
KeptPatient read_kept_patient(ByteView bytes);

}  // namespace kiroku::recorder
