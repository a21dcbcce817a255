#include "sim/align/lens_file.h"

#include <algorithm>
#include <initializer_list>
#include <opencv2/core.hpp>
#include <vector>

#include "base/error.h"

namespace kiroku::sim {
namespace {

constexpr const char* kWhatItIs =
    "a calibration as OpenCV writes it has camera_matrix, distortion_coefficients, image_width and "
    "image_height";

/// By its name in OpenCV's programs of today, or of version 2.
cv::FileNode node_of(const cv::FileStorage& file, std::initializer_list<const char*> keys,
                     const std::string& name) {
  for (const char* const key : keys) {
    const cv::FileNode node = file[key];
    if (!node.empty()) return node;
  }
  throw UsageError(name + " has no '" + *keys.begin() + "': " + kWhatItIs);
}

cv::Mat_<double> matrix_of(const cv::FileStorage& file, std::initializer_list<const char*> keys,
                           const std::string& name) {
  cv::Mat read;
  node_of(file, keys, name) >> read;
  if (read.empty() || read.dims != 2 || read.channels() != 1)
    throw UsageError(name + ": '" + *keys.begin() + "' is no matrix of numbers: " + kWhatItIs);
  cv::Mat_<double> matrix;
  read.convertTo(matrix, CV_64F);
  return matrix;
}

int count_of(const cv::FileStorage& file, std::initializer_list<const char*> keys, const std::string& name) {
  const cv::FileNode node = node_of(file, keys, name);
  if (!node.isInt()) throw UsageError(name + ": '" + *keys.begin() + "' is no whole number");
  return static_cast<int>(node);
}

void take_camera(const cv::Mat_<double>& matrix, const std::string& name, LensCalibration& into) {
  if (matrix.rows != 3 || matrix.cols != 3)
    throw UsageError(name + ": 'camera_matrix' has " + std::to_string(matrix.rows) + " rows of " +
                     std::to_string(matrix.cols) + " numbers instead of three of three");
  into.focal_px = {matrix(0, 0), matrix(1, 1)};
  into.middle_px = {matrix(0, 2), matrix(1, 2)};
  if (matrix(0, 1) != 0 || matrix(1, 0) != 0 || matrix(2, 0) != 0 || matrix(2, 1) != 0 || matrix(2, 2) != 1)
    throw UsageError(name +
                     ": 'camera_matrix' is not that of a camera with a row fx 0 cx, a row 0 fy cy and a "
                     "row 0 0 1");
}

void take_distortion(const cv::Mat_<double>& matrix, const std::string& name, LensCalibration& into) {
  const std::size_t count = matrix.total();
  constexpr std::size_t kWithoutK3 = 4;
  const bool is_fisheye = into.model == LensModel::kFisheye;
  if ((matrix.rows != 1 && matrix.cols != 1) || count < kWithoutK3 || (is_fisheye && count != kWithoutK3))
    throw UsageError(name + ": 'distortion_coefficients' has " + std::to_string(count) + " numbers: " +
                     (is_fisheye ? "a fisheye has k1, k2, k3 and k4" : "k1, k2, p1, p2 and k3 are needed"));
  for (std::size_t i = 0; i < count; ++i) {
    const double value = *(matrix.begin() + static_cast<std::ptrdiff_t>(i));
    if (i < into.coefficients.size()) {
      into.coefficients[i] = value;
    } else if (value != 0) {
      throw UsageError(name + " has a distortion of " + std::to_string(count) +
                       " coefficients (rational, thin prism or tilted), of which only k1, k2, p1, p2 and k3 "
                       "are understood: calibrate without these models");
    }
  }
}

LensCalibration taken(const cv::FileStorage& file, const std::string& name) {
  LensCalibration lens;
  const cv::FileNode fisheye = file["fisheye_model"];
  if (!fisheye.empty() && !fisheye.isInt() && !fisheye.isReal())
    throw UsageError(name + " has a fisheye_model that is no number: 1 where it is of that model, else 0");
  if (!fisheye.empty() && static_cast<double>(fisheye) != 0) lens.model = LensModel::kFisheye;
  take_camera(matrix_of(file, {"camera_matrix", "Camera_Matrix"}, name), name, lens);
  take_distortion(matrix_of(file, {"distortion_coefficients", "Distortion_Coefficients"}, name), name, lens);
  lens.width = count_of(file, {"image_width", "image_Width"}, name);
  lens.height = count_of(file, {"image_height", "image_Height"}, name);
  return lens;
}

}  // namespace

LensCalibration read_lens_calibration(std::string_view text, const std::string& name) {
  try {
    const cv::FileStorage file(std::string(text), cv::FileStorage::READ | cv::FileStorage::MEMORY);
    if (file.isOpened()) return taken(file, name);
  } catch (const cv::Exception&) {
    // OpenCV's word for what is none of its files; it tells neither the file nor what to do.
  }
  throw UsageError(name + " cannot be read as YAML, XML or JSON of OpenCV's FileStorage: " + kWhatItIs);
}

std::string lens_calibration_text(const LensCalibration& lens, double rms_px, std::size_t pictures,
                                  const std::string& form) {
  cv::FileStorage file(form, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  const bool is_fisheye = lens.model == LensModel::kFisheye;
  const cv::Matx33d camera(lens.focal_px.x(), 0, lens.middle_px.x(), 0, lens.focal_px.y(), lens.middle_px.y(),
                           0, 0, 1);
  const std::vector<double> distortion(lens.coefficients.begin(),
                                       lens.coefficients.end() - (is_fisheye ? 1 : 0));
  file << "image_width" << lens.width << "image_height" << lens.height;
  file << "nr_of_frames" << static_cast<int>(pictures);
  file << "fisheye_model" << (is_fisheye ? 1 : 0);
  file << "camera_matrix" << cv::Mat(camera) << "distortion_coefficients" << cv::Mat(distortion);
  file << "avg_reprojection_error" << rms_px;
  return file.releaseAndGetString();
}

}  // namespace kiroku::sim
