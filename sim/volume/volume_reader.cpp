#include "sim/volume/volume_reader.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <system_error>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/volume/dicom_series.h"
#include "sim/volume/image_file.h"

namespace kiroku::sim {
namespace {

/// Beyond these a unit was mistaken, or the file holds something else.
constexpr double kLargestPatientM = 3, kSmallestPatientM = 0.005;
/// In any CT of a patient some air is.
constexpr float kHighestAirHu = -500;

/// kiroku::UsageError where nothing is there, kiroku::IoError where that cannot be told.
void require_there(const std::filesystem::path& path) {
  std::error_code failure, no_link;
  if (std::filesystem::status(path, failure).type() == std::filesystem::file_type::not_found) {
    const std::filesystem::path target = std::filesystem::read_symlink(path, no_link);
    if (no_link) throw UsageError("there is no " + path.string());
    throw UsageError("cannot read " + path.string() + ": it is a link to " + target.string() +
                     ", where nothing is; bring that back, or name what the link stood for");
  }
  if (failure) throw IoError("read", path, failure.value());
}

VolumeFile read_dicom_folder(const std::filesystem::path& folder, const VolumeOptions& options) {
  const DicomFolder found = find_dicom_series(folder);
  const DicomSeries& series = choose_series(found, options.series);
  DicomVolume read = read_dicom_series(series, options.resample);
  VolumeFile file;
  file.volume = std::move(read.volume);
  file.format = "DICOM";
  file.series_uid = series.uid;
  file.patient_position = series.pictures.front().patient_position;
  file.instance_uids = std::move(read.instance_uids);
  file.padding_voxels = read.padding_voxels;
  if (!read.resampled.empty()) file.findings.push_back("resampled to a regular grid: " + read.resampled);
  std::ranges::move(read.findings, std::back_inserter(file.findings));
  if (series.uid.empty())
    file.findings.emplace_back("the pictures have no SeriesInstanceUID; they were taken for one series");
  if (found.other_files > 0) {
    file.findings.push_back(std::to_string(found.other_files) +
                            (found.other_files == 1 ? " file of the folder is" : " files of the folder are") +
                            " no DICOM picture");
  }
  if (found.dead_links > 0)
    file.findings.push_back(dead_links_text(found) + "; what they stood for is left out");
  return file;
}

/// Of how it lies in the patient.
std::vector<std::string> findings_of(ImageFile& image) {
  std::vector<std::string> findings = std::move(image.findings);
  if (!image.placed) {
    findings.emplace_back(
        "the file does not say how it lies in the patient: its axes are taken for left, back and head");
  }
  return findings;
}

VolumeFile read_one_file(const std::filesystem::path& path) {
  ImageFile image = read_image_file(path);
  VolumeFile file;
  file.format = image.format;
  for (float& value : image.values) {
    if (std::isfinite(value) && static_cast<double>(value) > kPaddingHu) continue;
    value = kAirHu;
    ++file.padding_voxels;
  }
  file.volume = {image.grid, std::move(image.values)};
  file.findings = findings_of(image);
  return file;
}

void add_findings(VolumeFile& file) {
  const Grid& grid = file.volume.grid;
  const HuRange range = range_of(file.volume);
  if (file.padding_voxels > 0) {
    file.findings.push_back(std::to_string(file.padding_voxels) +
                            " voxels are padding, where nothing was measured; they are taken for air");
  }
  if (range.least > kHighestAirHu) {
    file.findings.push_back("its least value is " + number_text(static_cast<double>(range.least)) +
                            ": a CT in Hounsfield units has air near -1000");
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double length_m =
        static_cast<double>(grid.size[axis]) * grid.spacing_m[static_cast<Eigen::Index>(axis)];
    if (length_m < kLargestPatientM && length_m > kSmallestPatientM) continue;
    file.findings.push_back("it is " + number_text(length_m, 3) +
                            " m long along one of its axes; is its unit right?");
  }
  if (const double oblique_deg = oblique_angle_rad(grid) * 180 / std::numbers::pi; oblique_deg > 1) {
    file.findings.push_back("its axes are oblique, up to " + number_text(oblique_deg, 3) +
                            " degrees off the patient's");
  }
}

}  // namespace

VolumeFile read_volume(const std::filesystem::path& path, const VolumeOptions& options) {
  require_there(path);
  const bool folder = std::filesystem::is_directory(path);
  if (!folder && !is_image_file(path)) {
    throw UsageError("cannot read " + path.string() +
                     ": a volume is a folder of DICOM files, or a file ending in .nii, .nii.gz, .nrrd, "
                     ".nhdr, .mha or .mhd");
  }
  if (!folder && !options.series.empty()) {
    throw UsageError("cannot choose a series in " + path.string() +
                     ": only a folder of DICOM files has series");
  }
  VolumeFile file = folder ? read_dicom_folder(path, options) : read_one_file(path);
  add_findings(file);
  return file;
}

LabelMap read_label_map(const std::filesystem::path& file, std::vector<std::string>* findings) {
  require_there(file);
  ImageFile image = read_image_file(file);
  if (findings != nullptr) {
    for (const std::string& finding : findings_of(image))
      findings->push_back("labels " + file.filename().string() + ": " + finding);
  }
  LabelMap map{image.grid, {}};
  map.labels.reserve(image.values.size());
  for (const float value : image.values) {
    if (!(value >= 0 && value <= 65535 && value == std::floor(value))) {
      throw Error("cannot take " + file.string() + " for labels: it holds " +
                  number_text(static_cast<double>(value)) + "; labels are whole numbers from 0 to 65535");
    }
    map.labels.push_back(static_cast<std::uint16_t>(value));
  }
  return map;
}

HuRange range_of(const Volume& volume) {
  if (volume.hu.empty()) return {};
  const auto [least, greatest] = std::ranges::minmax(volume.hu);
  return {least, greatest};
}

}  // namespace kiroku::sim
