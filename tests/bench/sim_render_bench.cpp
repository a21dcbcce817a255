// Pictures of a liver that is being deformed, simulation included: a program of its own, to be carried to
// another machine. It needs the libraries of linear algebra, and OSMesa or a graphics processor's EGL.
//
//   sim_render_bench [--gpu auto|off] [--engine auto|opengl|processor] [--frames N] [--picture FILE.png]
//
// CT and organ are computed: 256^3 voxels of 1 mm; an organ of 648 nodes with vessels in it, held at its
// back, whose edge forceps pull to and fro. Each frame: a step of the manipulation, displacements, the proxy
// geometry, a picture of 512x512 in memory.

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
#include "sim/render/volume_renderer.h"
#include "tests/bench/render_bench.h"
#include "tests/support/ball_mesh.h"

namespace {

using kiroku::bench::processor_seconds, kiroku::bench::seconds, kiroku::bench::write_png;
using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file

constexpr int kPictureSide = 512;
const Vector3 kMiddle(0.128, 0.128, 0.128), kHalf(0.095, 0.07, 0.055);

TetMesh organ() { return kiroku::test::ball_mesh({7, 8, 8}, kMiddle, kHalf); }

/// Fat around an organ of 60 HU with vessels of 180 HU, and a scanner's noise.
Volume ct() {
  std::uint32_t random = 1;
  return kiroku::test::volume_of({256, 256, 256}, 1e-3, Vector3::Zero(), [&](const Vector3& at) {
    const Vector3 place = at - kMiddle;
    const double depth = 1 - place.cwiseQuotient(kHalf * 0.97).norm();
    const double share = std::clamp(depth * 25 + 0.5, 0.0, 1.0);
    const double wave =
        std::sin(place.x() * 140) * std::cos(place.y() * 120) + std::sin(place.z() * 150 + place.x() * 60);
    const double vessel = std::clamp((wave - 1.2) * 4, 0.0, 1.0);
    random = random * 1664525U + 1013904223U;
    return -100 + share * (160 + 120 * vessel) + double(random >> 16U) / 65535 * 24 - 12;
  });
}

class Deformation {
 public:
  Deformation() {
    const double back_m = kMiddle.y() + 0.6 * kHalf.y();
    Constraints constraints(mesh_.nodes.size());
    for (std::size_t node = 0; node < mesh_.nodes.size(); ++node) {
      if (mesh_.nodes[node].y() > back_m) constraints.prescribe(node, Vector3::Zero(), "bench");
    }
    body_.emplace(mesh_, Materials{{0, {5000, 0.45, 1060}}}, constraints);
    contact_.emplace(*body_);
    manipulation_.emplace(*contact_, std::vector<Tool>{forceps("forceps", Vector3(0.03, 0.03, 0.03))});
    held_ = {kMiddle - Vector3(0.6 * kHalf.x(), 0.5 * kHalf.y(), 0.6 * kHalf.z()),
             Eigen::Quaterniond::Identity()};
    manipulation_->grasp(0, held_);
  }
  const Eigen::VectorXd& at(double phase) {
    Pose pose = held_;
    pose.position_m += Vector3(-0.01, -0.025, 0.02) * (1 - std::cos(2 * std::numbers::pi * phase)) / 2;
    pose.orientation = Eigen::AngleAxisd(0.5 * std::sin(2 * std::numbers::pi * phase), Vector3::UnitX());
    const std::vector<OptionalPose> poses{pose};
    manipulation_->step(poses);
    displacement_m_ = manipulation_->displacement_m();
    return displacement_m_;
  }
  [[nodiscard]] const TetMesh& mesh() const { return mesh_; }

 private:
  TetMesh mesh_ = organ();
  std::optional<ElasticBody> body_;
  std::optional<ContactBody> contact_;
  std::optional<Manipulation> manipulation_;
  Pose held_;
  Eigen::VectorXd displacement_m_;
};

struct Request {
  GpuUse gpu = GpuUse::kAuto;
  Engine engine = Engine::kAuto;
  int frames = 0;  // as many as five seconds take
  std::string picture;
};

Request parse(int argc, char** argv) {
  Request request;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    if (name == "--gpu" && (value == "auto" || value == "off")) {
      request.gpu = value == "off" ? GpuUse::kOff : GpuUse::kAuto;
    } else if (name == "--engine" && (value == "auto" || value == "opengl" || value == "processor")) {
      request.engine = value == "opengl"      ? Engine::kOpenGl
                       : value == "processor" ? Engine::kProcessor
                                              : Engine::kAuto;
    } else if (name == "--frames") {
      request.frames = std::stoi(value);
    } else if (name == "--picture") {
      request.picture = value;
    } else {
      throw kiroku::UsageError(
          "sim_render_bench [--gpu auto|off] [--engine auto|opengl|processor] [--frames N] [--picture "
          "FILE.png]");
    }
  }
  return request;
}

int run(const Request& request) {
  Deformation deformation;
  const auto volume =
      std::make_shared<const ShadedVolume>(shade(ct(), {Vector3::Zero(), Vector3::Constant(0.255)}));
  const TransferFunction transfer = find_transfer_function("liver");
  VolumeRenderer renderer(volume, transfer, {request.gpu, request.engine});
  if (!renderer.notice().empty()) std::cerr << renderer.notice() << '\n';
  renderer.set_mesh(deformation.mesh());
  Scene scene;
  scene.width = scene.height = kPictureSide;
  scene.camera = camera_looking_at(ball_around(deformation.mesh()), {30, -20}, kPictureSide, kPictureSide);
  std::cout << "renderer " << renderer.renderer() << "\n"
            << deformation.mesh().nodes.size() << " nodes, " << deformation.mesh().tetrahedra.size()
            << " tetrahedra, CT 256^3, picture 512x512\n";
  const auto frame = [&](double phase) {
    const Eigen::VectorXd& displacement_m = deformation.at(phase);
    return renderer.render({displacement_m.data(), static_cast<std::size_t>(displacement_m.size())}, scene);
  };
  Picture picture = frame(0.4);  // shaders are compiled, memory is there
  if (!request.picture.empty()) write_png(request.picture, picture);
  constexpr double kRun = 5;
  const double begin = seconds(), processor_begin = processor_seconds();
  double simulation = 0;
  int count = 0;
  while (request.frames > 0 ? count < request.frames : seconds() - begin < kRun) {
    constexpr double kFramesPerPull = 60;
    const double start = seconds();
    const Eigen::VectorXd& displacement_m = deformation.at(count / kFramesPerPull);
    simulation += seconds() - start;
    picture =
        renderer.render({displacement_m.data(), static_cast<std::size_t>(displacement_m.size())}, scene);
    ++count;
  }
  const double all = seconds() - begin, processor = processor_seconds() - processor_begin;
  std::printf(
      "%d frames in %.3f s: %.1f frames/s (%.2f ms each, of which %.3f ms simulation; %.1f ms of "
      "processors)\n",
      count, all, count / all, 1e3 * all / count, 1e3 * simulation / count, 1e3 * processor / count);
  if (request.gpu == GpuUse::kOff && request.engine == Engine::kOpenGl) return 0;
  try {
    VolumeRenderer software(volume, transfer, {GpuUse::kOff, Engine::kOpenGl});
    software.set_mesh(deformation.mesh());
    const Eigen::VectorXd& displacement_m = deformation.at(0.4);
    const std::span<const double> numbers(displacement_m.data(),
                                          static_cast<std::size_t>(displacement_m.size()));
    const Picture reference = software.render(numbers, scene);
    const kiroku::test::PictureLikeness found = kiroku::test::likeness(reference, frame(0.4));
    std::printf(
        "against %s: SSIM %.5f, largest difference %d of 255, %.4f %% of the samples by more than 2\n",
        software.renderer().c_str(), found.ssim, found.largest, 100 * found.share);
  } catch (const kiroku::Error& error) {
    std::cout << "not compared with software: " << error.what() << '\n';
  }
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
