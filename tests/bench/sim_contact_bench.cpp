// Contact and haptic rate against the figures of "Haptic Rate for Surgical Manipulations with Fingers and
// Instruments": reaction force and deformation of a body of about 820 nodes (here a cylinder of 819) pressed
// by one to five moving fingers, detection included; then the force loop at 1 kHz on 20,000 nodes.
//
//   sim_contact_bench --benchmark_repetitions=5 --benchmark_enable_random_interleaving=true
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "sim/contact/contact_body.h"
#include "tests/support/tet_cylinder.h"

namespace {

using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file

constexpr double kRadius_m = 0.03, kLength_m = 0.08;
// The papers' figures, ms, for one to five fingers.
constexpr double kPaperForce_ms[] = {0.20, 0.63, 2.36, 8.18, 29.7}, kPaperDeformation_ms = 32;

ElasticBody held_cylinder(std::uint32_t rings, std::uint32_t layers) {
  TetMesh mesh = kiroku::test::tet_cylinder(rings, layers, kRadius_m, kLength_m);
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "bench");
  }
  return {std::move(mesh), {{0, {1e4, 0.45}}}, constraints};
}

std::vector<ContactTool> fingers(std::size_t count, bool stick = false) {
  std::vector<ContactTool> tools;
  for (std::size_t i = 0; i < count; ++i)
    tools.push_back({"finger " + std::to_string(i + 1), Sphere{0.012}, stick});
  return tools;
}

/// A hand around the cylinder that presses up to 6 mm deep and strokes along it, 0.5 s a turn, at `time_s`.
void move(std::vector<Pose>& poses, double time_s) {
  const double turn = 2 * std::numbers::pi * time_s / 0.5;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double angle = i == 0 ? std::numbers::pi : 0.6 * (static_cast<double>(i) - 2.5);
    const double from_axis_m = kRadius_m + 0.012 - 0.0045 - 0.0015 * std::sin(turn);
    poses[i].position_m = {from_axis_m * std::cos(angle), from_axis_m * std::sin(angle),
                           0.6 * kLength_m + 0.004 * std::sin(turn / 3 + static_cast<double>(i))};
  }
}

struct SmallBody {
  ElasticBody body = held_cylinder(5, 8);
  ContactBody contact{body};
  std::shared_ptr<const ContactNeighbourhood> surface = contact.whole_surface();
};
SmallBody& small_body() {
  static SmallBody body;
  return body;
}

void reaction_force(benchmark::State& state) {
  const auto count = static_cast<std::size_t>(state.range(0));
  ContactSolver solver(small_body().surface, fingers(count, state.range(1) != 0));
  std::vector<Pose> poses(count);
  double time_s = 0, contacts = 0, iterations = 0;
  for (int i = 0; i < 1000; ++i) {
    move(poses, time_s += 1e-3);
    solver.step(poses);
  }
  for ([[maybe_unused]] auto _ : state) {
    move(poses, time_s += 1e-3);
    const ContactResult& result = solver.step(poses);
    benchmark::DoNotOptimize(result.wrist_force_n.data());
    contacts += static_cast<double>(result.contacts.size());
    iterations += result.iterations;
  }
  const auto steps = static_cast<double>(state.iterations());
  state.counters["contacts"] = contacts / steps;
  state.counters["iterations"] = iterations / steps;
}
BENCHMARK(reaction_force)->ArgsProduct({{1, 2, 3, 4, 5}, {0, 1}})->ArgNames({"fingers", "sticking"})->Unit(benchmark::kMicrosecond);

void deformation(benchmark::State& state) {
  ContactSolver solver(small_body().surface, fingers(5));
  std::vector<Pose> poses(5);
  move(poses, 0.1);
  const std::vector<Contact> contacts = solver.step(poses).contacts;
  Eigen::VectorXd displacement_m;
  for ([[maybe_unused]] auto _ : state) {
    small_body().contact.displacement_m(contacts, displacement_m);
    benchmark::DoNotOptimize(displacement_m.data());
  }
}
BENCHMARK(deformation)->Unit(benchmark::kMicrosecond);

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
