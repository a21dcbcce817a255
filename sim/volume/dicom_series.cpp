#include "sim/volume/dicom_series.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/volume/slice_stack.h"

namespace kiroku::sim {
namespace {

/// Positions are written with six decimals of a millimetre at most, directions with as many.
constexpr double kSamePlaceM = 1e-5;
constexpr double kSameDirection = 1e-3;

std::string title_of(const DicomSeries& series) {
  const DicomPicture& first = series.pictures.front();
  std::string title = (series.uid.empty() ? "without UID" : series.uid) + " (" +
                      std::to_string(series.pictures.size()) +
                      (series.pictures.size() == 1 ? " picture" : " pictures");
  if (!first.modality.empty()) title += ", " + first.modality;
  if (!first.series_description.empty()) title += ", '" + first.series_description + "'";
  return title + ")";
}

std::string list_of(const DicomFolder& folder) {
  std::string list;
  for (const DicomSeries& series : folder.series) list += (list.empty() ? "" : "; ") + title_of(series);
  return list;
}

/// A patient's name without what says nothing: "DOE^JOHN^^ " is "DOE^JOHN", in each of its writings.
std::string comparable_name(const std::string& text) {
  std::string out, writing;
  const auto take = [&] {
    while (!writing.empty() && (writing.back() == '^' || writing.back() == ' ')) writing.pop_back();
    const std::size_t begin = writing.find_first_not_of(' ');
    out += "=" + (begin == std::string::npos ? "" : writing.substr(begin));
    writing.clear();
  };
  for (const char c : text) c == '=' ? take() : writing.push_back(c);
  take();
  while (out.ends_with('=')) out.pop_back();
  return out;
}

void check_alike(const DicomSeries& series) {
  const DicomPicture& first = series.pictures.front();
  const auto differs = [&](const DicomPicture& other, const std::string& what) {
    throw Error("cannot read the series " + title_of(series) + ": " + other.file.filename().string() +
                " and " + first.file.filename().string() + " differ in " + what);
  };
  for (const DicomPicture& picture : series.pictures) {
    if (!picture.defect.empty()) {
      throw Error("cannot read the series in " + first.file.parent_path().string() + ": " + picture.defect);
    }
    // What stands there is a patient's, and is not told. One may have no number, two numbers or two names.
    constexpr std::array kOfOne{
        std::pair{&DicomPicture::patient_id, "whose they are (PatientID): they may be of two patients"},
        std::pair{&DicomPicture::patient_name, "whose they are (PatientName): they may be of two patients"},
        std::pair{&DicomPicture::study_uid, "their study (StudyInstanceUID)"},
        std::pair{&DicomPicture::frame_of_reference_uid,
                  "what their places count from (FrameOfReferenceUID)"}};
    for (const auto& [member, what] : kOfOne) {
      const bool is_same = member == &DicomPicture::patient_name
                               ? comparable_name(picture.*member) == comparable_name(first.*member)
                               : picture.*member == first.*member;
      if (!is_same) differs(picture, std::string(what) + "; keep those of one in a folder of their own");
    }
    if (picture.rows != first.rows || picture.columns != first.columns)
      differs(picture, "the number of pixels");
    if (std::abs(picture.row_spacing_m - first.row_spacing_m) > kSameDirection * first.row_spacing_m ||
        std::abs(picture.column_spacing_m - first.column_spacing_m) >
            kSameDirection * first.column_spacing_m) {
      differs(picture, "the size of pixels");
    }
    if ((picture.along_row - first.along_row).norm() > kSameDirection ||
        (picture.down_column - first.down_column).norm() > kSameDirection) {
      differs(picture, "their direction in the patient");
    }
  }
}

/// What is not measured in Hounsfield units must not be read as if it was: a PET has a slope and an
/// intercept, too.
void check_hounsfield(const DicomSeries& series, std::vector<std::string>& findings) {
  const std::string what = "cannot read the series " + title_of(series) + ": ";
  std::string unspecified;
  for (const DicomPicture& picture : series.pictures) {
    const std::string name = picture.file.filename().string();
    if (!picture.modality.empty() && picture.modality != "CT") {
      throw Error(what + name + " is no CT (Modality " + picture.modality +
                  "): its numbers are no Hounsfield units");
    }
    const std::string& type = picture.rescale_type;
    if (type.empty() || type == "HU") continue;
    // US is "unspecified", HU_MOD a CT that was changed by a program.
    if (type != "US" && type != "HU_MOD")
      throw Error(what + name + " holds no Hounsfield units (RescaleType " + type + ")");
    unspecified = type;
  }
  if (!unspecified.empty())
    findings.push_back("RescaleType is " + unspecified +
                       ": whether its values are Hounsfield units is not said");
}

/// Two acquisitions of one place, as of a breath held and let go, make every second slice another body's.
void check_acquisitions(const std::vector<DicomPicture>& sorted) {
  for (const auto& [member, tag] :
       {std::pair{&DicomPicture::acquisition, "AcquisitionNumber"},
        std::pair{&DicomPicture::temporal_position, "TemporalPositionIdentifier"}}) {
    std::map<std::string, std::size_t> counts;
    std::size_t runs = 0;
    const std::string* before = nullptr;
    for (const DicomPicture& picture : sorted) {
      const std::string& value = picture.*member;
      ++counts[value];
      if (before == nullptr || *before != value) ++runs;
      before = &value;
    }
    if (counts.size() < 2 || runs <= counts.size()) continue;
    throw Error("cannot read the series in " + sorted.front().file.parent_path().string() + ": pictures of " +
                std::to_string(counts.size()) + " acquisitions lie among each other (" + tag +
                "), as in a series of several phases; keep those of one");
  }
}

/// "2.5 mm" of 0.0025.
std::string in_millimetres(double metres) { return number_text(1000 * metres, 4) + " mm"; }

/// The least of a length that pictures state, nothing where none does.
std::optional<double> least_of(const std::vector<DicomPicture>& pictures,
                               std::optional<double> DicomPicture::*member) {
  std::optional<double> least;
  for (const DicomPicture& picture : pictures) {
    if (picture.*member && (!least || *(picture.*member) < *least)) least = picture.*member;
  }
  return least;
}

/// What says that pictures of the series are not here. A text where that is sure enough to refuse it.
std::string missing_of(const std::vector<DicomPicture>& sorted, double median_gap_m,
                       std::vector<std::string>& findings) {
  std::string refused;
  const auto stated = least_of(sorted, &DicomPicture::spacing_between_m);
  if (stated && median_gap_m > (1 + kMostUnevenness) * *stated) {
    refused = "its slices lie " + in_millimetres(median_gap_m) + " apart, and their headers say " +
              in_millimetres(*stated) + " (SpacingBetweenSlices): slices between them may be missing";
  }
  const auto thickness = least_of(sorted, &DicomPicture::thickness_m);
  if (thickness && median_gap_m > (1 + kMostUnevenness) * *thickness) {
    findings.push_back("its slices are " + in_millimetres(*thickness) + " thick and lie " +
                       in_millimetres(median_gap_m) + " apart: between them nothing was measured");
  }
  std::map<std::string, std::pair<std::int64_t, std::int64_t>> acquisitions;  // stated, here
  for (const DicomPicture& picture : sorted) {
    auto& [of_all, here] = acquisitions[picture.acquisition];
    of_all = std::max(of_all, picture.images_in_acquisition.value_or(0));
    ++here;
  }
  for (const auto& [number, counts] : acquisitions) {
    if (counts.second >= counts.first) continue;
    findings.push_back("its acquisition " + (number.empty() ? "" : number + " ") + "has " +
                       std::to_string(counts.first) + " pictures (ImagesInAcquisition), of which " +
                       std::to_string(counts.second) + " are here: some may be missing");
  }
  std::vector<std::int64_t> numbers;
  for (const DicomPicture& picture : sorted) {
    if (picture.instance_number) numbers.push_back(*picture.instance_number);
  }
  std::ranges::sort(numbers);
  if (numbers.size() == sorted.size() && std::ranges::adjacent_find(numbers) == numbers.end()) {
    const std::int64_t span = numbers.back() - numbers.front() + 1;
    if (span > static_cast<std::int64_t>(numbers.size()))
      findings.push_back("its pictures are numbered from " + std::to_string(numbers.front()) + " to " +
                         std::to_string(numbers.back()) + " (InstanceNumber), and " +
                         std::to_string(numbers.size()) + " are here: some may be missing");
  }
  return refused;
}

/// A hole that resampling would fill with what was never measured.
void tell_holes(const std::vector<DicomPicture>& sorted, const SliceStack& stack, double median_gap_m,
                const std::string& what, std::vector<std::string>& findings) {
  constexpr double kOneIsMissing = 1.5, kThreeAreMissing = 3.5;
  for (std::size_t slice = 1; slice < sorted.size(); ++slice) {
    const double gap_m = stack.normal().dot(stack.positions_m[slice] - stack.positions_m[slice - 1]);
    if (gap_m <= kOneIsMissing * median_gap_m) continue;
    const std::string where = "between " + sorted[slice - 1].file.filename().string() + " and " +
                              sorted[slice].file.filename().string() + " " + in_millimetres(gap_m) +
                              " were not measured";
    if (gap_m > kThreeAreMissing * median_gap_m)
      throw Error(what + ": " + where + ", where its slices lie " + in_millimetres(median_gap_m) +
                  " apart: too much is missing to be resampled over");
    findings.push_back(where + ": what is there was made up from the slices beside");
  }
}

void tell_lossy(const DicomSeries& series, std::vector<std::string>& findings) {
  const auto lossy = std::ranges::find_if(series.pictures, &DicomPicture::is_lossy);
  if (lossy == series.pictures.end()) return;
  findings.push_back("its pictures were compressed with loss" +
                     (lossy->lossy_ratio.empty() ? std::string() : ", 1 to " + lossy->lossy_ratio) +
                     " (LossyImageCompression): their values are not those that were measured");
}

/// Pictures sorted along their normal, and where they are.
SliceStack sorted_stack(std::vector<DicomPicture>& pictures) {
  const DicomPicture& first = pictures.front();
  SliceStack stack{
      first.columns,     first.rows, first.column_spacing_m, first.row_spacing_m, first.along_row,
      first.down_column, {}};
  const Vector3 normal = stack.normal();
  std::ranges::stable_sort(pictures, [&](const DicomPicture& a, const DicomPicture& b) {
    return normal.dot(a.position_m) < normal.dot(b.position_m);
  });
  for (const DicomPicture& picture : pictures) stack.positions_m.push_back(picture.position_m);
  for (std::size_t slice = 1; slice < pictures.size(); ++slice) {
    if (normal.dot(pictures[slice].position_m - pictures[slice - 1].position_m) < kSamePlaceM) {
      throw Error("cannot read the series in " + pictures[slice].file.parent_path().string() + ": " +
                  pictures[slice - 1].file.filename().string() + " and " +
                  pictures[slice].file.filename().string() +
                  " are at the same place, as in a series of several phases; keep one of each");
    }
  }
  return stack;
}

/// Reads what the pictures hold, one after another.
std::vector<float> read_slices(const std::vector<DicomPicture>& pictures, std::size_t& padding_voxels) {
  std::vector<float> hu;
  hu.reserve(pictures.size() * pictures.front().rows * pictures.front().columns);
  for (const DicomPicture& picture : pictures) {
    const DicomPixels pixels = read_dicom_pixels(picture);
    hu.insert(hu.end(), pixels.hu.begin(), pixels.hu.end());
    padding_voxels += pixels.padding;
  }
  return hu;
}

}  // namespace

DicomFolder find_dicom_series(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  DicomFolder found;
  found.path = folder;
  std::error_code failure, unknown;
  std::filesystem::recursive_directory_iterator walk(folder, failure);
  for (; !failure && walk != std::filesystem::recursive_directory_iterator(); walk.increment(failure)) {
    if (walk->is_regular_file(unknown)) {
      files.push_back(walk->path());
    } else if (walk->is_symlink(unknown) && !walk->exists(unknown)) {
      ++found.dead_links;
    }
  }
  if (failure) throw IoError("read the folder", folder, failure.value());
  std::ranges::sort(files);
  std::map<std::string, DicomSeries> by_uid;
  for (const std::filesystem::path& file : files) {
    std::optional<DicomPicture> picture = read_dicom_header(file);
    if (!picture) {
      ++found.other_files;
      continue;
    }
    DicomSeries& series = by_uid[picture->series_uid];
    series.uid = picture->series_uid;
    series.pictures.push_back(std::move(*picture));
  }
  for (auto& [uid, series] : by_uid) found.series.push_back(std::move(series));
  return found;
}

std::string dead_links_text(const DicomFolder& folder) {
  return std::to_string(folder.dead_links) +
         (folder.dead_links == 1 ? " link of the folder leads nowhere" : " links of the folder lead nowhere");
}

const DicomSeries& choose_series(const DicomFolder& folder, const std::string& wanted) {
  if (folder.series.empty()) {
    throw UsageError(
        "cannot read " + folder.path.string() + ": there is no DICOM picture among its " +
        std::to_string(folder.other_files) + " files" +
        (folder.dead_links > 0 ? "; " + dead_links_text(folder) + ": fetch what they stand for" : ""));
  }
  const DicomSeries* chosen = nullptr;
  std::size_t matching = 0;
  for (const DicomSeries& series : folder.series) {
    if (!wanted.empty() && !series.uid.ends_with(wanted)) continue;
    chosen = &series;
    if (++matching == 1 && series.uid == wanted) break;
  }
  if (matching == 1) return *chosen;
  const std::string begin = "cannot read " + folder.path.string() + ": ";
  if (matching == 0)
    throw UsageError(begin + "no series ends with '" + wanted + "'; there are " + list_of(folder));
  throw UsageError(
      begin + "it holds " + std::to_string(matching) +
      " series; choose one (--series) by its UID, of which the last digits are enough: " + list_of(folder));
}

DicomVolume read_dicom_series(const DicomSeries& series, bool resample) {
  check_alike(series);
  DicomVolume result;
  check_hounsfield(series, result.findings);
  tell_lossy(series, result.findings);
  std::vector<DicomPicture> pictures = series.pictures;
  const std::string what = "cannot read the series in " + pictures.front().file.parent_path().string();
  if (pictures.size() < 2) throw Error(what + ": one picture alone is no volume");
  const SliceStack stack = sorted_stack(pictures);
  check_acquisitions(pictures);
  const Irregularity irregularity = irregularity_of(stack);
  if (!irregularity.text.empty() && !resample) {
    std::string stated;
    if (irregularity.tilted && pictures.front().gantry_tilt_deg) {
      stated = " (the header says " + number_text(*pictures.front().gantry_tilt_deg, 3) + ")";
    }
    throw Error(what + ": " + irregularity.text + stated + "; they can be resampled (--resample)");
  }
  const std::string missing = missing_of(pictures, irregularity.median_gap_m, result.findings);
  if (!missing.empty() && !resample)
    throw Error(what + ": " + missing + "; if they are all there, take them as they lie (--resample)");
  if (!missing.empty()) result.findings.push_back(missing);
  if (irregularity.uneven) tell_holes(pictures, stack, irregularity.median_gap_m, what, result.findings);
  Grid grid = regular_grid(stack);
  make_sound(grid, what);
  std::vector<float> hu = read_slices(pictures, result.padding_voxels);
  if (!irregularity.text.empty()) {
    result.volume = resampled_stack(stack, hu);
    make_sound(result.volume.grid, what);
    result.resampled = irregularity.text;
    return result;
  }
  result.volume = {grid, std::move(hu)};
  for (const DicomPicture& picture : pictures) result.instance_uids.push_back(picture.instance_uid);
  return result;
}

}  // namespace kiroku::sim
