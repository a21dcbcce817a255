// 'kiroku sim' as a person calls it.
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

/// A unit cube of six tetrahedra in mm, its lower face held.
class Simulation : public ProgramTest {
 protected:
  Simulation() {
    write_text(folder() / "cube.msh",
               "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 0 0 0\n2 10 0 0\n3 0 10 0\n4 10 10 0\n5 0 "
               "0 10\n6 10 0 10\n"
               "7 0 10 10\n8 10 10 10\n$EndNodes\n$Elements\n7\n1 4 2 1 1 1 2 4 8\n2 4 2 1 1 1 3 7 8\n3 4 2 "
               "1 1 1 5 6 8\n"
               "4 4 2 1 1 1 2 8 6\n5 4 2 1 1 1 5 8 7\n6 4 2 1 1 1 3 8 4\n7 2 2 0 1 1 2 4\n$EndElements\n");
    write_model(R"("fixed": [{"box": [[0, 0, 0], [10, 10, 0]]}])");
  }
  void write_model(const std::string& fixed) const {
    write_text(folder() / "cube.json",
               R"({"mesh": "cube.msh", "length_unit": "mm", "materials": [{"region": "all",
      "young_modulus_pa": 5000, "poisson_ratio": 0.45}], "forces": [{"nodes": [4, 5, 6, 7], "force_n": [0, 0, 0.05]}], )" +
                   fixed + "}");
  }
};

TEST_F(Simulation, SolvesAndSaysWhatCameOut) {
  const ProcessResult result = kiroku({"sim", "solve", "cube.json", "-o", "cube.vtu"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("cube.vtu: 8 nodes, 6 tetrahedra; largest displacement"));
  EXPECT_THAT(result.out, HasSubstr("loads in total     (0, 0, 0.05) N"));
  EXPECT_EQ(result.err,
            "kiroku: warning: 1 triangles of the mesh file were left out: only 4-node tetrahedra are used\n");
  const std::string text = read_text(folder() / "cube.vtu");
  EXPECT_THAT(text, HasSubstr("Name=\"displacement\""));
  EXPECT_EQ(text.find("nan"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder() / "cube.vtu.part"));
}

TEST_F(Simulation, AnswersMachines) {
  const nlohmann::json answer = kiroku_json({"sim", "solve", "cube.json", "-o", "cube.vtu", "--json"});
  EXPECT_EQ(answer["nodes"], 8);
  EXPECT_EQ(answer["unknowns"], 12);
  EXPECT_EQ(answer["length_unit"], "mm");
  EXPECT_NEAR(answer["reaction_n"][2].get<double>(), -0.05, 1e-12);
  EXPECT_GT(answer["largest_displacement"].get<double>(), 0);
  EXPECT_EQ(answer["warnings"].size(), 1U);
}

TEST_F(Simulation, WritesTheSameBytesWhateverTheNumberOfThreads) {
  std::string first;
  for (const char* threads : {"1", "2", "4"}) {
    Process::Options run = options({"sim", "solve", "cube.json", "-o", "cube.vtu"});
    run.environment["OMP_NUM_THREADS"] = threads;
    run.environment["OPENBLAS_NUM_THREADS"] = threads;
    EXPECT_EQ(run_process(run).status, 0);
    if (first.empty()) first = read_text(folder() / "cube.vtu");
    EXPECT_EQ(read_text(folder() / "cube.vtu"), first);
  }
}

TEST_F(Simulation, RefusesInOneSentence) {
  EXPECT_REFUSED(kiroku({"sim"}), "solve");
  EXPECT_REFUSED(kiroku({"sim", "solve", "cube.json"}), "--output is required");
  EXPECT_REFUSED(kiroku({"sim", "solve", "cube.json", "-o", "cube.png"}), ".vtu");
  EXPECT_REFUSED(kiroku({"sim", "solve", "absent.json", "-o", "x.vtu"}), "absent.json");
  EXPECT_REFUSED(kiroku({"sim", "solve", "cube.msh", "-o", "x.vtu"}), "no JSON");
  std::filesystem::remove(folder() / "cube.msh");
  EXPECT_REFUSED(kiroku({"sim", "solve", "cube.json", "-o", "x.vtu"}), "cube.msh");
  EXPECT_FALSE(std::filesystem::exists(folder() / "x.vtu"));
}

TEST_F(Simulation, SaysWhatIsNotHeld) {
  write_model(R"("fixed": [])");
  EXPECT_THAT(kiroku({"sim", "solve", "cube.json", "-o", "x.vtu"}).err,
              HasSubstr("nothing is fixed: the body can move along x, y and z and turn about x, y and z"));
  EXPECT_FALSE(std::filesystem::exists(folder() / "x.vtu"));
}

}  // namespace
}  // namespace kiroku::test
