// Radiologists' contours as a region: the XML of the Lung Image Database Consortium (Armato et al., "The Lung
// Image Database Consortium (LIDC) and Image Database Resource Initiative (IDRI)", Medical Physics 38(2),
// 2011). Functions are thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sim/volume/volume_reader.h"

namespace kiroku::sim {

/// A nodule's outline on one slice. The points are pixels just outside the nodule (or, with `inclusion`
/// false, just outside a hole in it), as columns and rows from 0.
struct Contour {
  std::string instance_uid;  // of the slice
  bool inclusion = true;
  std::vector<std::array<int, 2>> points;
};
/// All of one radiologist.
struct Reading {
  std::vector<Contour> contours;
};
struct ContourFile {
  std::string series_uid;
  std::vector<Reading> readings;
  std::size_t points_alone = 0;  // marks of a single point, as small nodules have; they enclose nothing
};
/// kiroku::Error with the file's name (and line, where the XML is broken).
ContourFile read_contours(const std::filesystem::path& file);
/// `name` stands in errors.
ContourFile parse_contours(const std::string& xml, const std::string& name);

/// Voxels that at least half of the radiologists took for nodule: offsets into the volume's grid, ascending.
/// kiroku::Error where the volume's slices are not DICOM pictures, or not those of the contours.
std::vector<std::size_t> voxels_within(const ContourFile& contours, const VolumeFile& volume);

}  // namespace kiroku::sim
