// Planning as the page does it, without browser and network: a view that turns, forceps that pull, five
// fingers that press, 60 inputs a second; each picture as a JPEG in its message. The figures stand in
// docs/reference/viewer.md.
//   plan_page_bench FOLDER PLAN [SECONDS], as kiroku plan serve --plans FOLDER --gpu off lists the plan
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <thread>

#include "base/error.h"
#include "viewer/planning/planning_messages.h"

namespace {

using namespace kiroku;
using Clock = std::chrono::steady_clock;
using viewer::Deed;
using viewer::PointDeed;
using viewer::PointerUse;

double ms(std::chrono::nanoseconds time) { return static_cast<double>(time.count()) / 1e6; }

double swing(double time_s) { return (1 - std::cos(time_s * std::numbers::pi)) / 2; }

Deed turning(double time_s) { return viewer::ViewDeed{30 * swing(time_s), 10, 1, 0, 0}; }

Deed pulling(double time_s) {
  return PointDeed{PointerUse::kGrasp, {{1, 0.4 - 0.05 * swing(time_s), 0.6 + 0.08 * swing(time_s), 0}}};
}

Deed pressing(double time_s) {
  PointDeed deed{PointerUse::kPress, {}};
  for (std::uint32_t finger = 1; finger <= viewer::kMostPlanPointers; ++finger)
    deed.pointers.push_back({finger, 0.2 + 0.1 * finger, 0.45, 0.01 + 0.01 * swing(time_s)});
  return deed;
}

void measure(const viewer::PlanFolder& plans, const std::string& plan, const char* what, double seconds,
             const std::function<Deed(double time_s)>& deed_at) {
  std::atomic<bool> opened = false, failed = false;
  std::atomic<std::uint64_t> pictures = 0, bytes = 0, steps = 0;
  std::atomic<std::int64_t> computing_ns = 0, drawing_ns = 0;
  std::size_t vertices = 0;
  viewer::PlanningListener listener;
  listener.opening = [](const std::string& /*step*/) {};
  listener.opened = [&](const viewer::PlanningTable& table) {
    vertices = table.session().plan().body.mesh.nodes.size();
    opened = true;
  };
  listener.ready = [] { return true; };
  listener.shown = [&](const viewer::PlanningMoment& moment) {
    bytes += viewer::moment_message(moment).size();
    ++pictures;
    if (moment.moves) {
      ++steps;
      computing_ns += moment.computing.count();
    }
    drawing_ns += moment.drawing.count();
  };
  listener.steps_changed = [](const viewer::PlanningTable& /*table*/) {};
  listener.told = [](const std::string& sentence) { std::fprintf(stderr, "%s\n", sentence.c_str()); };
  listener.failed = [&](const std::string& sentence) {
    std::fprintf(stderr, "%s\n", sentence.c_str());
    failed = true;
  };
  viewer::LivePlanning planning(
      [&](const viewer::LivePlanning::Opening& opening) {
        return std::make_unique<viewer::PlanningTable>(
            plans.open(plan, opening), true, viewer::TableOptions{"liver", sim::GpuUse::kOff, 800, 600},
            [](double /*time_s*/) {});
      },
      listener);
  while (!opened && !failed) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  if (failed) return;
  const auto begun = Clock::now();
  const std::uint64_t before = pictures;
  const auto passed_s = [&] { return std::chrono::duration<double>(Clock::now() - begun).count(); };
  for (std::uint64_t number = 1; passed_s() < seconds && !failed; ++number) {
    std::this_thread::sleep_until(begun + number * std::chrono::microseconds(16'667));
    planning.apply(number, deed_at(passed_s()));
  }
  const auto count = static_cast<double>(pictures - before);
  std::printf("%s, %zu vertices: %.1f pictures a second of %.0f kB\n", what, vertices, count / passed_s(),
              static_cast<double>(bytes) / 1e3 / static_cast<double>(pictures));
  std::printf("  input to picture  median %.0f ms, 99 %% %.0f ms, longest %.0f ms\n",
              ms(planning.input_to_picture().percentile(0.5)),
              ms(planning.input_to_picture().percentile(0.99)), ms(planning.input_to_picture().longest()));
  std::printf("  of that a picture %.0f ms",
              static_cast<double>(drawing_ns) / 1e6 / static_cast<double>(pictures));
  if (steps > 0)
    std::printf(", a time step %.0f ms",
                static_cast<double>(computing_ns) / 1e6 / static_cast<double>(steps));
  std::printf(" on average\n");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "plan_page_bench FOLDER PLAN [SECONDS]\n");
    return 2;
  }
  const double seconds = argc > 3 ? std::atof(argv[3]) : 10;
  try {
    const viewer::PlanFolder plans(argv[1]);
    measure(plans, argv[2], "turning", seconds, turning);
    measure(plans, argv[2], "pulling", seconds, pulling);
    measure(plans, argv[2], "pressing with five fingers", seconds, pressing);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "plan_page_bench: %s\n", error.what());
    return 1;
  }
}
