#include "apps/sim/compared_ct.h"

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <vector>

#include "apps/sim/sealed_files.h"
#include "base/error.h"
#include "recorder/vitals/patient_number.h"
#include "sim/plan/plan_files.h"
#include "sim/volume/dicom_series.h"
#include "sim/volume/image_file.h"
#include "viewer/playback/case_media.h"
#include "viewer/playback/case_subject.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

/// Names do not count: a CT may lie elsewhere, under another name.
std::vector<crypto::Sha256Digest> hashes_of_volume(const std::vector<SealedFile>& files) {
  std::vector<crypto::Sha256Digest> hashes;
  for (const SealedFile& file : files) {
    if (file.role == "volume") hashes.push_back(file.sha256);
  }
  std::ranges::sort(hashes);
  return hashes;
}

std::string without_blanks(const std::string& text) {
  constexpr const char* kBlanks = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(kBlanks);
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(kBlanks) + 1 - begin);
}

constexpr std::string_view kBetweenNumbers = ", ";

/// Of a folder of DICOM files, or of one series in it; several numbers one behind the other.
std::string number_of_ct(const fs::path& ct, const std::string& series) {
  std::error_code unknown;
  if (!fs::is_directory(ct, unknown)) return {};
  std::vector<std::string> numbers;
  const sim::DicomFolder folder = sim::find_dicom_series(ct);
  for (const sim::DicomSeries& each : folder.series) {
    if (!series.empty() && !each.uid.ends_with(series)) continue;
    for (const sim::DicomPicture& picture : each.pictures) {
      const std::string number = without_blanks(picture.patient_id);
      if (!number.empty() && std::ranges::find(numbers, number) == numbers.end()) numbers.push_back(number);
    }
  }
  std::string all;
  for (const std::string& number : numbers) all += (all.empty() ? "" : std::string(kBetweenNumbers)) + number;
  return all;
}

}  // namespace

std::optional<compare::ComparedCt> compared_ct(const ComparisonRequest& request, const PlanAtHand& at_hand) {
  compare::ComparedCt ct;
  ct.series = request.series.value_or("");
  const std::vector<crypto::Sha256Digest> of_plan = hashes_of_volume(at_hand.files.files);
  if (!request.volume) return of_plan.empty() ? std::nullopt : std::optional(std::move(ct));
  std::vector<SealedFile> asked;
  for (const sim::PlanFile& file : sim::files_of_volume(*request.volume, sim::data_file_of))
    asked.push_back(hashed(file.role, file.name, file.path));
  if (hashes_of_volume(asked) == of_plan) return ct;
  if (!of_plan.empty()) {
    throw UsageError(*request.volume +
                     " is another CT than the plan's: beside the recording it would be taken for what was "
                     "planned on; leave --volume out");
  }
  ct.of_plan = false;
  for (const SealedFile& file : asked) ct.files.push_back({file.role, file.name, file.bytes, file.sha256});
  return ct;
}

std::optional<bool> PatientNumbers::are_same() const {
  if (ct.empty() || of_case.empty()) return {};
  bool alike = false, other = false;
  for (std::size_t begin = 0; begin <= ct.size();) {
    const std::size_t end = std::min(ct.find(kBetweenNumbers, begin), ct.size());
    (recorder::read_alike(ct.substr(begin, end - begin), of_case) ? alike : other) = true;
    begin = end + kBetweenNumbers.size();
  }
  // Of a folder with CTs of several patients nobody said which one is meant.
  return alike && other ? std::nullopt : std::optional(alike);
}

PatientNumbers patient_numbers(const ComparisonRequest& request, const PlanAtHand& at_hand,
                               const archive::CaseReader& recording,
                               const crypto::AgeIdentities& identities) {
  PatientNumbers numbers;
  const fs::path ct = request.volume ? fs::path(*request.volume) : at_hand.plan.volume;
  try {
    if (!ct.empty()) numbers.ct = number_of_ct(ct, request.series.value_or(""));
    if (numbers.ct.empty()) return numbers;
    // Read for this alone: a case without a DICOM plan gives nothing of its patient away.
    const playback::CaseMedia media(archive::CaseReader::open(recording.folder()), identities);
    const auto subjects = playback::subjects_of(media);
    if (!subjects.empty()) numbers.of_case = without_blanks(subjects.back().patient_id);
  } catch (const Error&) {
    // Whoever may not open the subject learns nothing of it; a CT that cannot be read is told where it is
    // read.
  }
  return numbers;
}

}  // namespace kiroku::apps
