// Radiographs as DICOM files: computed and digital radiography (CR, DX), angiography and fluoroscopy (XA, RF)
// and radiotherapy images (RT Image, DICOM PS3.3 A.17). Functions are thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "sim/drr/ct_projector.h"
#include "sim/drr/picture.h"
#include "sim/drr/projection_geometry.h"

namespace kiroku::sim {

/// Whether the file begins as DICOM files do.
bool is_dicom_file(const std::filesystem::path& file);

/// Light where much attenuates: as `stated` says how greater numbers look, else by Pixel Intensity
/// Relationship Sign (0028,1041) where it is there, else by Photometric Interpretation as films are looked
/// at, bone white. Intensities (Pixel Intensity Relationship LIN) become line integrals, -ln(I / greatest),
/// which are 0 at the lightest ray; all else is the stored numbers from 0 on, of a unit of their own.
/// kiroku::Error with the file's name for what is damaged, cut off, in colour, of several pictures, or
/// compressed in an unknown way.
ProjectionImage read_dicom_radiograph(const std::filesystem::path& file, std::optional<Polarity> stated = {});

/// Radiographs of one file, one after the other.
struct DicomRadiographs {
  std::vector<ProjectionImage> images;  // of one size
  /// Of each, since the first; empty where the file does not say.
  std::vector<double> times_s;
};
/// As read_dicom_radiograph(), of a file with one picture or several. Frame Time Vector (0018,1065), Frame
/// Time (0018,1063), Cine Rate (0018,0040) or Recommended Display Frame Rate (0008,2144), the first that is
/// there, says when they were taken. Intensities are compared with the lightest ray of all. kiroku::Error
/// also for several pictures in JPEG 2000, and for more than kMostRadiographPixels in all.
DicomRadiographs read_dicom_radiographs(const std::filesystem::path& file,
                                        std::optional<Polarity> stated = {});
/// As floats some 2 GB.
inline constexpr std::size_t kMostRadiographPixels = 500'000'000;

/// Where source and detector of an RT Image stood: RT Image SID, Radiation Machine SAD, Gantry Angle,
/// Isocenter Position, Image Plane Pixel Spacing and RT Image Position. Other radiographs do not say where
/// the patient was. kiroku::Error with the file's name for those, for what lacks (named), and for a patient
/// who did not lie head first and supine, a turned detector or a turned table.
GeometryDocument read_dicom_geometry(const std::filesystem::path& file);

}  // namespace kiroku::sim
