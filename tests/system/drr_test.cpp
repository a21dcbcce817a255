// 'kiroku sim drr' as a person calls it, and beside plastimatch.
#include <cmath>
#include <cstring>
#include <numbers>

#include "tests/support/shared_data.h"
#include "tests/support/unpacked.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;
using testing::Not;

struct Image {
  std::size_t columns = 0, rows = 0;
  std::vector<float> values;
};

std::vector<float> floats(const std::string& bytes, std::size_t from) {
  std::vector<float> values((bytes.size() - from) / sizeof(float));
  std::memcpy(values.data(), bytes.data() + from, values.size() * sizeof(float));
  return values;
}

/// Behind "ElementDataFile = LOCAL".
std::size_t data_of_mha(const std::string& bytes) { return bytes.find("LOCAL\n") + 6; }

double zncc(const std::vector<float>& a, const std::vector<float>& b) {
  const auto n = double(a.size());
  double mean_a = 0, mean_b = 0, ab = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    mean_a += double(a[i]) / n;
    mean_b += double(b[i]) / n;
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double x = double(a[i]) - mean_a, y = double(b[i]) - mean_b;
    ab += x * y;
    aa += x * x;
    bb += y * y;
  }
  return ab / std::sqrt(aa * bb);
}

class SimDrr : public ProgramTest {
 protected:
  SimDrr() {
    write_text(folder() / "front.json",
               R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [0, 0, 0], "gantry_deg": 0,
                   "detector_px": [128, 96], "detector_mm": [150, 112.5]})");
  }

  /// 128 mm along each axis: a body with an air-filled hole and a bone.
  void write_ct() const { write_ct("ct.mha", 0, 64); }
  void write_ct(const std::string& name, int added, int voxels) const {
    const double spacing = 128.0 / voxels;
    std::string text = header(voxels);
    for (int k = 0; k < voxels; ++k) {
      for (int j = 0; j < voxels; ++j) {
        for (int i = 0; i < voxels; ++i) {
          const double x = spacing * (i + 0.5) - 64, y = spacing * (j + 0.5) - 64,
                       z = spacing * (k + 0.5) - 64;
          double hu = std::hypot(x / 50, y / 35) < 1 && std::abs(z) < 52 ? 30 + 20 * std::sin(x / 5) : -1000;
          if (std::hypot((x - 18) / 14, y / 20, (z - 5) / 30) < 1) hu = -700;
          if (std::hypot(x, y - 24) < 7 && hu > -500) hu = 700;
          const auto value = static_cast<std::uint16_t>(static_cast<int>(hu) + added);
          text += static_cast<char>(value & 0xffU);
          text += static_cast<char>(value >> 8U);
        }
      }
    }
    write_text(folder() / name, text);
  }
  static std::string header(int voxels) {
    const auto thrice = [](double number) {
      const std::string text = std::to_string(number);
      return text + " " + text + " " + text + "\n";
    };
    const double spacing = 128.0 / voxels;
    return "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
           "CompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = " +
           thrice(spacing / 2 - 64) + "ElementSpacing = " + thrice(spacing) +
           "DimSize = " + std::to_string(voxels) + " " + std::to_string(voxels) + " " +
           std::to_string(voxels) + "\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";
  }
  void write_mesh() const {
    ASSERT_EQ(
        kiroku({"sim", "mesh", "ct.mha", "--threshold", "-750:-600", "--vertices", "150", "-o", "hole.msh"})
            .status,
        0);
  }

  /// Of hole.msh: at rest, and drawn towards the head.
  void write_frames() const {
    for (const int frame : {0, 1}) {
      write_text(
          folder() / "model.json",
          R"({"mesh": "hole.msh", "length_unit": "mm", "materials": [{"region": "all", "young_modulus_pa": 1000, "poisson_ratio": 0.3}],
                   "fixed": [{"box": [[0, -30, -40], [40, 30, -10]]}],
                   "forces": [{"box": [[0, -30, 20], [40, 30, 50]], "force_n": [0, 0, )" +
              std::to_string(frame * 0.2) + "]}]}");
      std::filesystem::create_directories(folder() / "moves/frames");
      ASSERT_EQ(
          kiroku({"sim", "solve", "model.json", "-o", "moves/frames/0000" + std::to_string(frame) + ".vtu"})
              .status,
          0);
    }
  }

  [[nodiscard]] std::vector<float> integrals(const std::string& file) const {
    const std::string bytes = read_text(folder() / file);
    return floats(bytes, data_of_mha(bytes));
  }
  /// plastimatch integrates the values as they are (-P none): above zero where there is tissue. Its own
  /// conversion from HU leaves out all below -800, most of a lung.
  [[nodiscard]] std::vector<float> by_plastimatch(const std::string& ct, double gantry_deg,
                                                  const std::string& isocenter, const std::string& pixels,
                                                  const std::string& size_mm) const {
    const double angle = gantry_deg * std::numbers::pi / 180;
    const std::string normal =
        std::to_string(std::sin(angle)) + " " + std::to_string(-std::cos(angle)) + " 0";
    const std::string name = "plastimatch_" + std::to_string(int(gantry_deg)) + "_";
    const ProcessResult result = tool(
        {"plastimatch", "drr",         "-A",      "cpu",   "-i",   "exact", "--nrm", normal,     "--vup",
         "0 0 1",       "--isocenter", isocenter, "--sad", "1000", "--sid", "1500",  "-r",       pixels,
         "-z",          size_mm,       "-P",      "none",  "-t",   "pfm",   "-O",    path(name), path(ct)});
    EXPECT_EQ(result.status, 0) << result.out << result.err;
    for (const std::string& file : files_below(folder())) {
      if (!file.starts_with(name)) continue;
      const std::string bytes = read_text(folder() / file);
      std::size_t at = 0;
      for (int line = 0; line < 3; ++line) at = bytes.find('\n', at) + 1;
      return floats(bytes, at);
    }
    ADD_FAILURE() << "plastimatch wrote nothing";
    return {};
  }
};

TEST_F(SimDrr, MakesLineIntegralsAndPictures) {
  write_ct();
  const nlohmann::json answer = kiroku_json({"sim", "drr", "ct.mha", "-g", "front.json", "-o", "front.mha",
                                             "--point", "0,0,0", "--point", "0,-2000,0", "--json"});
  EXPECT_EQ(answer["columns"], 128);
  EXPECT_EQ(answer["rows"], 96);
  EXPECT_EQ(answer["energy_kev"], 70);
  EXPECT_EQ(answer["points"][0]["pixel"], nlohmann::json({63.5, 47.5}));
  EXPECT_EQ(answer["points"][1]["pixel"], nullptr);
  // 70 mm of water with a bone behind: 14 mm of 700 HU.
  const double middle = double(integrals("front.mha")[47 * 128 + 63]);
  EXPECT_NEAR(middle, 0.001 * answer["water_per_m"].get<double>() * (72 + 14 * 0.7), 0.1);
  for (const Arguments& more :
       std::vector<Arguments>{{}, {"--response", "transmission", "--polarity", "bone-black"}}) {
    Arguments arguments{"sim", "drr", "ct.mha", "-g", "front.json", "-o", "front.png", "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProcessResult result = kiroku(arguments);
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_THAT(result.out, HasSubstr("front.png: 128 x 96 pixels, line integrals 0.1653 to "));
    EXPECT_THAT(read_text(folder() / "front.png"), testing::StartsWith("\x89PNG"));
  }
}

TEST_F(SimDrr, AMeshAtRestChangesNothingAndItsPartsAddUp) {
  write_ct();
  write_mesh();
  const auto make = [&](const std::string& name, const Arguments& more) {
    Arguments arguments{"sim", "drr", "ct.mha", "-g", "front.json", "--gantry", "30", "-o", name};
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(kiroku(arguments).status, 0);
    return integrals(name);
  };
  const std::vector<float> plain = make("plain.mha", {}), all = make("all.mha", {"--mesh", "hole.msh"}),
                           inside = make("inside.mha", {"--mesh", "hole.msh", "--part", "inside"}),
                           outside = make("outside.mha", {"--mesh", "hole.msh", "--part", "outside"});
  double most = 0;
  for (std::size_t i = 0; i < plain.size(); ++i) {
    EXPECT_NEAR(double(all[i]), double(plain[i]), 1e-5);
    EXPECT_NEAR(double(inside[i] + outside[i]), double(plain[i]), 1e-5);
    most = std::max(most, double(inside[i]));
  }
  EXPECT_GT(most, 0.05);
}

TEST_F(SimDrr, RefusesInASentence) {
  write_ct();
  write_mesh();
  const auto drr = [&](const Arguments& more) {
    Arguments arguments{"sim", "drr", "ct.mha", "-g", "front.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return kiroku(arguments);
  };
  EXPECT_REFUSED(drr({"-o", "x.jpg"}), "its ending must be .mha (line integrals) or .png (a picture)");
  EXPECT_REFUSED(drr({"-o", "front.json"}), "its ending must be");
  EXPECT_REFUSED(drr({"-o", "ct.mha"}), "is there already");
  EXPECT_REFUSED(drr({"-o", "x.mha", "--window", "0:1"}), "are of pictures");
  EXPECT_REFUSED(drr({"-o", "x.png", "--window", "1"}), "it must be 2 numbers with ':' between them");
  EXPECT_REFUSED(drr({"-o", "x.png", "--window", "2:1"}), "is empty");
  EXPECT_REFUSED(drr({"-o", "x.png", "--energy", "5"}), "the energy is 5 keV; it must be from 20");
  EXPECT_REFUSED(drr({"-o", "x.png", "--point", "1,2"}), "--point is '1,2'");
  EXPECT_REFUSED(drr({"-o", "x.png", "--keep-mass"}), "give --mesh too");
  EXPECT_REFUSED(drr({"-o", "x.png", "--mesh", "hole.msh", "--length-unit", "m"}),
                 "the mesh lies outside the volume");
  EXPECT_REFUSED(drr({"-o", "x.png", "--mesh", "hole.msh", "--displacement", "front.json"}),
                 "is no VTK file");
  write_text(folder() / "near.json", R"({"sad_mm": 40, "sid_mm": 1500, "isocenter_mm": [0, 0, 0],
                                         "detector_px": [128, 96], "detector_mm": [150, 112.5]})");
  EXPECT_REFUSED(kiroku({"sim", "drr", "ct.mha", "-g", "near.json", "-o", "x.png"}),
                 "the source is inside the volume");
  write_text(folder() / "none.json", R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [0, 0, 0],
                                         "detector_px": [0, 96], "detector_mm": [150, 112.5]})");
  EXPECT_REFUSED(kiroku({"sim", "drr", "ct.mha", "-g", "none.json", "-o", "x.png"}), "detector_px[0] is 0");
  EXPECT_FALSE(std::filesystem::exists(folder() / "x.png"));
}

TEST_F(SimDrr, OverlaysAndAlignsARadiograph) {
  write_ct();
  write_mesh();
  // The radiograph of a patient who lies 6 mm to the left and 4 mm lower than the geometry has them.
  write_text(folder() / "moved.json",
             R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [-6, 0, 4], "gantry_deg": 0,
                 "detector_px": [128, 96], "detector_mm": [150, 112.5]})");
  ASSERT_EQ(kiroku({"sim", "drr", "ct.mha", "-g", "moved.json", "-o", "xray.png"}).status, 0);
  write_text(folder() / "path.csv",
             "time_s,x_mm,y_mm,z_mm,moved_mm\r\n0,0,0,0,0\r\n1,10,0,0,10\r\n2,0,0,0,0\r\n");
  write_text(folder() / "seen.csv", "time_s,x_mm,y_mm,z_mm\n0.5,5,3,4\n1.5,5,0,1\n9,0,0,0\n");
  const Arguments scene{"ct.mha", "-g", "front.json", "-r", "xray.png"};
  const auto overlay = [&](const Arguments& more) {
    Arguments arguments{"sim", "overlay"};
    arguments.insert(arguments.end(), scene.begin(), scene.end());
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  };
  const nlohmann::json answer =
      kiroku_json(overlay({"-o", "both.png", "--mode", "beside", "--mesh", "hole.msh", "--outline", "1",
                           "--path", "path.csv", "--measured", "seen.csv", "--error-plot", "error.svg",
                           "--align", "--aligned-geometry", "found.json", "--json"}));
  EXPECT_EQ(answer["columns"], 256);
  EXPECT_NEAR(answer["alignment"]["translation_mm"][0].get<double>(), 6, 1);
  EXPECT_NEAR(answer["alignment"]["translation_mm"][2].get<double>(), -4, 1);
  EXPECT_LT(answer["alignment"]["gradient_correlation_before"].get<double>(), 0.5);
  EXPECT_GT(answer["alignment"]["gradient_correlation_after"].get<double>(), 0.95);
  // (0, 3, 4) and (0, 0, 1) mm; the third moment is after the path.
  EXPECT_EQ(answer["position_error_mm"]["moments"], 2);
  EXPECT_NEAR(answer["position_error_mm"]["mean"].get<double>(), 3, 1e-9);
  EXPECT_NEAR(answer["position_error_mm"]["greatest"].get<double>(), 5, 1e-9);
  EXPECT_THAT(read_text(folder() / "error.svg"), HasSubstr("<svg"));
  // What was found is a geometry that needs no more aligning.
  const nlohmann::json again = kiroku_json({"sim", "overlay", "ct.mha", "-g", "found.json", "-r", "xray.png",
                                            "-o", "contour.png", "--mode", "contour", "--json"});
  EXPECT_NEAR(again["gradient_correlation"].get<double>(),
              answer["alignment"]["gradient_correlation_after"].get<double>(), 1e-6);
  EXPECT_REFUSED(kiroku(overlay({"-o", "both.png"})), "is there already");
  EXPECT_REFUSED(kiroku(overlay({"-o", "x.png", "--outline", "1"})), "give --mesh too");
  EXPECT_REFUSED(kiroku(overlay({"-o", "x.png", "--mesh", "hole.msh", "--outline", "5"})), "it has 1");
  EXPECT_REFUSED(kiroku(overlay({"-o", "x.png", "--error-plot", "e.svg"})), "give both");
  EXPECT_REFUSED(kiroku(overlay({"-o", "x.png", "--opacity", "2"})), "it must be from 0 to 1");
  ASSERT_EQ(kiroku({"sim", "drr", "ct.mha", "-g", "front.json", "-o", "ours.png"}).status, 0);
  write_text(folder() / "small.json", R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [0, 0, 0],
                                          "detector_px": [64, 48], "detector_mm": [150, 112.5]})");
  EXPECT_REFUSED(kiroku({"sim", "overlay", "ct.mha", "-g", "small.json", "-r", "ours.png", "-o", "x.png"}),
                 "128 x 96 pixels");
}

TEST_F(SimDrr, AnRtImageIsRadiographAndGeometry) {
  if (!std::filesystem::exists("/usr/bin/dump2dcm"))
    GTEST_SKIP() << "dump2dcm is not installed (Debian package dcmtk)";
  write_ct();
  // A portal image of the phantom, 6 mm aside: what a DRR by the same machine says arrives at the detector.
  write_text(folder() / "aside.json",
             R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [6, 0, 0], "gantry_deg": 0,
                 "detector_px": [128, 96], "detector_mm": [150, 112.5]})");
  ASSERT_EQ(kiroku({"sim", "drr", "ct.mha", "-g", "aside.json", "-o", "aside.mha"}).status, 0);
  std::string pixels;
  for (const float integral : integrals("aside.mha")) {
    const auto arrived = static_cast<std::uint16_t>(std::lround(60000 * std::exp(-double(integral))));
    pixels += static_cast<char>(arrived & 0xffU);
    pixels += static_cast<char>(arrived >> 8U);
  }
  write_text(folder() / "pixels.raw", pixels);
  write_text(
      folder() / "portal.dump",
      "(0008,0016) UI [1.2.840.10008.5.1.4.1.1.481.1]\n(0008,0018) UI [1.2.3]\n(0008,0060) CS [RTIMAGE]\n"
      "(0018,5100) CS [HFS]\n(0028,0002) US 1\n(0028,0004) CS [MONOCHROME2]\n(0028,0010) US 96\n"
      "(0028,0011) US 128\n(0028,0100) US 16\n(0028,0101) US 16\n(0028,0102) US 15\n(0028,0103) US 0\n"
      "(0028,1040) CS [LIN]\n(0028,1041) SS 1\n(3002,0011) DS [1.171875\\1.171875]\n"
      "(3002,0012) DS [-74.4140625\\55.6640625]\n(3002,0022) DS [1000]\n(3002,0026) DS [1500]\n"
      "(300a,011e) DS [0]\n(300a,012c) DS [0\\0\\0]\n(7fe0,0010) OW =pixels.raw\n");
  ASSERT_EQ(tool({"dump2dcm", "--quiet", "portal.dump", "portal.dcm"}).status, 0);
  const nlohmann::json answer = kiroku_json({"sim", "overlay", "ct.mha", "-g", "portal.dcm", "-r",
                                             "portal.dcm", "--align", "-o", "moved.png", "--json"});
  EXPECT_GT(answer["alignment"]["gradient_correlation_after"].get<double>(), 0.99);
  EXPECT_NEAR(answer["alignment"]["translation_mm"][0].get<double>(), -6, 0.3);
  EXPECT_NEAR(answer["alignment"]["translation_mm"][2].get<double>(), 0, 0.3);
  EXPECT_EQ(answer["findings"].size(), 0U);
}

// Nothing in two pictures shows that they are of two patients.
TEST_F(SimDrr, ARadiographOfAnotherPatientThanTheCtsIsTold) {
  if (!std::filesystem::exists("/usr/bin/dump2dcm"))
    GTEST_SKIP() << "dump2dcm is not installed (Debian package dcmtk)";
  const auto write = [&](const std::string& file, const std::string& elements) {
    write_text(folder() / "a.dump", elements);
    ASSERT_EQ(tool({"dump2dcm", "--quiet", "a.dump", file}).status, 0);
  };
  const std::string grey =
      "(0028,0002) US 1\n(0028,0004) CS [MONOCHROME2]\n(0028,0010) US 16\n(0028,0011) US 16\n"
      "(0028,0100) US 16\n(0028,0101) US 16\n(0028,0102) US 15\n(0028,0103) US 0\n"
      "(7fe0,0010) OW =pixels.raw\n";
  write_text(folder() / "pixels.raw", std::string(std::size_t{16} * 16 * 2, '\1'));
  std::filesystem::create_directory(folder() / "ct");
  for (int slice = 0; slice < 16; ++slice) {
    const std::string number = std::to_string(slice);
    write("ct/" + number + ".dcm",
          "(0008,0016) UI [1.2.840.10008.5.1.4.1.1.2]\n(0008,0018) UI [1.2.4." + number +
              "]\n(0008,0060) CS [CT]\n(0010,0020) LO [ALPHA-1]\n(0020,000e) UI [1.2.4]\n"
              "(0020,0032) DS [-8\\-8\\" +
              std::to_string(slice - 8) +
              "]\n(0020,0037) DS [1\\0\\0\\0\\1\\0]\n(0028,0030) DS [1\\1]\n(0028,1052) DS [-1024]\n"
              "(0028,1053) DS [1]\n" +
              grey);
  }
  const auto told = [&](const std::string& patient) {
    write(
        "portal.dcm",
        "(0008,0016) UI [1.2.840.10008.5.1.4.1.1.481.1]\n(0008,0018) UI [1.2.3]\n(0008,0060) CS [RTIMAGE]\n" +
            patient +
            "(0018,5100) CS [HFS]\n(0028,1040) CS [LIN]\n(0028,1041) SS 1\n(3002,0011) DS [1\\1]\n"
            "(3002,0012) DS [-7.5\\7.5]\n(3002,0022) DS [1000]\n(3002,0026) DS [1500]\n"
            "(300a,011e) DS [0]\n(300a,012c) DS [0\\0\\0]\n" +
            grey);
    return kiroku_json({"sim", "overlay", "ct", "-g", "portal.dcm", "-r", "portal.dcm", "-o", "over.png",
                        "--force", "--json"})["findings"]
        .dump();
  };
  EXPECT_THAT(told("(0010,0020) LO [BRAVO-2]\n"), HasSubstr("the radiograph and the CT are of two patients"));
  EXPECT_THAT(told("(0010,0020) LO [BRAVO-2]\n"), Not(HasSubstr("ALPHA-1")));
  EXPECT_EQ(told("(0010,0020) LO [alpha-1]\n").find("two patients"), std::string::npos);
  EXPECT_EQ(told("").find("two patients"), std::string::npos);
}

TEST_F(SimDrr, IsWhatPlastimatchMakesOfAPhantom) {
  if (!has_tool("plastimatch")) GTEST_SKIP() << "needs plastimatch, not there";
  write_ct("ct.mha", 0, 160);
  write_ct("above.mha", 1000, 160);
  for (const int angle : {0, 90, 225}) {
    const std::string name = "ours" + std::to_string(angle) + ".mha";
    ASSERT_EQ(
        kiroku({"sim", "drr", "ct.mha", "-g", "front.json", "--gantry", std::to_string(angle), "-o", name})
            .status,
        0);
    const std::vector<float> theirs = by_plastimatch("above.mha", angle, "0 0 0", "128 96", "150 112.5");
    const std::vector<float> ours = integrals(name);
    ASSERT_EQ(ours.size(), theirs.size());
    EXPECT_GT(zncc(ours, theirs), 0.999) << angle;
    RecordProperty("zncc_at_" + std::to_string(angle), std::to_string(zncc(ours, theirs)));
  }
}

TEST_F(SimDrr, IsWhatPlastimatchMakesOfARealChest) {
  if (!has_tool("plastimatch")) GTEST_SKIP() << "needs plastimatch, not there";
  KIROKU_NEEDS_SHARED_DATA("sim/lung-ct");
  const Unpacked ct("sim/lung-ct/lidc-idri-0001-dicom.tar.xz");
  const ProcessResult converted = tool({"plastimatch", "convert", "--input", ct.path().string(),
                                        "--output-type", "short", "--output-img", path("ct.mha")});
  ASSERT_EQ(converted.status, 0) << converted.out << converted.err;
  std::string bytes = read_text(folder() / "ct.mha");
  for (std::size_t at = data_of_mha(bytes); at + 1 < bytes.size(); at += 2) {
    std::int16_t hu = 0;
    std::memcpy(&hu, &bytes[at], 2);
    hu = static_cast<std::int16_t>(std::max(hu + 1000, 0));
    std::memcpy(&bytes[at], &hu, 2);
  }
  write_text(folder() / "above.mha", bytes);
  write_text(folder() / "chest.json", R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [14, 8, -175],
                                          "detector_px": [512, 512], "detector_mm": [600, 600]})");
  for (const int angle : {0, 90, 225}) {
    const std::string name = "ours" + std::to_string(angle) + ".mha";
    ASSERT_EQ(kiroku({"sim", "drr", ct.path().string(), "-g", "chest.json", "--gantry", std::to_string(angle),
                      "-o", name})
                  .status,
              0);
    const std::vector<float> theirs = by_plastimatch("above.mha", angle, "14 8 -175", "512 512", "600 600");
    const std::vector<float> ours = integrals(name);
    ASSERT_EQ(ours.size(), theirs.size());
    EXPECT_GT(zncc(ours, theirs), 0.999) << angle;
    RecordProperty("zncc_at_" + std::to_string(angle), std::to_string(zncc(ours, theirs)));
  }
}

TEST_F(SimDrr, IsTheSameByOpenGl) {
  write_ct();
  write_mesh();
  const auto drr = [&](const std::string& projector) {
    const std::string file = projector + ".mha";
    const ProcessResult result = kiroku({"sim", "drr", "ct.mha", "-g", "front.json", "--gantry", "20",
                                         "--mesh", "hole.msh", "--projector", projector, "-o", file});
    EXPECT_EQ(result.status, 0) << result.err;
    return integrals(file);
  };
  EXPECT_GT(zncc(drr("processor"), drr("opengl")), 0.9999);
  EXPECT_REFUSED(kiroku({"sim", "drr", "ct.mha", "-g", "front.json", "--projector", "opengl", "-o", "x.mha"}),
                 "give --mesh");
}

TEST_F(SimDrr, ShowsWhatMovesAsAFilm) {
  write_ct();
  write_mesh();
  write_frames();
  const auto film = [&](const std::string& output, const Arguments& more = {}) {
    Arguments all{"sim",      "drr-film", "ct.mha", "-g", "front.json", "--mesh",
                  "hole.msh", "--frames", "moves",  "-o", output};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  };
  const ProcessResult made = film("film", {"--repeat", "2"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("film: 4 pictures of 128 x 96 pixels, 10 a second"));
  const auto picture = [&](const char* name) { return read_text(folder() / "film" / name); };
  EXPECT_EQ(picture("000001.png"), picture("000003.png"));
  EXPECT_EQ(picture("000002.png"), picture("000004.png"));
  EXPECT_NE(picture("000001.png"), picture("000002.png"));
  for (const char* name : {"film.mp4", "film.mkv"}) EXPECT_EQ(film(name, {"--rate", "25"}).status, 0) << name;
  EXPECT_GT(std::filesystem::file_size(folder() / "film.mp4"), 1000U);

  EXPECT_REFUSED(film("film.mp4"), "film.mp4");
  EXPECT_REFUSED(film("more.gif"), ".mp4");
  EXPECT_REFUSED(film("more", {"--rate", "0"}), "--rate is '0'");
  EXPECT_REFUSED(kiroku({"sim", "drr-film", "ct.mha", "-g", "front.json", "--mesh", "hole.msh", "--frames",
                         ".", "-o", "x.mp4"}),
                 "there is no .vtu");
  EXPECT_REFUSED(
      kiroku({"sim", "drr-film", "ct.mha", "-g", "front.json", "--frames", "moves", "-o", "x.mp4"}),
      "give --mesh");
}

TEST_F(SimDrr, OverlaysASeriesOfRadiographs) {
  write_ct();
  write_mesh();
  write_frames();
  write_text(folder() / "moves/moves.pvd",
             R"(<VTKFile type="Collection"><Collection><DataSet timestep="0" file="frames/00000.vtu"/>
                <DataSet timestep="1" file="frames/00001.vtu"/></Collection></VTKFile>)");
  for (const char* film : {"xray", "xray.mkv"}) {
    ASSERT_EQ(kiroku({"sim", "drr-film", "ct.mha", "-g", "front.json", "--mesh", "hole.msh", "--frames",
                      "moves", "--repeat", "2", "--rate", "1", "-o", film})
                  .status,
              0);
  }
  // The tumour goes up by 10 mm and back; it was seen where it rests, and measured 3 mm to the left of its
  // path.
  write_text(folder() / "path.csv", "time_s,x_mm,y_mm,z_mm\n0,0,0,0\n1,0,0,10\n");
  write_text(folder() / "seen.csv", "time_s,column,row\n0,63.5,47.5\n1,63.5,47.5\n2.5,0,0\n");
  write_text(folder() / "measured.csv", "time_s,x_mm,y_mm,z_mm\n0,3,0,0\n1,3,0,10\n");
  const auto series = [&](const std::string& of, const Arguments& more) {
    Arguments arguments{"sim", "overlay", "ct.mha",   "-g",       "front.json", "--radiographs",
                        of,    "--mesh",  "hole.msh", "--frames", "moves",      "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  };
  const Arguments breath{"--rate", "1", "--repeat"};
  const auto with = [](Arguments one, const Arguments& more) {
    one.insert(one.end(), more.begin(), more.end());
    return one;
  };
  const nlohmann::json answer = kiroku_json(
      series("xray", with(breath, {"--path", "path.csv", "--seen", "seen.csv", "--measured", "measured.csv",
                                   "--table", "table.csv", "--error-plot", "e.svg", "--outline", "1",
                                   "--mode", "beside", "-o", "both"})));
  EXPECT_EQ(answer["pictures"], 4);
  EXPECT_EQ(answer["duration_s"], 3);
  const double alike = answer["gradient_correlation"]["least"].get<double>();
  EXPECT_GT(alike, 0.99);
  EXPECT_EQ(answer["as_seen_mm"]["pictures"], 2);
  EXPECT_NEAR(answer["as_seen_mm"]["greatest"].get<double>(), 10, 0.01);
  EXPECT_NEAR(answer["as_seen_mm"]["mean"].get<double>(), 5, 0.01);
  EXPECT_EQ(answer["in_space_mm"]["pictures"], 2);
  EXPECT_NEAR(answer["in_space_mm"]["mean"].get<double>(), 3, 1e-9);
  EXPECT_THAT(answer["findings"].dump(), HasSubstr("1 positions of seen.csv count for nothing"));
  const std::string table = read_text(folder() / "table.csv");
  EXPECT_THAT(table, testing::StartsWith(
                         "picture,time_s,gradient_correlation,in_space_mm,across_ray_mm,as_seen_mm\n1,0,"));
  EXPECT_THAT(table, HasSubstr("\n4,3,"));
  EXPECT_THAT(read_text(folder() / "e.svg"), HasSubstr("<svg"));
  EXPECT_EQ(files_below(folder() / "both").size(), 4U);

  // Half a breath late, the pictures are less alike: the other way round would be a film that is not looked
  // at.
  const nlohmann::json late = kiroku_json(series("xray", with(breath, {"--start", "1", "-o", "late.mkv"})));
  EXPECT_LT(late["gradient_correlation"]["least"].get<double>(), alike - 0.01);
  // A film has times of its own.
  const nlohmann::json film =
      kiroku_json(series("xray.mkv", {"--repeat", "--mode", "difference", "-o", "film.mp4"}));
  EXPECT_EQ(film["duration_s"], 3);
  EXPECT_GT(film["gradient_correlation"]["least"].get<double>(), 0.98);

  EXPECT_REFUSED(kiroku(series("xray", {"--rate", "1", "-o", "x.mkv"})), "no frame is known for 2 s");
  EXPECT_REFUSED(kiroku(series("xray", {"-r", "xray/000001.png", "-o", "x.mkv"})), "one of them");
  EXPECT_REFUSED(kiroku(series("moves", {"-o", "x.mkv"})), "where there is no .png, .mha or DICOM file");
  EXPECT_REFUSED(kiroku(series("xray", {"--rate", "0", "-o", "x.mkv"})), "--rate is 0");
  EXPECT_REFUSED(kiroku({"sim", "overlay", "ct.mha", "-g", "front.json", "-r", "xray/000001.png", "--rate",
                         "1", "-o", "x.png"}),
                 "are of --radiographs");
}

}  // namespace
}  // namespace kiroku::test
