#include "sim/render/ray_caster.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/cutting/vertex_preserving_cut.h"
#include "sim/render/endoscope.h"
#include "sim/render/volume_renderer.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/picture_likeness.h"

namespace kiroku::sim {
namespace {

const Vector3 kCentre = Vector3::Constant(0.024);
constexpr double kBallM = 0.016;

/// A ball of tissue in fat with something different on each side, and vessels through it.
std::shared_ptr<const ShadedVolume> organ_ct() {
  const Volume ct = test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), [](const Vector3& at) {
    const Vector3 from = (at - kCentre) / kBallM;
    const double inside = std::clamp((kBallM - 0.002 - (at - kCentre).norm()) / 0.003 + 0.5, 0.0, 1.0);
    return -100 + 160 * inside +
           90 * std::max(0.0, std::sin(7 * from.x()) * std::cos(5 * from.y() + 1) + 0.6 * from.z());
  });
  return std::make_shared<const ShadedVolume>(shade(ct, {Vector3::Zero(), Vector3::Constant(0.047)}));
}
/// Air of -870 HU with a little noise, in which vessels branch: nearly all of it is faint.
std::shared_ptr<const ShadedVolume> lung_ct() {
  std::uint32_t random = 1;
  const Volume ct = test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), [&](const Vector3& at) {
    const Vector3 from = (at - kCentre) / kBallM;
    random = random * 1664525U + 1013904223U;
    const double noise = double(random >> 16U) / 65535 * 40 - 20;
    const double vessel = std::sin(6 * from.x() + std::cos(3 * from.z())) * std::cos(5 * from.y());
    return -870 + noise + 900 * std::clamp((vessel - 0.8) * 8, 0.0, 1.0);
  });
  return std::make_shared<const ShadedVolume>(shade(ct, {Vector3::Zero(), Vector3::Constant(0.047)}));
}
TetMesh ball_of_cells() { return test::ball_mesh({4, 4, 4}, kCentre, Vector3::Constant(kBallM)); }

Vector3 corkscrewed(const Vector3& node) {
  const Vector3 from = (node - kCentre) / kBallM;
  const Eigen::AngleAxisd twist(0.9 * from.z(), Vector3::UnitZ());
  return kCentre + kBallM * (twist * from + Vector3(0.3 * from.z() * from.z(), 0, 0.15 * from.x()));
}
template <typename To>
std::vector<double> displaced_by(const TetMesh& mesh, const To& to) {
  std::vector<double> numbers;
  for (const Vector3& node : mesh.nodes) {
    const Vector3 by = to(node) - node;
    numbers.insert(numbers.end(), by.data(), by.data() + 3);
  }
  return numbers;
}

struct Shown {
  TetMesh mesh;
  std::vector<double> displacement_m;
};
Shown bent_body() {
  Shown shown{ball_of_cells(), {}};
  shown.displacement_m = displaced_by(shown.mesh, corkscrewed);
  return shown;
}
Shown cut_body() {
  VertexPreservingCut cut(ball_of_cells());
  cut.cut(SweepSurface({{kCentre.x(), 0, 0}, {kCentre.x(), 0, 0.05}},
                       {{kCentre.x(), 0.022, 0}, {kCentre.x(), 0.022, 0.05}}));
  Shown shown{cut.remaining(), {}};
  shown.displacement_m = displaced_by(shown.mesh, [](const Vector3& node) -> Vector3 {
    const double depth = std::max(0.0, 0.024 - node.y()) / 0.016;
    return corkscrewed(node) + Vector3(node.x() > kCentre.x() ? 0.006 : -0.006, 0, 0) * depth;
  });
  return shown;
}

Scene view_of(const TetMesh& mesh, bool parallel = false) {
  Scene scene;
  scene.width = 150;
  scene.height = 131;
  scene.camera = camera_looking_at(ball_around(mesh), {25, 15}, scene.width, scene.height, 1, parallel);
  return scene;
}
/// Tools before, in and behind the tissue, its stress and its surface.
Scene everything(const TetMesh& mesh) {
  Scene scene = view_of(mesh);
  scene.solids = {
      {Capsule{0.002, 0.012},
       {{0.034, 0.006, 0.02}, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vector3::UnitX()))},
       {200, 200, 210}},
      {Sphere{0.004}, {{0.02, 0.012, 0.028}, Eigen::Quaterniond::Identity()}, {224, 182, 150}},
      {Box{{0.004, 0.001, 0.003}}, {{0.012, 0.006, 0.03}, Eigen::Quaterniond::Identity()}, {90, 160, 230}}};
  scene.stress.emplace();
  scene.stress->largest_pa = 100;
  for (const Vector3& node : mesh.nodes)
    scene.stress->at_nodes_pa.push_back(100 * (node - kCentre).norm() / kBallM);
  scene.surface.emplace();
  return scene;
}

Picture drawn(Engine engine, const std::shared_ptr<const ShadedVolume>& volume, const char* transfer,
              const Shown& shown, const Scene& scene) {
  VolumeRenderer renderer(volume, find_transfer_function(transfer), {GpuUse::kOff, engine});
  renderer.set_mesh(shown.mesh);
  return renderer.render(shown.displacement_m, scene);
}
void expect_alike(const std::shared_ptr<const ShadedVolume>& volume, const char* transfer, const Shown& shown,
                  const Scene& scene) {
  const Picture reference = drawn(Engine::kOpenGl, volume, transfer, shown, scene);
  const test::PictureLikeness found =
      test::likeness(reference, drawn(Engine::kProcessor, volume, transfer, shown, scene));
  EXPECT_GE(found.ssim, 0.995);
  EXPECT_LT(found.share, 0.01);
  // And there is something to be seen.
  Picture empty(scene.width, scene.height);
  for (std::size_t i = 0; i < empty.rgb.size(); ++i) empty.rgb[i] = scene.background[i % 3];
  EXPECT_GT(test::likeness(reference, empty).share, 0.05);
}

TEST(RayCaster, DrawsABentBodyAsOpenGlDoes) {
  const Shown shown = bent_body();
  expect_alike(organ_ct(), "liver", shown, view_of(shown.mesh));
  expect_alike(organ_ct(), "lung", shown, view_of(shown.mesh));
  expect_alike(lung_ct(), "lung", shown, view_of(shown.mesh));
}

TEST(RayCaster, DrawsACutBodyAsOpenGlDoes) {
  const Shown shown = cut_body();
  expect_alike(organ_ct(), "liver", shown, view_of(shown.mesh));
  expect_alike(lung_ct(), "lung", shown, view_of(shown.mesh));
}

TEST(RayCaster, DrawsToolsStressAndSurfaceAsOpenGlDoes) {
  const Shown shown = cut_body();
  expect_alike(organ_ct(), "liver", shown, everything(shown.mesh));
  expect_alike(lung_ct(), "lung", shown, everything(shown.mesh));
}

TEST(RayCaster, DrawsInParallelAndFromNearbyAsOpenGlDoes) {
  const Shown shown = bent_body();
  expect_alike(organ_ct(), "liver", shown, view_of(shown.mesh, true));
  // The eye is close to the surface, with parts of the body beside and behind it.
  Scene near = view_of(shown.mesh);
  near.camera.eye_m = kCentre + 0.021 * near.camera.to_view.row(2).transpose();
  near.camera.half_extent *= 3;
  expect_alike(organ_ct(), "liver", shown, near);
}

/// As an endoscope shows it from so far.
Scene through_endoscope(const Shown& shown, Scene scene, double distance_m) {
  look_through({distance_m, 70, {-0.25, 0.05}, {}}, shown.mesh, shown.displacement_m, scene);
  return scene;
}

TEST(RayCaster, DrawsWhatAnEndoscopeShowsAsOpenGlDoes) {
  for (const Shown& shown : {bent_body(), cut_body()}) {
    for (const double distance_m : {0.03, 0.012}) {
      SCOPED_TRACE(distance_m);
      expect_alike(organ_ct(), "liver", shown, through_endoscope(shown, view_of(shown.mesh), distance_m));
      expect_alike(lung_ct(), "lung", shown, through_endoscope(shown, view_of(shown.mesh), distance_m));
    }
  }
  const Shown shown = cut_body();
  expect_alike(organ_ct(), "liver", shown, through_endoscope(shown, everything(shown.mesh), 0.03));
}

TEST(RayCaster, DrawsByALightAtTheTipWithoutALensAsOpenGlDoes) {
  const Shown shown = cut_body();
  for (const bool parallel : {false, true}) {
    Scene scene = everything(shown.mesh);
    scene.camera = view_of(shown.mesh, parallel).camera;
    scene.tip_light.emplace();
    scene.tip_light->at_m = {0.01, 0.02, 0};
    scene.tip_light->working_distance_m = (scene.camera.eye_m - kCentre).norm() - kBallM;
    expect_alike(organ_ct(), "liver", shown, scene);
  }
}

TEST(RayCaster, DrawsThroughALensByALightFromAfarAsOpenGlDoes) {
  const Shown shown = cut_body();
  Scene scene = through_endoscope(shown, everything(shown.mesh), 0.03);
  scene.tip_light.reset();
  scene.round = false;
  expect_alike(organ_ct(), "liver", shown, scene);
}

TEST(RayCaster, GivesTheSameBytesOnAnyNumberOfThreadsWithAnyInstructions) {
  const Shown shown = cut_body();
  const Scene plain = everything(shown.mesh), endoscopic = through_endoscope(shown, plain, 0.03);
  for (const auto& [transfer, scene] :
       {std::pair("liver", plain), {"lung", plain}, {"liver", endoscopic}, {"lung", endoscopic}}) {
    const auto volume = organ_ct();
    const auto with = [&, name = transfer, shown_as = scene](unsigned threads, InstructionSet set) {
      RayCaster caster(volume, find_transfer_function(name), {threads, set});
      PlacedMesh mesh(shown.mesh);
      for (const Vector3& node : shown.mesh.nodes) mesh.texture.push_back(volume->texture_of(node));
      caster.set_mesh(mesh);
      mesh.place_nodes(shown.displacement_m, shown_as.camera);
      mesh.place_cells(shown_as.camera);
      return caster.draw(mesh, shown_as, 0.5e-3).rgb;
    };
    const std::vector<std::uint8_t> expected = with(1, InstructionSet::kBaseline);
    for (const InstructionSet set :
         {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512}) {
      if (!machine_has(set)) continue;
      for (const unsigned threads : {1U, 2U, 3U, 5U})
        EXPECT_TRUE(with(threads, set) == expected) << threads << " threads, set " << int(set);
    }
  }
}

TEST(RayCaster, RefusesInstructionsThatAreNotThere) {
  for (const InstructionSet set : {InstructionSet::kAvx2, InstructionSet::kAvx512}) {
    if (machine_has(set)) continue;
    EXPECT_THROW(RayCaster(organ_ct(), find_transfer_function("liver"), {1, set}), UsageError);
  }
  EXPECT_TRUE(machine_has(best_instruction_set()));
}

}  // namespace
}  // namespace kiroku::sim
