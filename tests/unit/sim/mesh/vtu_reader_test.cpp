#include "sim/mesh/vtu_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/mesh/mesh_writer.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

class VtuReaderTest : public testing::Test {
 protected:
  VtuReaderTest() {
    for (std::size_t i = 0; i < 3 * mesh_.nodes.size(); ++i) displacement_.push_back(0.1 * double(i) - 3);
    mesh_.regions[2] = 7;
    for (std::size_t t = 0; t < mesh_.tetrahedra.size(); ++t) stress_.push_back(double(t) * 1.5);
  }
  [[nodiscard]] std::string text() const {
    return vtu_text(mesh_, LengthUnit::kMillimetre, {{"displacement", {"X", "Y", "Z"}, displacement_}},
                    {{"von_mises_stress", {}, stress_}});
  }
  [[nodiscard]] std::filesystem::path written(const std::string& content) const {
    const std::filesystem::path file = folder_ / "u.vtu";
    std::ofstream(file) << content;
    return file;
  }
  [[nodiscard]] std::string refusal(const std::string& from, const std::string& to) const {
    std::string changed = text();
    const std::size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    changed.replace(at, from.size(), to);
    try {
      static_cast<void>(read_displacement(written(changed), mesh_, LengthUnit::kMillimetre));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  test::TemporaryFolder folder_;
  TetMesh mesh_ = test::tet_grid({2, 1, 1}, {0.02, 0.01, 0.01});
  std::vector<double> displacement_, stress_;
};

TEST_F(VtuReaderTest, ReadsWhatWasWrittenToTheBit) {
  const VtuFile file = parse_vtu(text(), "u.vtu", LengthUnit::kMillimetre);
  EXPECT_EQ(file.mesh.tetrahedra, mesh_.tetrahedra);
  EXPECT_EQ(file.mesh.regions, mesh_.regions);
  EXPECT_EQ(file.point_data.at("displacement").values, displacement_);
  EXPECT_EQ(file.point_data.at("displacement").components, 3U);
  EXPECT_EQ(file.cell_data.at("von_mises_stress").values, stress_);
  const std::vector<Vector3> read = read_displacement(written(text()), mesh_, LengthUnit::kMillimetre);
  ASSERT_EQ(read.size(), mesh_.nodes.size());
  EXPECT_EQ(read[5], Vector3(displacement_[15], displacement_[16], displacement_[17]) / 1000);
}

TEST_F(VtuReaderTest, RefusesInASentence) {
  EXPECT_THAT(refusal("VTKFile", "html"), HasSubstr("it is no VTK file"));
  EXPECT_THAT(refusal("\"displacement\"", "\"motion\""), HasSubstr("has no point data 'displacement'"));
  EXPECT_THAT(refusal("-3 ", "nan "), HasSubstr("value 0 of the array 'displacement' is no finite number"));
  EXPECT_THAT(refusal("-3 ", ""), HasSubstr("the array 'displacement' has 35 values, not 3 for each of 12"));
  EXPECT_THAT(refusal("format=\"ascii\"", "format=\"appended\""), HasSubstr("not in text form"));
  EXPECT_THAT(refusal("</Piece>", ""), HasSubstr("line 112: it is no XML: Start-end tags mismatch"));
  EXPECT_THAT(refusal("NumberOfPoints=\"12\"", "NumberOfPoints=\"-1\""), HasSubstr("which is no count"));
}

TEST_F(VtuReaderTest, ReadsAsXmlAllows) {
  std::string changed = text();
  const auto replace = [&](const std::string& from, const std::string& to) {
    const std::size_t at = changed.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    changed.replace(at, from.size(), to);
  };
  replace("<Piece ", "<!-- <Piece NumberOfPoints='1'> -->\n<Piece\t");
  replace("<DataArray ", "<DataArray\n\t");
  replace("Name=\"displacement\"", "Name = 'displacement'");
  const VtuFile file = parse_vtu(changed, "u.vtu", LengthUnit::kMillimetre);
  EXPECT_EQ(file.mesh.tetrahedra, mesh_.tetrahedra);
  EXPECT_EQ(file.point_data.at("displacement").values, displacement_);
}

TEST_F(VtuReaderTest, RefusesSeveralPieces) {
  EXPECT_THAT(refusal("</Piece>", "</Piece><Piece/>"), HasSubstr("in several pieces"));
}

TEST_F(VtuReaderTest, RefusesRawAppendedData) {
  EXPECT_THAT(refusal("</VTKFile>", "<AppendedData encoding=\"raw\">_\x01<\x02</AppendedData></VTKFile>"),
              HasSubstr("not in text form"));
}

TEST_F(VtuReaderTest, RefusesAnotherMesh) {
  const auto refused = [&](const TetMesh& other) -> std::string {
    try {
      static_cast<void>(read_displacement(written(text()), other, LengthUnit::kMillimetre));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refused(test::tet_grid({1, 1, 1}, {0.02, 0.01, 0.01})), HasSubstr("has 12 nodes, the mesh 8"));
  EXPECT_THAT(refused(test::tet_grid({2, 1, 1}, {0.02, 0.01, 0.011})),
              HasSubstr("is not where that of the mesh is"));
}

}  // namespace
}  // namespace kiroku::sim
