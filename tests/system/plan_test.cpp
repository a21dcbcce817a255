// 'kiroku plan' as a person calls it.
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <tuple>

#include "tests/support/build_paths.h"
#include "tests/support/shared_data.h"
#include "tests/support/small_disk.h"
#include "tests/support/unpacked.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// A unit cube of six tetrahedra in mm, its lower face held, and a plan for it.
class PlanProgram : public ProgramTest {
 protected:
  PlanProgram() {
    write_text(folder() / "cube.msh",
               "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 0 0 0\n2 10 0 0\n3 0 10 0\n4 10 10 0\n5 0 "
               "0 10\n6 10 0 10\n7 0 10 10\n8 10 10 10\n$EndNodes\n$Elements\n6\n1 4 2 1 1 1 2 4 8\n2 4 2 1 "
               "1 1 3 7 8\n3 4 2 1 1 1 5 6 8\n4 4 2 1 1 1 2 8 6\n5 4 2 1 1 1 5 8 7\n6 4 2 1 1 1 3 8 4\n"
               "$EndElements\n");
    write_plan(R"([{"do": "grasp", "tool": "forceps", "at": {"position": [5, 5, 10]}},
                   {"do": "retract", "tool": "forceps", "path": [{"at_s": 1, "position": [6, 5, 11]}]},
                   {"do": "release", "tool": "forceps"}])");
  }
  void write_plan(const std::string& steps) const {
    write_text(folder() / "plan.json",
               R"({"name": "cube", "mesh": "cube.msh", "length_unit": "mm", "time_step_s": 0.25,
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.45}],
      "fixed": [{"box": [[0, 0, 0], [10, 10, 0]]}],
      "tools": {"forceps": {"kind": "forceps", "jaws": [12, 12, 2]}, "pad": {"kind": "retractor", "size": [20, 20, 2]}},
      "steps": )" + steps +
                   "}");
  }
  /// Every file below a folder, by its name from there.
  [[nodiscard]] std::map<std::string, std::string> files(const std::string& below) const {
    std::map<std::string, std::string> all;
    for (const auto& entry : fs::recursive_directory_iterator(folder() / below)) {
      if (entry.is_regular_file())
        all[fs::relative(entry.path(), folder() / below).string()] = read_text(entry.path());
    }
    return all;
  }
};

TEST_F(PlanProgram, ChecksAPlan) {
  const ProcessResult good = kiroku({"plan", "check", "plan.json"});
  EXPECT_EQ(good.status, 0) << good.err;
  EXPECT_THAT(good.out, HasSubstr("nothing is wrong with it. 8 nodes, 2 tools, 3 steps, 1 s"));
  write_plan(R"([{"do": "grasp", "tool": "pad", "at": {"position": [5, 5, 10]}}, {"do": "hold"}])");
  const ProcessResult bad = kiroku({"plan", "check", "plan.json"});
  EXPECT_EQ(bad.status, 1);
  EXPECT_EQ(bad.out, "");
  EXPECT_THAT(bad.err, HasSubstr("steps[0].tool is 'pad', a retractor"));
  EXPECT_THAT(bad.err, HasSubstr("steps[1] lacks 'duration_s'"));
  const ProcessResult machine = kiroku({"plan", "check", "plan.json", "--json"});
  EXPECT_EQ(machine.status, 1);
  EXPECT_EQ(nlohmann::json::parse(machine.out)["errors"].size(), 2U);
  const ProcessResult refused = kiroku({"plan", "run", "plan.json", "-o", "out"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_EQ(refused.err, bad.err);
  EXPECT_FALSE(fs::exists(folder() / "out"));
}

TEST_F(PlanProgram, RunsAPlanAndLeavesEverythingBehind) {
  const ProcessResult result = kiroku({"plan", "run", "plan.json", "-o", "out"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.err, "");
  EXPECT_THAT(result.out, HasSubstr("out: 7 frames of 1 s"));
  const auto left = files("out");
  EXPECT_EQ(left.size(), 7U + 5U);
  EXPECT_THAT(left.at("plan.pvd"), HasSubstr("timestep=\"0.75\" file=\"frames/00004.vtu\""));
  EXPECT_THAT(left.at("frames/00005.vtu"), HasSubstr("Name=\"von_mises_stress\""));
  EXPECT_THAT(left.at("tools.csv"), HasSubstr("\r\n1,steps[1],forceps,6,5,11,1,0,0,0\r\n"));
  for (const auto& [name, text] : left) EXPECT_EQ(text.find("nan"), std::string::npos) << name;
  const nlohmann::json steps = nlohmann::json::parse(left.at("steps.json"))["steps"];
  EXPECT_EQ(steps[1]["tools"]["forceps"]["most_nodes"], 4);
  EXPECT_NEAR(steps[1]["largest_displacement"].get<double>(), std::sqrt(2.0), 1e-9);
  EXPECT_REFUSED(kiroku({"plan", "run", "plan.json", "-o", "out"}), "not an empty folder");
  EXPECT_THAT(kiroku({"plan", "run", "plan.json", "-o", "few", "--frames-every", "1"}).out,
              HasSubstr("few: 4 frames"));
  EXPECT_REFUSED(kiroku({"plan", "run", "plan.json", "-o", "none", "--frames-every", "often"}),
                 "--frames-every");
}

TEST_F(PlanProgram, WritesTheSameBytesWhateverTheNumberOfThreads) {
  std::map<std::string, std::string> first;
  for (const char* threads : {"1", "2", "4"}) {
    Process::Options run = options({"plan", "run", "plan.json", "-o", std::string("out") + threads});
    run.environment["OMP_NUM_THREADS"] = threads;
    EXPECT_EQ(run_process(run).status, 0);
    const auto left = files(std::string("out") + threads);
    if (first.empty()) first = left;
    EXPECT_TRUE(left == first) << threads;
  }
}

TEST_F(PlanProgram, SaysWhereAPlanCouldNotGoOn) {
  write_plan(
      R"([{"do": "press", "tool": "pad", "path": [{"at_s": 0, "position": [5, 5, 30]}, {"at_s": 1, "position": [5, 5, 20]}]}])");
  EXPECT_REFUSED(kiroku({"plan", "run", "plan.json", "-o", "out"}),
                 "steps[0] (press): 'pad' never touches the tissue: the nearest it comes is 9 mm");
  // What came before it is there, and a mended plan may take its place.
  const auto left = files("out");
  EXPECT_EQ(left.size(), 4U + 5U);
  EXPECT_THAT(left.at("steps.json"), HasSubstr("\"stopped\": \"steps[0] (press): 'pad' never touches"));
  EXPECT_THAT(left.at("tools.csv"), HasSubstr("0.75,steps[0],pad,5,5,22.5,1,0,0,0"));
  write_plan(R"([{"do": "hold", "duration_s": 0.25}])");
  write_text(folder() / "out/frames/notes.txt", "mine");
  EXPECT_REFUSED(kiroku({"plan", "run", "plan.json", "-o", "out"}),
                 "or give --force to replace an earlier run");
  EXPECT_EQ(kiroku({"plan", "run", "plan.json", "-o", "out", "--force"}).status, 0);
  const auto mended = files("out");
  EXPECT_EQ(mended.size(), 2U + 5U + 1U);
  EXPECT_EQ(mended.at("frames/notes.txt"), "mine");
  EXPECT_EQ(mended.at("steps.json").find("stopped"), std::string::npos);
}

TEST_F(PlanProgram, MakesTheMeshThatThePlanHasARecipeFor) {
  // A block of 24 x 20 x 16 mm of tissue in air, as MetaImage.
  std::string voxels;
  for (int k = 0; k < 14; ++k) {
    for (int j = 0; j < 16; ++j) {
      for (int i = 0; i < 18; ++i) {
        const bool inside = i >= 3 && i < 15 && j >= 3 && j < 13 && k >= 3 && k < 11;
        voxels += inside ? std::string("\x28\x00", 2) : std::string("\x18\xfc", 2);  // 40 and -1000
      }
    }
  }
  write_text(
      folder() / "block.mha",
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nTransformMatrix "
      "= 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nElementSpacing = 2 2 2\nDimSize = 18 16 14\nElementType = "
      "MET_SHORT\nElementDataFile = LOCAL\n" +
          voxels);
  const auto plan = [&](const std::string& recipe) {
    write_text(folder() / "plan.json",
               R"({"volume": "block.mha", "mesh": )" + recipe + R"(, "length_unit": "mm",
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.45}],
      "fixed": [{"box": [[0, 0, 0], [40, 40, 9]]}],
      "tools": {"forceps": {"kind": "forceps", "jaws": [12, 12, 6]}},
      "steps": [{"do": "grasp", "tool": "forceps", "at": {"position": [17, 15, 21]}},
                {"do": "retract", "tool": "forceps", "path": [{"at_s": 0.5, "position": [17, 15, 24]}]}]})");
  };
  plan(R"({"threshold": [-200, 200], "vertices": 200})");
  const ProcessResult run = kiroku({"plan", "run", "plan.json", "-o", "out"});
  ASSERT_EQ(run.status, 0) << run.err;
  const auto steps = nlohmann::json::parse(files("out").at("steps.json"));
  EXPECT_NEAR(steps["nodes"].get<double>(), 200, 30);
  // The mesh is that of the command.
  ASSERT_EQ(
      kiroku({"sim", "mesh", "block.mha", "--threshold", "-200:200", "--vertices", "200", "-o", "block.msh"})
          .status,
      0);
  plan(R"("block.msh")");
  EXPECT_EQ(kiroku({"plan", "run", "plan.json", "-o", "again"}).status, 0);
  // But for what its file rounds.
  const auto again = nlohmann::json::parse(files("again").at("steps.json"));
  EXPECT_EQ(again["nodes"], steps["nodes"]);
  const auto force_n = [](const nlohmann::json& of) {
    return of["steps"][1]["tools"]["forceps"]["largest_force_n"].get<double>();
  };
  EXPECT_GT(force_n(steps), 0.1);
  EXPECT_NEAR(force_n(again), force_n(steps), 1e-9 * force_n(steps));
  plan(R"({"threshold": [-200, 200], "vertexes": 200})");
  EXPECT_THAT(kiroku({"plan", "check", "plan.json"}).err, HasSubstr("mesh has the unknown key 'vertexes'"));
  plan(R"({"organ": "liver"})");
  EXPECT_THAT(kiroku({"plan", "check", "plan.json"}).err,
              HasSubstr("mesh is no recipe: it is not said what of the volume to mesh"));
  plan(R"({"threshold": [-200, 200], "labels": "none.nii"})");
  EXPECT_THAT(kiroku({"plan", "check", "plan.json"}).err,
              HasSubstr("mesh.labels is 'none.nii': there is no such file"));
}

// Whoever sets a recorder up chooses what its own authority is called.
TEST_F(PlanProgram, SaysOfASealWhoseClockTellsItsTime) {
  make_demo_home();
  std::string settings = read_text(home() / "kiroku.toml");
  const std::string name = "name = \"embedded\"";
  ASSERT_NE(settings.find(name), std::string::npos) << settings;
  settings.replace(settings.find(name), name.size(), "name = \"national-metrology-institute\"");
  write_text(home() / "kiroku.toml", settings);
  const std::string by_own =
      " by national-metrology-institute (self-issued: by the recorder's own authority, "
      "no outside clock stands behind it)\n";
  const ProcessResult told = kiroku({"plan", "seal", "plan.json"});
  EXPECT_EQ(told.status, 0) << told.err;
  EXPECT_THAT(told.out, HasSubstr(by_own));
  EXPECT_THAT(told.err, HasSubstr("warning: no outside authority time-stamped it: the recorder's own proves "
                                  "to nobody else when this was there"));
  write_text(folder() / "again.json", read_text(folder() / "plan.json") + "\n");
  const nlohmann::json sealed = kiroku_json({"plan", "seal", "again.json", "--json"});
  EXPECT_EQ(sealed["time_stamps"][0]["authority"], "national-metrology-institute");
  EXPECT_EQ(sealed["time_stamps"][0]["kind"], "self-issued");
  EXPECT_EQ(sealed["time"], "self-issued");
}

TEST_F(PlanProgram, SealsAPlanBeforeTheCaseIsRecorded) {
  make_demo_home();
  const std::filesystem::path other = record();
  EXPECT_REFUSED(kiroku({"record", "--vitals", "synthetic:patient", "--plan", "plan.json"}),
                 "plan.json is no sealed plan");
  const nlohmann::json sealed = kiroku_json({"plan", "seal", "plan.json", "--json"});
  EXPECT_EQ(sealed["files"], 2);
  ASSERT_TRUE(sealed["time_stamps"][0].contains("gen_time")) << sealed.dump();
  EXPECT_EQ(nlohmann::json::parse(read_text(folder() / "plan.seal.json"))["files"][1]["name"], "cube.msh");
  EXPECT_REFUSED(kiroku({"plan", "seal", "plan.json"}), "is there already");

  write_text(folder() / "unused.json", read_text(folder() / "plan.json") + "\n");
  const nlohmann::json unused = kiroku_json({"plan", "seal", "unused.json", "--json"});
  const std::filesystem::path folder_of_case = record({"--plan", "plan.seal.json"});
  const std::string first_line = read_text(folder_of_case / "ledger.jsonl");
  EXPECT_THAT(first_line.substr(0, first_line.find('\n')),
              HasSubstr("\"plan\":\"" + sealed["sha256"].get<std::string>() + "\""));
  EXPECT_EQ(kiroku_json({"verify", folder_of_case.string(), "--json"})["verdict"], "intact");
  const auto verify = [&](const std::filesystem::path& of) {
    return kiroku({"plan", "verify", "plan.seal.json", "--case", of.string()});
  };
  const ProcessResult whole = verify(folder_of_case);
  EXPECT_EQ(whole.status, 0) << whole.out << whole.err;
  EXPECT_THAT(whole.out, HasSubstr("plan.seal.json: HOLDS (cube)"));
  EXPECT_THAT(whole.out, HasSubstr("sealed before the first picture"));
  const ProcessResult unplanned = verify(other);
  EXPECT_EQ(unplanned.status, 1);
  EXPECT_THAT(unplanned.out, HasSubstr("names no plan"));

  // Another appliance's home can tell neither when it was sealed nor what came first: it does not guess.
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("other")}).status, 0);
  const ProcessResult elsewhere = kiroku(
      {"plan", "verify", "plan.seal.json", "--case", folder_of_case.string(), "--home", path("other")});
  EXPECT_EQ(elsewhere.status, 3) << elsewhere.out;
  EXPECT_THAT(elsewhere.out, HasSubstr("not known: the appliance log of"));
  EXPECT_THAT(elsewhere.out, HasSubstr("not known: which came first"));

  // A plan sealed after the case does not become the case's.
  write_text(folder() / "later.json", read_text(folder() / "plan.json") + "\n");
  EXPECT_EQ(kiroku({"plan", "seal", "later.json"}).status, 0);
  const ProcessResult later =
      kiroku({"plan", "verify", "later.seal.json", "--case", folder_of_case.string()});
  EXPECT_EQ(later.status, 1);
  EXPECT_THAT(later.out, HasSubstr("was recorded by another plan"));

  // Whoever has the disk writes into the case that it was recorded by another plan, which was sealed in time.
  const std::string ledger = read_text(folder_of_case / "ledger.jsonl");
  std::string rewritten = ledger;
  const std::string seal = sealed["sha256"];
  rewritten.replace(rewritten.find(seal), seal.size(), unused["sha256"].get<std::string>());
  write_text(folder_of_case / "ledger.jsonl", rewritten);
  const ProcessResult claimed =
      kiroku({"plan", "verify", "unused.seal.json", "--case", folder_of_case.string()});
  EXPECT_EQ(claimed.status, 1) << claimed.out;
  EXPECT_THAT(claimed.out, HasSubstr("is not the one that the appliance log states"));
  EXPECT_EQ(kiroku({"verify", folder_of_case.string()}).status, 1);
  write_text(folder_of_case / "ledger.jsonl", ledger);
  EXPECT_EQ(verify(folder_of_case).status, 0);

  // What is changed afterwards, what is gone, and what nobody can tell.
  const std::string mesh = read_text(folder() / "cube.msh");
  write_text(folder() / "cube.msh", mesh + "\n");
  EXPECT_THAT(verify(folder_of_case).out, HasSubstr("NO: cube.msh is not what was sealed"));
  EXPECT_EQ(verify(folder_of_case).status, 1);
  fs::remove(folder() / "cube.msh");
  EXPECT_THAT(verify(folder_of_case).out, HasSubstr("not known: "));
  EXPECT_EQ(verify(folder_of_case).status, 3);
  write_text(folder() / "cube.msh", mesh);
  fs::remove(folder() / "plan.seal.embedded.tsr");
  EXPECT_THAT(verify(folder_of_case).out, HasSubstr("not known: there is no time-stamp"));
  EXPECT_EQ(verify(folder_of_case).status, 3);
  // The seal itself: its hash is no longer the log's, nor the case's.
  std::string text = read_text(folder() / "plan.seal.json");
  text.replace(text.find("cube"), 4, "cuba");
  write_text(folder() / "plan.seal.json", text);
  const ProcessResult forged = verify(folder_of_case);
  EXPECT_EQ(forged.status, 1);
  EXPECT_THAT(forged.out, HasSubstr("does not know this seal"));
  EXPECT_THAT(forged.out, HasSubstr("was recorded by another plan"));
  EXPECT_REFUSED(kiroku({"record", "--vitals", "synthetic:patient", "--plan", "plan.seal.json"}),
                 "is not in the appliance log");

  // Somebody adds a line to the log, which says that it is entry 1: nobody signed it.
  write_text(folder() / "added.json", read_text(folder() / "plan.json") + "\n\n");
  ASSERT_EQ(kiroku({"plan", "seal", "added.json", "--home", path("other")}).status, 0);
  const std::string others = read_text(path("other/archive/log/ledger.jsonl"));
  std::string line = others.substr(others.rfind('\n', others.size() - 2) + 1);
  const std::size_t seq = line.find("\"seq\":") + 6;
  line.replace(seq, line.find(',', seq) - seq, "1");
  std::ofstream(home() / "archive/log/ledger.jsonl", std::ios::app) << line;
  const ProcessResult added = kiroku({"plan", "verify", "added.seal.json"});
  EXPECT_EQ(added.status, 3) << added.out;
  EXPECT_THAT(added.out, HasSubstr("this device did not sign it when it was written"));
  EXPECT_REFUSED(kiroku({"record", "--vitals", "synthetic:patient", "--plan", "added.seal.json"}),
                 "nobody signed its entry");
}

TEST_F(PlanProgram, SealsEveryFileThatAPlanIsMadeOf) {
  make_demo_home();
  fs::create_directories(folder() / "ct/series");
  for (const char* name : {"ct/b.dcm", "ct/series/a.dcm", "organs.nii.gz"}) write_text(folder() / name, name);
  std::string plan = read_text(folder() / "plan.json");
  plan.insert(1, "\"volume\": \"ct\", ");
  write_text(folder() / "plan.json", plan);
  EXPECT_EQ(kiroku({"plan", "seal", "plan.json"}).status, 0);
  const auto files = nlohmann::json::parse(read_text(folder() / "plan.seal.json"))["files"];
  ASSERT_EQ(files.size(), 4U);
  EXPECT_EQ(files[2]["name"], "ct/b.dcm");
  EXPECT_EQ(files[3]["name"], "ct/series/a.dcm");
  EXPECT_EQ(kiroku({"plan", "verify", "plan.seal.json"}).status, 0);
  write_text(folder() / "ct/c.dcm", "more");
  const ProcessResult more = kiroku({"plan", "verify", "plan.seal.json"});
  EXPECT_EQ(more.status, 1);
  EXPECT_THAT(more.out, HasSubstr("ct/c.dcm was not there when the plan was sealed"));
  write_plan("[]");
  EXPECT_EQ(kiroku({"plan", "seal", "plan.json"}).status, 2);
}

// A header that names another file is as it was, whatever that file holds.
TEST_F(PlanProgram, SealsTheVoxelsThatAVolumesHeaderNames) {
  make_demo_home();
  const std::string sound = read_text(folder() / "plan.json");
  const std::string voxels(54, '\x05');
  const std::string meta =
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nTransformMatrix "
      "= 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nElementSpacing = 2 2 2\nDimSize = 3 3 3\nElementType = "
      "MET_SHORT\nElementDataFile = ";
  const std::string nrrd =
      "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nspace directions: (2,0,0) "
      "(0,2,0) (0,0,2)\nspace origin: (0,0,0)\nsizes: 3 3 3\nendian: little\nencoding: raw\ndata file: ";
  const auto plan = [&](const std::string& name, const std::string& volume) {
    std::string text = sound;
    write_text(folder() / name, text.insert(1, "\"volume\": \"" + volume + "\", "));
  };
  fs::create_directory(folder() / "ct");
  for (const auto& [name, header] : {std::pair<std::string, std::string>{"mhd", meta}, {"nhdr", nrrd}}) {
    write_text(folder() / ("ct/" + name + ".raw"), voxels);
    write_text(folder() / ("ct/block." + name), header + name + ".raw\n");
    plan(name + ".json", "ct/block." + name);
    ASSERT_EQ(kiroku({"plan", "seal", name + ".json"}).status, 0);
    auto seal = nlohmann::json::parse(read_text(folder() / (name + ".seal.json")));
    ASSERT_EQ(seal["files"].size(), 4U);
    EXPECT_EQ(seal["files"][2]["name"], "ct/block." + name);
    EXPECT_EQ(seal["files"][3]["name"], "ct/" + name + ".raw");
    EXPECT_EQ(kiroku({"plan", "verify", name + ".seal.json"}).status, 0);
    std::string other = voxels;
    other[7] = 6;
    write_text(folder() / ("ct/" + name + ".raw"), other);
    const ProcessResult changed = kiroku({"plan", "verify", name + ".seal.json"});
    EXPECT_EQ(changed.status, 1);
    EXPECT_THAT(changed.out, HasSubstr("ct/" + name + ".raw is not what was sealed"));
    // A seal of an earlier version says nothing of the voxels.
    seal["files"].erase(3);
    write_text(folder() / (name + "-earlier.seal.json"), seal.dump());
    const ProcessResult earlier = kiroku({"plan", "verify", name + "-earlier.seal.json"});
    EXPECT_NE(earlier.status, 0);
    EXPECT_THAT(earlier.out, HasSubstr("which holds the voxels of ct/block." + name + ", is not listed"));
  }
  for (const std::string& volume : {meta + "LIST\nmhd.raw\n", meta + "s%d.raw 1 3 1\n"}) {
    write_text(folder() / "ct/several.mhd", volume);
    plan("several.json", "ct/several.mhd");
    const ProcessResult several = kiroku({"plan", "seal", "several.json"});
    EXPECT_NE(several.status, 0);
    EXPECT_THAT(several.err, HasSubstr("save the volume as one .mha or .nrrd file"));
    EXPECT_FALSE(fs::exists(folder() / "several.seal.json"));
  }
}

// Whoever wrote a seal chose its names and sizes.
TEST_F(PlanProgram, ReadsOfASealedPlanNoMoreThanTheSealLists) {
  make_demo_home();
  ASSERT_EQ(kiroku({"plan", "seal", "plan.json"}).status, 0);
  auto seal = nlohmann::json::parse(read_text(folder() / "plan.seal.json"));
  constexpr std::uint64_t kTooLong = std::uint64_t{1} << 42U;  // hours of hashing
  write_text(folder() / "hole.raw", "");
  std::error_code unable;
  fs::resize_file(folder() / "hole.raw", kTooLong, unable);
  if (unable) GTEST_SKIP() << "no file of 4 TiB can be made here";
  const auto verify = [&](std::uint64_t bytes) {
    nlohmann::json file = seal["files"][1];
    file["name"] = "hole.raw";
    file["bytes"] = bytes;
    nlohmann::json named = seal;
    named["files"].push_back(file);
    write_text(folder() / "long.seal.json", named.dump());
    return kiroku({"plan", "verify", "long.seal.json"});
  };
  const ProcessResult longer = verify(12);
  EXPECT_EQ(longer.status, 1);
  EXPECT_THAT(longer.out, HasSubstr("hole.raw is not what was sealed"));
  EXPECT_THAT(verify(kTooLong).out, HasSubstr("more than 1 GiB of it is a hole"));
}

// Jaws close along x on the upper half of the cube, hold it while it is lifted a little, and lose it.
TEST_F(PlanProgram, CarriesOutAPlanWithAGrasper) {
  write_plan(R"([
    {"do": "close", "tool": "grasper", "at": {"position": [5, 5, 9], "rotation": {"axis": [0, 1, 0], "degrees": 90}},
     "opening": 9, "duration_s": 0.75},
    {"do": "retract", "tool": "grasper", "path": [{"at_s": 0.5, "position": [5, 5, 9.1]}]},
    {"do": "retract", "tool": "grasper", "path": [{"at_s": 5, "position": [5, 5, 15]}]},
    {"do": "release", "tool": "grasper"}])");
  nlohmann::json plan = nlohmann::json::parse(read_text(folder() / "plan.json"));
  plan["tools"]["grasper"] = {{"kind", "grasper"}, {"jaw", {6, 20, 3}}, {"opening", 11}, {"friction", 0.4}};
  write_text(folder() / "plan.json", plan.dump());
  const ProcessResult result = kiroku({"plan", "run", "plan.json", "-o", "out"});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("warning: at "));
  EXPECT_THAT(result.err, HasSubstr("the tissue slips in 'grasper', by "));
  const auto left = files("out");
  const nlohmann::json steps = nlohmann::json::parse(left.at("steps.json"))["steps"];
  EXPECT_EQ(steps[0]["tools"]["grasper"]["most_nodes"], 4);
  EXPECT_GT(steps[0]["tools"]["grasper"]["largest_squeeze_n"].get<double>(), 0.001);
  EXPECT_EQ(steps[1]["remarks"].size(), 0U) << steps[1].dump();
  EXPECT_LT(steps[1]["tools"]["grasper"]["slipped"].get<double>(), 0.01);
  ASSERT_EQ(steps[2]["remarks"].size(), 2U) << steps[2].dump();
  EXPECT_THAT(steps[2]["remarks"][1].get<std::string>(), HasSubstr("has slipped out of 'grasper'"));
  for (const char* const who : {",grasper,", ",grasper jaw 1,", ",grasper jaw 2,"})
    EXPECT_THAT(left.at("forces.csv"), HasSubstr(who));
}

// The cube's plan becomes a template, and that a plan for a larger cube elsewhere.
TEST_F(PlanProgram, MakesAPlanForAnotherOrganFromATemplate) {
  const auto landmarks = [&](const char* file, double size, double from) {
    nlohmann::json places = {{"length_unit", "mm"}};
    for (const auto& [name, x, y, z] : std::vector<std::tuple<const char*, int, int, int>>{
             {"a", 0, 0, 0}, {"b", 1, 0, 0}, {"c", 0, 1, 0}, {"d", 0, 0, 1}, {"e", 1, 1, 1}})
      places["landmarks"][name] = {from + size * x, from + size * y, from + size * z};
    write_text(folder() / file, places.dump());
  };
  landmarks("own.places.json", 10, 0);
  landmarks("patient.places.json", 14, 100);
  std::string mesh = read_text(folder() / "cube.msh");
  const std::size_t nodes = mesh.find("$Nodes\n8\n") + 9, end = mesh.find("$EndNodes");
  std::istringstream before(mesh.substr(nodes, end - nodes));
  std::string after;
  for (double number = 0, x = 0, y = 0, z = 0; before >> number >> x >> y >> z;) {
    after += std::to_string(static_cast<int>(number));
    for (const double one : {x, y, z}) after += " " + std::to_string(static_cast<int>(100 + 1.4 * one));
    after += "\n";
  }
  write_text(folder() / "patient.msh", mesh.replace(nodes, end - nodes, after));
  // Tools keep their size: these jaws reach the corners of the larger cube, too.
  nlohmann::json patient = nlohmann::json::parse(read_text(folder() / "plan.json"));
  patient["tools"]["forceps"]["jaws"] = {18, 18, 2};
  write_text(folder() / "plan.json", patient.dump());
  patient["mesh"] = "patient.msh";
  patient["fixed"] = nlohmann::json::parse("[{\"box\": [[100, 100, 100], [114, 114, 100]]}]");
  patient.erase("tools");
  patient.erase("steps");
  write_text(folder() / "patient.json", patient.dump());

  const ProcessResult saved =
      kiroku({"plan", "template", "plan.json", "--landmarks", "own.places.json", "-o", "cube.template.json"});
  ASSERT_EQ(saved.status, 0) << saved.err;
  EXPECT_THAT(saved.out, HasSubstr("a template of 3 steps with 5 landmarks"));
  const std::vector<std::string> adapting{"plan",         "adapt",       "cube.template.json",
                                          "patient.json", "--landmarks", "patient.places.json",
                                          "-o",           "adapted.json"};
  const ProcessResult adapted = kiroku(adapting);
  ASSERT_EQ(adapted.status, 0) << adapted.err;
  EXPECT_THAT(adapted.out, HasSubstr("missed by the others"));
  EXPECT_THAT(adapted.out,
              HasSubstr("adapted.json: 3 steps; to suit the surface, tools were moved by up to "));
  const nlohmann::json plan = nlohmann::json::parse(read_text(folder() / "adapted.json"));
  EXPECT_NEAR(plan["steps"][0]["at"]["position"][2].get<double>(), 114, 1e-6);
  EXPECT_NEAR(plan["steps"][1]["path"][0]["position"][0].get<double>(), 108.4, 1e-6);
  EXPECT_EQ(kiroku({"plan", "run", "adapted.json", "-o", "out"}).status, 0);
  EXPECT_REFUSED(kiroku(adapting), "is there already");
  EXPECT_REFUSED(kiroku({"plan", "adapt", "cube.template.json", "patient.json", "--landmarks",
                         "patient.places.json", "-o", "/tmp/elsewhere/adapted.json"}),
                 "it must be beside patient.json");
  EXPECT_REFUSED(kiroku({"plan", "adapt", "plan.json", "patient.json", "--landmarks", "patient.places.json",
                         "-o", "other.json"}),
                 "it is no template of a plan");
}

/// The plans of docs/plans on organs of a real CT.
TEST_F(PlanProgram, CarriesOutTheWorkedPlans) {
  KIROKU_NEEDS_SHARED_DATA("sim/lung-ct");
  const Unpacked ct("sim/lung-ct/lidc-idri-0001-dicom.tar.xz");
  const auto mesh = [&](const std::string& organ, const std::string& vertices) {
    const ProcessResult made = kiroku({"sim", "mesh", ct.path().string(), "--labels",
                                       shared_data("sim/lung-ct/mask_totalsegmentator.nii.gz").string(),
                                       "--organ", organ, "--vertices", vertices, "-o", organ + ".msh"});
    ASSERT_EQ(made.status, 0) << made.err;
  };
  mesh("liver", "3000");
  fs::create_directory_symlink(ct.path(), folder() / "LIDC-IDRI-0001");
  fs::create_symlink(shared_data("sim/lung-ct/mask_totalsegmentator.nii.gz"),
                     folder() / "totalsegmentator.nii.gz");
  for (const char* name : {"liver-retraction", "kidney-opening", "kidney-drawn-cut", "two-finger-exclusion",
                           "lung-bulla", "kidney-turning", "liver-held-cut"}) {
    const std::string plan = std::string(name) + ".json";
    fs::copy_file(source_folder() / "docs/plans" / plan, folder() / plan);
    EXPECT_EQ(kiroku({"plan", "check", plan}).status, 0) << name;
    const ProcessResult ran = kiroku({"plan", "run", plan, "-o", name, "--frames-every", "1", "--json"});
    ASSERT_EQ(ran.status, 0) << ran.err;
    const nlohmann::json answer = nlohmann::json::parse(ran.out);
    for (const nlohmann::json& step : answer.at("steps"))
      EXPECT_EQ(step["remarks"].size(), 0U) << name << " " << step.dump();
  }
}

// Whoever writes a seal chooses the names in it.
TEST_F(PlanProgram, ASealOfWhatIsNoPlanDoesNotHold) {
  make_demo_home();
  const auto seal_of = [&](const std::string& name, const std::string& sha256) {
    write_text(
        folder() / "made.seal.json",
        nlohmann::json{{"format", "kiroku-plan-seal/1"},
                       {"plan", "liver"},
                       {"files", {{{"role", "plan"}, {"name", name}, {"bytes", 1}, {"sha256", sha256}}}}}
            .dump());
    return kiroku({"plan", "verify", "made.seal.json"});
  };
  ASSERT_EQ(tool({"mkfifo", path("pipe")}).status, 0);
  const ProcessResult pipe = seal_of("pipe", std::string(64, '0'));
  EXPECT_EQ(pipe.status, 3) << pipe.out;
  EXPECT_THAT(pipe.out, HasSubstr("it is a pipe, a socket or a device and no file"));
  write_text(folder() / "notes.txt", "x");
  const ProcessResult notes =
      seal_of("notes.txt", "2d711642b726b04401627ca9fbac32f5c8530fb1903cc4db02258717921a4881");
  EXPECT_EQ(notes.status, 3);
  EXPECT_THAT(notes.out,
              HasSubstr("not known: whether they are all that the plan is made of cannot be told"));
}

// The entry of a sealed plan lies on the recorder's disk.
TEST_F(PlanProgram, ASealedPlanLeavesARecorderItsRoom) {
  const SmallDisk disk(24U << 20U);
  if (!disk.mounted()) GTEST_SKIP() << "no file system can be mounted here";
  make_demo_home();
  const fs::path on_disk = disk.path() / "home";
  fs::copy(home(), on_disk, fs::copy_options::recursive);
  const std::string log = read_text(on_disk / "archive/log/ledger.jsonl");
  EXPECT_REFUSED(kiroku({"plan", "seal", "plan.json", "--home", on_disk.string()}), "the disk has no room");
  EXPECT_FALSE(fs::exists(folder() / "plan.seal.json"));
  EXPECT_EQ(read_text(on_disk / "archive/log/ledger.jsonl"), log);
}

}  // namespace
}  // namespace kiroku::test
