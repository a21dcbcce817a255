#include "trainer/exclusion/lift_picture.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "sim/render/colour_map.h"
#include "sim/render/lettering.h"
#include "sim/render/surface_renderer.h"
#include "trainer/exclusion/opened_object.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

constexpr sim::Rgb kTipColour{236, 205, 182};
constexpr double kHalfWidthOfView = 0.26;  // at distance 1

/// `elevation_deg` above the trainee's side, below it where negative.
sim::Camera camera_from(const sim::TetMesh& mesh, const ExclusionTask& task, double elevation_deg, int width,
                        int height) {
  const sim::Ball ball = sim::ball_around(mesh);
  const Vector3 onwards = task.lifts.cross(task.aside).normalized();
  const double up = elevation_deg * std::numbers::pi / 180, away_m = ball.radius_m / kHalfWidthOfView;
  sim::Camera camera;
  camera.eye_m = ball.centre_m + away_m * (std::sin(up) * task.lifts - std::cos(up) * onwards);
  const Vector3 forward = (ball.centre_m - camera.eye_m).normalized();
  const Vector3 right = forward.cross(task.lifts).normalized();
  camera.to_view.row(0) = right;
  camera.to_view.row(1) = right.cross(forward);
  camera.to_view.row(2) = -forward;
  camera.half_extent = {kHalfWidthOfView, kHalfWidthOfView * height / width};
  return camera;
}

std::vector<sim::Rgb> colours_of(const std::vector<double>& von_mises_pa, double top_pa) {
  std::vector<sim::Rgb> colours;
  for (const double pa : von_mises_pa) colours.push_back(sim::viridis(pa / top_pa));
  return colours;
}

sim::Picture dark(int width, int height) {
  const sim::Rgb background = sim::SurfaceScene().background;
  sim::Picture picture(width, height);
  for (std::size_t i = 0; i < picture.rgb.size(); ++i) picture.rgb[i] = background.at(i % 3);
  return picture;
}

sim::Picture render(const sim::TetMesh& mesh, const Eigen::VectorXd& displacement_m,
                    const sim::SurfaceScene& scene) {
  sim::SurfaceRenderer renderer(mesh, sim::GpuUse::kOff);
  return renderer.render({displacement_m.data(), static_cast<std::size_t>(displacement_m.size())}, scene)
      .picture;
}

}  // namespace

sim::Picture picture_from_below(const sim::TetMesh& mesh, const ExclusionTask& task,
                                const LiftedObject& lifted, double top_pa) {
  constexpr double kBelowDegrees = -42;
  sim::SurfaceScene scene;
  scene.width = 320;
  scene.height = 200;
  scene.camera = camera_from(mesh, task, kBelowDegrees, scene.width, scene.height);
  scene.node_colours = colours_of(lifted.von_mises_at_nodes_pa, top_pa);
  for (const sim::Pose& pose : lifted.poses)
    scene.solids.push_back({{sim::Sphere{kFingertipMetres}, pose, kTipColour}, 1, true});
  return render(mesh, lifted.displacement_m, scene);
}

sim::Picture picture_cut_open(const sim::TetMesh& mesh, const ExclusionTask& task, const LiftedObject& lifted,
                              double top_pa, const Vector3& on_plane_m) {
  constexpr double kAboveDegrees = 62;
  const OpenedObject opened = open_object(mesh, on_plane_m, task.lifts);
  sim::SurfaceScene scene;
  scene.width = 480;
  scene.height = 300;
  scene.camera = camera_from(mesh, task, kAboveDegrees, scene.width, scene.height);
  scene.node_colours = colours_of(opened.numbers(lifted.von_mises_at_nodes_pa), top_pa);
  return render(opened.mesh, opened.displacement_m(lifted.displacement_m), scene);
}

sim::Picture sheet_of(const std::vector<CaptionedPicture>& cells, std::size_t columns, double top_pa) {
  const auto first = std::ranges::find_if(cells, [](const auto& cell) { return cell.picture.width > 0; });
  if (first == cells.end() || columns == 0) throw UsageError("a sheet needs a picture and a column");
  const int width = first->picture.width, height = first->picture.height;
  sim::Lettering lettering;
  const std::size_t rows = (cells.size() + columns - 1) / columns;
  sim::Picture sheet(width * static_cast<int>(columns), height * static_cast<int>(rows));
  std::size_t scaled = cells.size() - 1;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (cells[i].picture.width == 0) scaled = i;
  }
  for (std::size_t i = 0; i < cells.size(); ++i) {
    sim::Picture cell = cells[i].picture.width > 0 ? cells[i].picture : dark(width, height);
    if (cell.width != width || cell.height != height)
      throw UsageError("the pictures of a sheet have one size");
    if (i == scaled) sim::draw_stress_scale(lettering, cell, top_pa);
    sim::draw_caption(lettering, cell, "", cells[i].caption);
    const int left = width * static_cast<int>(i % columns), top = height * static_cast<int>(i / columns);
    for (int y = 0; y < height; ++y)
      std::copy_n(cell.pixel(0, y), 3 * static_cast<std::size_t>(width), sheet.pixel(left, top + y));
  }
  return sheet;
}

}  // namespace kiroku::trainer
