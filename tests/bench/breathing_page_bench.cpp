// The breathing workbench as the page does it, without browser and network: a slider that moves, 60 inputs a
// second; each picture as a JPEG in its message. The figures stand in
// docs/reference/viewer.md.
//   breathing_page_bench VOLUME BREATHING GEOMETRY [SECONDS]
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <thread>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/volume/volume_reader.h"
#include "viewer/breathing/breathing_messages.h"

namespace {

using namespace kiroku;
using Clock = std::chrono::steady_clock;

double ms(std::chrono::nanoseconds time) { return static_cast<double>(time.count()) / 1e6; }

double processor_ms() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Processor time of one picture and of its parts, all threads together: it does not depend on what else the
/// machine does.
void measure_parts(const viewer::BreathingBench& bench) {
  constexpr int kTimes = 10;
  for (std::size_t factor = 1; factor <= viewer::BreathingBench::kFactors; ++factor) {
    viewer::BreathingTable table(bench);
    const auto timed_ms = [&](const auto& act) {
      const double begin_ms = processor_ms();
      for (int i = 0; i < kTimes; ++i) act(i);
      return (processor_ms() - begin_ms) / kTimes;
    };
    viewer::MotionDeed motion = bench.own_motion();
    const auto moved_m = [&](int i) {
      motion.motion.diaphragm.amplitude_m = 1e-3 * i;
      return bench.own_lung()->responses.displacement_m(motion.motion, bench.model().waveform, 0.5);
    };
    const double sum_ms = timed_ms([&](int i) { static_cast<void>(moved_m(i)); });
    const double drr_ms = timed_ms([&](int i) { static_cast<void>(bench.drr(factor, moved_m(i))); });
    const double outline_ms = timed_ms([&](int i) { static_cast<void>(bench.outline(factor, moved_m(i))); });
    table.apply(viewer::LookDeed{sim::OverlayMode::kOpacity, 0.5, true});
    const double all_ms = timed_ms([&](int i) {
      motion.motion.diaphragm.amplitude_m = 1e-3 * i;
      table.apply(motion);
      const viewer::BreathingTable::Shown shown = table.picture(factor);
      static_cast<void>(viewer::path_json(table));
      static_cast<void>(viewer::moment_message({&shown, 1, 1, 1, {}}));
    });
    std::printf(
        "pixels %zu times as wide: %.1f ms of processor time, of that %.1f the sum of motions, %.1f the DRR, "
        "%.1f the outline\n",
        factor, all_ms, sum_ms, drr_ms - sum_ms, outline_ms - sum_ms);
  }
}

void measure(const viewer::BreathingBench& bench, const char* what, sim::OverlayMode mode, double seconds) {
  std::atomic<std::uint64_t> pictures = 0, bytes = 0, full = 0;
  std::atomic<std::int64_t> drawing_ns = 0;
  std::atomic<bool> failed = false;
  const std::size_t rows = bench.geometry(1).rows();
  viewer::BreathingListener listener;
  listener.ready = [] { return true; };
  listener.shown = [&](const viewer::BreathingMoment& moment) {
    bytes += viewer::moment_message(moment).size();
    drawing_ns += moment.drawing.count();
    if (moment.shown->picture.rows == rows) ++full;
    ++pictures;
  };
  listener.moved = [](const viewer::BreathingTable& table) { static_cast<void>(viewer::path_json(table)); };
  listener.measured = [](const viewer::BreathingTable& /*table*/) {};
  listener.told = [](const std::string& sentence) { std::fprintf(stderr, "%s\n", sentence.c_str()); };
  listener.refused = [](const std::string& sentence, std::uint64_t /*input*/,
                        const viewer::BreathingTable& /*table*/) {
    std::fprintf(stderr, "%s\n", sentence.c_str());
  };
  listener.failed = [&](const std::string& sentence) {
    std::fprintf(stderr, "%s\n", sentence.c_str());
    failed = true;
  };
  viewer::LiveBreathing live(bench, listener);
  live.apply(1, viewer::LookDeed{mode, 0.5, true});
  const double begun_ms = processor_ms();
  const auto begun = Clock::now();
  const auto passed_s = [&] { return std::chrono::duration<double>(Clock::now() - begun).count(); };
  viewer::MotionDeed motion = bench.own_motion();
  for (std::uint64_t number = 2; passed_s() < seconds && !failed; ++number) {
    std::this_thread::sleep_until(begun + number * std::chrono::microseconds(16'667));
    motion.motion.diaphragm.amplitude_m = 0.01 * std::sin(2 * std::numbers::pi * passed_s());
    live.apply(number, motion);
  }
  const auto count = static_cast<double>(pictures);
  const double taken_s = (processor_ms() - begun_ms) / 1e3;
  std::printf(
      "%s, %zu vertices, %zu x %zu pixels: %.1f pictures a second of %.0f kB, %.0f %% of them of all "
      "pixels\n",
      what, bench.nodes(), bench.geometry(1).columns(), rows, count / passed_s(),
      static_cast<double>(bytes) / 1e3 / count, 100 * static_cast<double>(full) / count);
  std::printf(
      "  input to picture  median %.0f ms, 99 %% %.0f ms; a picture %.0f ms on average; %.1f pictures for "
      "each "
      "second of a core, of which it got %.2f\n",
      ms(live.input_to_picture().percentile(0.5)), ms(live.input_to_picture().percentile(0.99)),
      static_cast<double>(drawing_ns) / 1e6 / count, count / taken_s, taken_s / passed_s());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "breathing_page_bench VOLUME BREATHING GEOMETRY [SECONDS]\n");
    return 2;
  }
  const double seconds = argc > 4 ? std::atof(argv[4]) : 10;
  try {
    viewer::BenchInputs inputs{.file = argv[2],
                               .model = sim::read_breathing_model(argv[2]),
                               .named = {},
                               .volume = sim::read_volume(argv[1], {}).volume,
                               .geometry = sim::read_geometry(argv[3]).geometry,
                               .radiographs = {}};
    // What the model itself looks like stands for a radiograph: pictures cost the same.
    inputs.radiographs.push_back(
        {0,
         sim::CtProjector(inputs.volume, sim::Attenuation(sim::Attenuation::kCtEnergyKev))
             .project(inputs.geometry),
         "at rest"});
    const viewer::BreathingBench bench(std::move(inputs));
    measure_parts(bench);
    measure(bench, "over", sim::OverlayMode::kOpacity, seconds);
    measure(bench, "beside", sim::OverlayMode::kBeside, seconds);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "breathing_page_bench: %s\n", error.what());
    return 1;
  }
}
