#include "sim/drr/projection_geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/length_unit.h"
#include "sim/model/body_model.h"
#include "sim/model/json_field.h"

namespace kiroku::sim {
namespace {

/// Beyond the largest room, and below any machine.
constexpr double kMostM = 100;

void expect_length(double metres, const char* what) {
  if (!(metres > 0 && metres <= kMostM)) {
    throw Error(std::string(what) + " is " + number_text(metres * kMmPerM) +
                " mm; it must be more than 0 and at most " + number_text(kMostM * kMmPerM) + " mm");
  }
}

void expect_pixels(const std::array<std::size_t, 2>& pixels) {
  for (const std::size_t count : pixels) {
    if (count == 0 || count > ProjectionGeometry::kMostPixels) {
      throw Error("the detector has " + std::to_string(pixels[0]) + " x " + std::to_string(pixels[1]) +
                  " pixels; both numbers must be from 1 to " +
                  std::to_string(ProjectionGeometry::kMostPixels));
    }
  }
}

/// Exact at the quarters of a turn, where cos and sin of pi / 2 are not.
std::array<double, 2> cosine_and_sine(double degrees) {
  const double turned = std::remainder(degrees, 360);
  if (turned == 0) return {1, 0};
  if (turned == 90) return {0, 1};
  if (turned == -90) return {0, -1};
  if (std::abs(turned) == 180) return {-1, 0};
  const double radians = turned * std::numbers::pi / 180;
  return {std::cos(radians), std::sin(radians)};
}

std::array<std::size_t, 2> pixels_of(const JsonField& field) {
  std::array<std::size_t, 2> pixels{};
  const std::vector<JsonField> counts = field.elements(2);
  for (std::size_t i = 0; i < 2; ++i) {
    const std::int64_t count = counts[i].integer();
    if (count < 1 || count > static_cast<std::int64_t>(ProjectionGeometry::kMostPixels)) {
      counts[i].fail("is " + std::to_string(count) + "; it must be from 1 to " +
                     std::to_string(ProjectionGeometry::kMostPixels) + " pixels");
    }
    pixels[i] = static_cast<std::size_t>(count);
  }
  return pixels;
}

double positive_m(const JsonField& field) {
  const double metres = field.number() / kMmPerM;
  if (!(metres > 0 && metres <= kMostM)) {
    field.fail("is " + number_text(metres * kMmPerM) + "; it must be more than 0 and at most " +
               number_text(kMostM * kMmPerM) + " mm");
  }
  return metres;
}

GeometryDocument gantry_document(const JsonField& document) {
  document.expect_object(
      {"sad_mm", "sid_mm", "isocenter_mm", "gantry_deg", "detector_px", "detector_mm", "detector_offset_mm"});
  GantrySetup setup;
  setup.source_axis_m = positive_m(document.member("sad_mm"));
  const JsonField imager = document.member("sid_mm");
  setup.source_imager_m = positive_m(imager);
  if (setup.source_imager_m <= setup.source_axis_m) {
    imager.fail("is " + number_text(setup.source_imager_m * kMmPerM) +
                ", no more than sad_mm: the detector must be behind the isocentre");
  }
  const JsonField isocenter = document.member("isocenter_mm");
  setup.isocenter_m = isocenter.vector() / kMmPerM;
  if (!(setup.isocenter_m.cwiseAbs().maxCoeff() <= kMostM)) {
    isocenter.fail("is farther than " + number_text(kMostM) + " m from the origin of the volume");
  }
  if (const auto angle = document.optional_member("gantry_deg")) {
    setup.gantry_deg = angle->number();
    if (!(std::abs(setup.gantry_deg) <= 360)) {
      angle->fail("is " + number_text(setup.gantry_deg) + "; it must be from -360 to 360 degrees");
    }
  }
  setup.pixels = pixels_of(document.member("detector_px"));
  const std::vector<JsonField> size = document.member("detector_mm").elements(2);
  for (std::size_t i = 0; i < 2; ++i) setup.size_m[i] = positive_m(size[i]);
  if (const auto offset = document.optional_member("detector_offset_mm")) {
    const std::vector<JsonField> numbers = offset->elements(2);
    for (std::size_t i = 0; i < 2; ++i) {
      setup.offset_m[i] = numbers[i].number() / kMmPerM;
      if (!(std::abs(setup.offset_m[i]) <= kMostM)) {
        numbers[i].fail("is farther than " + number_text(kMostM) + " m from the middle");
      }
    }
  }
  return {ProjectionGeometry(setup), setup};
}

GeometryDocument matrix_document(const JsonField& document) {
  document.expect_object({"matrix", "detector_px"});
  const std::array<std::size_t, 2> pixels = pixels_of(document.member("detector_px"));
  const JsonField field = document.member("matrix");
  ProjectionGeometry::Matrix matrix;
  const std::vector<JsonField> rows = field.elements(3);
  for (std::size_t row = 0; row < 3; ++row) {
    const std::vector<JsonField> numbers = rows[row].elements(4);
    for (std::size_t column = 0; column < 4; ++column) {
      matrix(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) = numbers[column].number();
    }
  }
  matrix.leftCols<3>() *= kMmPerM;
  try {
    return {ProjectionGeometry(matrix, pixels), std::nullopt};
  } catch (const Error& refused) {
    field.fail(std::string("is no projection: ") + refused.what());
  }
}

}  // namespace

ProjectionGeometry::ProjectionGeometry(const GantrySetup& setup) : pixels_(setup.pixels) {
  expect_pixels(pixels_);
  expect_length(setup.source_axis_m, "the distance from source to isocentre");
  expect_length(setup.source_imager_m, "the distance from source to detector");
  expect_length(setup.size_m[0], "the detector's width");
  expect_length(setup.size_m[1], "the detector's height");
  if (setup.source_imager_m <= setup.source_axis_m) {
    throw Error("the detector is " + number_text(setup.source_imager_m * kMmPerM) +
                " mm from the source, no farther than the isocentre (" +
                number_text(setup.source_axis_m * kMmPerM) + " mm); it must be behind it");
  }
  if (!setup.isocenter_m.allFinite() || !std::isfinite(setup.gantry_deg) ||
      !std::isfinite(setup.offset_m[0]) || !std::isfinite(setup.offset_m[1])) {
    throw Error("the isocentre, the gantry's angle or the detector's offset is no number");
  }
  const auto [cosine, sine] = cosine_and_sine(setup.gantry_deg);
  const Vector3 to_source(sine, -cosine, 0), along_row(cosine, sine, 0), down_column(0, 0, -1);
  const Vector3 source = setup.isocenter_m + setup.source_axis_m * to_source;
  // Pixels per metre at depth 1, and the pixel of the middle.
  Eigen::Matrix3d camera = Eigen::Matrix3d::Identity();
  for (Eigen::Index i = 0; i < 2; ++i) {
    const auto count = static_cast<double>(pixels_[static_cast<std::size_t>(i)]);
    const double pixels_a_metre = count / setup.size_m[static_cast<std::size_t>(i)];
    camera(i, i) = setup.source_imager_m * pixels_a_metre;
    camera(i, 2) = (count - 1) / 2 - setup.offset_m[static_cast<std::size_t>(i)] * pixels_a_metre;
  }
  Eigen::Matrix3d axes;
  axes << along_row.transpose(), down_column.transpose(), -to_source.transpose();
  Matrix matrix;
  matrix.leftCols<3>() = camera * axes;
  matrix.col(3) = -(matrix.leftCols<3>() * source);
  take(matrix);
  source_m_ = source;  // to the bit, not by way of an inverse
  source_imager_m_ = setup.source_imager_m;
}

ProjectionGeometry::ProjectionGeometry(const Matrix& matrix, std::array<std::size_t, 2> pixels)
    : pixels_(pixels) {
  expect_pixels(pixels_);
  take(matrix);
}

void ProjectionGeometry::take(const Matrix& matrix) {
  const double scale = matrix.block<1, 3>(2, 0).norm();
  if (!matrix.allFinite() || !(scale > 0)) {
    throw Error("its numbers must be finite, and its last row must not begin with three zeros");
  }
  matrix_ = matrix / scale;
  const Eigen::Matrix3d left = matrix_.leftCols<3>();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(left);
  // Pixels are some thousand a metre, so that a sound matrix is far from this.
  constexpr double kWorstCondition = 1e10;
  if (!(svd.singularValues()[2] * kWorstCondition > svd.singularValues()[0])) {
    throw Error("its left 3 x 3 part has no inverse, so that there is no source");
  }
  const Eigen::Matrix3d inverse = left.inverse();
  source_m_ = -(inverse * matrix_.col(3));
  rays_ = {inverse.col(2), inverse.col(0), inverse.col(1)};
  if (!source_m_.allFinite() || !inverse.allFinite()) throw Error("its source is not finite");
}

std::optional<PixelPoint> ProjectionGeometry::project(const Vector3& point_m) const {
  const Vector3 projected = matrix_ * point_m.homogeneous();
  if (!(projected.z() > 0)) return std::nullopt;
  return PixelPoint{projected.x() / projected.z(), projected.y() / projected.z(), projected.z()};
}

SourceRay ProjectionGeometry::ray(double column, double row) const {
  return {source_m_, (rays_.corner + column * rays_.along_row + row * rays_.down_column).normalized()};
}

ProjectionGeometry ProjectionGeometry::of_moved_patient(const Eigen::Isometry3d& motion) const {
  ProjectionGeometry moved(matrix_ * motion.matrix(), pixels_);
  moved.source_imager_m_ = source_imager_m_;
  return moved;
}

ProjectionGeometry ProjectionGeometry::binned(std::size_t factor) const {
  const auto times = static_cast<double>(factor);
  // The centre of the first new pixel is (factor - 1) / 2 of the old ones.
  Eigen::Matrix3d fewer = Eigen::Vector3d(1 / times, 1 / times, 1).asDiagonal();
  fewer(0, 2) = fewer(1, 2) = -(times - 1) / (2 * times);
  ProjectionGeometry result(fewer * matrix_, {pixels_[0] / factor, pixels_[1] / factor});
  result.source_imager_m_ = source_imager_m_;
  return result;
}

GeometryDocument parse_geometry(std::string_view text, const std::string& name) {
  const nlohmann::json json = JsonField::parse(text, name);
  const JsonField document(json, name);
  return document.has("matrix") ? matrix_document(document) : gantry_document(document);
}

GeometryDocument read_geometry(const std::filesystem::path& file) {
  return parse_geometry(read_document(file), file.string());
}

std::string geometry_json(const ProjectionGeometry& geometry) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (Eigen::Index row = 0; row < 3; ++row) {
    const auto numbers = geometry.matrix().row(row);
    // The document is in millimetres, and any factor of the whole is the same.
    rows.push_back({numbers[0], numbers[1], numbers[2], numbers[3] * kMmPerM});
  }
  const nlohmann::ordered_json document{{"matrix", rows},
                                        {"detector_px", {geometry.columns(), geometry.rows()}}};
  return document.dump(1) + "\n";
}

void refuse_unseen(const ProjectionGeometry& geometry, const std::array<Vector3, 8>& corners_m,
                   const std::string& what) {
  double least_m = std::numeric_limits<double>::infinity(), greatest_m = -least_m;
  for (const Vector3& corner : corners_m) {
    const double depth_m = geometry.matrix().row(2) * corner.homogeneous();
    least_m = std::min(least_m, depth_m);
    greatest_m = std::max(greatest_m, depth_m);
  }
  // One millimetre keeps what is divided by the depth within bounds.
  constexpr double kLeastDepthM = 0.001;
  if (least_m < kLeastDepthM && greatest_m > 0) {
    throw Error("the source is inside " + what + " or beside it: " + what + " reaches from " +
                number_text(least_m * kMmPerM, 4) + " to " + number_text(greatest_m * kMmPerM, 4) +
                " mm in front of the source; move the isocentre, or lengthen the source-axis distance");
  }
  if (least_m < kLeastDepthM) {
    throw Error(what + " is behind the source: move the isocentre, or give the matrix the other sign");
  }
  if (const auto imager_m = geometry.source_imager_m(); imager_m && greatest_m > *imager_m) {
    throw Error("the detector is inside " + what + " or before it: " + what + " reaches to " +
                number_text(greatest_m * kMmPerM, 4) + " mm from the source, the detector is at " +
                number_text(*imager_m * kMmPerM, 4) + " mm; lengthen the source-imager distance");
  }
}

}  // namespace kiroku::sim
