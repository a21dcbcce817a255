// Seconds a radiograph takes in a series, for sim_drr.sh: 512 x 512 pixels of 600 x 600 mm, source-axis
// distance 1000 mm, source-imager distance 1500 mm, isocentre in the origin.
//
//   sim_drr_bench VOLUME            36 angles of the volume as it is
//   sim_drr_bench VOLUME MESH       36 frames from each of four sides of what is in a mesh (mm), deformed
//   anew each time sim_drr_bench VOLUME MESH all   the same with what is outside the mesh, computed once for
//   each side
//
// Threads: KIROKU_BENCH_THREADS, all if it is not set.
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <numbers>
#include <string>

#include "sim/drr/mesh_projector.h"
#include "sim/mesh/mesh_reader.h"
#include "sim/volume/volume_reader.h"

namespace {

using namespace kiroku::sim;
using kiroku::InstructionSet;

constexpr int kFrames = 36;

ProjectionGeometry geometry_at(double gantry_deg) {
  return ProjectionGeometry(GantrySetup{1, 1.5, Vector3::Zero(), gantry_deg, {512, 512}, {0.6, 0.6}});
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// Some breathing: up to 15 mm towards the feet at the lower end, 5 mm forwards.
std::vector<Vector3> breath(const TetMesh& mesh, double phase) {
  const Extent extent = extent_of(mesh);
  std::vector<Vector3> displacement_m;
  for (const Vector3& node : mesh.nodes) {
    const Vector3 part = (node - extent.least).cwiseQuotient(extent.greatest - extent.least);
    displacement_m.emplace_back(phase * Vector3(0, -0.005 * (1 - part.y()), -0.015 * (1 - part.z())));
  }
  return displacement_m;
}

double whole_volume(const CtProjector& ct) {
  static_cast<void>(ct.project(geometry_at(0)));
  static_cast<void>(ct.project(geometry_at(90)));
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < kFrames; ++i) static_cast<void>(ct.project(geometry_at(10.0 * i)));
  return seconds_since(begin) / kFrames;
}

double deformed(const CtProjector& ct, const std::string& file, bool all) {
  const MeshProjector projector(ct, read_mesh(file, LengthUnit::kMillimetre).mesh);
  std::vector<std::vector<Vector3>> phases;
  for (int i = 0; i < kFrames; ++i) {
    phases.push_back(breath(projector.mesh(), 0.5 - 0.5 * std::cos(2 * std::numbers::pi * i / kFrames)));
  }
  double sum_s = 0;
  for (const double gantry_deg : {0.0, 30.0, 90.0, 200.0}) {
    const ProjectionGeometry geometry = geometry_at(gantry_deg);
    const ProjectionImage outside = projector.outside(geometry);
    const auto begin = std::chrono::steady_clock::now();
    for (const std::vector<Vector3>& displacement_m : phases) {
      ProjectionImage image = projector.inside(geometry, displacement_m);
      if (all) add_to(image, outside);
    }
    sum_s += seconds_since(begin) / kFrames;
  }
  return sum_s / 4;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc < 2 || argc > 4) {
      std::cerr << "sim_drr_bench VOLUME [MESH [all]]\n";
      return 2;
    }
    ProjectorOptions options;
    if (const char* const threads = std::getenv("KIROKU_BENCH_THREADS")) {
      options.threads = static_cast<unsigned>(std::stoul(threads));
    }
    if (const char* const set = std::getenv("KIROKU_BENCH_INSTRUCTIONS")) {
      options.instructions = std::string(set) == "avx512" ? InstructionSet::kAvx512
                             : std::string(set) == "avx2" ? InstructionSet::kAvx2
                                                          : InstructionSet::kBaseline;
    }
    const CtProjector ct(read_volume(argv[1], {}).volume, Attenuation(70), options);
    std::cout << (argc == 2 ? whole_volume(ct) : deformed(ct, argv[2], argc == 4)) << "\n";
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 2;
  }
}
