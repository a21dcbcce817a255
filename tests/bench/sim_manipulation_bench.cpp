// What a step of a grasp, a retraction and a press costs, the positions of all nodes included, on bodies of
// about the sizes of "Interactive Volume Manipulation for Supporting Preoperative Planning" (613 vertices,
// 20 Hz with rendering; here a cylinder of 610) and of 5,000 vertices; and a frame of a body that turns.
//
//   sim_manipulation_bench --benchmark_repetitions=5 --benchmark_enable_random_interleaving=true
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "sim/manipulation/corotational_manipulation.h"
#include "sim/manipulation/manipulation.h"
#include "tests/support/tet_cylinder.h"
#include "tests/support/tet_grid.h"

namespace {

using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file

constexpr double kRadius_m = 0.03, kLength_m = 0.12;

struct Organ {
  Organ(std::uint32_t rings, std::uint32_t layers) : body(held_cylinder(rings, layers)), contact(body) {}
  static ElasticBody held_cylinder(std::uint32_t rings, std::uint32_t layers) {
    TetMesh mesh = kiroku::test::tet_cylinder(rings, layers, kRadius_m, kLength_m);
    Constraints constraints(mesh.nodes.size());
    for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
      if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "bench");
    }
    return {std::move(mesh), {{0, {1e4, 0.45}}}, constraints};
  }
  ElasticBody body;
  ContactBody contact;
};

const Organ& organ(std::int64_t nodes) {
  static const Organ small(4, 9), large(8, 22);
  return nodes < 1000 ? small : large;
}

/// Jaws of 24 mm around the cylinder near its free end, and a blade that may press below.
std::vector<Tool> tools(std::size_t holding) {
  std::vector<Tool> all;
  for (std::size_t i = 0; i < holding; ++i)
    all.push_back(forceps("forceps " + std::to_string(i + 1), {0.012, 0.012, 0.012}));
  all.push_back(flat_retractor("blade", {0.002, 0.012, 0.012}));
  return all;
}

Pose jaws(std::size_t tool) {
  const double angle = 2.0 * static_cast<double>(tool);
  Pose pose;
  pose.position_m = {kRadius_m * std::cos(angle), kRadius_m * std::sin(angle), 0.9 * kLength_m};
  return pose;
}

/// Pulls outwards by up to 6 mm and turns by up to 0.1, 0.5 s a turn, at `time_s`; the blade presses up to 4
/// mm deep below where the first tool holds.
void move(std::vector<OptionalPose>& poses, double time_s, bool press) {
  const double part = (1 - std::cos(2 * std::numbers::pi * time_s / 0.5)) / 2;
  for (std::size_t i = 0; i + 1 < poses.size(); ++i) {
    Pose pose = jaws(i);
    pose.position_m.head<2>() *= 1 + 0.2 * part;
    pose.orientation = Eigen::AngleAxisd(0.1 * part, Vector3::UnitZ());
    poses[i] = pose;
  }
  poses.back().reset();
  if (press) {
    poses.back().emplace();
    poses.back()->position_m = {-kRadius_m - 0.002 + 0.004 * part, 0, 0.5 * kLength_m};
  }
}

void step(benchmark::State& state) {
  const auto holding = static_cast<std::size_t>(state.range(1));
  const bool press = state.range(2) != 0;
  Manipulation manipulation(organ(state.range(0)).contact, tools(holding));
  for (std::size_t i = 0; i < holding; ++i) manipulation.grasp(i, jaws(i));
  std::vector<OptionalPose> poses(holding + 1);
  double time_s = 0, pressed = 0;
  for ([[maybe_unused]] auto _ : state) {
    move(poses, time_s += 1e-3, press);
    const ManipulationResult& result = manipulation.step(poses);
    const Eigen::VectorXd displacement_m = manipulation.displacement_m();
    benchmark::DoNotOptimize(displacement_m.data());
    pressed += static_cast<double>(result.contacts.size());
  }
  state.counters["held"] = static_cast<double>(manipulation.result().bound.size());
  state.counters["pressed"] = pressed / static_cast<double>(state.iterations());
  state.counters["steps"] =
      benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(step)
    ->ArgsProduct({{610, 4991}, {0, 1, 3}, {0, 1}})
    ->ArgNames({"nodes", "holding", "pressing"})
    ->Unit(benchmark::kMicrosecond);

void grasp_and_release(benchmark::State& state) {
  Manipulation manipulation(organ(state.range(0)).contact, tools(1));
  std::size_t held = 0;
  for ([[maybe_unused]] auto _ : state) {
    held = manipulation.grasp(0, jaws(0));
    manipulation.release(0);
  }
  state.counters["held"] = static_cast<double>(held);
}
BENCHMARK(grasp_and_release)->Arg(610)->Arg(4991)->ArgName("nodes")->Unit(benchmark::kMicrosecond);

/// A frame of a corotational plan: forceps at the free end of a bar of 2,496 nodes turn it by 2.4 degrees a
/// frame and bend it, while a finger presses it from above.
void corotational_frame(benchmark::State& state) {
  TetMesh mesh = kiroku::test::tet_grid({38, 7, 7}, {0.08, 0.02, 0.02});
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].x() == 0) constraints.prescribe(node, Vector3::Zero(), "bench");
  }
  const CorotationalBody body(std::move(mesh), {{0, {5e3, 0.45}}}, std::move(constraints));
  const Eigen::VectorXd none_n = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * 39 * 8 * 8));
  CorotationalManipulation hand(body, none_n,
                                {forceps("forceps", {0.001, 0.02, 0.02}), finger("finger", 0.008)});
  const auto turned = [](double part) {
    Pose pose;
    pose.position_m = Vector3(0.08, 0.01, 0.01) + part * Vector3(-0.029, 0, 0.051);
    pose.orientation = Eigen::AngleAxisd(-part * std::numbers::pi / 3, Vector3::UnitY());
    return pose;
  };
  hand.grasp(0, turned(0));
  double frames = 0, factorisations = 0, contacts = 0;
  for ([[maybe_unused]] auto _ : state) {
    ++frames;
    Pose pressing;
    pressing.position_m = {0.035, 0.01, 0.0275 - 0.0005 * frames};
    contacts += static_cast<double>(
        hand.step(std::vector<OptionalPose>{turned(frames / 25), pressing}).contacts.size());
    factorisations += hand.factorisations();
  }
  state.counters["factorisations"] = factorisations / frames;
  state.counters["contacts"] = contacts / frames;
}
BENCHMARK(corotational_frame)->Iterations(5)->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
