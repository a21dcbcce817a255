// Contact against Table 2 of "Construction of Training Environment for Surgical Exclusion with a Basic Study
// of Multi-finger Haptic Interaction": reaction force and deformation of a body of 820 nodes (here a cylinder
// of 819) pressed by one to five moving fingers, detection included; then the force loop at 1 kHz on 20,000
// nodes. The table's deformation includes the reaction force; so does force_and_deformation.
//
//   sim_contact_bench --benchmark_filter='-force_loop|force_and' --benchmark_repetitions=5
//   sim_contact_bench --benchmark_filter=force_and_deformation --benchmark_repetitions=5
//   sim_contact_bench --benchmark_filter=force_loop        (needs the right to real-time priority)
//
// The force loop runs three times: a loop that computes nothing, alone; the same beside the deformations,
// which is what this machine allows; and the one that computes forces.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

#include <benchmark/benchmark.h>

#include "sim/contact/contact_body.h"
#include "sim/fem/background_thread.h"
#include "sim/haptics/force_loop.h"
#include "sim/haptics/haptic_contact.h"
#include "sim/haptics/simulated_hand.h"
#include "tests/support/tet_cylinder.h"

namespace {

using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file

constexpr double kRadiusMetres = 0.03, kLengthMetres = 0.08;
// Table 2, ms, for one to five fingers.
constexpr double kPaperForceMs[] = {0.20, 0.63, 2.36, 8.18, 29.7},
                 kPaperDeformationMs[] = {1.32, 1.95, 4.41, 12.29, 32.36};

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

/// Of a hand of one to five fingers around the cylinder that presses up to 6 mm deep and strokes along it,
/// 0.5 s a turn, at `time_s`.
Pose finger_pose(std::size_t finger, double time_s) {
  const double turn = 2 * std::numbers::pi * time_s / 0.5;
  const double angle = finger == 0 ? std::numbers::pi : 0.6 * (static_cast<double>(finger) - 2.5);
  const double from_axis_m = kRadiusMetres + 0.012 - 0.0045 - 0.0015 * std::sin(turn);
  Pose pose;
  pose.position_m = {from_axis_m * std::cos(angle), from_axis_m * std::sin(angle),
                     0.6 * kLengthMetres + 0.004 * std::sin(turn / 3 + static_cast<double>(finger))};
  return pose;
}
void move(std::vector<Pose>& poses, double time_s) {
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i] = finger_pose(i, time_s);
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

// A step as the paper's table has it: forces of moving fingers, and where all nodes are under them.
void force_and_deformation(benchmark::State& state) {
  const auto count = static_cast<std::size_t>(state.range(0));
  ContactSolver solver(small_body().surface, fingers(count));
  std::vector<Pose> poses(count);
  Eigen::VectorXd displacement_m;
  double time_s = 0;
  for ([[maybe_unused]] auto _ : state) {
    move(poses, time_s += 1e-3);
    small_body().contact.displacement_m(solver.step(poses).contacts, displacement_m);
    benchmark::DoNotOptimize(displacement_m.data());
  }
}
BENCHMARK(force_and_deformation)->DenseRange(1, 5)->ArgName("fingers")->Unit(benchmark::kMicrosecond);

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

constexpr double kLoopSeconds = 60, kPeriodSeconds = 1e-3;

/// A device and a source that do nothing: how well the system keeps time.
class NoDevice : public HapticDevice {
 public:
  [[nodiscard]] std::size_t tools() const override { return 5; }
  bool read(std::span<Pose> /*poses*/) override { return true; }
  void write(std::span<const Vector3> /*forces_n*/) override {}
};
class NoForces : public ForceSource {
 public:
  void forces(std::span<const Pose> /*poses*/, double /*period_s*/, std::span<Vector3> forces_n) override {
    for (Vector3& force_n : forces_n) force_n.setZero();
  }
};

/// Time in which the host ran something else on this machine's processors, so far; ms.
double stolen_ms() {
  std::ifstream stat("/proc/stat");
  std::string name;
  std::array<double, 8> ticks{};  // user, nice, system, idle, iowait, irq, softirq, steal
  stat >> name;
  for (double& count : ticks) stat >> count;
  return 1e3 * ticks.back() / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

void report(const ForceLoopStatistics& found, benchmark::State& state) {
  const auto us = [](std::chrono::nanoseconds time) { return static_cast<double>(time.count()) / 1e3; };
  state.counters["on_time_%"] = 100 * found.on_time_share();
  state.counters["steps"] = static_cast<double>(found.steps);
  state.counters["skipped"] = static_cast<double>(found.skipped);
  state.counters["late"] = static_cast<double>(found.steps - found.on_time);
  state.counters["late_woken"] = static_cast<double>(found.late_woken);
  state.counters["real_time"] = found.real_time ? 1 : 0;
  state.counters["memory_locked"] = found.memory_locked ? 1 : 0;
  state.counters["step_p50_us"] = us(found.step_50);
  state.counters["step_p99_us"] = us(found.step_99);
  state.counters["step_p99.9_us"] = us(found.step_999);
  state.counters["step_max_us"] = us(found.step_longest);
  state.counters["jitter_p50_us"] = us(found.jitter_50);
  state.counters["jitter_p99_us"] = us(found.jitter_99);
  state.counters["jitter_p99.9_us"] = us(found.jitter_999);
  state.counters["jitter_max_us"] = us(found.jitter_longest);
}

/// Runs the loop while another thread computes deformations, if it is to.
void keep_time(HapticDevice& device, ForceSource& source, HapticContact* deformed, benchmark::State& state) {
  const double stolen_before_ms = stolen_ms();
  ForceLoop loop(device, source);
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration_cast<std::chrono::nanoseconds>(
                                                          std::chrono::duration<double>(kLoopSeconds));
  double deformations = 0, contacts = 0;
  if (deformed == nullptr) {
    std::this_thread::sleep_until(end);
  } else {
    std::thread([&] {
      work_in_background();
      while (std::chrono::steady_clock::now() < end && loop.running()) {
        contacts += static_cast<double>(deformed->refresh().contacts.size());
        ++deformations;
      }
    }).join();
  }
  loop.stop();
  report(loop.statistics(), state);
  state.counters["stolen_ms"] = stolen_ms() - stolen_before_ms;
  state.counters["deformations_hz"] = deformations / kLoopSeconds;
  state.counters["contacts"] = deformations > 0 ? contacts / deformations : 0;
}

/// 20,188 nodes whose surface was made ready before.
struct LargeBody {
  ElasticBody body = held_cylinder(15, 27);
  ContactBody contact{body};
  LargeBody() { (void)contact.compliance().groups_of(contact.surface()); }
};
LargeBody& large_body() {
  static LargeBody body;
  return body;
}

void force_loop_empty(benchmark::State& state) {
  NoDevice device;
  NoForces source;
  for ([[maybe_unused]] auto _ : state) keep_time(device, source, nullptr, state);
}
BENCHMARK(force_loop_empty)->Iterations(1)->Unit(benchmark::kSecond)->UseRealTime();

void force_loop_empty_beside_deformations(benchmark::State& state) {
  NoDevice device;
  NoForces source;
  HapticContact deformed(large_body().contact, fingers(5));
  for ([[maybe_unused]] auto _ : state) keep_time(device, source, &deformed, state);
}
BENCHMARK(force_loop_empty_beside_deformations)->Iterations(1)->Unit(benchmark::kSecond)->UseRealTime();

// Five fingers, forces at 1 kHz in a thread of their own; beside it, the deformation of all nodes as often as
// one thread can.
void force_loop(benchmark::State& state) {
  HapticContact source(large_body().contact, fingers(5));
  std::vector<SimulatedHand::Path> paths;
  for (std::size_t finger = 0; finger < 5; ++finger)
    paths.emplace_back([finger](double time_s) { return finger_pose(finger, 0.25 * time_s); });
  SimulatedHand hand(paths, kPeriodSeconds);
  for ([[maybe_unused]] auto _ : state) keep_time(hand, source, &source, state);
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
    for (std::size_t count = 1; count <= 5; ++count) {
      print("reaction_force/fingers:" + std::to_string(count) + "/sticking:0", kPaperForceMs[count - 1],
            0.03);
      print("force_and_deformation/fingers:" + std::to_string(count), kPaperDeformationMs[count - 1], 0.08);
    }
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
