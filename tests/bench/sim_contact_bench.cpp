// Contact and haptic rate against the figures of "Haptic Rate for Surgical Manipulations with Fingers and
// Instruments": reaction force and deformation of a body of about 820 nodes (here a cylinder of 819) pressed
// by one to five moving fingers, detection included; then the force loop at 1 kHz on 20,000 nodes.
//
//   sim_contact_bench --benchmark_filter=-force_loop --benchmark_repetitions=5
//   sim_contact_bench --benchmark_filter=force_loop        (needs the right to real-time priority)
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include <benchmark/benchmark.h>

#include "sim/contact/contact_body.h"
#include "sim/haptics/force_loop.h"
#include "sim/haptics/haptic_contact.h"
#include "sim/haptics/simulated_hand.h"
#include "tests/support/tet_cylinder.h"

namespace {

using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file

constexpr double kRadiusMetres = 0.03, kLengthMetres = 0.08;
// The papers' figures, ms, for one to five fingers.
constexpr double kPaperForceMs[] = {0.20, 0.63, 2.36, 8.18, 29.7}, kPaperDeformationMs = 32;

ElasticBody held_cylinder(std::uint32_t rings, std::uint32_t layers) {
  TetMesh mesh = kiroku::test::tet_cylinder(rings, layers, kRadiusMetres, kLengthMetres);
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

/// A hand of one to five fingers around the cylinder that presses up to 6 mm deep and strokes along it, 0.5 s
/// a turn, at `time_s`.
void move(std::vector<Pose>& poses, double time_s) {
  const double turn = 2 * std::numbers::pi * time_s / 0.5;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double angle = i == 0 ? std::numbers::pi : 0.6 * (static_cast<double>(i) - 2.5);
    const double from_axis_m = kRadiusMetres + 0.012 - 0.0045 - 0.0015 * std::sin(turn);
    poses[i].position_m = {from_axis_m * std::cos(angle), from_axis_m * std::sin(angle),
                           0.6 * kLengthMetres + 0.004 * std::sin(turn / 3 + static_cast<double>(i))};
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
BENCHMARK(reaction_force)
    ->ArgsProduct({{1, 2, 3, 4, 5}, {0, 1}})
    ->ArgNames({"fingers", "sticking"})
    ->Unit(benchmark::kMicrosecond);

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

// What a node costs that could not be touched before: columns of a group of eight.
void compliance_group(benchmark::State& state) {
  const auto rings = static_cast<std::uint32_t>(state.range(0));
  const ElasticBody body = held_cylinder(rings, static_cast<std::uint32_t>(state.range(1)));
  std::vector<std::uint32_t> nodes;
  for (std::uint32_t i = 1; i <= Compliance::kGroupSize; ++i)
    nodes.push_back(static_cast<std::uint32_t>(body.mesh().nodes.size()) - i);
  for ([[maybe_unused]] auto _ : state) benchmark::DoNotOptimize(body.compliance_columns(nodes).data());
  state.counters["nodes"] = static_cast<double>(body.mesh().nodes.size());
}
BENCHMARK(compliance_group)->Args({5, 8})->Args({10, 14})->Args({15, 27})->Unit(benchmark::kMillisecond);

// Sixty seconds of five fingers on 20,188 nodes whose surface was made ready before, forces at 1 kHz in a
// thread of their own; in this one, the deformation of all nodes as often as it can.
void force_loop(benchmark::State& state) {
  const ElasticBody body = held_cylinder(15, 27);
  const ContactBody contact(body);
  constexpr double kPeriodSeconds = 1e-3;
  std::vector<SimulatedHand::Path> paths;
  for (std::size_t tool = 0; tool < 5; ++tool) {
    paths.emplace_back([tool](double time_s) {
      std::vector<Pose> poses(5);
      move(poses, 0.25 * time_s);
      return poses[tool];
    });
  }
  const auto begun = std::chrono::steady_clock::now();
  (void)contact.compliance().groups_of(contact.surface());
  const std::chrono::duration<double> prepared = std::chrono::steady_clock::now() - begun;
  state.counters["prepared_s"] = prepared.count();
  for ([[maybe_unused]] auto _ : state) {
    HapticContact source(contact, fingers(5));
    SimulatedHand hand(paths, kPeriodSeconds);
    ForceLoop loop(hand, source);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    double deformations = 0, contacts = 0;
    while (std::chrono::steady_clock::now() < end && loop.running()) {
      contacts += static_cast<double>(source.refresh().contacts.size());
      ++deformations;
    }
    loop.stop();
    const ForceLoopStatistics found = loop.statistics();
    const auto us = [](std::chrono::nanoseconds time) { return static_cast<double>(time.count()) / 1e3; };
    state.counters["on_time_%"] = 100 * found.on_time_share();
    state.counters["steps"] = static_cast<double>(found.steps);
    state.counters["skipped"] = static_cast<double>(found.skipped);
    state.counters["real_time"] = found.real_time ? 1 : 0;
    state.counters["step_p50_us"] = us(found.step_50);
    state.counters["step_p99_us"] = us(found.step_99);
    state.counters["step_p99.9_us"] = us(found.step_999);
    state.counters["step_max_us"] = us(found.step_longest);
    state.counters["jitter_p50_us"] = us(found.jitter_50);
    state.counters["jitter_p99_us"] = us(found.jitter_99);
    state.counters["jitter_p99.9_us"] = us(found.jitter_999);
    state.counters["jitter_max_us"] = us(found.jitter_longest);
    state.counters["deformations_hz"] = deformations / 60;
    state.counters["contacts"] = contacts / deformations;
  }
}
BENCHMARK(force_loop)->Iterations(1)->Unit(benchmark::kSecond)->UseRealTime();

/// Prints as usual, and keeps the least CPU time of each benchmark, as other work on the machine only slows.
class LeastTimes : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration) continue;
      const double ms = run.cpu_accumulated_time / static_cast<double>(run.iterations) * 1e3;
      const auto [place, first] =
          least_ms_.try_emplace(run.run_name.function_name + "/" + run.run_name.args, ms);
      if (!first) place->second = std::min(place->second, ms);
    }
  }
  void print_ratios() const {
    for (std::size_t count = 1; count <= 5; ++count)
      print("reaction_force/fingers:" + std::to_string(count) + "/sticking:0", kPaperForceMs[count - 1],
            0.03);
    print("deformation/", kPaperDeformationMs, 0.05);
  }

 private:
  void print(const std::string& name, double paper_ms, double goal_ms) const {
    const auto found = least_ms_.find(name);
    if (found == least_ms_.end()) return;
    std::printf("%s: %.4f ms (goal %.2f), the paper %.2f ms: %.0f times as fast\n", name.c_str(),
                found->second, goal_ms, paper_ms, paper_ms / found->second);
  }
  std::map<std::string, double> least_ms_;
};

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  LeastTimes reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  reporter.print_ratios();
}
