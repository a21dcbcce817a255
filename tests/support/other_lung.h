// A lung that breathes otherwise than the model that is fitted to it, so that a fit is not proved on its own
// model:
//  - it is corotational (sim/fem/corotational_body.h), not linear, and nearly keeps its volume
//    (kOtherPoissonRatio);
//  - it slides along rib cage, diaphragm and back: a wall gives the part of its motion along its normal
//  alone, by
//    springs; the diaphragm goes straight down, further at the back;
//  - breaths are cos^4 (Lujan et al., Medical Physics 26(5), 1999), each of a length and a depth of its own,
//  and the
//    baseline drifts;
//  - the rib cage leads, and the lung follows its diaphragm later the higher it lies (hysteresis).
#pragma once

#include <random>
#include <vector>

#include "sim/respiration/breathing_model.h"
#include "sim/respiration/breathing_pictures.h"

namespace kiroku::test {

/// The same on every machine, unlike the distributions of the standard library.
class Chance {
 public:
  explicit Chance(unsigned seed) : engine_(seed) {}
  double even();  // 0 to 1
  double normal();
  double poisson(double mean);

 private:
  std::mt19937 engine_;
};

/// 0 where a breath begins and ends, about 1 where it is deepest.
class IrregularBreaths {
 public:
  /// From 10 s before 0 to 10 s after `until_s`; 20 % longer or shorter, deeper or flatter at random.
  IrregularBreaths(double until_s, double length_s, Chance& chance);
  [[nodiscard]] double at(double time_s) const;

 private:
  struct Breath {
    double begin_s, length_s, depth;
  };
  std::vector<Breath> breaths_;
};

/// How far walls go from where the CT has them, along their normals (the diaphragm: down), m, m/s, s.
struct OtherMotion {
  double rib_cage_rest_m = -0.0015, rib_cage_depth_m = 0.0025;
  double diaphragm_rest_m = -0.009, diaphragm_depth_m = 0.012;
  double drift_m_per_s = 0.0015 / 60;
  double rib_cage_leads_s = 0.3, top_follows_s = 0.3;
};

inline constexpr double kOtherPoissonRatio = 0.4;

/// Immutable once made; making it takes some dozens of solves on all cores.
class OtherLung {
 public:
  /// Of the model mesh, groups and Young's moduli count. kiroku::Error where no equilibrium is found.
  OtherLung(const sim::BreathingModel& model, IrregularBreaths breaths, const OtherMotion& motion);

  [[nodiscard]] double breath(double time_s) const { return breaths_.at(time_s); }
  /// (|V|)
  [[nodiscard]] std::vector<sim::Vector3> displacement_m(double time_s) const;

 private:
  IrregularBreaths breaths_;
  OtherMotion motion_;
  std::vector<double> height_;  // (|V|), 0 to 1
  sim::StateAxis rib_cage_, diaphragm_;
  std::vector<std::vector<sim::Vector3>> states_;  // by rib cage, then diaphragm
};

}  // namespace kiroku::test
