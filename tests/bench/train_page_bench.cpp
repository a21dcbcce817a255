// An attempt as the trainer's page makes it, without the browser: five pointers 60 times a second, forces at
// 1 kHz, each picture with stress as a JPEG in its message. The figures stand in
// docs/explanation/training.md.
//   train_page_bench [VERTICES [SECONDS]]
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <thread>

#include "base/error.h"
#include "trainer/exclusion/live_attempt.h"
#include "viewer/training/attempt_messages.h"

namespace {

using namespace kiroku;
using Clock = trainer::PointerHand::Clock;

/// Five fingers below the border, up into it and back every two seconds.
trainer::PointerInput lifting(std::uint64_t number, double time_s) {
  const double up = 0.045 + 0.04 * (1 - std::cos(time_s * std::numbers::pi)) / 2;
  trainer::PointerInput input{number, {}};
  for (std::size_t finger = 1; finger <= trainer::kMostExclusionFingers; ++finger)
    input.pointers.push_back({finger, 0.2 + 0.1 * static_cast<double>(finger), 0.66 - up, 0});
  return input;
}

void print(const char* what, const trainer::LiveOutcome::Latency& latency) {
  const auto ms = [](std::chrono::nanoseconds time) { return static_cast<double>(time.count()) / 1e6; };
  std::printf("  %s  median %.2f ms, 99 %% %.2f ms, longest %.1f ms\n", what, ms(latency.median),
              ms(latency.of_99), ms(latency.longest));
}

void measure(trainer::ObjectKind kind, std::size_t vertices, double seconds) {
  trainer::OrganObject object = trainer::make_object(kind, vertices);
  trainer::ExclusionTask task = trainer::exclusion_task(kind);
  task.hold_s = task.most_s = 2 * seconds;  // nothing ends it before its time
  const auto body = std::make_shared<const trainer::ExclusionBody>(std::move(object), task);
  trainer::ExclusionOptions options;
  options.shows_stress = true;
  options.picture_rate_hz = 30;
  options.most_s = seconds;
  std::atomic<bool> over = false;
  std::atomic<std::uint64_t> bytes = 0;
  trainer::LiveOutcome outcome;
  std::string failed;
  {
    trainer::LiveAttempt attempt(
        [&] { return body; }, options, trainer::kMostExclusionFingers,
        {[](const trainer::ExclusionBody&) {},
         [&](const trainer::LiveView& view) {
           bytes += viewer::moment_message(view, true, viewer::jpeg_of_moment(view)).size();
         },
         [&](const trainer::LiveOutcome& ended) {
           outcome = ended;
           over = true;
         },
         [&](const std::string& sentence) {
           std::fprintf(stderr, "%s\n", sentence.c_str());
           over = true;
         }});
    const auto begun = Clock::now();
    for (std::uint64_t number = 1; !over; ++number) {
      std::this_thread::sleep_until(begun + number * std::chrono::microseconds(16'667));
      attempt.point(lifting(number, std::chrono::duration<double>(Clock::now() - begun).count()));
    }
  }
  if (!failed.empty()) throw Error(failed);
  const trainer::ExclusionOutcome& attempt = outcome.outcome;
  std::printf("object %s: %zu vertices, five pointers, largest force %.1f N\n",
              trainer::name_of(kind).c_str(), body->object().mesh.nodes.size(), attempt.score.peak_force_n);
  std::printf(
      "  forces  %.1f Hz (goal 1000), %.2f %% on time; pictures  %.1f a second (goal 20), %.0f kB each\n",
      outcome.force_rate_hz, 100 * attempt.force_loop->on_time_share(), outcome.picture_rate_hz,
      static_cast<double>(bytes) / 1e3 / static_cast<double>(attempt.pictures));
  print("input to force  ", outcome.input_to_force);
  print("input to picture", outcome.input_to_picture);
}

}  // namespace

int main(int argc, char** argv) {
  const auto vertices = static_cast<std::size_t>(argc > 1 ? std::atol(argv[1]) : 4000);
  const double seconds = argc > 2 ? std::atof(argv[2]) : 20;
  try {
    for (const trainer::ObjectKind kind : {trainer::ObjectKind::kLiver, trainer::ObjectKind::kLung})
      measure(kind, vertices, seconds);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "train_page_bench: %s\n", error.what());
    return 1;
  }
}
