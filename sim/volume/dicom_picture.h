// One DICOM file with one CT picture: what its header says, and its pixels as Hounsfield units (DICOM PS3.3
// C.7.6.2, C.7.6.3, C.8.2.1). DCMTK reads the files, OpenJPEG their JPEG 2000 pictures. Functions are
// thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

struct DicomPicture {
  std::filesystem::path file;
  std::string series_uid, series_description, modality, instance_uid, patient_position;
  std::string patient_id, patient_name, study_uid, frame_of_reference_uid;  // empty where it says none
  std::size_t rows = 0, columns = 0;
  Vector3 position_m = Vector3::Zero();  // centre of the first pixel, patient LPS
  Vector3 along_row = Vector3::UnitX(), down_column = Vector3::UnitY();  // unit vectors
  double column_spacing_m = 0, row_spacing_m = 0;                        // between columns; between rows
  double slope = 1, intercept = 0;                                       // HU = slope * stored + intercept
  std::optional<double> gantry_tilt_deg;
  // What the scanner says of the series. Empty, or nothing, where it says none.
  std::string rescale_type, acquisition, temporal_position, lossy_ratio;
  bool is_lossy = false;
  std::optional<double> spacing_between_m, thickness_m;
  std::optional<std::int64_t> images_in_acquisition, instance_number;
  /// Stored values that mean that nothing was measured there: from the first to the second.
  std::optional<std::array<std::int32_t, 2>> padding;
  /// Why its pixels can't be used; empty if they can. "1-003.dcm lacks PixelSpacing (0028,0030)".
  std::string defect;
};

/// Nothing for what is no DICOM file, and for DICOM files without a picture (reports, structures,
/// directories). kiroku::Error where a file is damaged or cut off, with its name: also where one that ends in
/// .dcm is no DICOM file, and a CT picture has no pixels.
std::optional<DicomPicture> read_dicom_header(const std::filesystem::path& file);

/// PatientID (0010,0020) of a DICOM file of any kind, without blanks around it; empty where it states none
/// and for what is no DICOM file. kiroku::Error where it is damaged or cut off.
std::string patient_of_dicom(const std::filesystem::path& file);

struct DicomPixels {
  std::vector<float> hu;  // (columns x rows), rows from the top; padding is kAirHu already
  std::size_t padding = 0;
};
/// kiroku::Error for a compression that is not known (named), and for damaged or missing pixels.
DicomPixels read_dicom_pixels(const DicomPicture& picture);

/// At and below it a value is padding whether or not the file says so: nothing is that thin.
inline constexpr double kPaddingHu = -2000;

}  // namespace kiroku::sim
