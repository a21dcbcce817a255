// 'kiroku sim render' and 'kiroku plan replay' as a person calls them.
#include <cmath>

#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

/// A CT of 20^3 voxels of 1 mm, denser to the left, and a cube of 10 mm within it.
class Render : public ProgramTest {
 protected:
  Render() {
    std::string ct =
        "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 20 20 20\n"
        "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (-5,-5,-5)\nencoding: raw\nendian: "
        "little\n\n";
    for (int voxel = 0; voxel < 20 * 20 * 20; ++voxel) {
      const auto value = static_cast<std::uint16_t>(40 + 4 * (voxel % 20));
      ct += static_cast<char>(value & 0xffU);
      ct += static_cast<char>(value >> 8U);
    }
    write_text(folder() / "ct.nrrd", ct);
    write_mesh("cube.msh", 0);
    write_mesh("far.msh", 500);
    write_plan(R"("volume": "ct.nrrd",)");
  }
  void write_mesh(const std::string& name, int offset) const {
    std::string text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n";
    for (int node = 0; node < 8; ++node) {
      const auto at = [&](int bit) { return " " + std::to_string(offset + (node >> bit & 1) * 10); };
      text += std::to_string(node + 1) + at(0) + at(1) + at(2) + "\n";
    }
    write_text(folder() / name,
               text +
                   "$EndNodes\n$Elements\n6\n1 4 2 1 1 1 2 4 8\n2 4 2 1 1 1 3 7 8\n3 4 2 1 1 1 5 6 8\n4 4 2 "
                   "1 1 1 2 8 6\n5 4 2 1 1 1 5 8 7\n6 4 2 1 1 1 3 8 4\n$EndElements\n");
  }
  void write_plan(const std::string& volume) const {
    write_text(folder() / "plan.json",
               R"({"name": "cube", )" + volume + R"( "mesh": "cube.msh", "length_unit": "mm",
      "time_step_s": 0.25, "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.45}],
      "fixed": [{"box": [[0, 0, 0], [10, 10, 0]]}], "tools": {"forceps": {"kind": "forceps", "jaws": [12, 12, 2]}},
      "steps": [{"do": "grasp", "tool": "forceps", "at": {"position": [5, 5, 10]}},
                {"do": "retract", "tool": "forceps", "path": [{"at_s": 1, "position": [6, 5, 12]}]},
                {"do": "release", "tool": "forceps"}]})");
  }
  /// By OSMesa, on as many threads as told.
  [[nodiscard]] ProcessResult with_threads(const std::string& threads, Arguments arguments) const {
    arguments.insert(arguments.end(), {"--gpu", "off", "--engine", "opengl"});
    Process::Options started = options(arguments);
    started.environment["LP_NUM_THREADS"] = threads;
    return run_process(started);
  }
};

TEST_F(Render, MakesAPicture) {
  const nlohmann::json made = kiroku_json(
      {"sim", "render", "ct.nrrd", "--mesh", "cube.msh", "--size", "64x48", "-o", "cube.png", "--json"});
  EXPECT_EQ(made["width"], 64);
  EXPECT_EQ(made["height"], 48);
  EXPECT_THAT(read_text(folder() / "cube.png"), testing::StartsWith("\x89PNG"));
  EXPECT_REFUSED(kiroku({"sim", "render", "ct.nrrd", "--mesh", "cube.msh", "-o", "cube.png"}), "--force");
  // The whole CT, by a transfer function that was printed and edited.
  const ProcessResult printed = kiroku({"sim", "transfer", "skin"});
  EXPECT_EQ(printed.status, 0) << printed.err;
  write_text(folder() / "mine.json", printed.out);
  const ProcessResult whole = kiroku({"sim", "render", "ct.nrrd", "--transfer", "mine.json", "--size",
                                      "64x48", "-o", "cube.png", "--force"});
  EXPECT_EQ(whole.status, 0) << whole.err;
  EXPECT_THAT(whole.out, HasSubstr("cube.png: 64x48 pixels, by "));
}

TEST_F(Render, ShowsASolvedPlanWithItsStress) {
  ASSERT_EQ(kiroku({"plan", "run", "plan.json", "-o", "run"}).status, 0);
  const Arguments render{
      "sim",    "render", "ct.nrrd", "--mesh", "cube.msh", "--displacement", "run/frames/00004.vtu",
      "--size", "96x96"};
  const auto with = [&](Arguments more) {
    Arguments all = render;
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  };
  EXPECT_EQ(with({"-o", "plain.png"}).status, 0);
  const ProcessResult stress = with({"--stress", "auto", "-o", "stress.png"});
  EXPECT_EQ(stress.status, 0) << stress.err;
  EXPECT_NE(read_text(folder() / "plain.png"), read_text(folder() / "stress.png"));
  EXPECT_REFUSED(
      kiroku({"sim", "render", "ct.nrrd", "--mesh", "cube.msh", "--stress", "auto", "-o", "x.png"}),
      "--displacement");
}

TEST_F(Render, MakesTheSameBytesWhateverTheNumberOfThreads) {
  std::vector<std::string> pictures;
  for (const std::string threads : {"0", "1", "3"}) {
    const ProcessResult result = with_threads(threads, {"sim", "render", "ct.nrrd", "--mesh", "cube.msh",
                                                        "--view", "30,20", "-o", "cube.png", "--force"});
    ASSERT_EQ(result.status, 0) << result.err;
    pictures.push_back(read_text(folder() / "cube.png"));
  }
  EXPECT_TRUE(pictures[0] == pictures[1] && pictures[0] == pictures[2]);
}

TEST_F(Render, LooksThroughAnEndoscope) {
  const auto seen = [&](const std::string& threads, const Arguments& more) {
    Arguments arguments{"sim", "render", "ct.nrrd", "--mesh", "cube.msh", "--endoscope",
                        "20",  "--size", "96x64",   "-o",     "cube.png", "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProcessResult result = with_threads(threads, arguments);
    EXPECT_EQ(result.status, 0) << result.err;
    return read_text(folder() / "cube.png");
  };
  const std::string seen_first = seen("1", {});
  EXPECT_EQ(seen("3", {}), seen_first);
  EXPECT_EQ(seen("1", {"--lens", "-0.25,0.05", "--field", "70", "--spacing", "0.2"}), seen_first)
      << "these are the defaults";
  EXPECT_NE(seen("1", {"--lens", "-0.1,0"}), seen_first);
  EXPECT_NE(seen("1", {"--field", "60"}), seen_first);
  EXPECT_NE(seen("1", {"--at", "6,5,5"}), seen_first);
  // An own lens, as its calibration is written.
  write_text(folder() / "lens.yml",
             "%YAML:1.0\n---\nimage_width: 192\nimage_height: 128\n"
             "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
             "   data: [ 130., 0., 95.5, 0., 130., 63.5, 0., 0., 1. ]\n"
             "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
             "   data: [ -0.2, 0.02, 0., 0., 0. ]\n");
  EXPECT_NE(seen("1", {"--lens", "lens.yml"}), seen_first);
  // The lens is not to blame where nothing lies before it.
  const ProcessResult aside =
      kiroku({"sim", "render", "ct.nrrd", "--mesh", "cube.msh", "--endoscope", "20", "--lens", "lens.yml",
              "--size", "96x64", "--at", "90,5,5", "-o", "aside.png"});
  EXPECT_REFUSED(aside, "axis meets no tissue");
  EXPECT_THAT(aside.err, Not(HasSubstr("lens.yml")));
  const ProcessResult film = kiroku(
      {"plan", "replay", "plan.json", "--endoscope", "25", "--size", "96x64", "--gpu", "off", "-o", "film"});
  EXPECT_EQ(film.status, 0) << film.err;
  EXPECT_EQ(files_below(folder() / "film").size(), 7U);
}

TEST_F(Render, RefusesAnEndoscopeThatIsNoneInOneSentence) {
  const auto render = [&](const Arguments& more) {
    Arguments all{"sim", "render", "ct.nrrd", "--mesh", "cube.msh", "-o", "x.png"};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  };
  EXPECT_REFUSED(render({"--endoscope", "0"}), "--endoscope is '0'");
  EXPECT_REFUSED(render({"--endoscope", "near"}), "--endoscope is 'near'");
  EXPECT_REFUSED(render({"--endoscope", "20", "--field", "170"}), "--field is '170'");
  EXPECT_REFUSED(render({"--endoscope", "20", "--lens", "-0.25"}), "--lens is '-0.25'");
  EXPECT_REFUSED(render({"--endoscope", "20", "--lens", "-3,0"}), "folds back within 70 degrees");
  EXPECT_REFUSED(render({"--endoscope", "20", "--lens", "none.yml"}), "none.yml");
  EXPECT_REFUSED(render({"--endoscope", "20", "--lens", "none.yml", "--field", "60"}), "whose field it is");
  EXPECT_REFUSED(render({"--endoscope", "20", "--zoom", "2"}), "--zoom is for pictures without an endoscope");
  EXPECT_REFUSED(render({"--endoscope", "20", "--at", "90,5,5"}), "axis meets no tissue");
  EXPECT_REFUSED(render({"--at", "1,2"}), "--at is '1,2'");
  EXPECT_REFUSED(render({"--field", "60"}), "give --endoscope MM too");
  EXPECT_REFUSED(render({"--lens", "0,0"}), "give --endoscope MM too");
}

TEST_F(Render, TakesTheEngineThatIsAskedFor) {
  const auto made_by = [&](const Arguments& engine) {
    Arguments arguments{"sim",   "render", "ct.nrrd",  "--mesh",  "cube.msh", "--size",
                        "64x48", "-o",     "cube.png", "--force", "--json"};
    arguments.insert(arguments.end(), engine.begin(), engine.end());
    return kiroku_json(arguments)["renderer"].get<std::string>();
  };
  EXPECT_THAT(made_by({"--gpu", "off"}), testing::StartsWith("processor, "));
  const std::string first = read_text(folder() / "cube.png");
  EXPECT_THAT(made_by({"--engine", "processor"}), testing::StartsWith("processor, "));
  EXPECT_EQ(read_text(folder() / "cube.png"), first);
  EXPECT_THAT(made_by({"--gpu", "off", "--engine", "opengl"}), HasSubstr("llvmpipe"));
  EXPECT_REFUSED(kiroku({"sim", "render", "ct.nrrd", "--engine", "fast", "-o", "x.png"}), "--engine");
}

TEST_F(Render, ReplaysAPlanWithTheSameFramesEveryTime) {
  const auto replay = [&](const std::string& threads, const std::string& output) {
    const ProcessResult result = with_threads(
        threads, {"plan", "replay", "plan.json", "--size", "96x64", "--stress", "500", "-o", output});
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_THAT(result.out, HasSubstr(output + ": 7 frames of 1 s"));
  };
  replay("0", "one");
  replay("3", "two");
  const std::vector<std::string> frames = files_below(folder() / "one");
  ASSERT_EQ(frames.size(), 7U);
  for (const std::string& frame : frames)
    EXPECT_EQ(read_text(folder() / "one" / frame), read_text(folder() / "two" / frame)) << frame;
  EXPECT_NE(read_text(folder() / "one/000001.png"), read_text(folder() / "one/000006.png"));
  replay("2", "film.mkv");
  replay("2", "again.mkv");
  EXPECT_EQ(read_text(folder() / "film.mkv"), read_text(folder() / "again.mkv"));
  replay("2", "film.mp4");
}

TEST_F(Render, RefusesInOneSentence) {
  const auto render = [&](const Arguments& more) {
    Arguments all{"sim", "render", "ct.nrrd"};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  };
  EXPECT_REFUSED(render({"-o", "x.jpg"}), "must be .png");
  EXPECT_REFUSED(render({"--view", "above", "-o", "x.png"}), "the view 'above' is none");
  EXPECT_REFUSED(render({"--size", "640", "-o", "x.png"}), "--size is '640'");
  EXPECT_REFUSED(render({"--zoom", "0", "-o", "x.png"}), "--zoom is '0'");
  EXPECT_REFUSED(render({"--background", "grey", "-o", "x.png"}), "--background is 'grey'");
  EXPECT_REFUSED(render({"--gpu", "fast", "-o", "x.png"}), "--gpu");
  EXPECT_REFUSED(render({"--transfer", "spleen", "-o", "x.png"}), "no transfer function 'spleen'");
  EXPECT_REFUSED(render({"--transfer", "bone", "--mesh", "cube.msh", "-o", "x.png"}), "hides everything");
  EXPECT_REFUSED(render({"--mesh", "far.msh", "-o", "x.png"}), "the mesh lies outside its CT");
  EXPECT_FALSE(std::filesystem::exists(folder() / "x.png"));
  EXPECT_FALSE(std::filesystem::exists(folder() / "x.png.part"));
  write_plan("");
  EXPECT_REFUSED(kiroku({"plan", "replay", "plan.json", "-o", "x.mp4"}), "--volume");
  write_plan(R"("volume": "ct.nrrd",)");
  EXPECT_REFUSED(kiroku({"plan", "replay", "plan.json", "-o", "x.avi"}), "must end in .mp4");
  EXPECT_REFUSED(kiroku({"plan", "replay", "plan.json", "--size", "65x64", "-o", "x.mp4"}),
                 "sides must be even");
}

}  // namespace
}  // namespace kiroku::test
