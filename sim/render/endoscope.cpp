#include "sim/render/endoscope.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/number_text.h"
#include "sim/mesh/mesh_topology.h"
#include "sim/render/picking.h"

namespace kiroku::sim {
namespace {

/// How far the tip must be from where the camera is, along its axis.
double way_to_tissue_m(const Camera& camera, const TetMesh& mesh, std::span<const double> displacement_m) {
  std::vector<Vector3> places_m;
  double before_all_m = 0;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    Vector3 place_m = mesh.nodes[node];
    if (!displacement_m.empty()) place_m += Eigen::Map<const Vector3>(displacement_m.data() + 3 * node);
    places_m.push_back(in_depth_m(camera, place_m));
    before_all_m = std::max(before_all_m, -places_m.back().z());
  }
  // Along an axis all are seen that lie before an eye far behind.
  before_all_m += 1;
  for (Vector3& place_m : places_m) place_m.z() += before_all_m;
  const auto depth_m = depth_along(faces_of(mesh).surface, places_m, Eigen::Vector2d::Zero());
  if (!depth_m) {
    throw NoTissueOnAxis(
        "the endoscope's axis meets no tissue: aim at some (--at X,Y,Z), or look from another side (--view)");
  }
  return *depth_m - before_all_m;
}

LensCalibration lens_of(const Endoscope& endoscope, int width, int height) {
  if (endoscope.calibration) return *endoscope.calibration;
  const auto [k1, k2] = endoscope.bend;
  const double border = std::tan(endoscope.field_deg / 2 * std::numbers::pi / 180), square = border * border;
  const double shown = border * (1 + square * (k1 + square * k2));
  if (!(shown > 0)) {
    throw UsageError("the lens's distortion " + number_text(k1, 4) + "," + number_text(k2, 4) +
                     " folds back within " + number_text(endoscope.field_deg, 4) +
                     " degrees: take coefficients nearer to 0, or a smaller field");
  }
  LensCalibration lens;
  lens.width = width;
  lens.height = height;
  lens.focal_px.setConstant(std::min(width, height) / 2.0 / shown);
  lens.middle_px = Eigen::Vector2d(width - 1, height - 1) / 2;
  lens.coefficients = {k1, k2, 0, 0, 0};
  return lens;
}

/// What Lens refuses is told of pictures that were recorded; here it is told of options.
Lens checked_lens(const Endoscope& endoscope, const Scene& scene) {
  const LensCalibration calibration = lens_of(endoscope, scene.width, scene.height);
  if (endoscope.calibration) {
    Lens own(calibration);
    try {
      own.require_shape(scene.width, scene.height);
    } catch (const UsageError&) {
      throw UsageError("the lens was calibrated with pictures of " + std::to_string(calibration.width) + "x" +
                       std::to_string(calibration.height) +
                       " pixels: give the picture that shape too (--size)");
    }
    return own;
  }
  try {
    return Lens(calibration);
  } catch (const UsageError&) {
    throw UsageError("the lens's distortion " + number_text(endoscope.bend[0], 4) + "," +
                     number_text(endoscope.bend[1], 4) +
                     " is not monotone within the picture, or its corners lie more than 80 degrees off the "
                     "axis: take coefficients nearer to 0, or a smaller field (--field)");
  }
}

}  // namespace

void look_through(const Endoscope& endoscope, const TetMesh& mesh, std::span<const double> displacement_m,
                  Scene& scene) {
  const auto lens =
      std::make_shared<const LensRays>(checked_lens(endoscope, scene), scene.width, scene.height);
  Camera& camera = scene.camera;
  camera.parallel = false;
  camera.centre.setZero();
  const double along_m = way_to_tissue_m(camera, mesh, displacement_m) - endoscope.distance_m;
  camera.eye_m -= along_m * camera.to_view.row(2).transpose();
  const double half = std::tan(lens->lens().field_deg() / 2 * std::numbers::pi / 180);
  camera.half_extent =
      half * Eigen::Vector2d(scene.width, scene.height) / std::min(scene.width, scene.height);
  scene.lens = lens;
  scene.round = !endoscope.calibration;
  scene.tip_light.emplace();
  scene.tip_light->working_distance_m = endoscope.distance_m;
}

}  // namespace kiroku::sim
