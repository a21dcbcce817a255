#include "trainer/haptic_rate/sensing_subject.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/error.h"
#include "trainer/haptic_rate/held_forces.h"
#include "trainer/haptic_rate/pressing_hand.h"
#include "trainer/psychophysics/vibration_sense.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

/// What a device is to play all the time, and what it is given instead.
struct Held {
  std::vector<double> wanted_n, held_n;
};

void check(const SensingModel& model) {
  if (!(model.device_hz > 0) || !(model.masking_db >= 0) || !std::isfinite(model.masking_db) ||
      !std::isfinite(model.keener_db) || !(model.spread_db > 0) || !std::isfinite(model.spread_db) ||
      !(model.lapse_rate >= 0 && model.lapse_rate < 1)) {
    throw UsageError(
        "a sensing subject needs a device's bandwidth and a spread greater than zero, no negative masking, "
        "and a "
        "lapse rate below 1");
  }
}

/// The newest forces of somebody else, as often as one likes.
class Latest : public sim::ForceSource {
 public:
  explicit Latest(const std::vector<Vector3>& forces_n) : forces_n_(forces_n) {}
  void forces(std::span<const sim::Pose> /*poses*/, double /*period_s*/,
              std::span<Vector3> forces_n) override {
    std::ranges::copy(forces_n_, forces_n.begin());
  }

 private:
  const std::vector<Vector3>& forces_n_;
};

std::vector<Held> pressed(const Plate& plate, const Fingers& fingers, double rate_hz) {
  PressingHand pressing(plate, fingers);
  const std::size_t count = fingers.count();
  std::vector<sim::Pose> poses(count);
  std::vector<Vector3> wanted_n(count), held_n(count);
  Latest latest(wanted_n);
  HeldForces held(latest, rate_hz);
  std::vector<Held> found(count);
  for (std::int64_t step = press_steps(rate_hz); step >= 0; --step) {
    pressing.hand.read(poses);
    pressing.contact.forces(poses, kForcePeriodSeconds, wanted_n);
    held.forces(poses, kForcePeriodSeconds, held_n);
    pressing.hand.write(held_n);
    for (std::size_t i = 0; i < count; ++i) {
      found[i].wanted_n.push_back(wanted_n[i].z());
      found[i].held_n.push_back(held_n[i].z());
    }
  }
  return found;
}

/// How hard the plate resists to each of these fingertips being drawn along it, all together, N/m.
std::vector<double> drawn_stiffness_n_m(const Plate& plate, const Fingers& fingers) {
  constexpr double kDrawnMetres = 1e-4;
  std::vector<sim::Pose> poses = plate.pressing(fingers, kStrokePressN);
  PlateForces contact(plate, poses, true);
  std::vector<Vector3> before_n(poses.size()), after_n(poses.size());
  contact.forces(poses, kForcePeriodSeconds, before_n);
  for (sim::Pose& pose : poses) pose.position_m.x() += kDrawnMetres;
  contact.forces(poses, kForcePeriodSeconds, after_n);
  std::vector<double> found;
  for (std::size_t i = 0; i < poses.size(); ++i)
    found.push_back(std::abs(after_n[i].x() - before_n[i].x()) / kDrawnMetres);
  return found;
}

std::vector<Held> stroked(const Plate& plate, const Fingers& fingers, double rate_hz) {
  const std::vector<double> stiffness_n_m = drawn_stiffness_n_m(plate, fingers);
  constexpr double kMostN = kStrokeFriction * kStrokePressN;
  const std::size_t count = fingers.count();
  std::vector<sim::Pose> poses(count);
  std::vector<Vector3> wanted_n(count), held_n(count);
  Latest latest(wanted_n);
  HeldForces held(latest, rate_hz);
  std::vector<double> anchor_m(count);
  std::vector<Held> found(count);
  const std::int64_t steps = press_steps(rate_hz);
  for (std::int64_t step = 0; step <= steps; ++step) {
    const double at_m = kStrokeMetres * std::sin(2 * std::numbers::pi * kStrokeHz * kForcePeriodSeconds *
                                                 static_cast<double>(step));
    for (std::size_t i = 0; i < count; ++i) {
      // It sticks until friction no longer holds it, and then drags its place along.
      const double sticks_m = kMostN / stiffness_n_m[i];
      anchor_m[i] = std::clamp(anchor_m[i], at_m - sticks_m, at_m + sticks_m);
      wanted_n[i] = {stiffness_n_m[i] * (anchor_m[i] - at_m), 0, 0};
    }
    held.forces(poses, kForcePeriodSeconds, held_n);
    for (std::size_t i = 0; i < count; ++i) {
      found[i].wanted_n.push_back(wanted_n[i].x());
      found[i].held_n.push_back(held_n[i].x());
    }
  }
  return found;
}

/// What of the held forces is not in those that change all the time, played by the device, as a movement of
/// the skin that another force presses at the same time.
std::vector<double> skin_of(const Held& forces, const SensingModel& model) {
  const double kept = std::exp(-2 * std::numbers::pi * model.device_hz * kForcePeriodSeconds);
  std::vector<double> skin_m(forces.held_n.size());
  double played_n = 0;
  for (std::size_t i = 0; i < skin_m.size(); ++i) {
    played_n = kept * played_n + (1 - kept) * (forces.held_n[i] - forces.wanted_n[i]);
    const double pressing_n = model.manner == Manner::kPress ? forces.wanted_n[i] : kStrokePressN;
    skin_m[i] = played_n / fingerpad_stiffness_n_m(pressing_n);
  }
  return skin_m;
}

/// What the others mask of each finger, in shares of SensingModel::masking_db.
std::vector<double> masked_shares(const Fingers& fingers) {
  const std::vector<Finger> which = fingers.which();
  std::vector<double> shares(which.size());
  for (std::size_t i = 0; i < which.size(); ++i) {
    for (std::size_t j = 0; j < which.size(); ++j) {
      if (i != j)
        shares[i] += std::exp2(1 - std::abs(static_cast<int>(which[i]) - static_cast<int>(which[j])));
    }
  }
  return shares;
}

std::vector<Held> touched(const Plate& plate, const Fingers& fingers, double rate_hz, Manner manner) {
  return manner == Manner::kPress ? pressed(plate, fingers, rate_hz) : stroked(plate, fingers, rate_hz);
}

std::vector<double> levels_alone_db(const std::vector<Held>& touched, const SensingModel& model) {
  std::vector<double> levels_db;
  for (const Held& forces : touched)
    levels_db.push_back(felt_level_db(model.curves, skin_of(forces, model), kForcePeriodSeconds) +
                        model.keener_db);
  return levels_db;
}

/// Of the finger that feels most, others masking it.
double strongest_db(const std::vector<Held>& touched, const Fingers& fingers, const SensingModel& model) {
  const std::vector<double> alone_db = levels_alone_db(touched, model), shares = masked_shares(fingers);
  double strongest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < alone_db.size(); ++i)
    strongest = std::max(strongest, alone_db[i] - model.masking_db * shares[i]);
  return strongest;
}

/// Thresholds of fingers by models of one manner, for which the plate is touched once at each rate.
class Prediction {
 public:
  Prediction(const Plate& plate, RateSeries series, const Fingers& fingers, Manner manner)
      : plate_(plate), series_(series), fingers_(fingers), manner_(manner) {}

  PredictedThreshold of(const SensingModel& model) {
    check(model);
    PredictedThreshold found;
    found.level_at_100_hz_db = level_db(1, model);
    found.all_are_felt = found.level_at_100_hz_db >= 0;
    if (found.all_are_felt) return found;
    // Rates fall with i. A rate may be felt less than one above it, so that the first that is felt is looked
    // for from above, in steps of a tenth, and then between the last two.
    constexpr double kStep = 1.1;
    std::size_t not_felt = 1, felt = 1;
    while (level_db(felt, model) < 0) {
      if (felt == rates_of(series_)) return found;
      not_felt = felt;
      felt =
          std::min(rates_of(series_), static_cast<std::size_t>(std::ceil(static_cast<double>(felt) * kStep)));
    }
    while (felt - not_felt > 1) {
      const std::size_t middle = (felt + not_felt) / 2;
      (level_db(middle, model) >= 0 ? felt : not_felt) = middle;
    }
    found.hz = std::sqrt(rate_hz(series_, felt) * rate_hz(series_, not_felt));
    return found;
  }

 private:
  double level_db(std::size_t i, const SensingModel& model) {
    const auto [touch, is_new] = touches_.try_emplace(i);
    if (is_new) touch->second = touched(plate_, fingers_, rate_hz(series_, i), manner_);
    return strongest_db(touch->second, fingers_, model);
  }

  const Plate& plate_;
  RateSeries series_;
  Fingers fingers_;
  Manner manner_;
  std::map<std::size_t, std::vector<Held>> touches_;
};

}  // namespace

Manner manner_of(const std::string& name) {
  for (const Manner manner : {Manner::kPress, Manner::kStroke}) {
    if (name == name_of(manner)) return manner;
  }
  throw UsageError("'" + name + "' is no manner to touch the plate: it must be press or stroke");
}

std::string name_of(Manner manner) { return manner == Manner::kPress ? "press" : "stroke"; }

double felt_level_db(const Plate& plate, const Fingers& fingers, double rate_hz, const SensingModel& model) {
  check(model);
  return strongest_db(touched(plate, fingers, rate_hz, model.manner), fingers, model);
}

PredictedThreshold predicted_threshold(const Plate& plate, RateSeries series, const Fingers& fingers,
                                       const SensingModel& model) {
  return Prediction(plate, series, fingers, model.manner).of(model);
}

std::optional<double> masking_for(const Plate& plate, const Fingers& fingers, double threshold_hz,
                                  const SensingModel& model) {
  check(model);
  if (fingers.count() < 2) return std::nullopt;
  const std::vector<double> alone_db =
                                levels_alone_db(touched(plate, fingers, threshold_hz, model.manner), model),
                            shares = masked_shares(fingers);
  // The finger that is masked least for what it feels is the last to feel nothing.
  double needed_db = 0;
  for (std::size_t i = 0; i < alone_db.size(); ++i) needed_db = std::max(needed_db, alone_db[i] / shares[i]);
  if (needed_db <= 0) return std::nullopt;
  return needed_db;
}

double keener_for(const Plate& plate, const Fingers& fingers, double threshold_hz,
                  const SensingModel& model) {
  return model.keener_db - felt_level_db(plate, fingers, threshold_hz, model);
}

std::vector<TouchCurves> touch_curves_to_try() {
  std::vector<TouchCurves> all;
  for (const double slope_db : {0.0, 5.0, 10.0}) {
    for (const double np3_to_hz : {1.0, 3.0, 10.0}) {
      TouchCurves curves;
      curves.np1_slope_db = slope_db;
      curves.np3_to_hz = np3_to_hz;
      all.push_back(curves);
    }
  }
  return all;
}

PredictedRange predicted_beside(const Plate& plate, RateSeries series, const Fingers& fingers,
                                const Fingers& anchor, double anchor_hz, const SensingModel& model) {
  PredictedRange range{std::numeric_limits<double>::infinity(), 0};
  Prediction prediction(plate, series, fingers, model.manner);
  for (const TouchCurves& curves : touch_curves_to_try()) {
    SensingModel one = model;
    one.curves = curves;
    one.manner = Manner::kPress;
    one.keener_db = keener_for(plate, anchor, anchor_hz, one);
    one.manner = model.manner;
    const PredictedThreshold predicted = prediction.of(one);
    const double hz = predicted.hz.value_or(rate_hz(series, predicted.all_are_felt ? 1 : rates_of(series)));
    range.least_hz = std::min(range.least_hz, hz);
    range.most_hz = std::max(range.most_hz, hz);
  }
  return range;
}

std::vector<SensingModel> sensing_group(const SensingModel& model, std::size_t subjects, double between_db,
                                        std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<SensingModel> group(subjects, model);
  for (SensingModel& subject : group) subject.keener_db += between_db * standard_normal(random);
  return group;
}

SensingSubject::SensingSubject(const Plate& plate, const SensingModel& model, std::uint32_t seed)
    : plate_(plate), model_((check(model), model)), random_(seed) {}

bool SensingSubject::feels_vibration(const Fingers& fingers, double rate_hz) {
  const auto [level, is_new] = levels_db_.try_emplace({fingers, rate_hz});
  if (is_new) level->second = felt_level_db(plate_, fingers, rate_hz, model_);
  const double felt = std::erfc(-level->second / model_.spread_db / std::numbers::sqrt2) / 2;
  return uniform(random_) < model_.lapse_rate / 2 + (1 - model_.lapse_rate) * felt;
}

}  // namespace kiroku::trainer
