// A breathing lung as one JSON document; docs/explanation/respiration.md says what each key means.
//
// {"mesh": "lung.msh", "length_unit": "mm", "labels": "totalsegmentator.nii.gz", "tumour": {"region": 2},
//  "breathing": {"cycle_s": 3.6,
//                "rib_cage": {"amplitude": 3, "phase_s": 0},
//                "diaphragm": {"amplitude": 10, "phase_s": 0.6, "direction": [0, 0, -1]}},
//  "phases": 36}
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/mesh/length_unit.h"
#include "sim/respiration/breathing.h"
#include "sim/respiration/tumour.h"

namespace kiroku::sim {

/// The moments of so many phases (two at least) over the waveform's duration. A sine's last is one phase
/// before its first comes again.
std::vector<double> phase_times_s(const Waveform& waveform, std::size_t phases);

/// How far amplitude and baseline of a group may go, either way; the drift by as much in a minute.
inline constexpr double kLargestAmplitudeM = 0.2, kLongestPhaseS = 60;

struct BreathingModel {
  std::string name;  // for people; may be empty
  TetMesh mesh;
  LengthUnit unit = LengthUnit::kMillimetre;
  Materials materials;
  std::optional<Tumour> tumour;
  BoundaryGroups groups;
  Vector3 slide{0, 0, 1};  // which way nodes of the back are free to go
  BreathingMotion motion;
  Waveform waveform{SineWave{}};
  std::size_t phases = 36;  // over the waveform's duration
  std::vector<std::string> warnings;
  std::string document;  // its text, as it was read

  /// The tumour; kiroku::Error that says how to give one where there is none.
  [[nodiscard]] const Tumour& needed_tumour() const;
  [[nodiscard]] std::vector<double> times_s() const { return phase_times_s(waveform, phases); }
};

/// kiroku::Error in one sentence with the file and the JSON path; also what read_mesh(), read_label_map() and
/// find_boundary_groups() throw. Mesh, labels and trace are sought beside the model.
BreathingModel read_breathing_model(const std::filesystem::path& file);

/// Mesh, labels and trace of a model that was read from `file`, whichever it names.
std::vector<std::filesystem::path> files_of(const BreathingModel& model, const std::filesystem::path& file);

/// The document of a model that was read from `file`, as it was then, with another motion, for a file in
/// `folder`: the files that it names are named from there. `cycle_s` replaces the cycle of a sine. `groups`
/// (|V|; the model's own if absent): where they differ from the model's the document says so by nodes.
std::string with_motion(const BreathingModel& model, const std::filesystem::path& file,
                        const BreathingMotion& motion, const std::filesystem::path& folder,
                        std::optional<double> cycle_s = {}, const std::optional<BoundaryGroups>& groups = {});

}  // namespace kiroku::sim
