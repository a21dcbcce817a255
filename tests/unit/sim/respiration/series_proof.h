// A series fit against what its model does not know: the box-shaped chest breathes by a lung of another
// physics on another mesh, and its radiographs are no DRRs.
#pragma once

#include <numbers>

#include "base/number_text.h"
#include "sim/drr/registration.h"
#include "sim/respiration/tumour_track.h"
#include "tests/support/fluoroscope.h"
#include "tests/support/other_lung.h"
#include "tests/unit/sim/respiration/box_chest.h"

namespace kiroku::test {

inline constexpr double kProofBreathS = 3.6, kProofRate = 2.5;
inline constexpr std::size_t kProofMoments = 24, kNotExposed = 9;

struct SeriesProof {
  sim::SeriesFit fit;
  sim::TumourTrack track;             // without meaning where the fit was refused
  std::vector<sim::Vector3> truth_m;  // the tumour's centre, of each moment
};

/// `quanta` a pixel without a patient; from the front, or from the side, too. Moment kNotExposed has no rays.
/// `shift_m` and `turn_rad` are how the patient lay. Takes some ten seconds of a core.
inline SeriesProof prove_series(double quanta, bool side, const sim::Vector3& shift_m,
                                const sim::Vector3& turn_rad) {
  constexpr double kBeltLateS = 0.1, kBeltNoise = 0.03, kBeltStepS = 0.04;
  Chance chance(7);
  const sim::Volume volume = box_chest();
  const sim::BreathingModel other = box_lung_model({5, 7, 12});
  const double lasts_s = double(kProofMoments) / kProofRate;
  const OtherLung lung(other, IrregularBreaths(lasts_s, kProofBreathS, chance), {});

  // The fit knows the CT, a mesh of its own and a belt.
  sim::BreathingModel model = box_lung_model();
  std::string belt = "time_s,amplitude\n";
  for (double time_s = 0; time_s < lasts_s + 1; time_s += kBeltStepS) {
    belt += number_text(time_s, 6) + "," +
            number_text(lung.breath(time_s - kBeltLateS) + kBeltNoise * chance.normal(), 6) + "\n";
  }
  model.waveform = sim::Waveform(sim::parse_breathing_trace(belt, "belt"));
  sim::BreathingScene scene(model, volume);
  const Eigen::Isometry3d pose = sim::rigid_motion(shift_m, turn_rad, scene.middle_m());

  // The same piece of tissue in both meshes.
  const sim::Vector3 rest_m = sim::centre_of(model.mesh, model.needed_tumour()).mean(model.mesh.nodes);
  const sim::MeshPoint centre = sim::MeshLocator(other.mesh).locate(rest_m).point;
  SeriesProof proof;
  std::vector<std::vector<sim::Vector3>> displacement_m;
  for (std::size_t i = 0; i < kProofMoments; ++i) {
    displacement_m.push_back(lung.displacement_m(double(i) / kProofRate));
    proof.truth_m.emplace_back(pose * (rest_m + centre.mean(displacement_m.back())));
  }
  std::vector<sim::ProjectionGeometry> views{chest_view(0)};
  if (side) views.push_back(chest_view(90));
  std::vector<sim::SeriesPicture> pictures;
  for (std::size_t view = 0; view < views.size(); ++view) {
    const std::vector<ArrivedRays> arrived =
        fluoroscopy(volume, other.mesh, views[view].of_moved_patient(pose), displacement_m);
    for (std::size_t i = 0; i < kProofMoments; ++i) {
      pictures.push_back({double(i) / kProofRate, view, counted(arrived[i], quanta, i != kNotExposed, chance),
                          "picture " + std::to_string(i)});
    }
  }
  proof.fit = sim::fit_series(model, scene, views, pictures);
  if (proof.fit.refusal.empty())
    proof.track = sim::track_tumour(model, scene, volume, views, pictures, proof.fit);
  return proof;
}

}  // namespace kiroku::test
