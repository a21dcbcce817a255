// Whose a CT, radiographs and a case are, by the numbers that they state: they are laid on each other, and
// nothing in the pictures shows that they are of two patients. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"

namespace kiroku::apps {

/// Patients' numbers, each once but for case and leading zeros; none where none is stated.
using PatientIds = std::vector<std::string>;

/// Of a folder of DICOM files, or of one series in it; none of what is no folder. kiroku::Error as
/// sim::find_dicom_series().
PatientIds patients_of_ct(const std::filesystem::path& ct, const std::string& series);
/// Of a DICOM file, or of those in a folder, as open_radiographs() takes them. kiroku::Error for one that is
/// damaged.
PatientIds patients_of_radiographs(const std::filesystem::path& path);
/// Whom the case was about at its end. None where nothing is sealed, or the identities do not open it.
PatientIds patients_of_case(const archive::CaseReader& recording, const crypto::AgeIdentities& identities);

/// But for case and leading zeros. Nothing where one of them is not known, or of one side's several numbers
/// some are the other's: nobody said which is meant.
std::optional<bool> are_of_one_patient(const PatientIds& one, const PatientIds& other);

/// What a person must know before `what` ("the radiographs") is laid on the CT: that they are of two
/// patients, or `what` of several. No number stands in it. Nothing where that is not so, or not known.
std::optional<std::string> patient_warning(const PatientIds& of_ct, const std::string& what,
                                           const PatientIds& of_what);

}  // namespace kiroku::apps
