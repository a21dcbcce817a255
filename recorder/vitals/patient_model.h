// The physiology behind synthetic_patient.h, stepped at 250 Hz. An object belongs to one thread.
#pragma once

#include <array>
#include <cstdint>

namespace kiroku::recorder {

/// Uniform and normal numbers that are the same on every machine, unlike the standard's distributions.
class PatientRandom {
 public:
  explicit PatientRandom(std::uint64_t seed) : state_(seed) {}
  double uniform();  // [0, 1)
  double normal();   // mean 0, deviation 1

 private:
  std::uint64_t state_;
};

/// A value that wanders about zero with the given standard deviation and correlation time
/// (Ornstein-Uhlenbeck).
class Wander {
 public:
  Wander(double deviation, double correlation_s) : deviation_(deviation), correlation_s_(correlation_s) {}
  double step(double step_s, PatientRandom& random);
  [[nodiscard]] double value() const { return value_; }

 private:
  double deviation_, correlation_s_;
  double value_ = 0;
};

/// What a monitor shows, from the last complete beats.
struct PatientNumbers {
  double heart_rate_per_min = 0;
  double systolic_mmhg = 0, diastolic_mmhg = 0, mean_mmhg = 0;
  double respiration_per_min = 0, end_tidal_co2_mmhg = 0;
  double saturation_percent = 0, temperature_celsius = 0;
};

class PatientModel {
 public:
  static constexpr int kStepsPerSecond = 250;

  /// Already run for half a minute, so that the numbers stand. Without `waves` the ECG is not computed.
  PatientModel(std::uint64_t seed, bool waves);

  void step();
  [[nodiscard]] PatientNumbers numbers() const;
  [[nodiscard]] double ecg_mv() const;
  [[nodiscard]] double pleth() const;  // 0 to 1
  /// What a cuff would measure now, systolic, diastolic, mean.
  std::array<double, 3> measure_cuff_mmhg();

 private:
  struct Beat {
    double duration_s = 0, systolic_mmhg = 0, diastolic_mmhg = 0, mean_mmhg = 0;
  };
  static constexpr std::size_t kAveragedBeats = 8;

  void step_slowly_varying();
  void step_heart();
  void step_pressure();
  void step_ecg(double phase_before, double advance);
  void end_beat();
  [[nodiscard]] double breath() const;  // -1 to 1

  bool waves_;
  PatientRandom random_;
  PatientRandom noise_random_;  // of its own, so that the numbers do not depend on `waves`
  std::uint64_t steps_ = 0;
  double heart_phase_ = 0;   // turns since the last R wave
  double breath_phase_ = 0;  // turns
  double mayer_phase_ = 0;   // turns
  double heart_rate_hz_ = 1.2;
  double z_ = 0;  // McSharry's z
  double ecg_noise_mv_ = 0;
  double pressure_mmhg_ = 85;
  double beat_s_ = 0, beat_lowest_ = 0, beat_highest_ = 0, beat_sum_ = 0;
  double stroke_volume_ml_ = 75;
  std::array<Beat, kAveragedBeats> beats_{};
  std::size_t beat_count_ = 0;
  Wander rate_wander_{3, 90}, resistance_wander_{0.04, 120}, saturation_wander_{0.5, 60},
      co2_wander_{0.8, 90};
  Wander breath_wander_{0.15, 60};
};

}  // namespace kiroku::recorder
