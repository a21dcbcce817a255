// How an X-ray source and a flat detector see the patient: where any point is projected to, and which ray
// ends in a pixel. Plain data; functions are pure and thread-safe.
//
// Patient coordinates are DICOM's (x to the left, y to the back, z to the head), in metres. Pixels are
// counted from 0, whole numbers are their centres: (column, row), rows from the head to the feet, columns as
// seen from the source.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Geometry>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// A gantry that turns about the isocentre (IEC 61217, patient head first and supine): at 0 degrees the
/// source is in front of the patient, at 90 on the left. The detector is square to the line from the source
/// through the isocentre, which meets its middle.
struct GantrySetup {
  double source_axis_m = 1;      // from the source to the isocentre
  double source_imager_m = 1.5;  // from the source to the detector, more than source_axis_m
  Vector3 isocenter_m = Vector3::Zero();
  double gantry_deg = 0;
  std::array<std::size_t, 2> pixels{};  // columns, rows
  std::array<double, 2> size_m{};       // the detector's width and height
  /// Of the detector's middle from that line, along its rows and down its columns.
  std::array<double, 2> offset_m{};
};

struct PixelPoint {
  double column = 0, row = 0;
  /// Distance from the source at right angles to the detector, m.
  double depth_m = 0;
};

/// Of a ray from the source: points are origin_m + t * direction, direction of length 1.
struct SourceRay {
  Vector3 origin_m, direction;
};

class ProjectionGeometry {
 public:
  using Matrix = Eigen::Matrix<double, 3, 4>;
  /// No detector is larger on a side.
  static constexpr std::size_t kMostPixels = 16384;

  /// kiroku::Error for what no machine can be: sizes and distances that are not positive and finite, a
  /// detector before the isocentre, no pixel or more than kMostPixels on a side.
  explicit ProjectionGeometry(const GantrySetup& setup);
  /// (u w, v w, w)^T = matrix (x, y, z, 1)^T of points in metres, (u, v) the pixel; w is positive in front of
  /// the source. Any factor. kiroku::Error where the left 3 x 3 part has no inverse.
  ProjectionGeometry(const Matrix& pixels_of_patient_m, std::array<std::size_t, 2> pixels);

  [[nodiscard]] std::size_t columns() const { return pixels_[0]; }
  [[nodiscard]] std::size_t rows() const { return pixels_[1]; }
  [[nodiscard]] const Vector3& source_m() const { return source_m_; }
  /// Scaled so that w is the depth in metres.
  [[nodiscard]] const Matrix& matrix() const { return matrix_; }
  /// Known for a gantry, unknown for a matrix: where along the rays the detector stands.
  [[nodiscard]] std::optional<double> source_imager_m() const { return source_imager_m_; }

  /// Nothing for a point that is not in front of the source. It may lie beside the detector.
  [[nodiscard]] std::optional<PixelPoint> project(const Vector3& point_m) const;
  [[nodiscard]] SourceRay ray(double column, double row) const;
  /// The ray of a pixel as source + t (corner + column * along_row + row * down_column), where t is the
  /// depth.
  struct PixelRays {
    Vector3 corner, along_row, down_column;
  };
  [[nodiscard]] const PixelRays& pixel_rays() const { return rays_; }

  /// What the same machine sees of a patient who has been moved: a point p of the patient is at motion * p.
  [[nodiscard]] ProjectionGeometry of_moved_patient(const Eigen::Isometry3d& motion) const;
  /// The same field of view in fewer, larger pixels, of `factor` by `factor` of these; those at the right and
  /// lower edge that do not fill one are left out. The factor is at most columns() and rows().
  [[nodiscard]] ProjectionGeometry binned(std::size_t factor) const;

 private:
  void take(const Matrix& matrix);

  Matrix matrix_;
  Vector3 source_m_;
  PixelRays rays_;
  std::array<std::size_t, 2> pixels_;
  std::optional<double> source_imager_m_;
};

/// A geometry as a document says it, and its gantry where it has one (for other angles of the same machine).
struct GeometryDocument {
  ProjectionGeometry geometry;
  std::optional<GantrySetup> gantry;
};

/// {"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [0, 0, 0], "gantry_deg": 0,
///  "detector_px": [512, 512], "detector_mm": [600, 600], "detector_offset_mm": [0, 0]}
/// or {"matrix": [[..4..], [..4..], [..4..]], "detector_px": [512, 512]}, which takes patient coordinates in
/// millimetres. gantry_deg and detector_offset_mm are 0 if absent. kiroku::Error in one sentence with the
/// file and the JSON path; unknown keys are refused. kiroku::IoError.
GeometryDocument read_geometry(const std::filesystem::path& file);
/// `name` stands in errors.
GeometryDocument parse_geometry(std::string_view text, const std::string& name);
/// The document with "matrix", which says the same of any geometry.
std::string geometry_json(const ProjectionGeometry& geometry);

/// A box that must be seen whole, by its corners; kiroku::Error that names `what` ("the volume") where the
/// source is inside, a part is behind the source, or the detector goes through it or is before it.
void refuse_unseen(const ProjectionGeometry& geometry, const std::array<Vector3, 8>& corners_m,
                   const std::string& what);

}  // namespace kiroku::sim
