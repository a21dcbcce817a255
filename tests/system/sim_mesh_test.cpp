// 'kiroku sim volume' and 'kiroku sim mesh' as a person calls them.
#include <cmath>

#include "tests/support/shared_data.h"
#include "tests/support/unpacked.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

/// A NRRD file of 24 x 24 x 24 voxels of 2 mm: a ball of 40 HU in air, a denser one in its middle.
class SimMesh : public ProgramTest {
 protected:
  SimMesh() {
    write_volume("ct.nrrd", [](double radius_mm) {
      return radius_mm < 7 ? 300 : radius_mm < 20 ? 40 : -1000;
    });
    write_volume("labels.nrrd", [](double radius_mm) { return radius_mm < 7 ? 64 : radius_mm < 20 ? 5 : 0; });
  }

  void write_volume(const std::string& name, const std::function<int(double)>& value_at) const {
    std::string text =
        "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 24 24 24\n"
        "space directions: (2,0,0) (0,2,0) (0,0,2)\nspace origin: (-23,-23,-23)\nencoding: raw\nendian: "
        "little\n\n";
    for (int k = 0; k < 24; ++k) {
      for (int j = 0; j < 24; ++j) {
        for (int i = 0; i < 24; ++i) {
          const auto value =
              static_cast<std::uint16_t>(value_at(2 * std::hypot(i - 11.5, j - 11.5, k - 11.5)));
          text += static_cast<char>(value & 0xffU);
          text += static_cast<char>(value >> 8U);
        }
      }
    }
    write_text(folder() / name, text);
  }
};

TEST_F(SimMesh, SaysWhatAVolumeIs) {
  const ProcessResult result = kiroku({"sim", "volume", "ct.nrrd"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("ct.nrrd: NRRD, 24 x 24 x 24 voxels of 2 x 2 x 2 mm"));
  EXPECT_THAT(result.out, HasSubstr("orientation  LPS"));
  EXPECT_THAT(result.out, HasSubstr("values       -1000 to 300 HU"));
  const nlohmann::json answer = kiroku_json({"sim", "volume", "ct.nrrd", "--json"});
  EXPECT_EQ(answer["size"], nlohmann::json({24, 24, 24}));
  EXPECT_EQ(answer["orientation"], "LPS");
  EXPECT_EQ(answer["findings"].size(), 0U);
}

TEST_F(SimMesh, MakesAMeshThatCanBeSolved) {
  const nlohmann::json answer =
      kiroku_json({"sim", "mesh", "ct.nrrd", "--labels", "labels.nrrd", "--organ", "liver", "--region",
                   "vessels=64", "--vertices", "400", "-o", "liver.msh", "--json"});
  EXPECT_NEAR(answer["nodes"].get<double>(), 400, 60);
  EXPECT_GE(answer["quality"]["least_dihedral_deg"].get<double>(), 8);
  EXPECT_NEAR(answer["volume_ml"].get<double>(), 33.5, 2);
  ASSERT_EQ(answer["regions"].size(), 2U);
  EXPECT_EQ(answer["regions"][1]["name"], "vessels");
  EXPECT_THAT(read_text(folder() / "liver.msh"),
              HasSubstr("$PhysicalNames\n2\n3 1 \"liver\"\n3 2 \"vessels\"\n"));
  write_text(folder() / "liver.json",
             R"({"mesh": "liver.msh", "length_unit": "mm", "gravity_m_s2": [0, 0, -9.81],
      "materials": [{"region": 1, "young_modulus_pa": 5000, "poisson_ratio": 0.45, "density_kg_m3": 1060},
                    {"region": 2, "young_modulus_pa": 40000, "poisson_ratio": 0.45, "density_kg_m3": 1060}],
      "fixed": [{"box": [[-25, -25, 10], [25, 25, 25]]}]})");
  const nlohmann::json solved = kiroku_json({"sim", "solve", "liver.json", "-o", "liver.vtu", "--json"});
  EXPECT_NEAR(solved["reaction_n"][2].get<double>(), 9.81 * 1060 * answer["volume_ml"].get<double>() * 1e-6,
              1e-6);
  EXPECT_EQ(solved["warnings"].size(), 0U);
}

TEST_F(SimMesh, MeshesWhatIsBetweenTwoThresholds) {
  const ProcessResult result = kiroku({"sim", "mesh", "ct.nrrd", "--threshold", "-200:1000", "--vertices",
                                       "200", "--length-unit", "m", "-o", "ball.vtu"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, testing::MatchesRegex(
                              "ball.vtu: [0-9]+ vertices, [0-9]+ tetrahedra, 3[0-9.]+ ml, in m\n(.|\n)*"));
  EXPECT_THAT(result.out, HasSubstr("region 1  body"));
  EXPECT_EQ(result.err, "");
  EXPECT_THAT(read_text(folder() / "ball.vtu"), HasSubstr("UnstructuredGrid"));
}

TEST_F(SimMesh, WritesTheSameBytesWhateverTheNumberOfThreads) {
  std::string first;
  for (const char* threads : {"1", "4"}) {
    Process::Options run =
        options({"sim", "mesh", "ct.nrrd", "--threshold", "0:1000", "--vertices", "600", "-o", "ball.msh"});
    run.environment["OMP_NUM_THREADS"] = threads;
    EXPECT_EQ(run_process(run).status, 0);
    if (first.empty()) first = read_text(folder() / "ball.msh");
    EXPECT_EQ(read_text(folder() / "ball.msh"), first);
  }
}

TEST_F(SimMesh, RefusesInOneSentence) {
  const auto mesh = [&](Arguments more) {
    Arguments all{"sim", "mesh", "ct.nrrd", "-o", "x.msh"};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  };
  EXPECT_REFUSED(mesh({}), "by a threshold or by labels");
  EXPECT_REFUSED(mesh({"--threshold", "0:1", "--labels", "labels.nrrd"}), "one of them");
  EXPECT_REFUSED(mesh({"--threshold", "0"}), "-200:100");
  EXPECT_REFUSED(mesh({"--threshold", "2000:3000"}), "no voxel belongs to the body");
  EXPECT_REFUSED(mesh({"--threshold", "0:1", "--organ", "liver"}), "give the labels too");
  EXPECT_REFUSED(mesh({"--organ", "liver"}), "only the organ 'lung' is found without");
  EXPECT_REFUSED(mesh({"--organ", "lung"}), "no air within the body");
  EXPECT_REFUSED(mesh({"--labels", "labels.nrrd", "--organ", "hand"}), "there are spleen");
  EXPECT_REFUSED(mesh({"--labels", "labels.nrrd", "--organ", "heart"}), "the labels there are 5, 64");
  EXPECT_REFUSED(mesh({"--labels", "ct.nrrd"}), "labels are whole numbers");
  EXPECT_REFUSED(mesh({"--threshold", "0:100", "--vertices", "many"}), "--vertices is 'many'");
  EXPECT_REFUSED(mesh({"--threshold", "0:100", "--contours", "none.xml"}), "none.xml");
  EXPECT_REFUSED(kiroku({"sim", "mesh", "ct.nrrd", "--threshold", "0:100", "-o", "x.png"}), ".msh");
  EXPECT_REFUSED(kiroku({"sim", "mesh", "absent", "--threshold", "0:100", "-o", "x.msh"}),
                 "there is no absent");
  EXPECT_REFUSED(kiroku({"sim", "volume", "."}), "no DICOM picture");
  write_text(folder() / "cut.mha",
             "ObjectType = Image\nNDims = 3\nBinaryData = True\nDimSize = 4 3 2\n"
             "ElementSpacing = 1 1 1\nElementType = MET_SHORT\nElementDataFile = LOCAL\n123");
  EXPECT_REFUSED(kiroku({"sim", "volume", "cut.mha"}), "it holds 3 of 48 bytes");
  EXPECT_FALSE(std::filesystem::exists(folder() / "x.msh"));
}

TEST_F(SimMesh, NamesEveryOddSeries) {
  KIROKU_NEEDS_SHARED_DATA("sim/dicom-odd");
  const Unpacked tilted("sim/dicom-odd/gantry-tilt.tar.xz");
  EXPECT_REFUSED(kiroku({"sim", "volume", tilted.path().string()}), "tilted by 18.5 degrees");
  EXPECT_EQ(kiroku_json({"sim", "volume", tilted.path().string(), "--resample", "--json"})["size"][2], 134);
  EXPECT_EQ(
      kiroku_json({"sim", "volume", shared_data("sim/dicom-odd/jpeg2000").string(), "--json"})["greatest_hu"],
      1839);
}

TEST_F(SimMesh, MeshesARealLungWithItsTumour) {
  KIROKU_NEEDS_SHARED_DATA("sim/lung-ct");
  const Unpacked ct("sim/lung-ct/lidc-idri-0001-dicom.tar.xz");
  const nlohmann::json answer = kiroku_json(
      {"sim", "mesh", ct.path().string(), "--labels",
       shared_data("sim/lung-ct/mask_totalsegmentator.nii.gz").string(), "--organ", "left-lung", "--contours",
       shared_data("sim/lung-ct/069.xml").string(), "--vertices", "600", "-o", "lung.msh", "--json"});
  EXPECT_NEAR(answer["nodes"].get<double>(), 600, 90);
  EXPECT_EQ(answer["regions"][1]["name"], "tumour");
  EXPECT_EQ(answer["volume"]["patient_position"], "FFS");
}

}  // namespace
}  // namespace kiroku::test
