// One static solve as a document: which mesh, of what, held where, loaded how; and its result. Thread-safe
// but for files that others change meanwhile.
//
// {"mesh": "liver.msh", "length_unit": "mm",
//  "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.45, "density_kg_m3": 1060}],
//  "fixed": [{"box": [[0, 0, 0], [10, 50, 50]], "displacement": [0, 0, null]}],
//  "forces": [{"nodes": [17, 18], "force_n": [0, 0, -0.5]}],
//  "gravity_m_s2": [0, -9.81, 0], "corotational": false,
//  "cuts": [{"blade": [{"tip": [40, 20, 30], "heel": [40, 20, 60]},
//                      {"tip": [40, 50, 30], "heel": [40, 50, 60]}]}]}
//
// docs/reference/simulation.md says what each key means.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/cutting/sweep_surface.h"
#include "sim/fem/elastic_body.h"
#include "sim/model/body_model.h"

namespace kiroku::sim {

struct StaticModel : BodyModel {
  Eigen::VectorXd force_n;                      // (3 |V|), without weight
  bool corotational = false;                    // for large rotations
  std::vector<std::vector<SweepSurface>> cuts;  // of the rest shape, before anything is loaded
};

/// kiroku::Error in one sentence with the file and the JSON path; also what read_mesh() throws. The mesh is
/// sought beside the model.
StaticModel read_static_model(const std::filesystem::path& file);

struct StaticResult {
  StaticSolution solution;
  std::vector<SymmetricTensor> stress_pa;  // (|T|)
  Vector3 load_n, reaction_n;              // sums over what is held; weight is a load
  std::size_t unknowns = 0;
  /// Where there are cuts: the mesh they leave, which the stress is of. Nodes keep their numbers.
  std::optional<TetMesh> cut_mesh;
  double volume_lost_m3 = 0;          // by cuts
  std::vector<std::string> warnings;  // of cuts: what has fallen off, what meets nothing
};
/// kiroku::Error in one sentence, also where cuts leave nothing that is held.
StaticResult solve(const StaticModel& model);

/// Point data displacement (in the mesh's unit) and reaction_force (N), cell data stress (XX, YY, ZZ, XY, YZ,
/// XZ; Pa), von_mises_stress (Pa) and region, on the undeformed mesh (cut where there are cuts).
std::string vtu_text(const StaticModel& model, const StaticResult& result);

}  // namespace kiroku::sim
