// Four ways to cut, side by side: the same uneven block, the same hundred steps of a blade, the same pull. By
// each way: the volume that is lost, the nodes that are added, the time of a step with its solve, the
// smallest angle, the condition of the stiffness matrix, and how far the opening is from that of a fine mesh
// that was split exactly along the blade. Volume that hangs on nothing any longer counts as lost.
//
// The matrix of vertex-preserving cuts and of removal keeps its size and is brought up to date; that of the
// two others grows and is made and factorised anew in each step. Of the four, each step is timed once, in
// turn, so that other work on the machine falls on all alike; ratios of times are what counts.
//
//   sim_cut_ways_bench [--vtu PREFIX] [--picture FILE.png]
//
// Prints ID=VALUE, a line each, as docs/results/record.py takes them; with --vtu, writes the four bodies as
// they open: PREFIX-removal.vtu and so on; with --picture, draws the begin of the four openings beside each
// other.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <fstream>
#include <memory>
#include <string>

#include "sim/cutting/cut_body.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/render/lettering.h"
#include "sim/render/surface_renderer.h"
#include "tests/bench/cut_scene.h"
#include "tests/bench/render_bench.h"

namespace {

using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file
using kiroku::test::CutScene;

constexpr int kSteps = 100, kFew = 10;
constexpr std::array<std::uint32_t, 3> kCells{10, 100, 8}, kCellsOfReference{20, 200, 16};

/// Of all threads.
double processor_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// A body that is cut one way; each step leaves it solved for the pull.
class Way {
 public:
  virtual ~Way() = default;
  virtual void step(const SweepSurface& sweep) = 0;
  /// What bears, and how it lies.
  [[nodiscard]] virtual TetMesh mesh() const = 0;
  [[nodiscard]] const Eigen::VectorXd& displacement_m() const { return displacement_m_; }

 protected:
  Eigen::VectorXd displacement_m_;
};

class Preserving : public Way {
 public:
  Preserving(const CutScene& scene, const TetMesh& mesh)
      : body_(mesh, {{0, scene.tissue}}, scene.held(mesh)), force_n_(scene.pull(mesh)) {}
  void step(const SweepSurface& sweep) override {
    body_.cut(sweep);
    displacement_m_ = body_.solve(force_n_).displacement_m;
  }
  [[nodiscard]] TetMesh mesh() const override {
    const TetMesh& all = body_.shape().mesh();
    TetMesh left{all.nodes, {}, {}};
    for (std::uint32_t t = 0; t < all.tetrahedra.size(); ++t) {
      if (!body_.bears(t)) continue;
      left.tetrahedra.push_back(all.tetrahedra[t]);
      left.regions.push_back(all.regions[t]);
    }
    return left;
  }

 private:
  CutBody body_;
  Eigen::VectorXd force_n_;
};

class Removing : public Way {
 public:
  Removing(const CutScene& scene, const TetMesh& mesh)
      : cut_(mesh), body_(mesh, {{0, scene.tissue}}, scene.held(mesh)), force_n_(scene.pull(mesh)) {
    body_.apply({}, {});  // so that the first step is as quick as the others
  }
  void step(const SweepSurface& sweep) override {
    const std::vector<std::uint32_t> gone = cut_.cut(sweep);
    if (!gone.empty()) {
      const TetMesh left = cut_.mesh();
      const Parts parts = face_connected_parts(left, faces_of(left));
      std::vector<std::size_t> count(parts.count);
      for (const std::uint32_t part : parts.of_tetrahedron) ++count[part];
      const auto largest = static_cast<std::uint32_t>(std::ranges::max_element(count) - count.begin());
      std::vector<std::uint32_t> adrift;
      std::uint32_t next = 0;
      for (std::uint32_t t = 0; t < body_.mesh().tetrahedra.size(); ++t) {
        if (cut_.present(t) && parts.of_tetrahedron[next++] != largest) adrift.push_back(t);
      }
      body_.apply({{}, {}, gone}, adrift);
    }
    displacement_m_ = body_.solve(force_n_).displacement_m;
  }
  [[nodiscard]] TetMesh mesh() const override { return kiroku::test::largest_part(cut_.mesh()); }

 private:
  kiroku::test::RemovingCut cut_;
  ElasticBody body_;
  Eigen::VectorXd force_n_;
};

template <typename Cut>
class Growing : public Way {
 public:
  Growing(const CutScene& scene, const TetMesh& mesh) : scene_(scene), cut_(mesh) {}
  void step(const SweepSurface& sweep) override {
    cut_.cut(sweep);
    const TetMesh bearing = mesh();
    const ElasticBody body(bearing, {{0, scene_.tissue}}, scene_.held(bearing));
    displacement_m_ = body.solve(scene_.pull(bearing)).displacement_m;
  }
  [[nodiscard]] TetMesh mesh() const override { return kiroku::test::largest_part(cut_.mesh()); }

 private:
  const CutScene& scene_;
  Cut cut_;
};

struct Measured {
  std::string name;
  std::unique_ptr<Way> way;
  std::vector<double> step_s;
  double smallest_degrees = 180;
};

double mean_ms(const std::vector<double>& times_s, int from, int to) {
  double sum_s = 0;
  for (int i = from; i < to; ++i) sum_s += times_s[static_cast<std::size_t>(i)];
  return 1e3 * sum_s / (to - from);
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

/// Root mean square of the differences.
double error_mm(const std::vector<double>& values_m, const std::vector<double>& reference_m) {
  double squares_m2 = 0;
  for (std::size_t i = 0; i < values_m.size(); ++i) squares_m2 += std::pow(values_m[i] - reference_m[i], 2);
  return kMmPerM * std::sqrt(squares_m2 / static_cast<double>(values_m.size()));
}

CutScene::Opening opening_of(const CutScene& scene, const TetMesh& mesh) {
  const ElasticBody body(mesh, {{0, scene.tissue}}, scene.held(mesh));
  return scene.opening(mesh, body.solve(scene.pull(mesh)).displacement_m);
}

void print(const std::string& name, const char* what, double value) {
  std::printf("%s_%s=%.3g\n", name.c_str(), what, value);
}

/// The end where the blade went in, seen obliquely from above.
Picture picture_of(const TetMesh& mesh, const Eigen::VectorXd& displacement_m, const std::string& below) {
  SurfaceScene scene;
  scene.width = 640;
  scene.height = 480;
  scene.camera = camera_looking_at({{0.025, 0.05, 0.03}, 0.042}, {12, 40}, scene.width, scene.height);
  SurfaceRenderer renderer(mesh, GpuUse::kOff);
  Picture picture =
      renderer.render({displacement_m.data(), static_cast<std::size_t>(displacement_m.size())}, scene)
          .picture;
  Lettering lettering;
  draw_caption(lettering, picture, "", below);
  return picture;
}

/// Two in a row.
void write_beside(const std::string& file, const std::vector<Picture>& pictures) {
  const int width = pictures.front().width, height = pictures.front().height;
  Picture all(2 * width, height * static_cast<int>((pictures.size() + 1) / 2));
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    for (int y = 0; y < height; ++y) {
      std::copy_n(pictures[i].pixel(0, y), 3 * width,
                  all.pixel(static_cast<int>(i % 2) * width, static_cast<int>(i / 2) * height + y));
    }
  }
  kiroku::bench::write_png(file, all);
}

int run(const std::string& prefix, const std::string& picture) {
  const CutScene scene;
  const TetMesh block = scene.uneven(kCells);
  const std::vector<SweepSurface> path = scene.sweeps(kSteps);
  std::vector<Measured> all;
  all.push_back({"preserving", std::make_unique<Preserving>(scene, block), {}, 180});
  all.push_back({"removal", std::make_unique<Removing>(scene, block), {}, 180});
  all.push_back(
      {"subdivision", std::make_unique<Growing<kiroku::test::SubdividingCut>>(scene, block), {}, 180});
  all.push_back({"faces", std::make_unique<Growing<kiroku::test::FaceSplittingCut>>(scene, block), {}, 180});
  for (int step = 0; step < kSteps; ++step) {
    for (Measured& measured : all) {
      const double begin_s = processor_s();
      measured.way->step(path[static_cast<std::size_t>(step)]);
      measured.step_s.push_back(processor_s() - begin_s);
      if (step % kFew != kFew - 1) continue;
      measured.smallest_degrees =
          std::min(measured.smallest_degrees, kiroku::test::smallest_dihedral_degrees(measured.way->mesh()));
    }
  }

  const CutScene::Opening reference = opening_of(scene, scene.exactly_split(kCellsOfReference));
  const CutScene::Opening same = opening_of(scene, scene.exactly_split(kCells));
  std::printf("opening=%.3g\n", 1e3 * mean(reference.gap_m));
  std::printf("angle_before=%.3g\n", kiroku::test::smallest_dihedral_degrees(block));
  std::printf("condition_before=%.3g\n",
              kiroku::test::condition_number(ElasticBody(block, {{0, scene.tissue}}, scene.held(block))));
  print("exact", "gap", error_mm(same.gap_m, reference.gap_m));
  const double whole_m3 = kiroku::test::volume_m3(block);
  std::vector<Picture> pictures;
  for (const Measured& measured : all) {
    const TetMesh mesh = measured.way->mesh();
    const CutScene::Opening opening = scene.opening(mesh, measured.way->displacement_m());
    print(measured.name, "volume", 100 * (1 - kiroku::test::volume_m3(mesh) / whole_m3));
    print(measured.name, "nodes", static_cast<double>(mesh.nodes.size() - block.nodes.size()));
    print(measured.name, "step", mean_ms(measured.step_s, 0, kSteps));
    print(measured.name, "growth",
          mean_ms(measured.step_s, kSteps - kFew, kSteps) / mean_ms(measured.step_s, 0, kFew));
    print(measured.name, "angle", measured.smallest_degrees);
    print(measured.name, "condition",
          kiroku::test::condition_number(ElasticBody(mesh, {{0, scene.tissue}}, scene.held(mesh))));
    print(measured.name, "gap", error_mm(opening.gap_m, reference.gap_m));
    print(measured.name, "motion", error_mm(opening.motion_m, reference.motion_m));
    if (!picture.empty()) {
      pictures.push_back(picture_of(mesh, measured.way->displacement_m(),
                                    measured.name == "preserving"    ? "vertex-preserving: no node more"
                                    : measured.name == "removal"     ? "removal of what the blade meets"
                                    : measured.name == "subdivision" ? "subdivision along the blade"
                                                                     : "splitting along faces"));
    }
    if (!prefix.empty()) {
      const Eigen::VectorXd displacement_mm = kMmPerM * measured.way->displacement_m();
      std::ofstream(prefix + "-" + measured.name + ".vtu")
          << vtu_text(mesh, LengthUnit::kMillimetre,
                      {{"displacement",
                        {"X", "Y", "Z"},
                        std::span(displacement_mm.data(), static_cast<std::size_t>(displacement_mm.size()))}},
                      {});
    }
  }
  if (!pictures.empty()) write_beside(picture, pictures);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::string prefix, picture;
  bool known = argc % 2 == 1;
  for (int i = 1; known && i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--vtu") == 0) {
      prefix = argv[i + 1];
    } else if (std::strcmp(argv[i], "--picture") == 0) {
      picture = argv[i + 1];
    } else {
      known = false;
    }
  }
  if (!known) {
    std::fprintf(stderr, "usage: sim_cut_ways_bench [--vtu PREFIX] [--picture FILE.png]\n");
    return 2;
  }
  try {
    return run(prefix, picture);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
