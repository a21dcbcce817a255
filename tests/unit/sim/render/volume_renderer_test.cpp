#include "sim/render/volume_renderer.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <numbers>
#include <optional>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/cutting/vertex_preserving_cut.h"
#include "sim/render/endoscope.h"
#include "sim/render/vertex_rotations.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/build_paths.h"
#include "tests/support/picture_likeness.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

const Vector3 kMiddle = Vector3::Constant(0.024);
constexpr double kRadius = 0.016;

/// What no light changes: colour times ambient alone.
std::string flat_light() { return R"("light": {"ambient": 1, "diffuse": 0, "specular": 0})"; }
TransferFunction white(double opacity_per_mm) {
  return parse_transfer_function(
      R"({"name": "White", "points": [{"hu": 0, "color": "#ffffff", "opacity_per_mm": )" +
          std::to_string(opacity_per_mm) + "}], " + flat_light() + "}",
      "white.json");
}
TransferFunction tissue() { return find_transfer_function("liver"); }

Volume constant_ct(double hu) {
  return test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), [&](const Vector3&) { return hu; });
}
/// A ball of 60 HU in fat, its border 3 mm wide.
double ball_hu(const Vector3& at) {
  return -100 + 160 * std::clamp((kRadius - 0.002 - (at - kMiddle).norm()) / 0.003 + 0.5, 0.0, 1.0);
}
Volume ball_ct() { return test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), ball_hu); }
/// With something different on each side of it.
Volume marked_ct() {
  return test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), [](const Vector3& at) {
    const Vector3 from = (at - kMiddle) / kRadius;
    return ball_hu(at) +
           90 * std::max(0.0, std::sin(7 * from.x()) * std::cos(5 * from.y() + 1) + 0.6 * from.z());
  });
}
TetMesh ball() { return test::ball_mesh({4, 4, 4}, kMiddle, Vector3::Constant(kRadius)); }
TetMesh box(const Vector3& from, const Vector3& size, const std::array<std::uint32_t, 3>& cells = {2, 2, 2}) {
  TetMesh mesh = test::tet_grid(cells, size);
  for (Vector3& node : mesh.nodes) node += from;
  return mesh;
}

std::shared_ptr<const ShadedVolume> shaded(const Volume& volume) {
  return std::make_shared<const ShadedVolume>(shade(volume, {Vector3::Zero(), Vector3::Constant(0.047)}));
}

Scene scene_of(const TetMesh& mesh, const ViewDirection& from = {}, int side = 96) {
  Scene scene;
  scene.width = scene.height = side;
  scene.camera = camera_looking_at(ball_around(mesh), from, side, side);
  return scene;
}

/// What draws the pictures of a test.
EngineChoice drawn_by{GpuUse::kOff, Engine::kProcessor};
void for_both_engines(const std::function<void()>& test) {
  for (const Engine engine : {Engine::kOpenGl, Engine::kProcessor}) {
    SCOPED_TRACE(engine == Engine::kOpenGl ? "OpenGL" : "processor");
    drawn_by.engine = engine;
    test();
  }
}

Picture picture_of(const Volume& volume, const TransferFunction& transfer, const TetMesh& mesh,
                   const Scene& scene, const std::vector<double>& displacement_m = {}) {
  VolumeRenderer renderer(shaded(volume), transfer, drawn_by);
  renderer.set_mesh(mesh);
  return renderer.render(displacement_m, scene);
}

std::vector<double> displacement(const TetMesh& mesh, const std::function<Vector3(const Vector3&)>& to) {
  std::vector<double> numbers;
  for (const Vector3& node : mesh.nodes) {
    const Vector3 by = to(node) - node;
    numbers.insert(numbers.end(), by.data(), by.data() + 3);
  }
  return numbers;
}
std::vector<double> turned(const TetMesh& mesh, const Eigen::Matrix3d& turn) {
  return displacement(mesh,
                      [&](const Vector3& node) -> Vector3 { return kMiddle + turn * (node - kMiddle); });
}

/// Largest difference and the share of samples that differ by more than `allowed`.
struct Difference {
  int largest = 0;
  double share = 0;
};
Difference difference(const Picture& one, const Picture& other, int allowed = 2) {
  Difference found;
  EXPECT_EQ(one.rgb.size(), other.rgb.size());
  for (std::size_t i = 0; i < one.rgb.size(); ++i) {
    const int by = std::abs(int{one.rgb[i]} - int{other.rgb[i]});
    found.largest = std::max(found.largest, by);
    found.share += by > allowed ? 1.0 / double(one.rgb.size()) : 0;
  }
  return found;
}

double brightness(const Picture& picture, int x, int y) {
  const std::uint8_t* const pixel = picture.pixel(x, y);
  return (pixel[0] + pixel[1] + pixel[2]) / 3.0;
}
/// Where the brightest pixels are, from -1 to 1 to the right and up.
Eigen::Vector2d highlight(const Picture& picture) {
  double most = 0;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) most = std::max(most, brightness(picture, x, y));
  }
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double count = 0;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      if (brightness(picture, x, y) < 0.9 * most) continue;
      sum += Eigen::Vector2d(2.0 * x / (picture.width - 1) - 1, 1 - 2.0 * y / (picture.height - 1));
      ++count;
    }
  }
  return sum / count;
}

// The definition, written down plainly, in double precision: each tetrahedron's part of a ray by its own four
// planes, and each segment in small steps instead of a table.
class Reference {
 public:
  Reference(const ShadedVolume& volume, const TransferFunction& transfer, const TetMesh& mesh,
            const std::vector<double>& displacement_m, const Scene& scene)
      : volume_(volume), transfer_(transfer), mesh_(mesh), scene_(scene), positions_(mesh.nodes) {
    for (std::size_t i = 0; i < displacement_m.size(); ++i)
      positions_[i / 3][static_cast<Eigen::Index>(i % 3)] += displacement_m[i];
    VertexRotations(mesh).compute(positions_, rotations_);
    for (const Tetrahedron& corners : mesh.tetrahedra) {
      Eigen::Matrix3d edges;
      for (std::size_t corner = 1; corner < 4; ++corner)
        edges.col(static_cast<Eigen::Index>(corner) - 1) =
            positions_[corners[corner]] - positions_[corners[0]];
      inverses_.emplace_back(edges.inverse());
    }
  }

  Picture draw() const {
    Picture picture(scene_.width, scene_.height);
    for (int y = 0; y < scene_.height; ++y) {
      for (int x = 0; x < scene_.width; ++x) {
        const Vector3 colour = ray(2 * (x + 0.5) / scene_.width - 1, 1 - 2 * (y + 0.5) / scene_.height);
        for (int c = 0; c < 3; ++c)
          picture.pixel(x, y)[c] =
              static_cast<std::uint8_t>(std::lround(255 * std::clamp(colour[c], 0.0, 1.0)));
      }
    }
    return picture;
  }

 private:
  /// The part of a ray that is in a tetrahedron, by the depth.
  struct Part {
    double from_m, to_m;
    std::size_t tetrahedron;
  };
  Eigen::Vector4d shares(std::size_t tetrahedron, const Vector3& place) const {
    Eigen::Vector4d share;
    share.tail<3>() = inverses_[tetrahedron] * (place - positions_[mesh_.tetrahedra[tetrahedron][0]]);
    share[0] = 1 - share.tail<3>().sum();
    return share;
  }
  std::vector<Part> parts_of(const Vector3& to) const {
    std::vector<Part> parts;
    for (std::size_t number = 0; number < inverses_.size(); ++number) {
      const Eigen::Vector4d at_eye = shares(number, scene_.camera.eye_m),
                            slope = shares(number, scene_.camera.eye_m + to) - at_eye;
      Part part{0, 1e9, number};
      for (Eigen::Index corner = 0; corner < 4; ++corner) {
        const double crossing = -at_eye[corner] / slope[corner];
        if (slope[corner] > 0) part.from_m = std::max(part.from_m, crossing);
        if (slope[corner] < 0) part.to_m = std::min(part.to_m, crossing);
        if (slope[corner] == 0 && at_eye[corner] < 0) part.to_m = -1;
      }
      if (part.from_m < part.to_m) parts.push_back(part);
    }
    std::ranges::sort(parts, {}, &Part::from_m);
    return parts;
  }

  struct Sample {
    double depth_m, entry;
    Vector3 gradient;
    Eigen::Quaterniond turn;
  };

  Vector3 ray(double s, double t) const {
    const Camera& camera = scene_.camera;
    const Vector3 along(camera.centre.x() + s * camera.half_extent.x(),
                        camera.centre.y() + t * camera.half_extent.y(), -1);
    const Vector3 to = camera.to_view.transpose() * along;
    const double spacing_m = volume_.spacing_m / 2;
    constexpr double kTogether = 1e-9;
    Vector3 colour = Vector3::Zero();
    double through = 1;
    const std::vector<Part> parts = parts_of(to);
    for (std::size_t first = 0; first < parts.size();) {
      std::size_t last = first;
      while (last + 1 < parts.size() && parts[last + 1].from_m < parts[last].to_m + kTogether) ++last;
      std::vector<double> depths_m{parts[first].from_m};
      for (double section = std::floor(depths_m[0] / spacing_m) + 1; section * spacing_m < parts[last].to_m;
           ++section)
        depths_m.push_back(section * spacing_m);
      depths_m.push_back(parts[last].to_m);
      std::optional<Sample> before;
      std::size_t part = first;
      for (const double depth_m : depths_m) {
        while (part < last && parts[part].to_m < depth_m) ++part;
        const Sample sample = sample_at(parts[part].tetrahedron, depth_m, camera.eye_m + depth_m * to);
        if (before) add_segment(*before, sample, along, colour, through);
        before = sample;
      }
      first = last + 1;
    }
    return colour + through * Vector3(scene_.background[0], scene_.background[1], scene_.background[2]) / 255;
  }

  Sample sample_at(std::size_t tetrahedron, double depth_m, const Vector3& place) const {
    const Tetrahedron& corners = mesh_.tetrahedra[tetrahedron];
    const Eigen::Vector4d share = shares(tetrahedron, place);
    Vector3 rest = Vector3::Zero();
    Eigen::Vector4d q = Eigen::Vector4d::Zero();
    for (std::size_t corner = 0; corner < 4; ++corner) {
      rest += share[static_cast<Eigen::Index>(corner)] * mesh_.nodes[corners[corner]];
      const Eigen::Vector4d one = rotations_[corners[corner]].coeffs();
      q += share[static_cast<Eigen::Index>(corner)] *
           (one.dot(rotations_[corners[0]].coeffs()) < 0 ? -1 : 1) * one;
    }
    const Vector3 at = volume_.texture_of(rest);
    Eigen::Vector4d texel = Eigen::Vector4d::Zero();
    for (int corner = 0; corner < 8; ++corner) {
      double weight = 1;
      std::array<std::size_t, 3> voxel{};
      for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        const double index = at[axis] * double(volume_.size[a]) - 0.5, below = std::floor(index);
        const bool up = (corner >> axis & 1) != 0;
        weight *= up ? index - below : 1 - (index - below);
        voxel[a] =
            static_cast<std::size_t>(std::clamp(below + (up ? 1 : 0), 0.0, double(volume_.size[a]) - 1));
      }
      const std::uint16_t* const from =
          volume_.texels.data() + 4 * (voxel[0] + volume_.size[0] * (voxel[1] + volume_.size[1] * voxel[2]));
      texel += weight * Eigen::Vector4d(from[0], from[1], from[2], from[3]);
    }
    const Vector3 gradient = (texel.head<3>() - Vector3::Constant(32768)) * kGreatestGradientHuPerMm / 32767;
    return {depth_m, texel[3] / 65535 * 4095, gradient, Eigen::Quaterniond(Eigen::Vector4d(q.normalized()))};
  }

  void add_segment(const Sample& front, const Sample& end, const Vector3& along, Vector3& colour,
                   double& through) const {
    const Vector3 gradient = (front.gradient + end.gradient) / 2;
    const double steep = gradient.norm();
    const auto [flat, whole] = transfer_.edge_hu_per_mm;
    const double edge = std::clamp((steep - flat) / (whole - flat), 0.0, 1.0);
    const Vector3 normal = -(scene_.camera.to_view * (end.turn * gradient)) / std::max(steep, 1e-6);
    const Vector3 light = scene_.to_light.normalized(), half = (light - along.normalized()).normalized();
    const double diffuse = (1 - edge) * 0.75 + edge * std::max(normal.dot(light), 0.0);
    const double gloss = edge * std::pow(std::max(normal.dot(half), 0.0), transfer_.shininess);
    constexpr int kSteps = 16;
    const double step_mm = (end.depth_m - front.depth_m) * 1000 * along.norm() / kSteps;
    for (int step = 0; step < kSteps; ++step) {
      const double at = front.entry + (end.entry - front.entry) * (step + 0.5) / kSteps;
      const TransferFunction::Entry& entry = transfer_.entries[static_cast<std::size_t>(std::lround(at))];
      const Vector3 lit = Vector3(entry.colour[0], entry.colour[1], entry.colour[2]) *
                              (transfer_.ambient + transfer_.diffuse * diffuse) +
                          Vector3::Constant(transfer_.specular * gloss);
      const double share = 1 - std::exp2(-double{entry.extinction_per_mm} * step_mm);
      colour += through * share * lit;
      through *= 1 - share;
    }
  }

  const ShadedVolume& volume_;
  const TransferFunction& transfer_;
  const TetMesh& mesh_;
  const Scene& scene_;
  std::vector<Vector3> positions_;
  std::vector<Eigen::Quaterniond> rotations_;
  std::vector<Eigen::Matrix3d> inverses_;  // of each tetrahedron's edges
};

Vector3 bent(const Vector3& node) {
  const Vector3 from = (node - kMiddle) / kRadius;
  const Eigen::AngleAxisd twist(0.9 * from.z(), Vector3::UnitZ());
  return kMiddle + kRadius * (twist * from + Vector3(0.3 * from.z() * from.z(), 0, 0.15 * from.x()));
}

TEST(VolumeRenderer, BlendsTheSegmentsOfTheDefinition) {
  for_both_engines([] {
    const TetMesh mesh = test::ball_mesh({3, 3, 3}, kMiddle, Vector3::Constant(kRadius));
    const Scene scene = scene_of(mesh, {25, 15}, 32);
    const std::vector<double> displacement_m = displacement(mesh, bent);
    for (const char* const name : {"liver", "lung"}) {
      const TransferFunction transfer = find_transfer_function(name);
      const auto volume = shaded(marked_ct());
      VolumeRenderer renderer(volume, transfer, drawn_by);
      renderer.set_mesh(mesh);
      const Difference found = difference(renderer.render(displacement_m, scene),
                                          Reference(*volume, transfer, mesh, displacement_m, scene).draw());
      // HU are rounded to the table's nodes, and faint cross-sections are left out.
      EXPECT_LT(found.share, 0.01) << name;
    }
  });
}

TEST(VolumeRenderer, LetsThroughWhatBeersLawLetsThrough) {
  for_both_engines([] {
    // A slab of 12 mm; each mm takes a tenth. Grey on black, straight on.
    const TetMesh mesh = box({0.010, 0.018, 0.010}, {0.028, 0.012, 0.028});
    Scene scene = scene_of(mesh);
    scene.background = {0, 0, 0};
    scene.camera = camera_looking_at(ball_around(mesh), {0, 0}, 96, 96, 1, true);
    const Picture picture = picture_of(constant_ct(50), white(0.1), mesh, scene);
    EXPECT_NEAR(brightness(picture, 48, 48), 255 * (1 - std::pow(0.9, 12)), 1.5);
    scene.spacing_m = 0.25e-3;
    EXPECT_NEAR(brightness(picture_of(constant_ct(50), white(0.1), mesh, scene), 48, 48),
                255 * (1 - std::pow(0.9, 12)), 1.5)
        << "finer cross-sections do not make tissue denser";
  });
}

/// Decibels.
double peak_ratio(const Picture& one, const Picture& other) {
  double sum = 0;
  for (std::size_t i = 0; i < one.rgb.size(); ++i)
    sum += std::pow(double(one.rgb[i]) - double(other.rgb[i]), 2);
  return 10 * std::log10(255 * 255 * double(one.rgb.size()) / std::max(sum, 1.0));
}

TEST(VolumeRenderer, ARampIsTheIntegralAlongTheRayWhateverTheSpacing) {
  for_both_engines([] {
    // Across 20 mm HU rise straight from -80 to 240; no light from any side.
    const Volume ct = test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(),
                                      [](const Vector3& at) { return -80 + 16000 * (at.y() - 0.014); });
    const TransferFunction transfer = parse_transfer_function(
        R"({"name": "Ramp", "points": [{"hu": -30, "color": "#ffff00", "opacity_per_mm": 0},
                                     {"hu": 40, "color": "#ff0000", "opacity_per_mm": 0.1},
                                     {"hu": 220, "color": "#0000ff", "opacity_per_mm": 0.3}], )" +
            flat_light() + "}",
        "ramp.json");
    const TetMesh mesh = box({0.010, 0.014, 0.010}, {0.028, 0.020, 0.028});
    Scene scene = scene_of(mesh);
    scene.background = {0, 0, 0};
    scene.camera = camera_looking_at(ball_around(mesh), {0, 0}, 96, 96, 1, true);
    std::array<double, 3> expected{};
    double through = 1;
    constexpr int kSteps = 20'000;
    for (int step = 0; step < kSteps; ++step) {
      const double hu = -80 + 320 * (step + 0.5) / kSteps;
      const TransferFunction::Entry& entry =
          transfer.entries[static_cast<std::size_t>(std::lround(hu)) + 1024];
      const double share = 1 - std::exp2(-double{entry.extinction_per_mm} * 20 / kSteps);
      for (std::size_t c = 0; c < 3; ++c) expected[c] += 255 * through * share * double{entry.colour[c]};
      through *= 1 - share;
    }
    for (const double spacing_mm : {0.1, 0.5, 2.0, 5.0}) {
      scene.spacing_m = spacing_mm * 1e-3;
      const Picture picture = picture_of(ct, transfer, mesh, scene);
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(picture.pixel(48, 48)[c], expected[c], 2) << spacing_mm << " mm, colour " << c;
    }
  });
}

TEST(VolumeRenderer, CoarseStepsShowNoSlices) {
  for_both_engines([] {
    // A shell of 0.6 mm, which cross-sections 1 mm apart meet here and there.
    const TransferFunction transfer = parse_transfer_function(
        R"({"name": "Shell", "points": [{"hu": -60, "color": "#f0d9a0", "opacity_per_mm": 0},
                                      {"hu": -45, "color": "#c04030", "opacity_per_mm": 0.8},
                                      {"hu": -30, "color": "#602018", "opacity_per_mm": 0}]})",
        "shell.json");
    const TetMesh mesh = ball();
    Scene scene = scene_of(mesh, {25, 15});
    const std::vector<double> displacement_m = displacement(mesh, bent);
    const auto at = [&](double spacing_mm) {
      scene.spacing_m = spacing_mm * 1e-3;
      return picture_of(ball_ct(), transfer, mesh, scene, displacement_m);
    };
    // Cross-sections that each showed their own HU alone were at 32.3, 23.9 and 21.0 dB.
    EXPECT_GT(peak_ratio(at(0.5), at(0.05)), 37);
    EXPECT_GT(peak_ratio(at(1), at(0.1)), 35);
    EXPECT_GT(peak_ratio(at(2), at(0.2)), 34);
  });
}

TEST(VolumeRenderer, ARayEndsWhereNothingMoreCouldBeSeen) {
  for_both_engines([] {
    // White takes all but a trace of the light within 3 mm; what is behind it may be anything.
    const TransferFunction transfer = parse_transfer_function(
        R"({"name": "Wall", "points": [{"hu": 0, "color": "#ffffff", "opacity_per_mm": 0.95},
                                     {"hu": 99, "color": "#ffffff", "opacity_per_mm": 0.95},
                                     {"hu": 100, "color": "#000000", "opacity_per_mm": 0.95}], )" +
            flat_light() + "}",
        "wall.json");
    const TetMesh mesh = box(Vector3::Constant(0.010), Vector3::Constant(0.028));
    Scene scene = scene_of(mesh);
    scene.camera = camera_looking_at(ball_around(mesh), {0, 0}, 96, 96, 1, true);
    const auto behind = [&](double hu, bool moving) {
      scene.moving = moving;
      return picture_of(test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(),
                                        [&](const Vector3& at) { return at.y() < 0.016 ? 50 : hu; }),
                        transfer, mesh, scene);
    };
    EXPECT_LE(difference(behind(50, false), behind(200, false)).largest, 1);
    EXPECT_LE(difference(behind(50, true), behind(200, true)).largest, 1);
    EXPECT_NEAR(behind(200, true).pixel(48, 48)[0], 255, 1);
  });
}

TEST(VolumeRenderer, APictureOfWhatMovesIsNearlyTheStillOne) {
  for_both_engines([] {
    const TetMesh mesh = ball();
    Scene scene = scene_of(mesh, {25, 15}, 256);
    const std::vector<double> displacement_m = displacement(mesh, bent);
    const Picture still = picture_of(marked_ct(), tissue(), mesh, scene, displacement_m);
    scene.moving = true;
    const Picture moving = picture_of(marked_ct(), tissue(), mesh, scene, displacement_m);
    EXPECT_GE(test::likeness(still, moving).ssim, 0.98);
    EXPECT_NE(still.rgb, moving.rgb) << "it is coarser";
  });
}

TEST(VolumeRenderer, DrawsAMirroredBodyMirrored) {
  for_both_engines([] {
    // The ball is the same on both sides, its mesh is not.
    const TetMesh mesh = ball();
    Scene scene = scene_of(mesh);
    scene.to_light = {0, 0.5, 1};
    const Picture picture = picture_of(ball_ct(), tissue(), mesh, scene);
    Picture mirrored = picture;
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x)
        std::copy_n(picture.pixel(picture.width - 1 - x, y), 3, mirrored.pixel(x, y));
    }
    const Difference found = difference(picture, mirrored, 4);
    EXPECT_LT(found.share, 0.01);
  });
}

TEST(VolumeRenderer, ATurnedOrganIsATurnedCamera) {
  for_both_engines([] {
    const TetMesh mesh = ball();
    const Scene scene = scene_of(mesh, {20, 10});
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Vector3(1, 2, -1).normalized()).toRotationMatrix();
    const Picture organ = picture_of(marked_ct(), tissue(), mesh, scene, turned(mesh, turn));
    Scene other = scene;
    other.camera.eye_m = kMiddle + turn.transpose() * (scene.camera.eye_m - kMiddle);
    other.camera.to_view = scene.camera.to_view * turn;
    const Difference found = difference(organ, picture_of(marked_ct(), tissue(), mesh, other));
    EXPECT_LT(found.share, 0.004);
    // And the turn is to be seen.
    EXPECT_GT(difference(organ, picture_of(marked_ct(), tissue(), mesh, scene)).share, 0.1);
  });
}

TEST(VolumeRenderer, ShadingOfATurnedOrganStaysWithTheLight) {
  for_both_engines([] {
    const TetMesh mesh = ball();
    Scene scene = scene_of(mesh);
    scene.to_light = {1, 0.3, 0.5};
    const Eigen::Vector2d still = highlight(picture_of(ball_ct(), tissue(), mesh, scene));
    EXPECT_GT(still.x(), 0.2);
    for (const double angle : {0.7, 1.6, 3.0}) {
      const Eigen::Matrix3d turn =
          Eigen::AngleAxisd(angle, Vector3(0.2, 1, 0.3).normalized()).toRotationMatrix();
      const Picture picture = picture_of(ball_ct(), tissue(), mesh, scene, turned(mesh, turn));
      EXPECT_LT((highlight(picture) - still).norm(), 0.08) << angle;
    }
    scene.to_light = {-1, 0.3, 0.5};
    EXPECT_LT(highlight(picture_of(ball_ct(), tissue(), mesh, scene)).x(), -0.2);
  });
}

TEST(VolumeRenderer, ShowsTheInsideOnTheFacesOfACut) {
  for_both_engines([] {
    // A block of 60 HU with a core of 200 HU that nothing shows from outside.
    const Volume ct = test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), [](const Vector3& at) {
      return (at - kMiddle).head<2>().norm() < 0.005 ? 200 : 60;
    });
    const TransferFunction transfer = parse_transfer_function(
        R"({"name": "Core", "points": [{"hu": 100, "color": "#0000ff", "opacity_per_mm": 1},
                                     {"hu": 101, "color": "#ff0000", "opacity_per_mm": 1}], )" +
            flat_light() + "}",
        "core.json");
    const TetMesh mesh = box(kMiddle - Vector3::Constant(0.014), Vector3::Constant(0.028), {6, 6, 6});
    const Scene scene = scene_of(mesh);
    const auto reds = [&](const Picture& picture) {
      int count = 0;
      for (int y = 0; y < picture.height; ++y) {
        for (int x = 0; x < picture.width; ++x) count += picture.pixel(x, y)[0] > 150 ? 1 : 0;
      }
      return count;
    };
    EXPECT_EQ(reds(picture_of(ct, transfer, mesh, scene)), 0);
    // From the front to behind the core, then the halves are drawn apart.
    VertexPreservingCut cut(mesh);
    cut.cut(SweepSurface({{kMiddle.x(), -0.01, -0.01}, {kMiddle.x(), -0.01, 0.06}},
                         {{kMiddle.x(), 0.03, -0.01}, {kMiddle.x(), 0.03, 0.06}}));
    const TetMesh after = cut.remaining();
    const std::vector<double> apart = displacement(after, [](const Vector3& node) -> Vector3 {
      const double depth = std::max(0.0, 0.03 - node.y()) / 0.02;
      return node + Vector3(node.x() > kMiddle.x() ? 0.008 : -0.008, 0, 0) * depth;
    });
    const Picture opened = picture_of(ct, transfer, after, scene, apart);
    EXPECT_GT(reds(opened), 300);
    // Closed: within the gap tissue is seen everywhere, nowhere the background.
    for (int y = 35; y < 62; ++y) {
      for (int x = 30; x < 67; ++x)
        EXPECT_GT(opened.pixel(x, y)[0] + opened.pixel(x, y)[2], 120) << x << ',' << y;
    }
  });
}

TEST(VolumeRenderer, SeesEveryLayerOfAMeshThatFoldsBack) {
  for_both_engines([] {
    // Two slabs of 4 mm behind each other, one mesh: rays leave it and enter again.
    TetMesh mesh = box({0.010, 0.010, 0.010}, {0.028, 0.004, 0.028});
    const TetMesh behind = box({0.010, 0.030, 0.010}, {0.028, 0.004, 0.028});
    for (Tetrahedron corners : behind.tetrahedra) {
      for (std::uint32_t& node : corners) node += static_cast<std::uint32_t>(mesh.nodes.size());
      mesh.tetrahedra.push_back(corners);
      mesh.regions.push_back(0);
    }
    mesh.nodes.insert(mesh.nodes.end(), behind.nodes.begin(), behind.nodes.end());
    Scene scene = scene_of(mesh);
    scene.background = {0, 0, 0};
    scene.camera = camera_looking_at(ball_around(mesh), {0, 0}, 96, 96, 1, true);
    EXPECT_NEAR(brightness(picture_of(constant_ct(50), white(0.1), mesh, scene), 48, 48),
                255 * (1 - std::pow(0.9, 8)), 1.5);
  });
}

TEST(VolumeRenderer, PassingEmptyTetrahedraOverChangesNothing) {
  for_both_engines([] {
    // Much of the box is air that the transfer function hides. A trace of opacity makes it count as seen.
    const TetMesh mesh = box(Vector3::Constant(0.004), Vector3::Constant(0.040), {8, 8, 8});
    const Volume ct = test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), [](const Vector3& at) {
      return (at - kMiddle).norm() < 0.01 ? 60 : -900;
    });
    const auto transfer = [](const std::string& of_air) {
      return parse_transfer_function(
          R"({"name": "Ball", "points": [{"hu": -500, "color": "#ffffff", "opacity_per_mm": )" + of_air +
              R"(}, {"hu": -400, "color": "#ff0000", "opacity_per_mm": 0.5}]})",
          "ball.json");
    };
    const Scene scene = scene_of(mesh);
    EXPECT_LE(
        difference(picture_of(ct, transfer("0"), mesh, scene), picture_of(ct, transfer("1e-9"), mesh, scene))
            .largest,
        0);
  });
}

TEST(VolumeRenderer, ToolsHideWhatIsBehindAndTissueHidesTools) {
  for_both_engines([] {
    const TetMesh mesh = box({0.010, 0.018, 0.010}, {0.028, 0.012, 0.028});
    Scene scene = scene_of(mesh);
    const auto with = [&](double y_m) {
      scene.solids = {{Sphere{0.003}, {{0.024, y_m, 0.024}, Eigen::Quaterniond::Identity()}, {0, 255, 0}}};
      return picture_of(constant_ct(60), white(1), mesh, scene);
    };
    const auto is_green = [](const std::uint8_t* pixel) { return pixel[1] > 80 && pixel[0] < pixel[1] - 40; };
    EXPECT_TRUE(is_green(with(0.010).pixel(48, 48))) << "in front";
    EXPECT_FALSE(is_green(with(0.024).pixel(48, 48))) << "within";
    EXPECT_FALSE(is_green(with(0.040).pixel(48, 48))) << "behind";
    EXPECT_FALSE(is_green(with(0.010).pixel(48, 20))) << "beside it";
  });
}

TEST(VolumeRenderer, DrawsEveryShapeOfATool) {
  for_both_engines([] {
    const TetMesh mesh = box(Vector3::Constant(0.022), Vector3::Constant(0.004));
    Scene scene = scene_of(mesh);
    scene.camera = camera_looking_at({kMiddle, 0.02}, {0, 0}, 96, 96, 1, true);
    // Seen along y, at scale 96 pixels to 40 mm: x and z extents in pixels.
    const auto extent = [&](const ToolShape& shape) {
      scene.solids = {{shape, {{0.024, 0.005, 0.024}, Eigen::Quaterniond::Identity()}, {0, 255, 0}}};
      const Picture picture = picture_of(constant_ct(60), white(1), mesh, scene);
      int wide = 0, high = 0;
      for (int i = 0; i < 96; ++i) {
        const auto is_green = [&](const std::uint8_t* pixel) { return pixel[1] > pixel[0] + 20; };
        wide += is_green(picture.pixel(i, 48)) ? 1 : 0;
        high += is_green(picture.pixel(48, i)) ? 1 : 0;
      }
      return std::pair(wide, high);
    };
    const auto near = [](int pixels, double mm) { return std::abs(pixels - mm * 96 / 40) <= 1.5; };
    const auto [sphere_wide, sphere_high] = extent(Sphere{0.008});
    EXPECT_TRUE(near(sphere_wide, 16) && near(sphere_high, 16)) << sphere_wide << ' ' << sphere_high;
    const auto [rod_wide, rod_high] = extent(Capsule{0.005, 0.010});
    EXPECT_TRUE(near(rod_wide, 10) && near(rod_high, 30)) << rod_wide << ' ' << rod_high;
    const auto [box_wide, box_high] = extent(Box{{0.010, 0.002, 0.006}});
    EXPECT_TRUE(near(box_wide, 20) && near(box_high, 12)) << box_wide << ' ' << box_high;
  });
}

TEST(VolumeRenderer, TintsTissueByItsStress) {
  for_both_engines([] {
    const TetMesh mesh = box({0.010, 0.018, 0.010}, {0.028, 0.012, 0.028}, {8, 1, 1});
    Scene scene = scene_of(mesh);
    scene.stress.emplace();
    scene.stress->share = 1;
    scene.stress->largest_pa = 1000;
    for (const Vector3& node : mesh.nodes)
      scene.stress->at_nodes_pa.push_back((node.x() - 0.010) / 0.028 * 1000);
    const Picture picture = picture_of(constant_ct(60), white(1), mesh, scene);
    // Viridis: blue where there is none, yellow where there is most.
    EXPECT_GT(picture.pixel(22, 48)[2], picture.pixel(22, 48)[0]);
    EXPECT_GT(picture.pixel(74, 48)[0], 2 * picture.pixel(74, 48)[2]);
  });
}

TEST(VolumeRenderer, DrawsTheSurfaceAroundTheTissue) {
  for_both_engines([] {
    const TetMesh mesh = box({0.010, 0.018, 0.010}, {0.028, 0.012, 0.028});
    Scene scene = scene_of(mesh);
    scene.background = {0, 0, 0};
    const Volume ct = constant_ct(60);
    const Picture without = picture_of(ct, white(0.001), mesh, scene);
    scene.surface = SurfaceSheet{{0, 200, 0}, 0.5};
    const Picture with = picture_of(ct, white(0.001), mesh, scene);
    EXPECT_LT(brightness(without, 48, 48), 8);
    // The near side, and through it the far side.
    EXPECT_GT(with.pixel(48, 48)[1], 90);
    EXPECT_EQ(brightness(with, 2, 2), 0);
  });
}

TEST(VolumeRenderer, RefusesATransferFunctionThatHidesEverything) {
  for_both_engines([] {
    VolumeRenderer renderer(shaded(constant_ct(50)), find_transfer_function("bone"), drawn_by);
    try {
      renderer.set_mesh(ball());
      FAIL();
    } catch (const Error& error) {
      EXPECT_STREQ(
          error.what(),
          "the transfer function 'Bone' hides everything: it shows 151 to 3071 HU, and the CT in the "
          "mesh has 50 "
          "to 50 HU; choose another (--transfer), or look at whether the mesh belongs to this CT");
    }
    EXPECT_THROW(renderer.render({}, Scene()), UsageError) << "there is no mesh yet";
  });
}

TEST(VolumeRenderer, RefusesNumbersAndPicturesThatAreNone) {
  for_both_engines([] {
    VolumeRenderer renderer(shaded(constant_ct(50)), tissue(), drawn_by);
    const TetMesh mesh = ball();
    renderer.set_mesh(mesh);
    Scene scene = scene_of(mesh);
    EXPECT_THROW(renderer.render(std::vector<double>(7), scene), UsageError);
    EXPECT_THROW(renderer.render(std::vector<double>(3 * mesh.nodes.size(), std::nan("")), scene),
                 UsageError);
    scene.width = 0;
    EXPECT_THROW(renderer.render({}, scene), UsageError);
    scene.width = 9000;
    EXPECT_THROW(renderer.render({}, scene), UsageError);
  });
}

TEST(VolumeRenderer, SurvivesElementsWithoutVolumeAndTurnedInsideOut) {
  for_both_engines([] {
    const TetMesh mesh = ball();
    const Scene scene = scene_of(mesh);
    VolumeRenderer renderer(shaded(ball_ct()), tissue(), drawn_by);
    renderer.set_mesh(mesh);
    renderer.render(displacement(mesh,
                                 [](const Vector3& node) -> Vector3 {
                                   return {node.x(), 0.024, node.z()};
                                 }),
                    scene);
    renderer.render(displacement(mesh, [](const Vector3&) -> Vector3 { return kMiddle; }), scene);
    renderer.render(displacement(mesh, [](const Vector3& node) -> Vector3 { return 2 * kMiddle - node; }),
                    scene);
    // And draws as ever afterwards.
    EXPECT_EQ(renderer.render({}, scene).rgb, picture_of(ball_ct(), tissue(), mesh, scene).rgb);
  });
}

/// Software that claims to be a graphics processor; one that fails works until it is to draw.
class ClaimedContext : public GlContext {
 public:
  explicit ClaimedContext(bool fails) {
    inner_->make_current();
    compute_ = inner_->gl().DispatchCompute;
    load(
        [this, fails](const char* name) -> void* {
          if (fails && std::string_view(name) == "glGetError")
            return reinterpret_cast<void*>(+[]() -> GLenum { return GL_OUT_OF_MEMORY; });
          if (std::string_view(name) == "glDispatchCompute")
            return reinterpret_cast<void*>(+[](GLuint x, GLuint y, GLuint z) { dispatch(x, y, z); });
          return address(inner_->gl(), name);
        },
        "test");
  }
  ~ClaimedContext() override { leave(); }
  ClaimedContext(const ClaimedContext&) = delete;
  ClaimedContext& operator=(const ClaimedContext&) = delete;
  [[nodiscard]] bool is_software() const override { return false; }
  static int computed;  // how often, by all of them

 private:
  void bind() override { inner_->make_current(); }
  void release() noexcept override {}
  static void dispatch(GLuint x, GLuint y, GLuint z) {
    ++computed;
    compute_(x, y, z);
  }
  static void* address(const GlFunctions& gl, std::string_view name) {
#define KIROKU_GL_ADDRESS(Type, Name) \
  if (name == "gl" #Name) return reinterpret_cast<void*>(gl.Name);
    KIROKU_GL_FUNCTIONS(KIROKU_GL_ADDRESS)
#undef KIROKU_GL_ADDRESS
    return nullptr;
  }
  static PFNGLDISPATCHCOMPUTEPROC compute_;
  std::unique_ptr<GlContext> inner_ = make_software_context();
};
int ClaimedContext::computed = 0;
PFNGLDISPATCHCOMPUTEPROC ClaimedContext::compute_ = nullptr;

TEST(VolumeRenderer, GoesOnInSoftwareWhereTheGraphicsProcessorRunsOutOfMemory) {
  for_both_engines([] {
    VolumeRenderer renderer(
        shaded(ball_ct()), tissue(),
        {GpuUse::kAuto, drawn_by.engine == Engine::kOpenGl ? Engine::kOpenGl : Engine::kAuto},
        [] { return std::make_unique<ClaimedContext>(true); });
    EXPECT_THAT(renderer.notice(), HasSubstr("in software from now on"));
    EXPECT_THAT(renderer.notice(), HasSubstr("out of memory"));
    const TetMesh mesh = ball();
    renderer.set_mesh(mesh);
    const Scene scene = scene_of(mesh);
    EXPECT_EQ(renderer.render({}, scene).rgb, picture_of(ball_ct(), tissue(), mesh, scene).rgb);
  });
}

TEST(VolumeRenderer, DrawsTheSameOverEgl) {
  // Mesa's own device, where its drivers are installed: the way to a graphics processor, without one.
  const GpuMaker maker = [] { return make_gpu_context(true); };
  std::unique_ptr<GlContext> there;
  try {
    there = maker();
  } catch (const Error& error) {
    GTEST_SKIP() << error.what();
  }
  if (!there) GTEST_SKIP() << "there is no EGL device";
  there.reset();
  drawn_by.engine = Engine::kOpenGl;
  const TetMesh mesh = ball();
  const Scene scene = scene_of(mesh);
  VolumeRenderer renderer(shaded(marked_ct()), tissue(), GpuUse::kAuto, maker);
  renderer.set_mesh(mesh);
  EXPECT_EQ(renderer.notice(), "");
  const Difference found =
      difference(renderer.render({}, scene), picture_of(marked_ct(), tissue(), mesh, scene));
  EXPECT_LT(found.share, 0.001) << renderer.renderer();
}

// Frames as they were when they were last looked at, kept as PPM. Another software rasteriser, or a processor
// of other vectors, may round otherwise; there they must agree nearly.
constexpr const char* kGoldenRenderer = "llvmpipe (LLVM 15.0.6, 256 bits)";

void expect_golden(const std::string& name, const Picture& picture) {
  const std::string text = "P6\n" + std::to_string(picture.width) + " " + std::to_string(picture.height) +
                           "\n255\n" + std::string(picture.rgb.begin(), picture.rgb.end());
  const std::string here = test::binary_folder() / ("golden_" + name + ".ppm");
  std::ofstream(here, std::ios::binary) << text;
  std::ifstream file(test::source_folder() / "tests/unit/sim/render/golden" / (name + ".ppm"),
                     std::ios::binary);
  const std::string golden{std::istreambuf_iterator<char>(file), {}};
  ASSERT_EQ(golden.size(), text.size())
      << "look at " << here << " and put it into tests/unit/sim/render/golden/";
  if (make_software_context()->renderer() == kGoldenRenderer) {
    EXPECT_TRUE(golden == text) << here << " is no longer the golden " << name
                                << "; where the change is meant, look at it and put it there";
    return;
  }
  Picture before = picture;
  before.rgb.assign(golden.end() - static_cast<std::ptrdiff_t>(picture.rgb.size()), golden.end());
  EXPECT_LT(difference(before, picture).share, 0.01) << here;
}

/// Cut open, bent, with tools in it, its stress and its surface.
struct RichCase {
  TetMesh mesh;
  Scene scene;
  std::vector<double> opened;
};
RichCase rich_case() {
  const TetMesh whole = ball();
  VertexPreservingCut cut(whole);
  cut.cut(SweepSurface({{kMiddle.x(), 0, 0}, {kMiddle.x(), 0, 0.05}},
                       {{kMiddle.x(), 0.022, 0}, {kMiddle.x(), 0.022, 0.05}}));
  RichCase rich{cut.remaining(), scene_of(whole, {25, 15}), {}};
  rich.scene.solids = {
      {Capsule{0.002, 0.012},
       {{0.034, 0.006, 0.02}, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vector3::UnitX()))},
       {200, 200, 210}},
      {Box{{0.004, 0.001, 0.003}}, {{0.012, 0.006, 0.03}, Eigen::Quaterniond::Identity()}, {90, 160, 230}}};
  rich.scene.stress.emplace();
  rich.scene.stress->largest_pa = 100;
  for (const Vector3& node : rich.mesh.nodes)
    rich.scene.stress->at_nodes_pa.push_back(100 * (node - kMiddle).norm() / kRadius);
  rich.scene.surface.emplace();
  rich.opened = displacement(rich.mesh, [](const Vector3& node) -> Vector3 {
    const double depth = std::max(0.0, 0.024 - node.y()) / 0.016;
    return bent(node) + Vector3(node.x() > kMiddle.x() ? 0.006 : -0.006, 0, 0) * depth;
  });
  return rich;
}

TEST(VolumeRenderer, DrawsTheSameByComputingAsByDrawing) {
  const auto drawn = [](bool computing, const TetMesh& mesh, std::span<const double> displacement_m,
                        const Scene& scene) {
    VolumeRenderer renderer(shaded(marked_ct()), tissue(),
                            {computing ? GpuUse::kAuto : GpuUse::kOff, Engine::kOpenGl},
                            [] { return std::make_unique<ClaimedContext>(false); });
    renderer.set_mesh(mesh);
    const int before = ClaimedContext::computed;
    Picture picture = renderer.render(displacement_m, scene);
    EXPECT_EQ(renderer.notice(), "");
    EXPECT_EQ(ClaimedContext::computed > before, computing);
    return picture;
  };
  const RichCase rich = rich_case();
  EXPECT_LT(difference(drawn(true, rich.mesh, rich.opened, rich.scene),
                       drawn(false, rich.mesh, rich.opened, rich.scene))
                .share,
            0.001);
  Scene endoscopic = rich.scene;
  look_through({0.02, 70, {-0.25, 0.05}, {}}, rich.mesh, rich.opened, endoscopic);
  EXPECT_LT(difference(drawn(true, rich.mesh, rich.opened, endoscopic),
                       drawn(false, rich.mesh, rich.opened, endoscopic))
                .share,
            0.001);
  // Sides that are no multiple of a group's, the organ over one corner of the picture. The bytes of the
  // second are more than one row of groups packs, 1024 groups of 256 bytes.
  constexpr std::ptrdiff_t kRowBytes = 262'144;
  for (const auto& [width, height] : {std::pair{101, 67}, {331, 307}}) {
    Scene odd = scene_of(ball());
    odd.width = width;
    odd.height = height;
    odd.camera.centre += odd.camera.half_extent * 0.7;
    const Picture picture = drawn(true, ball(), {}, odd);
    EXPECT_LT(difference(picture, drawn(false, ball(), {}, odd)).share, 0.001) << width << " x " << height;
    if (std::ssize(picture.rgb) <= kRowBytes) continue;
    EXPECT_GT(std::count_if(picture.rgb.begin() + kRowBytes, picture.rgb.end(),
                            [](std::uint8_t byte) { return byte > 0; }),
              10'000);
  }
}

TEST(VolumeRenderer, FindsLayersThatTheLastPictureDidNotHave) {
  // Four bars of one mesh, behind each other at rest, drawn beside each other and back.
  TetMesh mesh;
  std::vector<double> beside_m;
  for (int bar = 0; bar < 4; ++bar) {
    const TetMesh one = box({0.021, 0.006 + 0.009 * bar, 0.010}, {0.006, 0.005, 0.028});
    const auto first = static_cast<std::uint32_t>(mesh.nodes.size());
    for (const Tetrahedron& at : one.tetrahedra) {
      mesh.tetrahedra.push_back({at[0] + first, at[1] + first, at[2] + first, at[3] + first});
      mesh.regions.push_back(0);
    }
    for (const Vector3& node : one.nodes) {
      mesh.nodes.push_back(node);
      beside_m.insert(beside_m.end(), {0.009 * (bar - 1.5), 0, 0});
    }
  }
  Scene scene = scene_of(mesh);
  scene.camera = camera_looking_at(ball_around(mesh), {0, 0}, 96, 96, 1, true);
  const auto shading = shaded(constant_ct(50));
  VolumeRenderer software(shading, white(0.02), {GpuUse::kOff, Engine::kOpenGl});
  VolumeRenderer computed(shading, white(0.02), {GpuUse::kAuto, Engine::kOpenGl},
                          [] { return std::make_unique<ClaimedContext>(false); });
  for (VolumeRenderer* const renderer : {&software, &computed}) renderer->set_mesh(mesh);
  struct Step {
    std::span<const double> displacement_m;
    int cast;  // how often: again where there are more layers than were drawn ahead
  };
  const std::span<const double> behind;
  for (const Step& step : {Step{beside_m, 1}, {behind, 2}, {behind, 1}, {beside_m, 1}, {behind, 2}}) {
    const int before = ClaimedContext::computed;
    const Picture picture = computed.render(step.displacement_m, scene);
    EXPECT_EQ(ClaimedContext::computed - before, 2 * step.cast);  // the rays, then the picture's bytes
    EXPECT_LT(difference(picture, software.render(step.displacement_m, scene)).share, 0.001);
  }
  EXPECT_EQ(computed.notice(), "");
}

TEST(GoldenFrames, AreTheSameToTheByte) {
  drawn_by.engine = Engine::kOpenGl;
  const TetMesh mesh = ball();
  const Scene still = scene_of(mesh, {25, 15});
  expect_golden("still", picture_of(marked_ct(), tissue(), mesh, still));
  expect_golden("lung", picture_of(marked_ct(), find_transfer_function("lung"), mesh, still));
  const RichCase rich = rich_case();
  expect_golden("opened", picture_of(marked_ct(), tissue(), rich.mesh, rich.scene, rich.opened));
}

TEST(VolumeRenderer, TakesTheProcessorWhereNoGraphicsProcessorIsToBeUsed) {
  const GpuMaker none = [] { return std::unique_ptr<GlContext>(); };
  const GpuMaker broken = []() -> std::unique_ptr<GlContext> { throw Error("it is on fire"); };
  const auto by = [](const EngineChoice& choice, const GpuMaker& maker) {
    const VolumeRenderer renderer(shaded(constant_ct(50)), tissue(), choice, maker);
    return std::pair(renderer.renderer(), renderer.notice());
  };
  EXPECT_THAT(by(GpuUse::kOff, broken).first, HasSubstr("processor, "));
  EXPECT_EQ(by(GpuUse::kOff, broken).second, "");
  EXPECT_THAT(by(GpuUse::kAuto, none).first, HasSubstr("processor, "));
  EXPECT_EQ(by(GpuUse::kAuto, none).second, "");
  EXPECT_THAT(by(GpuUse::kAuto, broken).first, HasSubstr("processor, "));
  EXPECT_THAT(by(GpuUse::kAuto, broken).second, HasSubstr("it is on fire"));
  EXPECT_THAT(by({GpuUse::kAuto, Engine::kOpenGl}, none).first, HasSubstr("llvmpipe"));
  EXPECT_EQ(by({GpuUse::kAuto, Engine::kProcessor}, broken).second, "") << "it is not even asked";
}

TEST(AtNodes, IsTheMeanByVolume) {
  TetMesh mesh;
  mesh.nodes = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -3}, {9, 9, 9}};
  mesh.tetrahedra = {{0, 1, 2, 3}, {0, 2, 1, 4}};
  mesh.regions = {0, 0};
  const std::vector<double> pa = at_nodes(mesh, std::vector<double>{8, 4});
  EXPECT_DOUBLE_EQ(pa[0], 5);
  EXPECT_DOUBLE_EQ(pa[3], 8);
  EXPECT_DOUBLE_EQ(pa[4], 4);
  EXPECT_DOUBLE_EQ(pa[5], 0);
}

}  // namespace
}  // namespace kiroku::sim
