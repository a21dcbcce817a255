// A chest of a made-up shape around the box-shaped lung, as a CT, and radiographs of it while it breathes.
#pragma once

#include <random>

#include "sim/respiration/series_fit.h"
#include "tests/unit/sim/respiration/box_lung.h"

namespace kiroku::test {

/// Soft tissue with ribs and a spine; the lung with vessels, and the tumour in it.
inline sim::Volume box_chest() {
  sim::Volume volume;
  volume.grid.size = {72, 62, 84};
  volume.grid.spacing_m = sim::Vector3::Constant(0.004);
  volume.grid.origin_m = sim::Vector3(-0.17, -0.045, -0.04);
  for (std::size_t k = 0; k < volume.grid.size[2]; ++k) {
    for (std::size_t j = 0; j < volume.grid.size[1]; ++j) {
      for (std::size_t i = 0; i < volume.grid.size[0]; ++i) {
        const sim::Vector3 p = volume.grid.patient_m({double(i), double(j), double(k)});
        const sim::Vector3 from_middle = p - sim::Vector3(-0.03, 0.075, 0.125);
        double hu = -1000;
        if (std::hypot(from_middle.x() / 0.13, from_middle.y() / 0.11) < 1) hu = 20;
        const bool in_lung =
            p.x() > -0.12 && p.x() < -0.02 && p.y() > 0 && p.y() < 0.15 && p.z() > 0 && p.z() < 0.25;
        if (in_lung) {
          hu = -820 + 350 * std::max(std::sin(90 * p.x() + 40 * p.z()) * std::sin(70 * p.y() + 30 * p.z()) *
                                         std::sin(60 * p.z() - 50 * p.x()),
                                     0.0);
          if ((p - kBoxTumourM).norm() < 0.018) hu = 30;
        } else if (hu > -1000) {
          // Ribs slope to the front; the spine is behind, to one side the heart.
          const double rib = std::sin(150 * (p.z() + 0.3 * p.y()));
          if (std::hypot(from_middle.x() / 0.12, from_middle.y() / 0.1) > 0.9 && rib > 0.4) hu = 600;
          if ((sim::Vector3(p.x(), p.y(), 0) - sim::Vector3(0.01, 0.15, 0)).norm() < 0.018) {
            hu = 300 + 300 * std::sin(190 * p.z());
          }
        }
        volume.hu.push_back(static_cast<float>(hu));
      }
    }
  }
  return volume;
}

inline sim::ProjectionGeometry chest_view(double gantry_deg) {
  sim::GantrySetup setup;
  setup.isocenter_m = {-0.04, 0.075, 0.125};
  setup.gantry_deg = gantry_deg;
  setup.pixels = {128, 128};
  setup.size_m = {0.5, 0.5};
  return sim::ProjectionGeometry(setup);
}

/// How the patient lay and breathed.
struct ChestTruth {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  sim::BreathingMotion motion;
  sim::Waveform waveform{sim::SineWave{3.6}};
  double noise = 0;  // of line integrals, standard deviation
  std::size_t moments = 24;
  double rate = 2.5;
};

inline std::vector<sim::SeriesPicture> chest_radiographs(const sim::BreathingScene& scene,
                                                         const std::vector<sim::ProjectionGeometry>& views,
                                                         const ChestTruth& truth) {
  std::mt19937 random(5);
  // Twelve even numbers make a nearly normal one, the same on every machine.
  const auto normal = [&] {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += double(random()) / 4294967296.0;
    return sum;
  };
  std::vector<sim::SeriesPicture> pictures;
  for (std::size_t view = 0; view < views.size(); ++view) {
    const sim::ProjectionGeometry geometry = views[view].of_moved_patient(truth.pose);
    const sim::ProjectionImage still = scene.still(geometry);
    for (std::size_t i = 0; i < truth.moments; ++i) {
      const double time_s = double(i) / truth.rate;
      sim::ProjectionImage image =
          scene.moving(geometry, {truth.motion.rib_cage.moved_m(truth.waveform, time_s),
                                  truth.motion.diaphragm.moved_m(truth.waveform, time_s)});
      sim::add_to(image, still);
      if (truth.noise > 0) {
        for (float& value : image.values) value += static_cast<float>(truth.noise * normal());
      }
      pictures.push_back({time_s, view, std::move(image), "picture " + std::to_string(i)});
    }
  }
  return pictures;
}

}  // namespace kiroku::test
