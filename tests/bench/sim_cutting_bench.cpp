// A cut step: finding and moving what a blade sweeps through, and bringing matrix and factor up to date;
// beside it, in the same run, the factorisation of the whole matrix that it takes the place of. An organ of
// 5,100 nodes is cut a hundred times on parallel lines, each step about an element long and two deep; bodies
// are made anew for every repetition, and of all repetitions the least time of each step counts, because
// other work on the machine only ever slows. The last lines are the figures of docs/results/performance.md.
//
//   sim_cutting_bench --benchmark_repetitions=5
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>
#include <vector>

#include <benchmark/benchmark.h>

#include "sim/cutting/cut_body.h"
#include "sim/fem/elimination_order.h"
#include "tests/support/organ_mesh.h"

namespace {

using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file

constexpr std::size_t kSteps = 100;
const Material kTissue{5e3, 0.45};

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

TetMesh organ() { return kiroku::test::organ_mesh({24, 16, 11}, {0.2, 0.14, 0.1}); }

Constraints held(const TetMesh& mesh) {
  Constraints constraints(mesh.nodes.size());
  const double floor_m = extent_of(mesh).least.z() + 0.015;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].z() < floor_m) constraints.prescribe(node, Vector3::Zero(), "bench");
  }
  return constraints;
}

/// Ten lines across the organ, ten steps each.
std::vector<SweepSurface> sweeps() {
  std::vector<SweepSurface> all;
  for (int line = 0; line < 10; ++line) {
    const double x = -0.075 + 0.0165 * line, top = 0.045 + 0.2 * 0.05 * (x / 0.1) * (x / 0.1);
    for (int step = 0; step < 10; ++step) {
      const double y = -0.045 + 0.009 * step;
      all.emplace_back(BladePose{{x, y, top - 0.016}, {x, y, top + 0.02}},
                       BladePose{{x, y + 0.009, top - 0.016}, {x, y + 0.009, top + 0.02}});
    }
  }
  return all;
}

struct StepTimes {
  double shape_s = std::numeric_limits<double>::infinity(), system_s = shape_s, solve_s = shape_s;
};
std::vector<StepTimes> least(kSteps);
double least_whole_s = std::numeric_limits<double>::infinity();
std::size_t removed = 0, changed = 0;

/// The shape is cut a second time beside the body, to tell its share.
void cut_steps(benchmark::State& state) {
  const TetMesh mesh = organ();
  const std::vector<SweepSurface> path = sweeps();
  for ([[maybe_unused]] auto _ : state) {
    state.PauseTiming();
    CutBody body(mesh, {{0, kTissue}}, held(mesh));
    VertexPreservingCut shape(mesh);
    Eigen::VectorXd force_n =
        Eigen::VectorXd::Constant(static_cast<Eigen::Index>(3 * mesh.nodes.size()), 1e-4);
    removed = changed = 0;
    state.ResumeTiming();
    for (std::size_t step = 0; step < kSteps; ++step) {
      auto begin = std::chrono::steady_clock::now();
      const CutStep cut = shape.cut(path[step]);
      const double shape_s = seconds_since(begin);
      begin = std::chrono::steady_clock::now();
      body.cut(path[step]);
      const double step_s = seconds_since(begin);
      begin = std::chrono::steady_clock::now();
      benchmark::DoNotOptimize(body.solve(force_n));
      least[step].shape_s = std::min(least[step].shape_s, shape_s);
      least[step].system_s = std::min(least[step].system_s, step_s);
      least[step].solve_s = std::min(least[step].solve_s, seconds_since(begin));
      removed += cut.change.removed.size();
      for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
        changed += shape.present(t) && std::ranges::any_of(mesh.tetrahedra[t], [&](std::uint32_t node) {
                     return std::ranges::binary_search(cut.change.moved, node);
                   });
      }
    }
  }
}

/// The matrix assembled and factorised from nothing, in a given order.
void whole_factorisation(benchmark::State& state) {
  const TetMesh mesh = organ();
  const Constraints constraints = held(mesh);
  const std::vector<const Material*> materials(mesh.tetrahedra.size(), &kTissue);
  const std::vector<std::uint32_t> order = elimination_order(mesh);
  std::vector<bool> free(3 * mesh.nodes.size());
  for (std::size_t number = 0; number < free.size(); ++number) free[number] = !constraints.prescribed(number);
  for ([[maybe_unused]] auto _ : state) {
    const auto begin = std::chrono::steady_clock::now();
    const StiffnessMatrix stiffness(mesh, materials);
    const Factorisation factorisation(stiffness, free, order);
    benchmark::DoNotOptimize(factorisation.unknowns());
    least_whole_s = std::min(least_whole_s, seconds_since(begin));
  }
}

BENCHMARK(cut_steps)->Iterations(1)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(whole_factorisation)->Unit(benchmark::kMillisecond)->UseRealTime();

void print_figures() {
  if (least.front().system_s == std::numeric_limits<double>::infinity()) return;
  const auto mean_ms = [](std::size_t from, std::size_t to, auto time) {
    double sum = 0;
    for (std::size_t step = from; step < to; ++step) sum += 1e3 * time(least[step]);
    return sum / static_cast<double>(to - from);
  };
  const auto step = [](const StepTimes& times) { return times.system_s; };
  const auto worst = std::ranges::max_element(least, {}, &StepTimes::system_s);
  std::printf("%zu nodes; a step takes out %.1f tetrahedra and reshapes %.1f\n", organ().nodes.size(),
              static_cast<double>(removed) / kSteps, static_cast<double>(changed) / kSteps);
  std::printf("whole factorisation: %.1f ms\n", 1e3 * least_whole_s);
  std::printf(
      "cut step: mean %.1f ms (of that the shape %.2f ms), worst %.1f ms; the solve after it %.1f ms\n",
      mean_ms(0, kSteps, step), mean_ms(0, kSteps, [](const StepTimes& t) { return t.shape_s; }),
      1e3 * worst->system_s, mean_ms(0, kSteps, [](const StepTimes& t) { return t.solve_s; }));
  std::printf("steps 1 to 10: %.1f ms, steps 91 to 100: %.1f ms, ratio %.2f\n", mean_ms(0, 10, step),
              mean_ms(kSteps - 10, kSteps, step), mean_ms(kSteps - 10, kSteps, step) / mean_ms(0, 10, step));
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  print_figures();
  return 0;
}
