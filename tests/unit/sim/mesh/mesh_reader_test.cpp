#include "sim/mesh/mesh_reader.h"

#include <bit>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::sim {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;
using Parser = MeshFile (*)(std::string_view, const std::string&, LengthUnit);

/// The sentence after "cannot read NAME, ".
std::string refusal(Parser parse, const std::string& text) {
  try {
    parse(text, "m", LengthUnit::kMetre);
  } catch (const Error& error) {
    const std::string sentence = error.what();
    EXPECT_TRUE(sentence.starts_with("cannot read m"));
    EXPECT_EQ(sentence.find('\n'), std::string::npos);
    return sentence.substr(std::min<std::size_t>(15, sentence.size()));
  }
  return "";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

template <typename Number>
std::string packed(std::initializer_list<Number> numbers, std::endian order = std::endian::little) {
  std::string bytes;
  for (const Number number : numbers) {
    auto one = std::bit_cast<std::array<char, sizeof(Number)>>(number);
    if (order != std::endian::native) std::ranges::reverse(one);
    bytes.append(one.data(), one.size());
  }
  return bytes;
}

const std::string kMsh22 =
    "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 7 \"liver\"\n$EndPhysicalNames\n"
    "$Nodes\n5\n1 0 0 0\n2 1000 0 0\n3 0 1e3 0\n4 0 0 +1000\n9 -1000 0 0\n$EndNodes\n"
    "$Elements\n4\n1 2 2 0 1 1 2 3\n2 4 2 7 1 1 2 3 4\n3 4 2 8 1 1 3 9 4\n4 15 2 0 1 1\n$EndElements\n";

void expect_two_tetrahedra(const MeshFile& file) {
  EXPECT_EQ(file.mesh.nodes.size(), 5U);
  EXPECT_EQ(file.mesh.nodes[4], Vector3(-1, 0, 0));
  EXPECT_THAT(file.mesh.tetrahedra, ElementsAre(Tetrahedron{0, 1, 2, 3}, Tetrahedron{0, 2, 4, 3}));
  EXPECT_THAT(file.mesh.regions, ElementsAre(7, 8));
}

TEST(MeshReader, ReadsMsh22) {
  const MeshFile file = parse_msh(kMsh22, "m", LengthUnit::kMillimetre);
  expect_two_tetrahedra(file);
  EXPECT_THAT(file.dropped, ElementsAre(Pair("triangles", 1), Pair("points", 1)));
  EXPECT_FALSE(file.turned);
}

TEST(MeshReader, TakesElementaryEntitiesWhereNoTetrahedronHasAPhysicalGroup) {
  const std::string text = replaced(replaced(kMsh22, "4 2 7 1", "4 2 0 3"), "4 2 8 1", "4 2 0 4");
  EXPECT_THAT(parse_msh(text, "m", LengthUnit::kMetre).mesh.regions, ElementsAre(3, 4));
}

TEST(MeshReader, ReadsBinaryMsh22InBothByteOrders) {
  for (const std::endian order : {std::endian::little, std::endian::big}) {
    const auto ints = [&](std::initializer_list<std::int32_t> numbers) { return packed(numbers, order); };
    std::string text = "$MeshFormat\n2.2 1 8\n" + ints({1}) + "\n$EndMeshFormat\n$Nodes\n5\n";
    const std::vector<std::pair<std::int32_t, Vector3>> nodes{
        {1, {0, 0, 0}}, {2, {1, 0, 0}}, {3, {0, 1, 0}}, {4, {0, 0, 1}}, {9, {-1, 0, 0}}};
    for (const auto& [number, at] : nodes) text += ints({number}) + packed({at.x(), at.y(), at.z()}, order);
    text += "\n$EndNodes\n$Elements\n3\n" + ints({2, 1, 2, 1, 0, 1, 1, 2, 3}) +
            ints({4, 2, 2, 2, 7, 1, 1, 2, 3, 4, 3, 8, 1, 1, 3, 9, 4}) + "\n$EndElements\n";
    const MeshFile file = parse_msh(text, "m", LengthUnit::kMetre);
    expect_two_tetrahedra(file);
    EXPECT_THAT(file.dropped, ElementsAre(Pair("triangles", 1)));
    EXPECT_THAT(refusal(parse_msh, text.substr(0, 90)), HasSubstr("byte 89: a coordinate is cut off"));
  }
}

const std::string kMsh41 =
    "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n1 1 0 2\n1 0 0 0 0\n1 0 0 0 1 0 0 1 5 2 1 -2\n"
    "3 0 0 0 1 1 1 1 7 0\n4 0 0 0 1 1 1 2 8 9 1 3\n$EndEntities\n"
    "$Nodes\n2 5 1 9\n0 1 0 1\n1\n0 0 0\n3 3 1 4\n2\n3\n4\n9\n1 0 0 .1 .2 .3\n0 1 0 0 0 0\n0 0 1 0 0 0\n-1 0 "
    "0 0 0 0\n"
    "$EndNodes\n$Elements\n3 3 1 3\n2 1 2 1\n1 1 2 3\n3 3 4 1\n2 1 2 3 4\n3 4 4 1\n3 1 3 9 4\n$EndElements\n";

TEST(MeshReader, ReadsMsh41) {
  const MeshFile file = parse_msh(kMsh41, "m", LengthUnit::kMetre);
  expect_two_tetrahedra(file);
  EXPECT_THAT(file.dropped, ElementsAre(Pair("triangles", 1)));
}

TEST(MeshReader, ReadsBinaryMsh41) {
  const auto ints = [](std::initializer_list<std::int32_t> numbers) { return packed(numbers); };
  const auto sizes = [](std::initializer_list<std::int64_t> numbers) { return packed(numbers); };
  const std::string text =
      "$MeshFormat\n4.1 1 8\n" + ints({1}) + "\n$EndMeshFormat\n$Entities\n" + sizes({0, 0, 0, 2}) +
      ints({3}) + packed({0., 0., 0., 1., 1., 1.}) + sizes({1}) + ints({7}) + sizes({0}) + ints({4}) +
      packed({0., 0., 0., 1., 1., 1.}) + sizes({1}) + ints({8}) + sizes({1}) + ints({-1}) +
      "\n$EndEntities\n$Nodes\n" + sizes({1, 5, 1, 9}) + ints({3, 3, 0}) + sizes({5, 1, 2, 3, 4, 9}) +
      packed({0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1., -1., 0., 0.}) + "\n$EndNodes\n$Elements\n" +
      sizes({2, 2, 1, 2}) + ints({3, 3, 4}) + sizes({1, 1, 1, 2, 3, 4}) + ints({3, 4, 4}) +
      sizes({1, 2, 1, 3, 9, 4}) + "\n$EndElements\n";
  expect_two_tetrahedra(parse_msh(text, "m", LengthUnit::kMetre));
}

TEST(MeshReader, RefusesDamagedMshWithLineAndCause) {
  const auto with = [](const std::string& from, const std::string& to) {
    return refusal(parse_msh, replaced(kMsh22, from, to));
  };
  EXPECT_EQ(refusal(parse_msh, ""), "line 1: it is no MSH file: it does not begin with $MeshFormat");
  EXPECT_EQ(with("2.2 0", "4.0 0"), "line 2: it is of version '4.0'; save it as MSH 4.1 or 2.2");
  EXPECT_EQ(with("0 1e3 0", "0 nan 0"), "line 12: a coordinate is 'nan', not a finite number");
  EXPECT_EQ(with("0 1e3 0", "0 1e999 0"), "line 12: a coordinate is '1e999', not a finite number");
  EXPECT_EQ(with("9 -1000", "4 -1000"), "line 14: two nodes have the number 4");
  EXPECT_EQ(with("1 3 9 4", "1 3 8 4"),
            "line 20: tetrahedron 1 (counted from 0) names the node 8, which is not there");
  EXPECT_THAT(with("1 3 9 4", "9223372036854775807 -9223372036854775808 9 4"),
              HasSubstr("which is not there"));
  EXPECT_EQ(with("$Nodes\n5", "$Nodes\n4"),
            "line 14: $EndNodes was expected: the count in its section is wrong");
  EXPECT_EQ(with("$Nodes\n5", "$Nodes\n99999999999"),
            "line 15: the number of a node is '$EndNodes', not a whole number");
  EXPECT_EQ(with("$Nodes\n5", "$Nodes\n-1"),
            "line 9: the number of nodes is '-1', not a whole number from 0");
  EXPECT_EQ(with("3 4 2 8 1", "3 99 2 8 1"), "line 20: elements of type 99 are not known");
  EXPECT_EQ(with("3 4 2 8 1", "3 4 2 3000000000 1"),
            "line 20: the region 3000000000 does not fit into 32 bits");
  EXPECT_EQ(with("$EndElements", ""),
            "line 23: $EndElements was expected: the count in its section is wrong");
  EXPECT_EQ(refusal(parse_msh, kMsh22.substr(0, kMsh22.find("$Elements"))), "it holds no 4-node tetrahedra");
  EXPECT_EQ(refusal(parse_msh, replaced(kMsh41, "2 5 1 9\n", "2 4 1 9\n")),
            "line 16: the blocks hold more nodes than the section says");
  EXPECT_EQ(refusal(parse_msh, replaced(kMsh41, "3 3 1 3\n", "3 4 1 3\n")),
            "line 33: the blocks hold fewer elements than the section says");
}

TEST(MeshReader, NamesWhatAFileWithoutTetrahedraHolds) {
  const std::string text =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n"
      "$Elements\n1\n1 2 2 0 1 1 2 3\n$EndElements\n";
  EXPECT_EQ(refusal(parse_msh, text), "it holds no 4-node tetrahedra, only 1 triangles");
}

TEST(MeshReader, SurvivesEveryTruncationOfEveryFormat) {
  for (const auto& [parse, text] : {std::pair<Parser, std::string>{parse_msh, kMsh22}, {parse_msh, kMsh41}}) {
    for (std::size_t size = 0; size + 2 < text.size(); ++size) {
      EXPECT_NE(refusal(parse, text.substr(0, size)), "") << size;
    }
  }
}

const std::string kVtk =
    "# vtk DataFile Version 3.0\nliver\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n"
    "0 0 0 1 0 0\n0 1 0 0 0 1\n-1 0 0\n\nCELLS 3 14\n3 0 1 2\n4 0 1 2 3\n4 0 2 4 3\n\nCELL_TYPES "
    "3\n5\n10\n10\n"
    "POINT_DATA 5\nSCALARS depth float 1\nLOOKUP_TABLE default\n0 0 0 0 1\nVECTORS v float\n"
    "0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\nMETADATA\nINFORMATION 0\n\n"
    "CELL_DATA 3\nFIELD data 2\nquality 1 3 float\n1 1 .5\nregion 1 3 int\n0 7 8\n";

TEST(MeshReader, ReadsLegacyVtk) {
  const MeshFile file = parse_vtk(kVtk, "m", LengthUnit::kMetre);
  expect_two_tetrahedra(file);
  EXPECT_THAT(file.dropped, ElementsAre(Pair("triangles", 1)));
}

TEST(MeshReader, ReadsTheOffsetsOfVtk51) {
  const std::string text =
      replaced(kVtk, "CELLS 3 14\n3 0 1 2\n4 0 1 2 3\n4 0 2 4 3\n",
               "CELLS 4 11\nOFFSETS vtktypeint64\n0 3 7 11\nCONNECTIVITY vtktypeint64\n0 1 2 0 1 2 3 0 2 "
               "4 3\n");
  expect_two_tetrahedra(parse_vtk(text, "m", LengthUnit::kMetre));
  EXPECT_EQ(refusal(parse_vtk, replaced(text, "0 3 7 11", "0 7 3 11")),
            "line 14: the offsets of the cells do not run from 0 to the end of the connectivity");
}

TEST(MeshReader, ReadsBinaryVtk) {
  const auto ints = [](std::initializer_list<std::int32_t> numbers) {
    return packed(numbers, std::endian::big);
  };
  const std::string text =
      "# vtk DataFile Version 4.2\n\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n" +
      packed({0.F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F, 1.F, -1.F, 0.F, 0.F}, std::endian::big) +
      "\nCELLS 2 10\n" + ints({4, 0, 1, 2, 3, 4, 0, 2, 4, 3}) + "\nCELL_TYPES 2\n" + ints({10, 10}) +
      "\nCELL_DATA 2\nSCALARS material int\nLOOKUP_TABLE default\n" + ints({7, 8}) + "\n";
  expect_two_tetrahedra(parse_vtk(text, "m", LengthUnit::kMetre));
  EXPECT_THAT(refusal(parse_vtk, replaced(text, "POINTS 5 ", "POINTS 60 ")),
              HasSubstr("more than the file has room for"));
}

TEST(MeshReader, RefusesDamagedVtkWithLineAndCause) {
  const auto with = [](const std::string& from, const std::string& to) {
    return refusal(parse_vtk, replaced(kVtk, from, to));
  };
  EXPECT_THAT(with("# vtk", "# itk"), HasSubstr("line 1: it is no legacy VTK file"));
  EXPECT_EQ(with("UNSTRUCTURED_GRID", "POLYDATA"),
            "line 4: it is a POLYDATA: tetrahedra are read from an UNSTRUCTURED_GRID only");
  EXPECT_EQ(with("POINTS 5 double", "POINTS 5 integer"), "line 5: the data type 'integer' is not known");
  EXPECT_THAT(with("CELLS 3", "CELLS 300000000000"),
              HasSubstr("line 10: the number of cells is larger than the file"));
  EXPECT_EQ(with("4 0 2 4 3", "4 0 2 5 3"), "line 13: a cell names the point 5, which is not there");
  EXPECT_EQ(with("4 0 2 4 3", "3 0 2 4 3"),
            "line 13: CELLS says another number of values than its cells have");
  EXPECT_THAT(with("CELL_TYPES 3\n5\n10\n10", "CELL_TYPES 2\n10\n10"),
              HasSubstr("there are 3 cells and 2 cell types"));
  EXPECT_THAT(with("0 7 8", "0 7 8.5"), HasSubstr("a region is '8.5'"));
  EXPECT_THAT(with("POINT_DATA", "POINTDATA"), HasSubstr("a section was expected"));
}

const std::string kVeg =
    "# a mesh\n*VERTICES\n5 3 0 0\n1 0 0 0\n2 1 0 0\n3, 0, 1, 0\n4 0 0 1\n5 -1 0 0\n\n*ELEMENTS\nTET\n2 4 0\n"
    "1 1 2 3 4\n2 1 3 5 4\n*MATERIAL soft\nENU, 1000, 2500, 0.45\n*SET right\n2\n*REGION\nallElements, soft\n"
    "*REGION\nright, soft\n";

TEST(MeshReader, ReadsVeg) {
  const MeshFile file = parse_veg(kVeg, "m", LengthUnit::kMetre);
  EXPECT_THAT(file.mesh.tetrahedra, ElementsAre(Tetrahedron{0, 1, 2, 3}, Tetrahedron{0, 2, 4, 3}));
  EXPECT_THAT(file.mesh.regions, ElementsAre(1, 2));
}

TEST(MeshReader, RefusesDamagedVegWithLineAndCause) {
  const auto with = [](const std::string& from, const std::string& to) {
    return refusal(parse_veg, replaced(kVeg, from, to));
  };
  EXPECT_EQ(refusal(parse_veg, "# nothing\n"), "line 2: it is empty");
  EXPECT_EQ(with("2 1 0 0", "2 1 0"), "line 5: a coordinate is missing");
  EXPECT_EQ(with("2 1 0 0", "2 1 inf 0"), "line 5: a coordinate is 'inf', which is no such number");
  EXPECT_EQ(with("\nTET\n", "\nCUBIC\n"),
            "line 11: its elements are no tetrahedra (TET), and others are not read");
  EXPECT_EQ(with("*SET right\n2", "*SET right\n3"),
            "line 18: a *SET names the element 3, which is not there");
  EXPECT_EQ(with("right, soft", "left, soft"), "line 22: a *REGION is of the set 'left', which is not there");
  EXPECT_THAT(with("*MATERIAL", "*INCLUDE"), HasSubstr("line 15: a section was expected"));
}

TEST(MeshReader, TurnsMeshesThatCountTheOtherWayRound) {
  const std::string text = replaced(replaced(kMsh22, "1 2 3 4\n", "1 3 2 4\n"), "1 3 9 4\n", "1 9 3 4\n");
  const MeshFile file = parse_msh(text, "m", LengthUnit::kMetre);
  EXPECT_TRUE(file.turned);
  EXPECT_GT(signed_volume_m3(file.mesh, 0), 0);
  EXPECT_GT(signed_volume_m3(file.mesh, 1), 0);
  // One alone is a fault of the mesh, not a custom of its writer.
  EXPECT_FALSE(parse_msh(replaced(kMsh22, "1 2 3 4\n", "1 3 2 4\n"), "m", LengthUnit::kMetre).turned);
}

TEST(MeshReader, ChoosesTheFormatByTheEnding) {
  const test::TemporaryFolder folder;
  std::ofstream(folder / "a.MSH") << kMsh22;
  std::ofstream(folder / "a.stl") << kMsh22;
  EXPECT_EQ(read_mesh(folder / "a.MSH", LengthUnit::kMetre).mesh.tetrahedra.size(), 2U);
  EXPECT_THROW(read_mesh(folder / "a.stl", LengthUnit::kMetre), UsageError);
  EXPECT_THROW(read_mesh(folder / "absent.msh", LengthUnit::kMetre), IoError);
  EXPECT_THROW(read_mesh(folder.path(), LengthUnit::kMetre), UsageError);
}

struct RealMesh {
  const char* file;
  std::size_t nodes, tetrahedra;
};
class RealMeshes : public testing::TestWithParam<RealMesh> {};

TEST_P(RealMeshes, AreReadWhole) {
  const std::string file = std::string("sim/meshes/") + GetParam().file;
  KIROKU_NEEDS_SHARED_DATA(file);
  const MeshFile read = read_mesh(test::shared_data(file), LengthUnit::kMillimetre);
  EXPECT_EQ(read.mesh.nodes.size(), GetParam().nodes);
  EXPECT_EQ(read.mesh.tetrahedra.size(), GetParam().tetrahedra);
}

INSTANTIATE_TEST_SUITE_P(Files, RealMeshes,
                         testing::Values(RealMesh{"sofa_env/liver_volumetric.vtk", 98, 273},
                                         RealMesh{"sofa_env/gallbladder_volumetric.vtk", 367, 1063},
                                         RealMesh{"sofa_env/tissue_volume.msh", 493, 1432},
                                         RealMesh{"sofa_env/tissue_volumetric.msh", 145, 348},
                                         RealMesh{"vega/turtle-volumetric-homogeneous.veg", 347, 1185}),
                         [](const auto& test) { return "M" + std::to_string(test.param.nodes); });

TEST(RealMeshes, SurfacesAreRefusedByName) {
  KIROKU_NEEDS_SHARED_DATA("sim/meshes/scikit_surgeryvtk/liver.vtk");
  try {
    read_mesh(test::shared_data("sim/meshes/scikit_surgeryvtk/liver.vtk"), LengthUnit::kMillimetre);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("POLYDATA"));
  }
}

}  // namespace
}  // namespace kiroku::sim
