// Pushing objects A and B aside with five fingers in real time: forces at 1 kHz in a thread of their own,
// pictures of 640 x 480 in software beside it, as many as are made. The figures stand in
// docs/explanation/training.md.
//   train_exclusion_bench [VERTICES [SECONDS]]
#include <cstdio>
#include <cstdlib>

#include "trainer/exclusion/exclusion_run.h"

namespace {

using namespace kiroku;

/// Fingertips under the border, up and down by 8 mm every two seconds: always in contact.
trainer::HandMotion lifting(trainer::ObjectKind kind, double seconds) {
  trainer::HandMotion motion;
  motion.fingers = 5;
  const double touching_m = -trainer::half_thickness_m(kind) - trainer::kFingertipMetres + 0.003;
  for (int half = 0; half <= static_cast<int>(seconds) + 1; ++half) {
    std::vector<sim::Pose> poses(motion.fingers);
    for (std::size_t i = 0; i < motion.fingers; ++i)
      poses[i].position_m = {-0.06 + 0.03 * static_cast<double>(i), -0.046, touching_m + (half % 2) * 0.008};
    motion.times_s.push_back(half);
    motion.poses.push_back(poses);
  }
  return motion;
}

void measure(trainer::ObjectKind kind, std::size_t vertices, double seconds) {
  trainer::OrganObject object = trainer::make_object(kind, vertices);
  trainer::ExclusionTask task = trainer::exclusion_task(kind);
  task.hold_s = task.most_s = 2 * seconds;  // nothing ends it before its time
  const trainer::ExclusionBody body(std::move(object), task);
  trainer::ExclusionOptions options;
  options.shows_stress = true;
  options.picture_rate_hz = 60;
  options.most_s = seconds;
  trainer::ExclusionRunner runner(body, options);
  trainer::MotionPlayer player(lifting(kind, seconds), 1 / options.force_rate_hz);
  const trainer::ExclusionOutcome outcome =
      runner.run_in_real_time(player, [](const trainer::ExclusionView&) { return true; });
  const sim::ForceLoopStatistics& loop = *outcome.force_loop;
  const auto us = [](std::chrono::nanoseconds time) { return static_cast<double>(time.count()) / 1e3; };
  std::printf(
      "object %s: %zu vertices, %zu tetrahedra, five fingers, largest force %.2f N\n"
      "  forces  %.1f Hz (goal 1000), %.3f %% on time, step %.0f us median, %.0f us 99 %%, %.0f us longest; "
      "real-time "
      "priority: %s\n"
      "  pictures with stress, 640 x 480 in software  %.1f a second (goal 20)\n",
      trainer::name_of(kind).c_str(), body.object().mesh.nodes.size(), body.object().mesh.tetrahedra.size(),
      outcome.score.peak_force_n, static_cast<double>(loop.steps) / outcome.elapsed_s,
      100 * loop.on_time_share(), us(loop.step_50), us(loop.step_99), us(loop.step_longest),
      loop.real_time ? "yes" : "no", static_cast<double>(outcome.pictures) / outcome.elapsed_s);
}

}  // namespace

int main(int argc, char** argv) {
  const auto vertices = static_cast<std::size_t>(argc > 1 ? std::atol(argv[1]) : 5000);
  const double seconds = argc > 2 ? std::atof(argv[2]) : 20;
  try {
    for (const trainer::ObjectKind kind : {trainer::ObjectKind::kLiver, trainer::ObjectKind::kLung})
      measure(kind, vertices, seconds);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "train_exclusion_bench: %s\n", error.what());
    return 1;
  }
}
