// A CT from whatever it is in: a folder of DICOM files, NIfTI, NRRD or MetaImage; and label maps. Functions
// are thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/volume/volume.h"

namespace kiroku::sim {

struct VolumeOptions {
  std::string series;     // of a DICOM folder: a UID, or how it ends; empty where there is one series
  bool resample = false;  // uneven gaps and a tilted gantry are resampled instead of refused
};

struct VolumeFile {
  Volume volume;
  std::string format;                        // "DICOM", "NIfTI", "NRRD", "MetaImage"
  std::string series_uid, patient_position;  // of DICOM; may be empty
  /// The SOP Instance UID of each slice along k; empty but for DICOM that was not resampled.
  std::vector<std::string> instance_uids;
  std::size_t padding_voxels = 0;  // nothing was measured there; they are kAirHu
  /// What a person should know, one sentence each.
  std::vector<std::string> findings;
};
/// kiroku::Error and its kin in one sentence for what cannot be read, see dicom_series.h and image_file.h.
VolumeFile read_volume(const std::filesystem::path& path, const VolumeOptions& options);

/// A segmentation: whole numbers from 0 to 65535. kiroku::Error for others. `findings` gets what a person
/// should know of how it lies in the patient.
LabelMap read_label_map(const std::filesystem::path& file, std::vector<std::string>* findings = nullptr);

struct HuRange {
  float least = 0, greatest = 0;
};
HuRange range_of(const Volume& volume);

}  // namespace kiroku::sim
