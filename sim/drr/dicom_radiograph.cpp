#include "sim/drr/dicom_radiograph.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/length_unit.h"
#include "sim/volume/dicom_file.h"

namespace kiroku::sim {
namespace {

/// A machine states the angles of table and collimator with some noise.
constexpr double kTurnedDeg = 0.1;

void open(DcmFileFormat& dicom, const std::filesystem::path& file) {
  if (!begins_as_dicom(file)) throw Error(no_dicom_file(file));
  load_dicom(dicom, file);
}

/// Whether a greater stored number stands for more attenuation.
bool grows_with_attenuation(DicomHeader& header, std::optional<Polarity> stated) {
  if (stated) return *stated == Polarity::kBoneWhite;
  if (const auto sign = header.stored(DCM_PixelIntensityRelationshipSign, true)) return *sign < 0;
  return header.text(DCM_PhotometricInterpretation) != "MONOCHROME1";
}

void refuse_turned(DicomHeader& header, const DcmTagKey& angle, const std::string& what,
                   const std::string& refused) {
  const double degrees = header.optional_real(angle).value_or(0);
  if (std::abs(std::remainder(degrees, 360)) > kTurnedDeg) {
    throw Error(refused + what + " is turned by " + number_text(degrees) +
                " degrees, which is not read; describe source and detector in a .json with a matrix");
  }
}

}  // namespace

bool is_dicom_file(const std::filesystem::path& file) { return begins_as_dicom(file); }

ProjectionImage read_dicom_radiograph(const std::filesystem::path& file, std::optional<Polarity> stated) {
  DcmFileFormat dicom;
  open(dicom, file);
  DcmDataset& dataset = *dicom.getDataset();
  DicomHeader header(dataset);
  const std::string refused = "cannot read " + file.string();
  const std::size_t rows = header.count(DCM_Rows), columns = header.count(DCM_Columns);
  const PixelPacking packing = packing_of(header);
  if (!header.lacking().empty()) throw Error(refused + ": it lacks " + header.lacking());
  if (rows == 0 || columns == 0) throw Error(refused + ": it has no pixels");
  if (const std::string unread = unread_pixels(dataset, header, packing); !unread.empty()) {
    throw Error(refused + ": it" + unread);
  }
  const std::vector<std::int32_t> stored = stored_values(dataset, packing, columns, rows, refused);
  const auto [least, greatest] = std::ranges::minmax(stored);
  const bool grows = grows_with_attenuation(header, stated);
  const bool is_intensity = header.text(DCM_PixelIntensityRelationship) == "LIN";
  ProjectionImage image{columns, rows, {}};
  image.values.reserve(stored.size());
  const double full_scale = double((1U << packing.stored) - 1);
  const auto arrived = [&](std::int32_t value) {
    // One step of the detector keeps the logarithm finite where no ray arrived.
    return std::max(1.0, grows ? full_scale - double(value) : double(value));
  };
  const double most_arrived = arrived(grows ? least : greatest);
  for (const std::int32_t value : stored) {
    const double attenuation = is_intensity ? -std::log(arrived(value) / most_arrived)
                               : grows      ? double(value) - double(least)
                                            : double(greatest) - double(value);
    image.values.push_back(static_cast<float>(attenuation));
  }
  return image;
}

GeometryDocument read_dicom_geometry(const std::filesystem::path& file) {
  DcmFileFormat dicom;
  open(dicom, file);
  DicomHeader header(*dicom.getDataset());
  const std::string refused = "cannot use " + file.string() + " as a geometry: ";
  if (const std::string modality = header.text(DCM_Modality); modality != "RTIMAGE") {
    throw Error(refused + "its modality is '" + modality +
                "'; only an RT Image (RTIMAGE) says where the patient was. Describe source and detector in a "
                ".json");
  }
  const std::array<double, 2> spacing = header.reals<2>(DCM_ImagePlanePixelSpacing);  // rows, columns
  const std::array<double, 2> first = header.reals<2>(DCM_RTImagePosition);
  const std::array<double, 3> isocenter = header.reals<3>(DCM_IsocenterPosition);
  GantrySetup setup;
  setup.source_axis_m = header.reals<1>(DCM_RadiationMachineSAD)[0] / kMmPerM;
  setup.source_imager_m = header.reals<1>(DCM_RTImageSID)[0] / kMmPerM;
  setup.gantry_deg = header.reals<1>(DCM_GantryAngle)[0];
  setup.pixels = {header.count(DCM_Columns), header.count(DCM_Rows)};
  if (!header.lacking().empty()) throw Error(refused + "it lacks " + header.lacking());
  const std::string position = header.text(DCM_PatientPosition);
  if (!position.empty() && position != "HFS") {
    throw Error(refused + "the patient lay '" + position + "'; only head first and supine (HFS) is read");
  }
  refuse_turned(header, DCM_PatientSupportAngle, "the table", refused);
  refuse_turned(header, DCM_XRayImageReceptorAngle, "the detector", refused);
  for (std::size_t i = 0; i < 3; ++i) setup.isocenter_m[Eigen::Index(i)] = isocenter[i] / kMmPerM;
  setup.size_m = {double(setup.pixels[0]) * spacing[1] / kMmPerM,
                  double(setup.pixels[1]) * spacing[0] / kMmPerM};
  // RT Image Position is the centre of the first pixel: to the patient's left at 0 degrees, and to the head.
  setup.offset_m = {(first[0] + double(setup.pixels[0] - 1) / 2 * spacing[1]) / kMmPerM,
                    (-first[1] + double(setup.pixels[1] - 1) / 2 * spacing[0]) / kMmPerM};
  try {
    return {ProjectionGeometry(setup), setup};
  } catch (const Error& error) {
    throw Error(refused + error.what());
  }
}

}  // namespace kiroku::sim
