// Whose CT a sealed plan was made on: whoever begins a case by a plan says it to the recorder, which compares
// it with whom the case is about. Patient data: never to be written where the case is not sealed. Functions
// are thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace kiroku::recorder {

inline constexpr std::size_t kMostPlanPatients = 8;
inline constexpr std::size_t kLongestPlanPatient = 256;

/// Patient IDs (0010,0020) that pictures of the CT state which the sealed plan `seal` (NAME.seal.json) lists,
/// each once; none where it is no DICOM or is not there, for one that is more than printable ASCII, and for
/// what is no seal. Reads of each file no more than what stands before the patient's number.
std::vector<std::string> patients_of_plan(const std::filesystem::path& seal);

}  // namespace kiroku::recorder
