#include "viewer/breathing/series_fitting.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sim/drr/registration.h"

namespace kiroku::viewer {
namespace {

/// Pictures are taken in pixels that are no smaller than this of the lesser side: what is finer is noise.
constexpr std::size_t kMostFitPixels = 256;

/// Ends a fit from within.
struct FitCancelled : std::exception {
  [[nodiscard]] const char* what() const noexcept override { return "the fit was cancelled"; }
};

std::vector<std::optional<SeenTumour>> seen_of(const BreathingBench& bench, const sim::SeriesFit& fit,
                                               const sim::TumourTrack& track) {
  std::vector<std::optional<SeenTumour>> seen(bench.radiographs().size());
  for (std::size_t m = 0; m < track.moments.size(); ++m) {
    const sim::TumourMoment& moment = track.moments[m];
    if (moment.sight != sim::TumourSight::kSeen) continue;
    for (const std::size_t picture : fit.moments[m].pictures)
      seen[picture] = SeenTumour{moment.place_m - bench.tumour_m(),
                                 moment.covariance.diagonal().cwiseMax(0.0).cwiseSqrt()};
  }
  return seen;
}

}  // namespace

FittedSeries fit_to_radiographs(const BreathingBench& bench, const FitDeed& deed,
                                const sim::SeriesProgress& progress) {
  const auto begin = std::chrono::steady_clock::now();
  const sim::BreathingModel model = bench.model_with(deed.start);
  const sim::ProjectionGeometry& geometry = bench.geometry(1);
  const std::size_t factor =
      std::max<std::size_t>(std::min(geometry.columns(), geometry.rows()) / kMostFitPixels, 1);
  const std::vector<sim::ProjectionGeometry> views{geometry.binned(factor)};
  std::vector<sim::SeriesPicture> pictures;
  for (const BenchRadiograph& one : bench.radiographs())
    pictures.push_back({bench.model_time_s(one.time_s), 0, sim::binned(one.image, factor), one.name});
  sim::BreathingScene scene = bench.scene_of(model);
  FittedSeries fitted{
      deed.start,
      sim::fit_series(model, scene, views, pictures,
                      {.direction = deed.direction, .lies_as_given = true, .progress = progress}),
      {},
      {}};
  if (fitted.fit.refusal.empty()) {
    fitted.motion.motion = fitted.fit.motion;
    if (fitted.motion.cycle_s) {
      const sim::CycleFit cycle =
          fitted.fit.cycle.value_or(sim::CycleFit{fitted.fit.waveform.duration_s(), 0});
      fitted.motion.cycle_s = cycle.cycle_s;
      // A phase is the same a cycle later: the one that is nearest to where its slider was.
      const auto near = [&](sim::WaveFit& found, sim::GroupMotion& motion, const sim::GroupMotion& start) {
        shift_phase(found, std::round((start.phase_s - found.phase_s) / cycle.cycle_s), cycle);
        motion.phase_s = found.phase_s;
      };
      near(fitted.fit.rib_cage, fitted.motion.motion.rib_cage, deed.start.motion.rib_cage);
      near(fitted.fit.diaphragm, fitted.motion.motion.diaphragm, deed.start.motion.diaphragm);
    }
    progress("looking for the tumour", 0, 1);
    fitted.tumour = seen_of(bench, fitted.fit,
                            sim::track_tumour(model, scene, bench.volume(), views, pictures, fitted.fit));
  }
  fitted.took = std::chrono::steady_clock::now() - begin;
  return fitted;
}

BackgroundFit::BackgroundFit(const BreathingBench& bench, const FitDeed& deed,
                             std::unique_ptr<Turns::Turn> turn, Listener listener)
    : listener_(std::move(listener)),
      turn_(std::move(turn)),
      thread_([this, &bench, deed] { run(bench, deed); }) {}

BackgroundFit::~BackgroundFit() {
  cancel();
  thread_.join();
}

void BackgroundFit::run(const BreathingBench& bench, const FitDeed& deed) {
  const auto progress = [this](const std::string& doing, std::size_t done, std::size_t all) {
    if (cancelled_) throw FitCancelled();
    listener_.progress(doing, done, all);
  };
  std::optional<FittedSeries> fitted;
  std::string sentence;
  try {
    fitted = fit_to_radiographs(bench, deed, progress);
    if (cancelled_) throw FitCancelled();
  } catch (const std::exception& error) {
    fitted.reset();
    sentence = error.what();
  }
  turn_.reset();
  over_ = true;
  if (fitted) {
    listener_.fitted(*fitted);
  } else {
    listener_.ended(sentence);
  }
}

}  // namespace kiroku::viewer
