// A breathing cycle of 36 phases on a body of 5,000 nodes: factor, responses, displacements, the tumour's
// path and the text of each frame; and the fit of its motion to one view of the tumour. Goals: 1 s and 10 s.
#include <benchmark/benchmark.h>

#include "sim/mesh/mesh_writer.h"
#include "sim/respiration/motion_fit.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

/// A right lung in the shape of a box, 4,914 nodes; region 2 is the tumour.
BreathingModel box_lung() {
  BreathingModel model;
  model.mesh = test::tet_grid({12, 17, 20}, {0.12, 0.17, 0.25});
  for (std::size_t t = 0; t < model.mesh.tetrahedra.size(); ++t) {
    const Vector3& corner = model.mesh.nodes[model.mesh.tetrahedra[t][0]];
    model.mesh.regions[t] = (corner - Vector3(0.05, 0.06, 0.09)).norm() < 0.02 ? 2 : 1;
  }
  model.materials = {{1, kLungTissue}, {2, kTumourTissue}};
  model.tumour = tumour_of_region(model.mesh, 2);
  GroupRules rules;
  rules.side = LungSide::kRight;
  model.groups = find_boundary_groups(model.mesh, surface_of(model.mesh), nullptr, rules);
  return model;
}

void cycle(benchmark::State& state) {
  const BreathingModel model = box_lung();
  for (auto _ : state) {
    const BreathingBody body(model.mesh, model.materials, model.groups, model.slide);
    const BreathingCycle breathing(body, model.motion, model.waveform);
    const MeshPoint centre = centre_of(model.mesh, *model.tumour);
    TumourPath path;
    for (const double time_s : model.times_s()) {
      const Eigen::VectorXd displacement_m = breathing.displacement_m(time_s);
      path.times_s.push_back(time_s);
      path.centres_m.push_back(centre.mean(displacement_m));
      benchmark::DoNotOptimize(
          vtu_text(model.mesh, model.unit,
                   {{"displacement",
                     {"X", "Y", "Z"},
                     std::span(displacement_m.data(), static_cast<std::size_t>(displacement_m.size()))}},
                   {}));
    }
    benchmark::DoNotOptimize(path_csv(path, model.unit));
  }
  state.counters["nodes"] = static_cast<double>(model.mesh.nodes.size());
}
BENCHMARK(cycle)->Unit(benchmark::kMillisecond)->UseRealTime();

void fit_one_view(benchmark::State& state) {
  const BreathingModel model = box_lung();
  GantrySetup setup;
  setup.isocenter_m = Vector3(0.05, 0.06, 0.09);
  setup.pixels = {1024, 768};
  setup.size_m = {0.4, 0.3};
  const std::vector<ProjectionGeometry> views{ProjectionGeometry(setup)};
  std::vector<RadiographPosition> positions;
  const BreathingBody body(model.mesh, model.materials, model.groups, model.slide);
  const BreathingCycle breathing(body, {{0.005, 0.3, std::nullopt}, {0.014, 1.1, std::nullopt}},
                                 model.waveform);
  const MeshPoint centre = centre_of(model.mesh, *model.tumour);
  constexpr int kRadiographs = 108;  // 10 a second, three cycles
  for (int i = 0; i < kRadiographs; ++i) {
    const double time_s = 0.1 * i;
    const auto seen =
        views[0].project(centre.mean(model.mesh.nodes) + centre.mean(breathing.displacement_m(time_s)));
    if (seen) positions.push_back({time_s, 0, seen->column, seen->row});
  }
  for (auto _ : state) benchmark::DoNotOptimize(fit_motion(model, views, positions, {}));
}
BENCHMARK(fit_one_view)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace kiroku::sim

BENCHMARK_MAIN();
