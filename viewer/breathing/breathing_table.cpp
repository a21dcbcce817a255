#include "viewer/breathing/breathing_table.h"

#include <utility>

#include "sim/drr/registration.h"

namespace kiroku::viewer {
namespace {

constexpr sim::Colour kOutlineColour{255, 200, 0};

}  // namespace

BreathingTable::BreathingTable(const BreathingBench& bench)
    : bench_(bench),
      lung_(bench.own_lung()),
      motion_(bench.own_motion()),
      waveform_(bench.model().waveform),
      time_s_(bench.times_s(waveform_).front()),
      similarities_(bench.radiographs().size()) {}

void BreathingTable::apply(const MotionDeed& deed) {
  sim::Waveform waveform = bench_.waveform_of(deed);
  if (deed.surface_groups != motion_.surface_groups) lung_ = bench_.lung_of(deed);
  waveform_ = std::move(waveform);
  motion_ = deed;
  ++revision_;
  similarities_.assign(similarities_.size(), std::nullopt);
}

double BreathingTable::duration_s() const {
  return bench_.has_radiographs() ? bench_.radiographs().back().time_s : waveform_.duration_s();
}

std::vector<sim::Vector3> BreathingTable::moved_m(double time_s) const {
  return lung_->responses.displacement_m(motion_.motion, waveform_, bench_.model_time_s(time_s));
}

sim::TumourPath BreathingTable::path() const {
  sim::TumourPath path;
  path.rest_m = bench_.tumour_m();
  path.times_s = bench_.times_s(waveform_);
  for (const double time_s : path.times_s) {
    path.centres_m.push_back(
        path.rest_m + lung_->tumour.displacement_m(motion_.motion, waveform_, bench_.model_time_s(time_s)));
  }
  return path;
}

BreathingTable::Shown BreathingTable::picture(std::size_t factor) const {
  Shown shown;
  shown.time_s = time_s_;
  if (bench_.has_radiographs()) {
    shown.radiograph = bench_.radiograph_at(time_s_);
    shown.time_s = bench_.radiographs()[*shown.radiograph].time_s;
  }
  const std::vector<sim::Vector3> moved = moved_m(shown.time_s);
  const sim::ProjectionImage drr = bench_.drr(factor, moved);
  shown.tumour_m = lung_->tumour.displacement_m(motion_.motion, waveform_, bench_.model_time_s(shown.time_s));
  const auto& windows = bench_.windows();
  if (!shown.radiograph) {
    shown.picture = sim::overlay_of(drr, drr, sim::OverlayMode::kOpacity, 1, windows);
  } else {
    const sim::ProjectionImage& own = bench_.radiographs()[*shown.radiograph].image;
    shown.picture = factor == 1
                        ? sim::overlay_of(own, drr, look_.mode, look_.part, windows)
                        : sim::overlay_of(sim::binned(own, factor), drr, look_.mode, look_.part, windows);
  }
  if (look_.outlined) {
    const std::vector<sim::PixelLine> lines = bench_.outline(factor, moved);
    sim::draw(shown.picture, lines, kOutlineColour);
    if (shown.picture.columns > drr.columns)
      sim::draw(shown.picture, lines, kOutlineColour, static_cast<double>(drr.columns));
  }
  return shown;
}

bool BreathingTable::measure_one() {
  if (!bench_.has_radiographs()) return false;
  const std::size_t count = similarities_.size(), first = bench_.radiograph_at(time_s_);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = (first + i) % count;
    if (similarities_[at]) continue;
    const BenchRadiograph& one = bench_.radiographs()[at];
    similarities_[at] = sim::gradient_correlation(one.image, bench_.drr(1, moved_m(one.time_s)));
    return true;
  }
  return false;
}

}  // namespace kiroku::viewer
