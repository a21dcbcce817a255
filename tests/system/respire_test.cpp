// 'kiroku sim respire' and 'kiroku sim fit' as a person calls them.
#include <sstream>

#include "tests/support/shared_data.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

/// A right lung in the shape of an upright ellipsoid, cut off below, with a tumour; in mm, labels 1 and 2.
class Respire : public ProgramTest {
 protected:
  Respire() {
    std::string labels =
        "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 26 36 44\n"
        "space directions: (4,0,0) (0,4,0) (0,0,4)\nspace origin: (-120,-72,-80)\nencoding: raw\nendian: "
        "little\n\n";
    for (int k = 0; k < 44; ++k) {
      for (int j = 0; j < 36; ++j) {
        for (int i = 0; i < 26; ++i) {
          const double x = 4 * i - 50, y = 4 * j - 70, z = 4 * k - 80;
          const bool lung = x * x / 1600 + y * y / 3600 + z * z / 6400 < 1 && z > -50;
          const bool tumour = lung && std::hypot(x, y + 15, z + 25) < 15;
          labels += static_cast<char>(tumour ? 2 : lung ? 1 : 0);
          labels += '\0';
        }
      }
    }
    write_text(folder() / "labels.nrrd", labels);
    const ProcessResult mesh = kiroku(
        {"sim", "mesh", "labels.nrrd", "--labels", "labels.nrrd", "--vertices", "500", "-o", "lung.msh"});
    EXPECT_EQ(mesh.status, 0) << mesh.err;
    write_model("lung.json", R"("tumour": {"region": 2}, )", 4, 12);
  }
  void write_model(const std::string& name, const std::string& tumour, double rib_cage,
                   double diaphragm) const {
    write_text(folder() / name, R"({"mesh": "lung.msh", "length_unit": "mm", "lung": "right", )" + tumour +
                                    R"("breathing": {"rib_cage": {"amplitude": )" + std::to_string(rib_cage) +
                                    R"(}, "diaphragm": {"amplitude": )" + std::to_string(diaphragm) +
                                    R"(, "phase_s": 0.6}}})");
  }
  /// Seen along y from 1 m in front, a pixel a millimetre at the isocentre.
  void write_radiographs() const {
    write_text(folder() / "front.json",
               R"({"matrix": [[1000, 512, 0, 512000], [0, 384, -1000, 384000], [0, 1, 0, 1000]],
                   "detector_px": [1024, 768]})");
    std::istringstream path(read_text(folder() / "out/tumour.csv"));
    std::string line, seen = "time_s,column,row\n";
    std::getline(path, line);
    char comma = 0;
    for (double t = 0, x = 0, y = 0, z = 0; std::getline(path, line);) {
      std::istringstream(line) >> t >> comma >> x >> comma >> y >> comma >> z;
      std::ostringstream row;
      row.precision(12);
      row << t << ',' << 1000 * x / (y + 1000) + 512 << ',' << 384 - 1000 * z / (y + 1000) << '\n';
      seen += row.str();
    }
    write_text(folder() / "seen.csv", seen);
  }
};

TEST_F(Respire, BreathesAndSaysWhatCameOut) {
  const ProcessResult result = kiroku({"sim", "respire", "lung.json", "-o", "out", "--margin", "5"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("out: 36 phases of 3.6 s"));
  EXPECT_THAT(result.out, HasSubstr("diaphragm"));
  EXPECT_THAT(result.out, HasSubstr("irradiation field with a margin of 5 mm"));
  EXPECT_EQ(files_below(folder() / "out").size(), 36U + 4);  // with the folder of frames
  EXPECT_THAT(read_text(folder() / "out/respire.pvd"), HasSubstr("frames/00035.vtu"));
  EXPECT_THAT(read_text(folder() / "out/tumour.svg"), HasSubstr("to the head (z)"));
  EXPECT_EQ(read_text(folder() / "out/frames/00007.vtu").find("nan"), std::string::npos);
  EXPECT_REFUSED(kiroku({"sim", "respire", "lung.json", "-o", "out"}), "give --force to replace");
  EXPECT_EQ(kiroku({"sim", "respire", "lung.json", "-o", "out", "--force"}).status, 0);
}

TEST_F(Respire, WritesTheSameBytesWhateverTheNumberOfThreads) {
  std::string first;
  for (const char* threads : {"1", "4"}) {
    Process::Options run = options({"sim", "respire", "lung.json", "-o", std::string("out") + threads});
    run.environment["OMP_NUM_THREADS"] = threads;
    EXPECT_EQ(run_process(run).status, 0);
    const std::string frame = read_text(folder() / (std::string("out") + threads) / "frames/00011.vtu");
    if (first.empty()) first = frame;
    EXPECT_EQ(frame, first);
  }
}

TEST_F(Respire, TheMotionIsFoundFromRadiographsOfIt) {
  EXPECT_EQ(kiroku({"sim", "respire", "lung.json", "-o", "out"}).status, 0);
  write_radiographs();
  write_model("guess.json", R"("tumour": {"region": 2}, )", 1, 1);
  const nlohmann::json found = kiroku_json({"sim", "fit", "guess.json", "--positions", "seen.csv",
                                            "--geometry", "front.json", "-o", "found.json", "--json"});
  EXPECT_NEAR(found["rib_cage"]["amplitude_mm"].get<double>(), 4, 0.04);
  EXPECT_NEAR(found["diaphragm"]["amplitude_mm"].get<double>(), 12, 0.12);
  EXPECT_NEAR(found["diaphragm"]["phase_s"].get<double>(), 0.6, 0.036);
  EXPECT_EQ(found["observer_mm"], nlohmann::json({0.9, 0.8}));
  EXPECT_EQ(kiroku({"sim", "respire", "found.json", "-o", "again"}).status, 0);
}

TEST_F(Respire, FitsToASecondShapeAndSaysTheErrorAtLandmarks) {
  write_text(folder() / "fixed.txt", "-70 0 0\n-60 10 20\n-65 5 10\n-75 -5 5\n");
  write_text(folder() / "moving.txt", "-70 0 0\n-60 10 20\n-65 5 10\n-75 -5 5\n");
  const ProcessResult result =
      kiroku({"sim", "fit", "lung.json", "--shape", "labels.nrrd", "--landmarks", "fixed.txt", "moving.txt",
              "--errors", "errors.csv", "--cross-validate", "-o", "found.json"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("sliding boundary"));
  EXPECT_THAT(result.out,
              HasSubstr("4 landmarks, on which nothing was fitted; people find the same point twice to "
                        "0.9 +/- 0.8 mm"));
  EXPECT_THAT(result.out, HasSubstr("where it was left out of the fit, a quarter at a time"));
  EXPECT_THAT(result.out, HasSubstr("along the nearest surface's normal"));
  EXPECT_THAT(result.out, HasSubstr("fitted on the landmarks themselves"));
  EXPECT_THAT(read_text(folder() / "errors.csv"), testing::StartsWith("x_mm,y_mm,z_mm,depth_mm,rigid_x_mm,"));
  EXPECT_THAT(read_text(folder() / "errors.svg"), HasSubstr("</svg>"));
}

TEST_F(Respire, ARealLungComesToItsSecondMask) {
  KIROKU_NEEDS_SHARED_DATA("sim/lung-pair/3DCT_lung_followup_mask.mha");
  const std::string first = shared_data("sim/lung-pair/3DCT_lung_baseline_mask.mha").string(),
                    second = shared_data("sim/lung-pair/3DCT_lung_followup_mask.mha").string();
  const ProcessResult mesh =
      kiroku({"sim", "mesh", first, "--labels", first, "--vertices", "5000", "-o", "right.msh"});
  ASSERT_EQ(mesh.status, 0) << mesh.err;
  write_text(folder() / "right.json", R"({"mesh": "right.msh", "length_unit": "mm"})");
  const nlohmann::json found =
      kiroku_json({"sim", "fit", "right.json", "--shape", second, "-o", "found.json", "--json"});
  const nlohmann::json& steps = found["steps"];
  ASSERT_EQ(steps.size(), 4U);
  const double bound_mm[] = {5, 3.5, 3.5, 0.5};
  const std::string names[] = {"rigid", "model", "even_stretch", "sliding_boundary"};
  for (std::size_t i = 0; i < 4; ++i) {
    const double mean_mm = steps[i]["surface"]["mean_mm"];
    RecordProperty(names[i] + "_mm", std::to_string(mean_mm));
    EXPECT_LT(mean_mm, bound_mm[i]) << steps[i]["step"];
  }
  const double second_ml = found["second_volume_ml"];
  EXPECT_NEAR(steps[3]["volume_ml"].get<double>() / second_ml, 1, 0.01);
  EXPECT_LT(steps[0]["volume_ml"].get<double>() / second_ml, 0.9);  // it was smaller before
}

TEST_F(Respire, WhatIsMissingIsSaidInASentence) {
  write_model("bare.json", "", 3, 10);
  EXPECT_REFUSED(kiroku({"sim", "respire", "bare.json", "-o", "out", "--margin", "5"}),
                 "the model has no tumour");
  EXPECT_REFUSED(kiroku({"sim", "respire", "lung.json", "-o", "out", "--margin", "thick"}),
                 "--margin is 'thick'");
  EXPECT_REFUSED(kiroku({"sim", "fit", "lung.json", "-o", "found.json"}), "say what to fit to");
  EXPECT_REFUSED(
      kiroku({"sim", "fit", "lung.json", "--shape", "labels.nrrd", "--errors", "e.csv", "-o", "found.json"}),
      "--errors needs --landmarks");
  EXPECT_REFUSED(kiroku({"sim", "fit", "lung.json", "--shape", "labels.nrrd", "--poisson-ratio", "0.5", "-o",
                         "found.json"}),
                 "Poisson's ratio of the sliding boundary is 0.5");
  write_text(folder() / "seen.csv", "time_s,column,row\n0,1,1\n");
  EXPECT_REFUSED(kiroku({"sim", "fit", "lung.json", "--positions", "seen.csv", "-o", "found.json"}),
                 "--positions needs --geometry");
  write_text(folder() / "fixed.txt", "1 2 3\n4 5 6\n");
  write_text(folder() / "moving.txt", "1 2 3\n");
  EXPECT_REFUSED(kiroku({"sim", "fit", "lung.json", "--shape", "labels.nrrd", "--landmarks", "fixed.txt",
                         "moving.txt", "-o", "found.json"}),
                 "fixed.txt has 2 landmarks and moving.txt has 1");
  EXPECT_FALSE(std::filesystem::exists(folder() / "found.json"));
  EXPECT_FALSE(std::filesystem::exists(folder() / "out"));
}

TEST_F(Respire, TellsWhatABeamThatFollowsNeeds) {
  ASSERT_EQ(kiroku({"sim", "respire", "lung.json", "-o", "out"}).status, 0);
  const nlohmann::json answer =
      kiroku_json({"sim", "beam", "out/tumour.csv", "--repeat-for", "60s", "--excursion", "5,20", "--margin",
                   "2,8", "--volume", "1,30", "-o", "beam", "--json"});
  EXPECT_EQ(answer["places"], 3001);
  ASSERT_EQ(answer["latencies"].size(), 5U);
  for (const nlohmann::json& latency : answer["latencies"])
    EXPECT_LT(latency["predicted_mm"]["mean"].get<double>(), latency["delayed_mm"]["mean"].get<double>());
  ASSERT_EQ(answer["fields"].size(), 8U);
  // What a beam that follows spares grows with the motion, and shrinks with margin and tumour.
  const auto part = [&](std::size_t at) {
    return answer["fields"][at]["following_of_covering"].get<double>();
  };
  EXPECT_LT(part(4), part(0));
  EXPECT_LT(part(4), part(5));
  EXPECT_LT(part(4), part(6));
  EXPECT_THAT(read_text(folder() / "beam/angles.csv"),
              testing::StartsWith("time_s,x_mm,y_mm,z_mm,pan_deg,tilt_deg\n0,"));
  EXPECT_THAT(read_text(folder() / "beam/latency.svg"), HasSubstr("<svg"));
  EXPECT_THAT(answer["findings"].dump(), testing::Not(HasSubstr("gimbals")));

  const ProcessResult told = kiroku({"sim", "beam", "out/tumour.csv", "--repeat-for", "60s", "-o", "beam",
                                     "--force", "--isocenter", "0,0,500"});
  EXPECT_EQ(told.status, 0);
  EXPECT_THAT(told.err, HasSubstr("the gimbals would have to turn by"));
  EXPECT_THAT(told.out, HasSubstr("  300 ms"));
  EXPECT_REFUSED(kiroku({"sim", "beam", "out/tumour.csv", "-o", "beam"}), "is there already");
  EXPECT_REFUSED(kiroku({"sim", "beam", "out/tumour.csv", "-o", "new"}), "too short to learn from");
  EXPECT_REFUSED(kiroku({"sim", "beam", "out/tumour.csv", "-o", "new", "--margin", "2,x"}),
                 "--margin is '2,x'");
  EXPECT_REFUSED(kiroku({"sim", "beam", "out/tumour.csv", "-o", "new", "--latency", "0"}),
                 "--latency holds 0");
}

}  // namespace
}  // namespace kiroku::test
