#include "sim/drr/dicom_radiograph.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/length_unit.h"
#include "sim/volume/dicom_file.h"

namespace kiroku::sim {
namespace {

/// A machine states the angles of table and collimator with some noise.
constexpr double kTurnedDeg = 0.1;
constexpr double kMsPerS = 1000;

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

/// When each of several pictures was taken, since the first; empty where the header does not say.
std::vector<double> times_of(DcmDataset& dataset, DicomHeader& header, std::size_t frames) {
  std::vector<double> times_s(frames);
  Float64 step_ms = 0;
  if (dataset.findAndGetFloat64(DCM_FrameTimeVector, step_ms, frames - 1).good()) {
    // Each is the time since the picture before; the first is 0.
    for (std::size_t i = 1; i < frames; ++i) {
      if (dataset.findAndGetFloat64(DCM_FrameTimeVector, step_ms, i).bad() || !(step_ms > 0)) return {};
      times_s[i] = times_s[i - 1] + step_ms / kMsPerS;
    }
    return times_s;
  }
  double interval_s = header.optional_real(DCM_FrameTime).value_or(0) / kMsPerS;
  for (const DcmTagKey& rate : {DCM_CineRate, DCM_RecommendedDisplayFrameRate}) {
    Sint32 a_second = 0;
    const bool stated = dataset.findAndGetSint32(rate, a_second).good() && a_second > 0;
    if (!(interval_s > 0) && stated) interval_s = 1.0 / double(a_second);
  }
  if (!(interval_s > 0) && frames > 1) return {};
  for (std::size_t i = 0; i < frames; ++i) times_s[i] = double(i) * interval_s;
  return times_s;
}

DicomRadiographs read(const std::filesystem::path& file, std::optional<Polarity> stated, bool several) {
  DcmFileFormat dicom;
  open(dicom, file);
  DcmDataset& dataset = *dicom.getDataset();
  DicomHeader header(dataset);
  const std::string refused = "cannot read " + file.string();
  const std::size_t rows = header.count(DCM_Rows), columns = header.count(DCM_Columns);
  const PixelPacking packing = packing_of(header);
  if (!header.lacking().empty()) throw Error(refused + ": it lacks " + header.lacking());
  const std::int32_t frames = frames_of(dataset);
  if (rows == 0 || columns == 0 || frames < 1) throw Error(refused + ": it has no pixels");
  if (const std::string unread = unread_pixels(dataset, header, packing, several); !unread.empty()) {
    throw Error(refused + ": it" + unread);
  }
  const auto count = static_cast<std::size_t>(frames);
  const std::size_t pixels = rows * columns;
  if (count > kMostRadiographPixels / pixels) {
    throw Error(refused + ": its " + std::to_string(count) + " pictures have more than " +
                std::to_string(kMostRadiographPixels) + " pixels; split the file");
  }
  const E_TransferSyntax syntax = dataset.getOriginalXfer();
  if (count > 1 && (syntax == EXS_JPEG2000 || syntax == EXS_JPEG2000LosslessOnly)) {
    throw Error(
        refused + ": its " + std::to_string(count) +
        " pictures are compressed as JPEG 2000, which is read of single pictures only; decompress it");
  }
  const std::vector<std::int32_t> stored = stored_values(dataset, packing, columns, rows * count, refused);
  const auto [least, greatest] = std::ranges::minmax(stored);
  const bool grows = grows_with_attenuation(header, stated);
  const bool is_intensity = header.text(DCM_PixelIntensityRelationship) == "LIN";
  const double full_scale = double((1U << packing.stored) - 1);
  const auto arrived = [&](std::int32_t value) {
    // One step of the detector keeps the logarithm finite where no ray arrived.
    return std::max(1.0, grows ? full_scale - double(value) : double(value));
  };
  const double most_arrived = arrived(grows ? least : greatest);
  DicomRadiographs radiographs{{}, times_of(dataset, header, count)};
  for (std::size_t at = 0; at < count; ++at) {
    ProjectionImage image{columns, rows, {}};
    image.values.reserve(pixels);
    for (const std::int32_t value : std::span(stored).subspan(at * pixels, pixels)) {
      const double attenuation = is_intensity ? -std::log(arrived(value) / most_arrived)
                                 : grows      ? double(value) - double(least)
                                              : double(greatest) - double(value);
      image.values.push_back(static_cast<float>(attenuation));
    }
    radiographs.images.push_back(std::move(image));
  }
  return radiographs;
}

}  // namespace

bool is_dicom_file(const std::filesystem::path& file) { return begins_as_dicom(file); }

ProjectionImage read_dicom_radiograph(const std::filesystem::path& file, std::optional<Polarity> stated) {
  return std::move(read(file, stated, false).images.front());
}

DicomRadiographs read_dicom_radiographs(const std::filesystem::path& file, std::optional<Polarity> stated) {
  return read(file, stated, true);
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
