#include "trainer/exclusion/pointer_instruments.h"

#include <string>
#include <utility>

#include "base/error.h"

namespace kiroku::trainer {

using sim::Pose;
using sim::Vector3;

namespace {

/// The handle, not rolled, of the instrument whose tip ends there; as near as it can come.
Pose handle_of(const Trocar& trocar, const Vector3& end_m) {
  const Vector3 from_trocar_m = end_m - trocar.pose.position_m;
  return instrument_at(trocar,
                       {end_m - kInstrumentMetres * from_trocar_m.normalized(), trocar.pose.orientation})
      .handle;
}

}  // namespace

PointerInstruments::PointerInstruments(sim::HapticDevice& ends, std::vector<Trocar> trocars, double period_s)
    : ends_(ends), trocars_(std::move(trocars)), most_step_m_(kMostHandleSpeedMetres * period_s) {
  if (trocars_.size() != ends_.tools())
    throw UsageError("each instrument needs a trocar of its own: there are " +
                     std::to_string(trocars_.size()) + " trocars for " + std::to_string(ends_.tools()) +
                     " instruments");
}

Pose PointerInstruments::on_the_way(const Trocar& trocar, const Pose& from, const Pose& to) const {
  const Vector3 way_m = to.position_m - from.position_m;
  if (way_m.norm() <= most_step_m_) return to;
  // On the straight line, but for what no instrument can follow: there it is drawn back, which may be
  // further.
  constexpr int kHalvings = 8;
  double step_m = most_step_m_;
  for (int i = 0; i < kHalvings; ++i, step_m /= 2) {
    const Pose aim{from.position_m + step_m * way_m.normalized(), trocar.pose.orientation};
    const Pose next = instrument_at(trocar, aim).handle;
    if ((next.position_m - from.position_m).norm() <= most_step_m_) return next;
  }
  return from;
}

bool PointerInstruments::read(std::span<Pose> poses) {
  if (!ends_.read(poses)) return false;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose wanted = handle_of(trocars_[i], poses[i].position_m);
    if (last_.size() == i) last_.push_back(wanted);
    last_[i] = on_the_way(trocars_[i], last_[i], wanted);
    poses[i] = last_[i];
  }
  return true;
}

}  // namespace kiroku::trainer
