// Table 1 of "Interactive Volume Manipulation for Supporting Preoperative Planning": frames a second of
// simulation and shading together, for an organ that tools pull.
//
//   sim_table1_bench ORGAN [--ct FOLDER] [--labels FILE] [--gpu auto|off] [--engine auto|opengl|processor]
//                    [--seconds N] [--picture FILE.png] [--reference FILE.png]
//
// ORGAN is liver, right-kidney or right-lung of a CT and TotalSegmentator's labels, or breast, a phantom that
// is computed. The CT is resampled to 256^3 voxels around the organ. The mesh has at least as many vertices
// as the paper's. The back of the organ is held, forceps pull the side towards the eye to and fro. Each frame
// is a step of the manipulation and a picture of 512x512, first as they are while something moves
// (sim/render/scene.h), then as they are at rest. --reference also draws a still one with OSMesa and compares
// one of each with it.
//
// Prints lines for people, and last what docs/results/record.py takes: fps=38.1 cpu=40.2 ...

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "sim/fem/elastic_body.h"
#include "sim/manipulation/manipulation.h"
#include "sim/meshing/organ_mesher.h"
#include "sim/meshing/organs.h"
#include "sim/render/volume_renderer.h"
#include "sim/volume/volume_reader.h"
#include "tests/bench/render_bench.h"

namespace {

using kiroku::bench::processor_seconds, kiroku::bench::seconds, kiroku::bench::write_png;
using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file

constexpr int kPictureSide = 512;
constexpr std::size_t kVoxels = 256;

struct Row {
  const char* organ;
  std::size_t vertices;
  double paper_fps;
  const char* transfer;
  ViewDirection view;
};
constexpr std::array<Row, 4> kTable1{{{"liver", 567, 38, "liver", {20, -15}},
                                      {"right-kidney", 424, 45, "kidney", {20, 10}},
                                      {"breast", 613, 20, "breast", {25, 10}},
                                      {"right-lung", 344, 50, "lung", {20, 10}}}};

struct Request {
  Row row{};
  std::string ct, labels;
  EngineChoice choice{GpuUse::kOff};
  double seconds = 5;
  std::string picture, reference;
};

[[noreturn]] void tell_usage() {
  throw kiroku::UsageError(
      "sim_table1_bench liver|right-kidney|breast|right-lung [--ct FOLDER] [--labels FILE] [--gpu auto|off]\n"
      "  [--engine auto|opengl|processor] [--seconds N] [--picture FILE.png] [--reference FILE.png]\n"
      "--ct and --labels are needed but for the breast");
}

Request parse(int argc, char** argv) {
  Request request;
  if (argc < 2) tell_usage();
  const auto row =
      std::ranges::find_if(kTable1, [&](const Row& one) { return one.organ == std::string(argv[1]); });
  if (row == kTable1.end() || argc % 2 != 0) tell_usage();
  request.row = *row;
  for (int i = 2; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    if (name == "--ct") {
      request.ct = value;
    } else if (name == "--labels") {
      request.labels = value;
    } else if (name == "--gpu" && (value == "auto" || value == "off")) {
      request.choice.gpu = value == "off" ? GpuUse::kOff : GpuUse::kAuto;
    } else if (name == "--engine" && (value == "auto" || value == "opengl" || value == "processor")) {
      request.choice.engine = value == "opengl"      ? Engine::kOpenGl
                              : value == "processor" ? Engine::kProcessor
                                                     : Engine::kAuto;
    } else if (name == "--seconds") {
      request.seconds = std::stod(value);
    } else if (name == "--picture") {
      request.picture = value;
    } else if (name == "--reference") {
      request.reference = value;
    } else {
      tell_usage();
    }
  }
  if (request.row.organ != std::string("breast") && (request.ct.empty() || request.labels.empty()))
    tell_usage();
  return request;
}

/// What is simulated and shown.
struct Subject {
  Volume volume;
  LabelMap organ;
  TransferFunction transfer;
};

/// The CT on a grid of 256^3 around the organ, with `margin_m` on each side; voxels as near to cubes as the
/// organ lets them.
Subject from_ct(const Request& request) {
  const Volume ct = read_volume(request.ct, {}).volume;
  LabelMap labels = read_label_map(request.labels);
  const LabelRange wanted = organ_named(request.row.organ).labels;
  Extent box;
  bool first = true;
  for (std::size_t k = 0; k < labels.grid.size[2]; ++k) {
    for (std::size_t j = 0; j < labels.grid.size[1]; ++j) {
      for (std::size_t i = 0; i < labels.grid.size[0]; ++i) {
        std::uint16_t& label = labels.labels[labels.grid.offset(i, j, k)];
        label = label >= wanted.first && label <= wanted.last ? 1 : 0;
        if (label == 0) continue;
        const Vector3 at = labels.grid.patient_m({double(i), double(j), double(k)});
        box.least = first ? at : box.least.cwiseMin(at).eval();
        box.greatest = first ? at : box.greatest.cwiseMax(at).eval();
        first = false;
      }
    }
  }
  if (first) throw kiroku::Error("no voxel of " + request.labels + " is labelled " + request.row.organ);
  constexpr double kMarginM = 0.01;
  Subject subject{{}, labels, find_transfer_function(request.row.transfer)};
  Grid& grid = subject.volume.grid;
  grid.size = {kVoxels, kVoxels, kVoxels};
  const Vector3 size = box.greatest - box.least + Vector3::Constant(2 * kMarginM);
  grid.spacing_m = Vector3::Constant(size.maxCoeff() / double(kVoxels - 1));
  grid.origin_m = (box.least + box.greatest) / 2 - grid.spacing_m * (double(kVoxels - 1) / 2);
  subject.volume.hu.reserve(grid.voxels());
  for (std::size_t k = 0; k < kVoxels; ++k) {
    for (std::size_t j = 0; j < kVoxels; ++j) {
      for (std::size_t i = 0; i < kVoxels; ++i) {
        subject.volume.hu.push_back(
            static_cast<float>(sample_hu(ct, grid.patient_m({double(i), double(j), double(k)}))));
      }
    }
  }
  return subject;
}

/// A breast as a phantom: half an ellipsoid of fat (-100 HU) of 60 mm height and 65 mm radius under 1.5 mm of
/// skin (40 HU), glands (40 HU) between fat in lobules of some 12 mm around the middle, a tumour of 9 mm
/// (80 HU), 12 HU of noise; 256^3 voxels of 0.55 mm. The eye is in front of it.
Subject phantom() {
  Subject subject;
  constexpr double kSpacingM = 0.55e-3;
  const Vector3 half(0.065, 0.060, 0.065), wall(0.07, 0.1, 0.07), tumour(0.085, 0.065, 0.08);
  Grid& grid = subject.volume.grid;
  grid.size = {kVoxels, kVoxels, kVoxels};
  grid.spacing_m = Vector3::Constant(kSpacingM);
  subject.organ.grid = grid;
  std::uint32_t random = 1;
  const auto blend = [](double from, double to, double depth_m) {
    return from + (to - from) * std::clamp(depth_m / 1e-3 + 0.5, 0.0, 1.0);
  };
  for (std::size_t k = 0; k < kVoxels; ++k) {
    for (std::size_t j = 0; j < kVoxels; ++j) {
      for (std::size_t i = 0; i < kVoxels; ++i) {
        const Vector3 at = grid.patient_m({double(i), double(j), double(k)}), from = at - wall;
        const double reach = from.cwiseQuotient(half).norm();
        const double depth = (1 - reach) * half.minCoeff();
        const double wave =
            std::sin(from.x() * 260) + std::sin(from.y() * 230 + 1) + std::sin(from.z() * 250 + 2);
        const double gland = (wave - 0.2) * 3e-3 * (reach < 0.75 ? 1 : 0) - (reach < 0.75 ? 0 : 1e-2);
        double hu = blend(-100, 40, gland);
        hu = blend(hu, 80, 9e-3 / 2 - (at - tumour).norm());
        hu = blend(40, hu, depth - 1.5e-3);
        hu = blend(-1000, hu, depth);
        random = random * 1664525U + 1013904223U;
        subject.volume.hu.push_back(static_cast<float>(hu + double(random >> 16U) / 65535 * 24 - 12));
        // The mesh reaches a little beyond the skin.
        subject.organ.labels.push_back(depth > -1e-3 && from.y() < 0.02 ? 1 : 0);
      }
    }
  }
  // Glands and tumour, seen through fat and a hint of skin.
  subject.transfer = parse_transfer_function(
      R"({"name": "Breast", "points": [{"hu": -60, "color": "#f0d8a8", "opacity_per_mm": 0},
          {"hu": 20, "color": "#e0a090", "opacity_per_mm": 0.12},
          {"hu": 65, "color": "#c04040", "opacity_per_mm": 0.6}]})",
      "breast");
  return subject;
}

/// At least as many nodes as the paper's, and not many more.
TetMesh mesh_of(const Subject& subject, std::size_t nodes) {
  std::optional<TetMesh> best;
  for (const double share : {0.92, 0.97, 1.0, 1.03, 1.06, 1.1, 1.15, 1.2}) {
    MeshRequest request;
    request.nodes = static_cast<std::size_t>(std::lround(double(nodes) * share));
    TetMesh mesh = make_organ_mesh(subject.organ, request).mesh;
    if (mesh.nodes.size() >= nodes && (!best || mesh.nodes.size() < best->nodes.size()))
      best = std::move(mesh);
    if (best && double(best->nodes.size()) < 1.05 * double(nodes)) break;
  }
  if (!best) throw kiroku::Error("no mesh of " + std::to_string(nodes) + " vertices or a few more was found");
  return *best;
}

/// The organ's back is held; forceps pull what is nearest to the patient's front to and fro.
class Deformation {
 public:
  explicit Deformation(TetMesh mesh) : mesh_(std::move(mesh)) {
    mesh_.regions.assign(mesh_.tetrahedra.size(), 0);
    const Extent extent = extent_of(mesh_);
    const Vector3 size = extent.greatest - extent.least;
    Constraints constraints(mesh_.nodes.size());
    std::size_t front = 0;
    for (std::size_t node = 0; node < mesh_.nodes.size(); ++node) {
      if (mesh_.nodes[node].y() > extent.greatest.y() - 0.25 * size.y())
        constraints.prescribe(node, Vector3::Zero(), "bench");
      if (mesh_.nodes[node].y() < mesh_.nodes[front].y()) front = node;
    }
    pull_ = Vector3(0.05 * size.x(), -0.1 * size.y(), 0.1 * size.z());
    body_.emplace(mesh_, Materials{{0, {5000, 0.45, 1060}}}, constraints);
    contact_.emplace(*body_);
    manipulation_.emplace(*contact_,
                          std::vector<Tool>{forceps("forceps", Vector3::Constant(0.12 * size.maxCoeff()))});
    held_ = {mesh_.nodes[front], Eigen::Quaterniond::Identity()};
    manipulation_->grasp(0, held_);
  }
  const Eigen::VectorXd& at(double phase) {
    Pose pose = held_;
    pose.position_m += pull_ * (1 - std::cos(2 * std::numbers::pi * phase)) / 2;
    pose.orientation = Eigen::AngleAxisd(0.4 * std::sin(2 * std::numbers::pi * phase), Vector3::UnitX());
    const std::vector<OptionalPose> poses{pose};
    manipulation_->step(poses);
    displacement_m_ = manipulation_->displacement_m();
    return displacement_m_;
  }
  [[nodiscard]] const TetMesh& mesh() const { return mesh_; }

 private:
  TetMesh mesh_;
  Vector3 pull_;
  std::optional<ElasticBody> body_;
  std::optional<ContactBody> contact_;
  std::optional<Manipulation> manipulation_;
  Pose held_;
  Eigen::VectorXd displacement_m_;
};

std::span<const double> numbers_of(const Eigen::VectorXd& displacement_m) {
  return {displacement_m.data(), static_cast<std::size_t>(displacement_m.size())};
}

void compare(const Request& request, const std::shared_ptr<const ShadedVolume>& volume,
             const TransferFunction& transfer, Deformation& deformation, const Scene& scene,
             const Picture& moving, const Picture& still) {
  VolumeRenderer software(volume, transfer, {GpuUse::kOff, Engine::kOpenGl});
  software.set_mesh(deformation.mesh());
  const Picture reference = software.render(numbers_of(deformation.at(0.4)), scene);
  write_png(request.reference, reference);
  const kiroku::test::PictureLikeness moved = kiroku::test::likeness(reference, moving),
                                      rested = kiroku::test::likeness(reference, still);
  std::printf("against %s: largest difference %d of 255 at rest\nssim=%.5f still_ssim=%.5f differing=%.3f\n",
              software.renderer().c_str(), rested.largest, moved.ssim, rested.ssim, 100 * rested.share);
}

struct Pace {
  double fps, cpu_ms, simulation_ms;
};
Pace pace_of(VolumeRenderer& renderer, Deformation& deformation, const Scene& scene, double for_seconds) {
  const double begin = seconds(), processor_begin = processor_seconds();
  double simulation = 0;
  int count = 0;
  do {
    constexpr double kFramesPerPull = 60;
    const double start = seconds();
    const Eigen::VectorXd& displacement_m = deformation.at(count / kFramesPerPull);
    simulation += seconds() - start;
    renderer.render(numbers_of(displacement_m), scene);
    ++count;
  } while (seconds() - begin < for_seconds);
  return {count / (seconds() - begin), 1e3 * (processor_seconds() - processor_begin) / count,
          1e3 * simulation / count};
}

int run(const Request& request) {
  const Row& row = request.row;
  const bool is_phantom = row.organ == std::string("breast");
  const Subject subject = is_phantom ? phantom() : from_ct(request);
  Deformation deformation(mesh_of(subject, row.vertices));
  const Extent whole{subject.volume.grid.origin_m,
                     subject.volume.grid.patient_m(Vector3::Constant(double(kVoxels - 1)))};
  const auto volume = std::make_shared<const ShadedVolume>(shade(subject.volume, whole));
  VolumeRenderer renderer(volume, subject.transfer, request.choice);
  if (!renderer.notice().empty()) std::cerr << renderer.notice() << '\n';
  renderer.set_mesh(deformation.mesh());
  Scene scene;
  scene.width = scene.height = kPictureSide;
  scene.camera = camera_looking_at(ball_around(deformation.mesh()), row.view, kPictureSide, kPictureSide);
  std::cout << row.organ << ", " << deformation.mesh().nodes.size() << " nodes (the paper's: " << row.vertices
            << "), " << deformation.mesh().tetrahedra.size() << " tetrahedra, CT 256^3 of "
            << subject.volume.grid.spacing_m.x() * 1000 << " mm, picture 512x512, " << renderer.renderer()
            << std::endl;
  const Picture still = renderer.render(numbers_of(deformation.at(0.4)), scene);  // all memory is there
  scene.moving = true;
  const Picture moving = renderer.render(numbers_of(deformation.at(0.4)), scene);
  const Pace moved = pace_of(renderer, deformation, scene, request.seconds);
  scene.moving = false;
  const Pace rested = pace_of(renderer, deformation, scene, request.seconds);
  if (!request.picture.empty()) write_png(request.picture, moving);
  if (!request.reference.empty())
    compare(request, volume, subject.transfer, deformation, scene, moving, still);
  std::printf("the paper has %.0f frames/s\n", row.paper_fps);
  std::printf("fps=%.1f cpu=%.1f still_fps=%.1f still_cpu=%.1f simulation=%.2f vertices=%zu\n", moved.fps,
              moved.cpu_ms, rested.fps, rested.cpu_ms, moved.simulation_ms, deformation.mesh().nodes.size());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(parse(argc, argv));
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 2;
  }
}
