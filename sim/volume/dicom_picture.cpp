#include "sim/volume/dicom_picture.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <system_error>

#include "base/error.h"
#include "base/trimmed.h"
#include "sim/volume/dicom_file.h"
#include "sim/volume/volume.h"

namespace kiroku::sim {
namespace {

bool is_unit(const Vector3& direction) { return std::abs(direction.norm() - 1) < 0.01; }

std::string defect_of(const DicomPicture& picture, const PixelPacking& packing, DcmDataset& dataset,
                      DicomHeader& header) {
  const std::string name = picture.file.filename().string();
  if (!header.lacking().empty()) return name + " lacks " + header.lacking();
  if (const std::string unread = unread_pixels(dataset, header, packing); !unread.empty())
    return name + unread;
  if (picture.rows == 0 || picture.columns == 0) return name + " has no pixels";
  if (!(picture.row_spacing_m > 0 && picture.column_spacing_m > 0))
    return name + " has a PixelSpacing that is not positive";
  if (!is_unit(picture.along_row) || !is_unit(picture.down_column) ||
      std::abs(picture.along_row.dot(picture.down_column)) > 0.01) {
    return name + " has an ImageOrientationPatient that is no pair of unit vectors at right angles";
  }
  if (picture.slope == 0) return name + " has a RescaleSlope of 0";
  return {};
}

/// Nothing for what is no length.
std::optional<double> in_metres(const std::optional<double>& millimetres) {
  return millimetres && *millimetres > 0 ? std::optional(*millimetres / 1000) : std::nullopt;
}

/// Of an integer string (PS3.5, 6.2): nothing for what is none.
std::optional<std::int64_t> whole(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" +");
  if (begin == std::string::npos) return {};
  std::int32_t number = 0;
  const auto read = std::from_chars(text.data() + begin, text.data() + text.size(), number);
  return read.ec == std::errc() ? std::optional<std::int64_t>(number) : std::nullopt;
}

/// What pads a number is no part of it (PS3.5, 6.2).
std::string patient_in(DicomHeader& header) { return std::string(trimmed(header.text(DCM_PatientID))); }

Vector3 vector_of(const double* values) { return {values[0], values[1], values[2]}; }

}  // namespace

std::optional<DicomPicture> read_dicom_header(const std::filesystem::path& file) {
  if (!begins_as_dicom(file)) {
    if (file.extension() == ".dcm" || file.extension() == ".DCM") {
      throw Error(no_dicom_file(file));
    }
    return std::nullopt;
  }
  DcmFileFormat dicom;
  load_dicom(dicom, file);
  DcmDataset& dataset = *dicom.getDataset();
  if (!dataset.tagExists(DCM_PixelData)) {
    // Cut off between two elements, a file looks whole.
    OFString kind;
    dicom.getMetaInfo()->findAndGetOFString(DCM_MediaStorageSOPClassUID, kind);
    if (kind == UID_CTImageStorage)
      throw Error("cannot read " + file.string() + ": it is a CT picture without pixels, or cut off");
    return std::nullopt;
  }
  DicomHeader header(dataset);
  DicomPicture picture;
  picture.file = file;
  picture.series_uid = header.text(DCM_SeriesInstanceUID);
  picture.series_description = header.text(DCM_SeriesDescription);
  picture.modality = header.text(DCM_Modality);
  picture.instance_uid = header.text(DCM_SOPInstanceUID);
  picture.patient_position = header.text(DCM_PatientPosition);
  picture.patient_id = patient_in(header);
  picture.patient_name = header.text(DCM_PatientName);
  picture.study_uid = header.text(DCM_StudyInstanceUID);
  picture.frame_of_reference_uid = header.text(DCM_FrameOfReferenceUID);
  picture.rows = header.count(DCM_Rows);
  picture.columns = header.count(DCM_Columns);
  picture.position_m = vector_of(header.reals<3>(DCM_ImagePositionPatient).data()) / 1000;
  const std::array<double, 6> orientation = header.reals<6>(DCM_ImageOrientationPatient);
  picture.along_row = vector_of(orientation.data());
  picture.down_column = vector_of(orientation.data() + 3);
  // The first is the distance between rows (PS3.3 10.7.1.3).
  const std::array<double, 2> spacing = header.reals<2>(DCM_PixelSpacing);
  picture.row_spacing_m = spacing[0] / 1000;
  picture.column_spacing_m = spacing[1] / 1000;
  picture.slope = header.reals<1>(DCM_RescaleSlope)[0];
  picture.intercept = header.reals<1>(DCM_RescaleIntercept)[0];
  picture.gantry_tilt_deg = header.optional_real(DCM_GantryDetectorTilt);
  picture.rescale_type = header.text(DCM_RescaleType);
  picture.acquisition = header.text(DCM_AcquisitionNumber);
  picture.temporal_position = header.text(DCM_TemporalPositionIdentifier);
  picture.is_lossy = header.text(DCM_LossyImageCompression) == "01";
  picture.lossy_ratio = header.text(DCM_LossyImageCompressionRatio);
  picture.spacing_between_m = in_metres(header.optional_real(DCM_SpacingBetweenSlices));
  picture.thickness_m = in_metres(header.optional_real(DCM_SliceThickness));
  picture.images_in_acquisition = whole(header.text(DCM_ImagesInAcquisition));
  picture.instance_number = whole(header.text(DCM_InstanceNumber));
  const PixelPacking packing = packing_of(header);
  if (const auto padding = header.stored(DCM_PixelPaddingValue, packing.is_signed)) {
    const std::int32_t limit =
        header.stored(DCM_PixelPaddingRangeLimit, packing.is_signed).value_or(*padding);
    picture.padding = {std::min(*padding, limit), std::max(*padding, limit)};
  }
  picture.defect = defect_of(picture, packing, dataset, header);
  return picture;
}

std::string patient_of_dicom(const std::filesystem::path& file) {
  if (!begins_as_dicom(file)) return {};
  DcmFileFormat dicom;
  load_dicom(dicom, file);
  DicomHeader header(*dicom.getDataset());
  return patient_in(header);
}

DicomPixels read_dicom_pixels(const DicomPicture& picture) {
  const std::string what = "cannot read " + picture.file.string();
  DcmFileFormat dicom;
  load_dicom(dicom, picture.file);
  DicomHeader header(*dicom.getDataset());
  const std::vector<std::int32_t> stored =
      stored_values(*dicom.getDataset(), packing_of(header), picture.columns, picture.rows, what);
  DicomPixels pixels;
  pixels.hu.reserve(stored.size());
  for (const std::int32_t value : stored) {
    const double hu = picture.slope * value + picture.intercept;
    const bool is_padding = hu <= kPaddingHu || (picture.padding && value >= (*picture.padding)[0] &&
                                                 value <= (*picture.padding)[1]);
    if (is_padding) ++pixels.padding;
    pixels.hu.push_back(is_padding ? kAirHu : static_cast<float>(hu));
  }
  return pixels;
}

}  // namespace kiroku::sim
