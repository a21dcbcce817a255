// 'kiroku sim fit-series' as a person calls it, and 'kiroku compare' of a lung that breathes.
#include <cmath>

#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

/// A chest with ribs, a spine and a right lung in the shape of an upright ellipsoid, cut off below, with
/// vessels and a tumour; voxels of 4 mm. Radiographs of one breath of it from the front.
class SimFitSeries : public ProgramTest {
 protected:
  static constexpr int kColumns = 66, kRows = 52, kSlices = 60, kPhases = 12;

  SimFitSeries() {
    std::string ct, labels;
    for (int k = 0; k < kSlices; ++k) {
      for (int j = 0; j < kRows; ++j) {
        for (int i = 0; i < kColumns; ++i) {
          const double x = 4 * i - 70, y = 4 * j - 104, z = 4 * k - 110;
          const bool lung = x * x / 1600 + y * y / 3600 + z * z / 6400 < 1 && z > -50;
          const bool tumour = lung && std::hypot(x, y + 15, z + 25) < 15;
          const double across = std::hypot((x - 60) / 125, y / 95);
          double hu = across < 1 ? 20 : -1000;
          if (across > 0.88 && across < 1 && std::sin(0.15 * (z + 0.3 * y)) > 0.4) hu = 600;
          if (std::hypot(x - 62, y - 60) < 18) hu = 300 + 300 * std::sin(0.19 * z);
          if (lung) {
            hu = -820 + 350 * std::max(std::sin(0.09 * x + 0.04 * z) * std::sin(0.07 * y + 0.03 * z) *
                                           std::sin(0.06 * z - 0.05 * x),
                                       0.0);
          }
          if (tumour) hu = 30;
          const auto value = static_cast<std::uint16_t>(static_cast<int>(hu));
          ct += static_cast<char>(value & 0xffU);
          ct += static_cast<char>(value >> 8U);
          labels += static_cast<char>(tumour ? 2 : lung ? 1 : 0);
          labels += '\0';
        }
      }
    }
    write_text(
        folder() / "ct.mha",
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = "
        "False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -140 -106 -110\nElementSpacing = 4 4 4\n"
        "DimSize = 66 52 60\nElementType = MET_SHORT\nElementDataFile = LOCAL\n" +
            ct);
    write_text(
        folder() / "labels.nrrd",
        "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 66 52 60\n"
        "space directions: (4,0,0) (0,4,0) (0,0,4)\nspace origin: (-140,-106,-110)\nencoding: raw\nendian: "
        "little\n\n" +
            labels);
    const ProcessResult mesh = kiroku(
        {"sim", "mesh", "labels.nrrd", "--labels", "labels.nrrd", "--vertices", "400", "-o", "lung.msh"});
    EXPECT_EQ(mesh.status, 0) << mesh.err;
    write_model("truth.json", 2.5, 9);
    write_model("guess.json", 1, 4);
    write_geometry("front.json", 0);
    // The patient lies 5 mm to the left and 6 mm higher than the geometry says.
    write_text(folder() / "lain.json",
               R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [-15, -2, -6], "detector_px": [128, 128],
                   "detector_mm": [420, 420]})");
  }
  void write_geometry(const std::string& name, int gantry_deg) const {
    write_text(folder() / name,
               R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [-10, -2, 0], "detector_px": [128, 128],
                   "detector_mm": [420, 420], "gantry_deg": )" +
                   std::to_string(gantry_deg) + "}");
  }
  void write_model(const std::string& name, double rib_cage, double diaphragm, int phases = kPhases) const {
    write_text(
        folder() / name,
        R"({"mesh": "lung.msh", "length_unit": "mm", "lung": "right", "tumour": {"region": 2}, "phases": )" +
            std::to_string(phases) + R"(, "breathing": {"rib_cage": {"amplitude": )" +
            std::to_string(rib_cage) + R"(}, "diaphragm": {"amplitude": )" + std::to_string(diaphragm) +
            R"(, "phase_s": 0.6}}})");
  }
  /// Of `truth.json`, three pictures and a third a second.
  void write_radiographs() const {
    ASSERT_EQ(kiroku({"sim", "respire", "truth.json", "-o", "breathing"}).status, 0);
    std::filesystem::create_directories(folder() / "xrays");
    for (int phase = 0; phase < kPhases; ++phase) {
      std::string number = std::to_string(phase);
      number.insert(0, 5 - number.size(), '0');
      ASSERT_EQ(kiroku({"sim", "drr", "ct.mha", "-g", "lain.json", "--mesh", "lung.msh", "--displacement",
                        "breathing/frames/" + number + ".vtu", "-o", "xrays/" + number + ".png"})
                    .status,
                0);
    }
  }
  [[nodiscard]] std::vector<std::string> fit(const std::vector<std::string>& more) const {
    std::vector<std::string> words{"sim",   "fit-series", "ct.mha",   "guess.json", "--radiographs",
                                   "xrays", "--rate",     "3.333333", "-o",         "found.json"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
};

TEST_F(SimFitSeries, FindsPoseBreathAndTumour) {
  write_radiographs();
  const nlohmann::json found = kiroku_json(
      fit({"-g", "front.json", "--track", "tumour.csv", "--aligned-geometry", "aligned.json", "--json"}));
  EXPECT_EQ(found["refusal"], nullptr);
  EXPECT_EQ(found["moments"], kPhases);
  // From one side, of a body that is nearly round, less is told than from two.
  EXPECT_NEAR(found["pose"]["translation_mm"][0].get<double>(), 5, 2);
  EXPECT_NEAR(found["pose"]["translation_mm"][2].get<double>(), 6, 1.5);
  EXPECT_NEAR(found["diaphragm"]["amplitude_mm"].get<double>(), 9, 3);
  EXPECT_NEAR(found["diaphragm"]["phase_s"].get<double>(), 0.6, 0.2);
  EXPECT_GE(found["tumour"]["seen"].get<int>(), kPhases / 2);
  EXPECT_EQ(found["tumour"]["places"].size(), std::size_t(kPhases));
  EXPECT_THAT(read_text(folder() / "tumour.csv"), HasSubstr("time_s,x_mm,y_mm,z_mm,error_x_mm"));
  EXPECT_THAT(read_text(folder() / "aligned.json"), HasSubstr("matrix"));
  // What was found breathes.
  EXPECT_EQ(kiroku({"sim", "respire", "found.json", "-o", "again"}).status, 0);
  EXPECT_REFUSED(kiroku(fit({"-g", "front.json"})), "give --force to replace");
}

TEST_F(SimFitSeries, RefusesWhatDoesNotFit) {
  write_radiographs();
  const ProcessResult dark = kiroku(fit({"-g", "front.json", "--polarity", "bone-black"}));
  EXPECT_EQ(dark.status, 1);
  EXPECT_THAT(dark.err, HasSubstr("with dark and light exchanged to"));
  EXPECT_THAT(dark.err, HasSubstr("tried: mirrored left to right"));
  EXPECT_FALSE(std::filesystem::exists(folder() / "found.json"));
  EXPECT_REFUSED(kiroku(fit({})), "there are 1 --radiographs and 0 --geometry");
  EXPECT_REFUSED(
      kiroku(fit({"-g", "front.json", "--aligned-geometry", "a.json", "--aligned-geometry", "b.json"})),
      "--aligned-geometry is given 2 times");
  write_text(folder() / "small.json",
             R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [-10, -2, 0], "detector_px": [64, 64],
                 "detector_mm": [420, 420]})");
  EXPECT_REFUSED(kiroku(fit({"-g", "small.json"})),
                 "00000.png has 128 x 128 pixels, small.json says 64 x 64");
}

/// A breath that was planned and sealed, and the fluoroscopy of a deeper one, recorded by that plan.
class CompareBreathing : public SimFitSeries {
 protected:
  void SetUp() override {
    make_demo_home();
    write_model("planned.json", 2.5, 5);
    sealed_ = kiroku_json({"plan", "seal", "planned.json", "--json"})["sha256"];
    // Of the film's ten pictures a second a breath has 36.
    write_model("deep.json", 2.5, 9, 36);
    ASSERT_EQ(kiroku({"sim", "respire", "deep.json", "-o", "breathing"}).status, 0);
    const ProcessResult film =
        kiroku({"sim", "drr-film", "ct.mha", "-g", "front.json", "--mesh", "lung.msh", "--frames",
                "breathing", "--repeat", "3", "--polarity", "bone-black", "-o", "fluoroscopy.mkv"});
    ASSERT_EQ(film.status, 0) << film.err;
    case_ = kiroku_json({"record", "--json", "--fluoroscopy", "fluoroscopy.mkv?speed=max", "--profile",
                         "lossless", "--duration", "00:00:09", "--plan", "planned.seal.json"})["case"]
                .get<std::string>();
  }
  [[nodiscard]] Arguments compare(const Arguments& more) const {
    Arguments words{"compare", case_.string(), "planned.seal.json", "-g", "front.json"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  std::filesystem::path case_;
  std::string sealed_;
};

TEST_F(CompareBreathing, TellsHowFarTheTumourWasFromItsPlanAndSealsThat) {
  const nlohmann::json told =
      kiroku_json(compare({"--volume", "ct.mha", "-o", "out.json", "--made-by", "Dr. Sato", "--json"}));
  EXPECT_EQ(told["case_names_plan"], true);
  EXPECT_THAT(told["cautions"].dump(), HasSubstr("The CT shown is not part of the plan: ct.mha"));
  const nlohmann::json document = nlohmann::json::parse(read_text(folder() / "out.json"));
  EXPECT_EQ(document["format"], "kiroku-comparison/1");
  EXPECT_EQ(document["plan"]["seal"], sealed_);
  EXPECT_EQ(document["plan"]["sealed"], true);
  EXPECT_EQ(document["case"]["stream"], "fluoroscopy");
  EXPECT_EQ(document["ct"]["files"][0]["name"], "ct.mha");
  const nlohmann::json& breathing = document["breathing"];
  EXPECT_EQ(breathing["geometry"]["name"], "front.json");
  EXPECT_EQ(breathing["planned"]["diaphragm"]["amplitude_mm"], 5);
  EXPECT_NEAR(breathing["found"]["diaphragm"]["amplitude_mm"].get<double>(), 9, 1.5);
  EXPECT_GT(breathing["errors"]["diaphragm"]["amplitude_mm"], 0);
  EXPECT_NEAR(breathing["found"]["cycle_s"].get<double>(), 3.6, 0.1);
  const std::size_t pictures = breathing["radiographs"].size();
  EXPECT_GE(pictures, 25U);
  EXPECT_GT(breathing["tumour"]["seen"], pictures / 2);
  // The tumour goes with the diaphragm: some four millimetres more at the end of a breath, none in its
  // middle.
  EXPECT_GT(breathing["tumour"]["largest_mm"], 1.5);
  EXPECT_LT(breathing["tumour"]["largest_mm"], 5);
  EXPECT_GT(breathing["similarity"]["found"], breathing["similarity"]["planned"]);
  EXPECT_THAT(kiroku_json({"log", "--json"}).dump(),
              HasSubstr("document sha256 " + told["sha256"].get<std::string>()));
  // It is checked as any comparison is.
  const nlohmann::json held =
      kiroku_json({"compare", case_.string(), "planned.seal.json", "--verify", "out.json", "--json"});
  for (const nlohmann::json& check : held["checks"]) EXPECT_EQ(check["answer"], "holds") << check.dump();
  EXPECT_EQ(kiroku_json({"verify", case_.string(), "--json"})["verdict"], "intact");
  EXPECT_REFUSED(kiroku(compare({"--volume", "ct.mha", "-o", "out.json"})), "is already there");
  // For people.
  const ProcessResult said = kiroku(compare({"--volume", "ct.mha", "-o", "again.json"}));
  EXPECT_EQ(said.status, 0) << said.err;
  EXPECT_THAT(said.out, HasSubstr("from where the plan has it on average, 95 % within"));
  EXPECT_THAT(said.out, HasSubstr("diaphragm, amplitude, mm"));
}

TEST_F(CompareBreathing, SaysWhatIsMissingAndWhatIsOfOperations) {
  EXPECT_REFUSED(kiroku(compare({"-o", "out.json"})), "name the CT that it lies in with --volume");
  EXPECT_REFUSED(kiroku(compare({"--volume", "ct.mha"})), "say where to with -o OUT.json");
  EXPECT_REFUSED(kiroku(compare({"--volume", "ct.mha", "-o", "out.mp4"})), "say where to with -o OUT.json");
  EXPECT_REFUSED(kiroku(compare({"--volume", "ct.mha", "-o", "out.json", "--align", "auto"})),
                 "leave --align out");
  EXPECT_REFUSED(kiroku({"compare", case_.string(), "planned.json", "--volume", "ct.mha", "-o", "out.json"}),
                 "nothing says how the fluoroscope of 'fluoroscopy' saw the patient");
  const ProcessResult few = kiroku(compare({"--volume", "ct.mha", "-o", "out.json", "--to", "00:00:01"}));
  EXPECT_NE(few.status, 0);
  EXPECT_THAT(few.err, HasSubstr("8 at least"));
  // What was sealed is another by now.
  write_model("planned.json", 2.5, 9);
  EXPECT_THAT(kiroku(compare({"--volume", "ct.mha", "-o", "out.json"})).err,
              HasSubstr("the plan is not the one that was sealed"));
  EXPECT_FALSE(std::filesystem::exists(folder() / "out.json"));
}

}  // namespace
}  // namespace kiroku::test
