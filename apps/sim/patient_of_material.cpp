#include "apps/sim/patient_of_material.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/trimmed.h"
#include "recorder/vitals/patient_number.h"
#include "sim/drr/dicom_radiograph.h"
#include "sim/volume/dicom_picture.h"
#include "sim/volume/dicom_series.h"
#include "viewer/playback/case_media.h"
#include "viewer/playback/case_subject.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

void add(PatientIds& ids, const std::string& id) {
  if (id.empty()) return;
  if (std::ranges::none_of(ids, [&](const std::string& each) { return recorder::read_alike(each, id); }))
    ids.push_back(id);
}

}  // namespace

PatientIds patients_of_ct(const fs::path& ct, const std::string& series) {
  PatientIds ids;
  std::error_code unknown;
  if (!fs::is_directory(ct, unknown)) return ids;
  const sim::DicomFolder folder = sim::find_dicom_series(ct);
  for (const sim::DicomSeries& each : folder.series) {
    if (!series.empty() && !each.uid.ends_with(series)) continue;
    for (const sim::DicomPicture& picture : each.pictures) add(ids, picture.patient_id);
  }
  return ids;
}

PatientIds patients_of_radiographs(const fs::path& path) {
  PatientIds ids;
  std::error_code unknown;
  if (!fs::is_directory(path, unknown)) {
    add(ids, sim::patient_of_dicom(path));
    return ids;
  }
  for (const auto& entry : fs::directory_iterator(path))
    if (entry.is_regular_file()) add(ids, sim::patient_of_dicom(entry.path()));
  std::ranges::sort(ids);
  return ids;
}

PatientIds patients_of_case(const archive::CaseReader& recording, const crypto::AgeIdentities& identities) {
  PatientIds ids;
  try {
    const playback::CaseMedia media(archive::CaseReader::open(recording.folder()), identities);
    const auto subjects = playback::subjects_of(media);
    if (!subjects.empty()) add(ids, std::string(trimmed(subjects.back().patient_id)));
  } catch (const Error&) {
    // Whoever may not open the subject learns nothing of it.
  }
  return ids;
}

std::optional<bool> are_of_one_patient(const PatientIds& one, const PatientIds& other) {
  if (one.empty() || other.empty()) return {};
  bool alike = false, differs = false;
  for (const std::string& a : one)
    for (const std::string& b : other) (recorder::read_alike(a, b) ? alike : differs) = true;
  return alike && differs ? std::nullopt : std::optional(alike);
}

std::optional<std::string> patient_warning(const PatientIds& of_ct, const std::string& what,
                                           const PatientIds& of_what) {
  if (of_what.size() > 1) {
    return what + " are of " + std::to_string(of_what.size()) +
           " patients, by the patient numbers that they state";
  }
  if (are_of_one_patient(of_ct, of_what).value_or(true)) return {};
  return what + " and the CT are of two patients, by the patient numbers that they state";
}

}  // namespace kiroku::apps
