#include "trainer/exclusion/exclusion_run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "sim/haptics/rate_scheduler.h"
#include "sim/render/colour_map.h"
#include "sim/render/volume_renderer.h"
#include "trainer/exclusion/press_cue.h"
#include "trainer/exclusion/stress_score.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

constexpr std::uint8_t kContactLineMark = 1, kFingerMark = 2, kGhostMark = 3;
constexpr sim::Rgb kFingerColour{236, 205, 182}, kSteelColour{188, 194, 200}, kGhostColour{120, 170, 255};

void check(const ExclusionOptions& options) {
  const auto rate = [](double hz, double most) { return std::isfinite(hz) && hz >= 1 && hz <= most; };
  if (!rate(options.force_rate_hz, 1e5) || !rate(options.picture_rate_hz, options.force_rate_hz))
    throw UsageError("forces come at 1 to 100,000 Hz, and pictures no more often than forces");
}

}  // namespace

ExclusionRunner::ExclusionRunner(const ExclusionBody& body, ExclusionOptions options, sim::GpuUse gpu)
    : body_(body),
      options_((check(options), std::move(options))),
      renderer_(body.object().mesh, gpu),
      meter_(renderer_, body.task(), options_.width, options_.height),
      von_mises_pa_(body.object().mesh.tetrahedra.size()) {}

sim::SurfaceScene ExclusionRunner::scene_of(const HandForces::State& hand, double time_s,
                                            std::span<const double> displacement_m) const {
  sim::SurfaceScene scene;
  scene.camera = camera_of(body_.task(), options_.width, options_.height);
  scene.width = options_.width;
  scene.height = options_.height;
  scene.tissue = body_.object().tissue;
  if (options_.shows_stress) {
    for (const double pa : sim::at_nodes(body_.object().mesh, von_mises_pa_))
      scene.node_colours.push_back(sim::viridis(pa / body_.task().damage_pa));
  }
  const bool shows_press = options_.shows_press && hand.any;
  if (shows_press) {
    scene.node_colours.resize(body_.object().mesh.nodes.size(), scene.tissue);
    colour_pressed_tissue(body_.object().mesh, displacement_m, hand, scene.node_colours);
  }
  scene.solids.push_back({line_of(body_.task()), kContactLineMark, false});
  if (hand.any) add_tools(hand, shows_press, scene);
  if (options_.ghost) add_ghost(time_s, scene);
  return scene;
}

void ExclusionRunner::add_tools(const HandForces::State& hand, bool shows_press,
                                sim::SurfaceScene& scene) const {
  const std::vector<sim::ContactTool> tools =
      touching_tools(hand.poses.size(), options_.touch, 0, options_.instruments);
  const sim::Rgb& colour = options_.touch == Touch::kTrocar ? kSteelColour : kFingerColour;
  for (std::size_t i = 0; i < hand.poses.size(); ++i) {
    const PressCue cue = shows_press ? press_cue(hand.forces_n[i].norm()) : PressCue();
    scene.solids.push_back({{tools[i].shape, hand.poses[i], with_cue(colour, cue)}, kFingerMark, false});
  }
  for (std::size_t part = 0; part < hand.parts.size(); ++part)
    scene.solids.push_back(
        {{tools[hand.poses.size() + part].shape, hand.parts[part], colour}, kFingerMark, false});
}

void ExclusionRunner::add_ghost(double time_s, sim::SurfaceScene& scene) const {
  const std::vector<sim::Pose> poses = options_.ghost->at(time_s);
  const auto add = [&](const sim::ToolShape& shape, const sim::Pose& pose) {
    scene.solids.push_back({{shape, pose, kGhostColour}, kGhostMark, true});
  };
  if (options_.touch != Touch::kTrocar) {
    for (const sim::Pose& pose : poses) add(sim::Sphere{kFingertipMetres}, pose);
    return;
  }
  const InstrumentShape shape(options_.instruments.tip);
  const std::vector<Trocar> trocars = trocars_of(body_.task(), poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const InstrumentPlace place = instrument_at(trocars[i], poses[i]);
    add(shape.tips(1, 0).front().shape, shape.tip_at(place));
    add(shape.shafts(1, 0).front().shape, shape.shaft_at(place));
  }
}

bool ExclusionRunner::look(HandForces& forces, ExclusionJudge& judge, double time_s,
                           const ExclusionObserver& observer) {
  const auto looked_at = std::chrono::steady_clock::now();
  const Eigen::VectorXd displacement_m = forces.refresh().displacement_m;
  const std::span<const double> displacement(displacement_m.data(),
                                             static_cast<std::size_t>(displacement_m.size()));
  ExclusionView view;
  view.time_s = time_s;
  const std::vector<sim::SymmetricTensor> stress_pa = body_.body().stress_pa(displacement_m);
  view.high_von_mises_pa =
      stress_of_share_pa(body_.object().mesh, body_.volumes_m3(), body_.body().at_nodes(stress_pa));
  for (std::size_t t = 0; t < von_mises_pa_.size(); ++t) {
    von_mises_pa_[t] = sim::von_mises(stress_pa[t]);
    view.largest_von_mises_pa = std::max(view.largest_von_mises_pa, von_mises_pa_[t]);
    if (von_mises_pa_[t] > body_.task().damage_pa) view.damaged_m3 += body_.volumes_m3()[t];
  }
  view.visible_share = meter_.visible_share(displacement);
  view.hand = forces.state();
  judge.see({time_s, view.visible_share, view.largest_von_mises_pa, view.damaged_m3, view.high_von_mises_pa});
  const bool given_up = options_.most_s > 0 && time_s >= options_.most_s;
  if (!observer) return !judge.over() && !given_up;
  view.danger = danger(view.largest_von_mises_pa, body_.task().damage_pa);
  view.tone_hz = danger_tone_hz(view.danger);
  view.held_s = judge.held_s();
  view.score = judge.score();
  sim::Picture picture;
  if (options_.draws) {
    picture = renderer_.render(displacement, scene_of(view.hand, time_s, displacement)).picture;
    view.picture = &picture;
  }
  view.displacement_m = displacement;
  view.looked_at = looked_at;
  return observer(view) && !judge.over() && !given_up;
}

namespace {

ExclusionOutcome outcome_of(const ExclusionJudge& judge, const HandForces& forces,
                            const MotionRecorder& recorder, const SafeDevice& safe) {
  ExclusionOutcome outcome;
  outcome.score = judge.score();
  const HandForces::State hand = forces.state();
  outcome.score.path_m = hand.path_m;
  outcome.score.peak_force_n = hand.peak_force_n;
  outcome.score.peak_wrist_n = hand.peak_wrist_n;
  outcome.peak_wall_n = hand.peak_wall_n;
  outcome.motion = recorder.motion();
  outcome.faults = safe.faults();
  return outcome;
}

}  // namespace

ExclusionOutcome ExclusionRunner::run_in_own_time(sim::HapticDevice& device,
                                                  const ExclusionObserver& observer) {
  const double period_s = 1 / options_.force_rate_hz;
  SafeDevice safe(device, period_s, options_.limits);
  MotionRecorder recorder(safe, period_s, body_.task().most_s + 1);
  HandForces forces(body_, device.tools(), options_.feedback, options_.touch, options_.instruments);
  ExclusionJudge judge(body_.task());
  std::vector<sim::Pose> poses(device.tools());
  std::vector<Vector3> forces_n(device.tools(), Vector3::Zero());
  const auto steps_a_picture =
      static_cast<std::uint64_t>(std::lround(options_.force_rate_hz / options_.picture_rate_hz));
  bool any = false;
  std::uint64_t step = 0, pictures = 0;
  for (bool goes_on = true; goes_on; ++step) {
    any = recorder.read(poses) || any;
    if (any) forces.wrist_at(recorder.has_wrist() ? std::optional(recorder.wrist()) : std::nullopt);
    if (any) forces.forces(poses, period_s, forces_n);
    if (any && recorder.has_wrist()) recorder.write_wrist(forces.wrist_force(recorder.wrist().position_m));
    recorder.write(forces_n);
    // What is near the fingers is looked for beside the pictures too, so that coarse pictures miss no
    // contact.
    if (step % steps_a_picture == 0) {
      goes_on = look(forces, judge, static_cast<double>(step) * period_s, observer);
      ++pictures;
    }
  }
  ExclusionOutcome outcome = outcome_of(judge, forces, recorder, safe);
  outcome.pictures = pictures;
  outcome.elapsed_s = static_cast<double>(step) * period_s;
  return outcome;
}

ExclusionOutcome ExclusionRunner::run_in_real_time(sim::HapticDevice& device,
                                                   const ExclusionObserver& observer) {
  using std::chrono::nanoseconds;
  const double period_s = 1 / options_.force_rate_hz;
  SafeDevice safe(device, period_s, options_.limits);
  // However this ends, no force stays on a finger.
  const AtRest at_rest(safe);
  sim::MonotonicClock clock;
  MotionRecorder recorder(safe, period_s, body_.task().most_s + 1, clock);
  HandForces forces(body_, device.tools(), options_.feedback, options_.touch, options_.instruments);
  ExclusionJudge judge(body_.task());
  sim::ForceLoopOptions loop_options;
  loop_options.rate_hz = options_.force_rate_hz;
  std::uint64_t pictures = 0;
  sim::ForceLoopStatistics statistics;
  const nanoseconds begun = clock.now();
  {
    sim::ForceLoop loop(recorder, forces, loop_options);
    const auto between = nanoseconds(static_cast<std::int64_t>(1e9 / options_.picture_rate_hz));
    for (nanoseconds due = begun; loop.running(); due = std::max(due + between, clock.now())) {
      clock.sleep_until(due);
      ++pictures;
      if (!look(forces, judge, std::chrono::duration<double>(clock.now() - begun).count(), observer)) break;
    }
    loop.stop();
    statistics = loop.statistics();
  }
  safe.come_to_rest();
  ExclusionOutcome outcome = outcome_of(judge, forces, recorder, safe);
  outcome.pictures = pictures;
  outcome.elapsed_s = std::chrono::duration<double>(clock.now() - begun).count();
  outcome.force_loop = statistics;
  return outcome;
}

}  // namespace kiroku::trainer
