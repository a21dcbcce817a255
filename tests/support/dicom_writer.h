// DICOM files of pictures, made as small and as odd as a test needs them.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::test {

enum class DicomCompression { kNone, kRunLength, kJpegLossless, kJpegLs };

/// One picture. Members are what a CT scanner would write.
struct DicomSlice {
  std::string series_uid = "1.2.3.4", description = "thin", instance_uid = "1.2.3.4.1";
  std::uint16_t rows = 3, columns = 4;
  sim::Vector3 position_mm = {0, 0, 0}, along_row = {1, 0, 0}, down_column = {0, 1, 0};
  double row_spacing_mm = 1, column_spacing_mm = 1;
  double slope = 1, intercept = -1024;
  std::uint16_t bits_stored = 16;
  bool is_signed = true;
  std::vector<std::uint16_t> stored;  // (rows x columns)
  DicomCompression compression = DicomCompression::kNone;
  /// Further elements by "(gggg,eeee)" as DCMTK's dictionary knows them; an empty value removes the element.
  std::map<std::string, std::string> elements;
};

void write_dicom(const std::filesystem::path& file, const DicomSlice& slice);

}  // namespace kiroku::test
