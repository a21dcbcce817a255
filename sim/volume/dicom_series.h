// A folder of DICOM files as series, and one series as a volume. Functions are thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/volume/dicom_picture.h"
#include "sim/volume/volume.h"

namespace kiroku::sim {

/// Pictures under one Series Instance UID, in the order of their file names.
struct DicomSeries {
  std::string uid;  // empty where files have none
  std::vector<DicomPicture> pictures;
};

struct DicomFolder {
  std::filesystem::path path;
  std::vector<DicomSeries> series;  // ascending by UID
  std::size_t other_files = 0;      // no DICOM, or without a picture
  std::size_t dead_links = 0;       // that lead nowhere, as where a picture was not fetched
};
/// All files of the folder and of the folders in it. kiroku::Error for a damaged file, with its name;
/// kiroku::IoError for a folder that cannot be read.
DicomFolder find_dicom_series(const std::filesystem::path& folder);
/// "1 link of the folder leads nowhere", "3 links of the folder lead nowhere".
std::string dead_links_text(const DicomFolder& folder);

/// The series whose UID is or ends with `wanted`, or the only one where that is empty. kiroku::UsageError
/// with the list of them where that is not one.
const DicomSeries& choose_series(const DicomFolder& folder, const std::string& wanted);

struct DicomVolume {
  Volume volume;
  /// The SOP Instance UID of each slice along k; empty for a resampled volume, whose slices are no files.
  std::vector<std::string> instance_uids;
  std::size_t padding_voxels = 0;
  /// What was resampled, in words; empty where nothing was.
  std::string resampled;
  /// What the headers say that a person should know, one sentence each.
  std::vector<std::string> findings;
};
/// kiroku::Error in one sentence for: pictures that cannot be used (the first is named, with the tags it
/// lacks), patients, studies, frames of reference, sizes or directions that differ, two pictures at one
/// place, a single picture, pictures of no CT or whose numbers are none of HU, acquisitions that lie among
/// each other, more than two slices missing in one place; and for uneven gaps, slices that lie wider apart
/// than their headers say, and a tilted gantry, with the numbers, unless `resample`.
DicomVolume read_dicom_series(const DicomSeries& series, bool resample);

}  // namespace kiroku::sim
