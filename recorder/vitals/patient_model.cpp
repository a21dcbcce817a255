#include "recorder/vitals/patient_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace kiroku::recorder {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kStepS = 1.0 / PatientModel::kStepsPerSecond;
constexpr int kSlowEverySteps = 50;
constexpr double kWarmUpS = 30;

constexpr double kHeartRatePerMin = 72, kSinusArrhythmiaPerMin = 2.5, kMayerPerMin = 1.2;
constexpr double kBreathsPerMin = 12, kMayerHz = 0.1;

// McSharry 2003, table I: P, Q, R, S, T.
struct EcgEvent {
  double angle_rad, a, b;
};
constexpr std::array<EcgEvent, 5> kEcgEvents{{{-kPi / 3, 1.2, 0.25},
                                              {-kPi / 12, -5.0, 0.1},
                                              {0, 30.0, 0.1},
                                              {kPi / 12, -7.5, 0.1},
                                              {kPi / 2, 0.75, 0.4}}};
// The model's z has no unit; this makes an R wave of about 1 mV of it.
constexpr double kMillivoltsPerZ = 27;
constexpr double kBaselineZ = 0.004;  // wander with the breath
constexpr double kEcgNoiseMv = 0.006;

// Windkessel of an adult: resistance in mmHg s/ml, compliance in ml/mmHg.
constexpr double kResistance = 1.02, kCompliance = 1.3, kEjectionS = 0.3, kStrokeVolumeMl = 75;
constexpr double kStrokeVolumeBreathShare = 0.04;  // ventilation's effect

constexpr double kPulseTransitS = 0.22;

/// -pi to pi.
double wrapped_angle(double turns) { return 2 * kPi * (turns - std::floor(turns + 0.5)); }

double ecg_slope(double turns) {
  const double theta = wrapped_angle(turns);
  double slope = 0;
  for (const EcgEvent& event : kEcgEvents) {
    const double delta = std::remainder(theta - event.angle_rad, 2 * kPi);
    slope -= event.a * delta * std::exp(-delta * delta / (2 * event.b * event.b));
  }
  return slope;
}

double gaussian_of_turns(double turns, double centre, double width) {
  const double delta = (turns - centre) - std::floor(turns - centre + 0.5);
  return std::exp(-delta * delta / (2 * width * width));
}

}  // namespace

// splitmix64 (Steele, Lea, Flood 2014).
double PatientRandom::uniform() {
  state_ += 0x9E3779B97F4A7C15U;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
  z ^= z >> 31U;
  return static_cast<double>(z >> 11U) * 0x1p-53;
}

double PatientRandom::normal() {
  const double radius = std::sqrt(-2 * std::log(1 - uniform()));
  return radius * std::cos(2 * kPi * uniform());
}

double Wander::step(double step_s, PatientRandom& random) {
  const double keep = std::exp(-step_s / correlation_s_);
  value_ = value_ * keep + deviation_ * std::sqrt(1 - keep * keep) * random.normal();
  return value_;
}

PatientModel::PatientModel(std::uint64_t seed, bool waves)
    : waves_(waves), random_(seed), noise_random_(seed ^ 0x5DEECE66DU), beat_lowest_(pressure_mmhg_) {
  for (int i = 0; i < kWarmUpS * kStepsPerSecond; ++i) {
    step();
  }
  steps_ = 0;
}

double PatientModel::breath() const { return std::sin(2 * kPi * breath_phase_); }

void PatientModel::step() {
  if (steps_ % kSlowEverySteps == 0) {
    step_slowly_varying();
  }
  ++steps_;
  step_heart();
}

void PatientModel::step_slowly_varying() {
  constexpr double kSlowS = kSlowEverySteps * kStepS;
  for (Wander* wander :
       {&rate_wander_, &resistance_wander_, &saturation_wander_, &co2_wander_, &breath_wander_}) {
    wander->step(kSlowS, random_);
  }
}

void PatientModel::step_heart() {
  breath_phase_ = std::fmod(breath_phase_ + (kBreathsPerMin + breath_wander_.value()) / 60 * kStepS, 1.0);
  mayer_phase_ = std::fmod(mayer_phase_ + kMayerHz * kStepS, 1.0);
  heart_rate_hz_ = (kHeartRatePerMin + rate_wander_.value() + kSinusArrhythmiaPerMin * breath() +
                    kMayerPerMin * std::sin(2 * kPi * mayer_phase_)) /
                   60;
  const double phase_before = heart_phase_;
  const double advance = heart_rate_hz_ * kStepS;
  heart_phase_ += advance;
  beat_s_ += kStepS;
  step_pressure();
  if (waves_) {
    step_ecg(phase_before, advance);
  }
  if (heart_phase_ >= 1) {
    heart_phase_ -= 1;
    end_beat();
  }
}

void PatientModel::step_pressure() {
  const double flow_ml_per_s =
      beat_s_ < kEjectionS ? stroke_volume_ml_ * kPi / (2 * kEjectionS) * std::sin(kPi * beat_s_ / kEjectionS)
                           : 0;
  const double resistance = kResistance * (1 + resistance_wander_.value());
  pressure_mmhg_ += kStepS / kCompliance * (flow_ml_per_s - pressure_mmhg_ / resistance);
  beat_lowest_ = std::min(beat_lowest_, pressure_mmhg_);
  beat_highest_ = std::max(beat_highest_, pressure_mmhg_);
  beat_sum_ += pressure_mmhg_ * kStepS;
}

// z' = f(theta(t)) - (z - z0): linear in z, so that Runge-Kutta's fourth order needs f at three times only.
void PatientModel::step_ecg(double phase_before, double advance) {
  const double baseline = kBaselineZ * breath();
  const double begin = ecg_slope(phase_before) + baseline;
  const double middle = ecg_slope(phase_before + advance / 2) + baseline;
  const double end = ecg_slope(phase_before + advance) + baseline;
  const double k1 = begin - z_;
  const double k2 = middle - (z_ + kStepS / 2 * k1);
  const double k3 = middle - (z_ + kStepS / 2 * k2);
  const double k4 = end - (z_ + kStepS * k3);
  z_ += kStepS / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  ecg_noise_mv_ = kEcgNoiseMv * noise_random_.normal();
}

void PatientModel::end_beat() {
  beats_[beat_count_++ % kAveragedBeats] = {beat_s_, beat_highest_, beat_lowest_, beat_sum_ / beat_s_};
  beat_s_ = 0;
  beat_sum_ = 0;
  beat_lowest_ = beat_highest_ = pressure_mmhg_;
  stroke_volume_ml_ = kStrokeVolumeMl * (1 + kStrokeVolumeBreathShare * breath());
}

PatientNumbers PatientModel::numbers() const {
  Beat mean;
  for (const Beat& beat : beats_) {
    mean.duration_s += beat.duration_s / kAveragedBeats;
    mean.systolic_mmhg += beat.systolic_mmhg / kAveragedBeats;
    mean.diastolic_mmhg += beat.diastolic_mmhg / kAveragedBeats;
    mean.mean_mmhg += beat.mean_mmhg / kAveragedBeats;
  }
  const double elapsed_s = static_cast<double>(steps_) * kStepS;
  PatientNumbers numbers;
  numbers.heart_rate_per_min = 60 / mean.duration_s;
  numbers.systolic_mmhg = mean.systolic_mmhg;
  numbers.diastolic_mmhg = mean.diastolic_mmhg;
  numbers.mean_mmhg = mean.mean_mmhg;
  numbers.respiration_per_min = kBreathsPerMin + breath_wander_.value();
  numbers.end_tidal_co2_mmhg = 36 + co2_wander_.value();
  numbers.saturation_percent = std::min(100.0, 98 + saturation_wander_.value());
  // Redistribution of heat after induction: most of a degree within the first hour or so.
  numbers.temperature_celsius = 36.0 + 0.8 * std::exp(-elapsed_s / 2400);
  return numbers;
}

double PatientModel::ecg_mv() const { return kMillivoltsPerZ * z_ + ecg_noise_mv_; }

double PatientModel::pleth() const {
  const double turns = heart_phase_ - kPulseTransitS * heart_rate_hz_;
  const double wave =
      0.85 * gaussian_of_turns(turns, 0.18, 0.09) + 0.34 * gaussian_of_turns(turns, 0.46, 0.12);
  return std::clamp(wave * (1 + 0.05 * breath()) + 0.05, 0.0, 1.0);
}

std::array<double, 3> PatientModel::measure_cuff_mmhg() {
  const PatientNumbers now = numbers();
  const double error = 2.5 * random_.normal();
  return {now.systolic_mmhg + error, now.diastolic_mmhg + error, now.mean_mmhg + error};
}

}  // namespace kiroku::recorder
