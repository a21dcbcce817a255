#include "sim/model/static_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/mesh/mesh_writer.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A block of 40 x 20 x 20 mm, regions 1 (left) and 2, with node i + 5 j + 15 k at (10 i, 10 j, 10 k) mm.
class StaticModelTest : public testing::Test {
 protected:
  StaticModelTest() {
    TetMesh mesh = test::tet_grid({4, 2, 2}, {0.04, 0.02, 0.02});
    for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
      mesh.regions[t] = mesh.nodes[mesh.tetrahedra[t][0]].x() < 0.015 ? 1 : 2;
    }
    write_mesh(mesh);
  }
  void write_mesh(const TetMesh& mesh) {
    std::ofstream(folder_ / "block.msh") << msh_text(mesh, LengthUnit::kMillimetre);
  }
  [[nodiscard]] StaticModel read(const std::string& text) const {
    std::ofstream(folder_ / "model.json") << text;
    return read_static_model(folder_ / "model.json");
  }
  [[nodiscard]] StaticModel read(const json& document) const { return read(document.dump()); }
  /// The sentence after "cannot use FILE: " or "cannot read FILE: ".
  template <typename Document>
  [[nodiscard]] std::string refusal(const Document& document) const {
    try {
      static_cast<void>(read(document));
    } catch (const Error& error) {
      const std::string sentence = error.what(), name = "model.json: ";
      const std::size_t at = sentence.find(name);
      return at == std::string::npos ? sentence : sentence.substr(at + name.size());
    }
    return "";
  }
  /// The model with one value changed; a null pointer value removes it.
  [[nodiscard]] std::string refusal_with(const char* pointer, const json& value) const {
    json document = model_;
    document[json::json_pointer(pointer)] = value;
    return refusal(document);
  }

  test::TemporaryFolder folder_;
  json model_ = json::parse(R"({
    "mesh": "block.msh", "length_unit": "mm",
    "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.45},
                  {"region": 2, "young_modulus_pa": 20000, "poisson_ratio": 0.3, "density_kg_m3": 1060}],
    "fixed": [{"box": [[0, 0, 0], [0, 20, 20]]}, {"nodes": [44], "displacement": [null, null, -2]}],
    "forces": [{"box": [[40, 0, 0], [40, 20, 20]], "force_n": [0.09, 0, 0]}, {"nodes": [44], "force_n": [0, 0.01, 0]}],
    "gravity_m_s2": [0, 0, -9.81]})");
};

TEST_F(StaticModelTest, ReadsAModel) {
  const StaticModel model = read(model_);
  EXPECT_EQ(model.materials.at(1).young_modulus_pa, 5000);
  EXPECT_EQ(model.materials.at(2).density_kg_m3, 1060);
  EXPECT_TRUE(model.constraints.prescribed(0) && model.constraints.prescribed(1) &&
              model.constraints.prescribed(2));
  EXPECT_FALSE(model.constraints.prescribed(3));
  EXPECT_FALSE(model.constraints.prescribed(3 * 44));
  EXPECT_EQ(model.constraints.displacement_m()[3 * 44 + 2], -0.002);
  // In total, shared evenly.
  EXPECT_NEAR(model.force_n[3 * 4], 0.01, 1e-15);
  EXPECT_EQ(model.force_n[3 * 44 + 1], 0.01);
  EXPECT_EQ(model.gravity_m_s2.z(), -9.81);
  EXPECT_THAT(model.warnings, ElementsAre("a material has no density_kg_m3: 1000 was taken for its weight"));
}

TEST_F(StaticModelTest, SolvesAndWritesWhatWasAskedFor) {
  const StaticModel model = read(model_);
  const StaticResult result = solve(model);
  EXPECT_EQ(result.unknowns, 3U * 36 - 1);
  EXPECT_NEAR(result.load_n.x(), 0.09, 1e-12);
  EXPECT_LE((result.load_n + result.reaction_n).norm(), 1e-9 * result.load_n.norm());
  const std::string text = vtu_text(model, result);
  for (const char* part :
       {R"(Name="displacement" NumberOfComponents="3")", R"(Name="reaction_force" NumberOfComponents="3")",
        R"(Name="stress" NumberOfComponents="6")", R"(Name="von_mises_stress" NumberOfComponents="1")",
        "NumberOfPoints=\"45\" NumberOfCells=\"96\"", "\n40 20 20\n"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
  EXPECT_EQ(text.find("nan"), std::string::npos);
  EXPECT_EQ(vtu_text(model, solve(model)), text);
}

TEST_F(StaticModelTest, NamesThePathOfWhatIsWrong) {
  EXPECT_EQ(refusal_with("/materials/1/poisson_ratio", 0.5),
            "materials[1].poisson_ratio is 0.5: material without any change of volume cannot be computed; "
            "take 0.49, or "
            "0.45 for soft tissue");
  EXPECT_EQ(refusal_with("/materials/0/young_modulus_pa", -1),
            "materials[0].young_modulus_pa is -1: stiffness must be greater than 0");
  EXPECT_EQ(refusal_with("/materials/0/young_modulus_pa", "soft"),
            "materials[0].young_modulus_pa is of type string where a number is expected");
  EXPECT_EQ(
      refusal_with("/materials/0/possion_ratio", 0.3),
      "materials[0] has the unknown key 'possion_ratio'; known are region, young_modulus_pa, poisson_ratio, "
      "density_kg_m3");
  EXPECT_EQ(refusal_with("/materials/1/region", 3),
            "materials[1].region is 3, which the mesh does not have; it has 1, 2");
  EXPECT_EQ(refusal_with("/materials/1/region", "liver"),
            "materials[1].region is 'liver': it must be \"all\" or a region's number");
  EXPECT_EQ(refusal_with("/materials/0/region", 2), "materials[1].region is 2 again, as materials[0].region");
  EXPECT_EQ(refusal_with("/materials/1/region", "all"), "materials[1].region is \"all\" a second time");
  EXPECT_EQ(refusal_with("/materials/0/region", 1), "");
  EXPECT_EQ(refusal_with("/materials", json::array()), "materials has none for region 1 of the mesh");
  EXPECT_EQ(refusal_with("/length_unit", "cm"), "length_unit is 'cm': it must be \"mm\" or \"m\"");
  EXPECT_EQ(refusal_with("/fixed/0/box/0", json{0, 0}), "fixed[0].box[0] has 2 elements, not 3");
  EXPECT_EQ(
      refusal_with("/fixed/0/box/0", json{1, 0, 0}),
      "fixed[0].box has its corners the wrong way round: the first must not be greater in any coordinate");
  EXPECT_EQ(refusal_with("/fixed/0/box", json::parse("[[50, 0, 0], [60, 1, 1]]")),
            "fixed[0].box holds no node; the mesh reaches from [0, 0, 0] to [40, 20, 20]");
  EXPECT_EQ(refusal_with("/fixed/1/nodes/0", 45), "fixed[1].nodes[0] is 45: nodes are numbered from 0 to 44");
  EXPECT_EQ(refusal_with("/fixed/1/nodes/0", 0.5), "fixed[1].nodes[0] is not a whole number");
  EXPECT_EQ(refusal_with("/fixed/1/nodes", json{7, 7}), "fixed[1].nodes[1] names node 7 a second time");
  EXPECT_EQ(refusal_with("/fixed/1/nodes", json::array()), "fixed[1].nodes names no node");
  EXPECT_EQ(refusal_with("/fixed/1/box", 0), "fixed[1] must have either 'nodes' or 'box'");
  EXPECT_EQ(refusal_with("/fixed/1/displacement", json{nullptr, nullptr, nullptr}),
            "fixed[1].displacement fixes no component");
  EXPECT_EQ(refusal_with("/forces/0/force_n", json{1, 2, nullptr}),
            "forces[0].force_n[2] is null where a number is expected");
  EXPECT_EQ(refusal_with("/gravity_m_s2", 9.81), "gravity_m_s2 is of type number where an array is expected");
  EXPECT_EQ(refusal_with("/corotational", 1),
            "corotational is of type number where true or false is expected");
  EXPECT_EQ(refusal_with("/fixed/1/nodes/0", 15),
            "fixed[1] contradicts another: fixed[1] moves node 15 by -0.002 m along z, fixed[0] by 0 m: only "
            "one of them can "
            "be");
  json document = model_;
  document.erase("mesh");
  EXPECT_EQ(refusal(document), "the document lacks 'mesh'");
  EXPECT_EQ(refusal(json::array()), "the document is of type array where an object is expected");
}

/// Upright across the block, from x = 0 over its whole depth down to `bottom`; mm.
json blade_at(double x, double bottom) {
  return {{"blade",
           {{{"tip", {x, -5, bottom}}, {"heel", {x, -5, 25}}},
            {{"tip", {x, 25, bottom}}, {"heel", {x, 25, 25}}}}}};
}

TEST_F(StaticModelTest, CutsBeforeItSolves) {
  const StaticResult whole = solve(read(model_));
  EXPECT_FALSE(whole.cut_mesh);
  model_["cuts"] = json::array({blade_at(24, 12)});
  const StaticModel model = read(model_);
  ASSERT_EQ(model.cuts.size(), 1U);
  const StaticResult cut = solve(model);
  ASSERT_TRUE(cut.cut_mesh);
  EXPECT_LT(cut.cut_mesh->tetrahedra.size(), model.mesh.tetrahedra.size());
  EXPECT_EQ(cut.cut_mesh->tetrahedra.size(), cut.stress_pa.size());
  EXPECT_EQ(cut.cut_mesh->nodes.size(), model.mesh.nodes.size());
  EXPECT_EQ(cut.unknowns, whole.unknowns);
  EXPECT_THAT(cut.warnings, IsEmpty());
  // The notch makes it softer: the same load does more work.
  const auto work_j = [&](const StaticResult& result) {
    return model.force_n.dot(result.solution.displacement_m);
  };
  EXPECT_GT(work_j(cut), work_j(whole));
  EXPECT_TRUE((cut.load_n + cut.reaction_n).norm() < 1e-9 * cut.load_n.norm());
  EXPECT_THAT(vtu_text(model, cut),
              HasSubstr("NumberOfCells=\"" + std::to_string(cut.cut_mesh->tetrahedra.size()) + "\""));
}

TEST_F(StaticModelTest, SaysWhatFallsOffAndWhatMeetsNothing) {
  model_["cuts"] = {blade_at(60, 12), blade_at(24, -5)};
  const StaticResult result = solve(read(model_));
  EXPECT_THAT(
      result.warnings,
      ElementsAre("cuts[0] meets no edge of the mesh",
                  testing::MatchesRegex("after cuts\\[1\\] a part of [0-9]+ tetrahedra with node [0-9]+ "
                                        "hangs on nothing that is fixed any longer: it is held where it "
                                        "was")));
  EXPECT_TRUE((result.load_n + result.reaction_n).norm() <= 1e-9);
}

TEST_F(StaticModelTest, NamesThePathOfAnUnsoundCut) {
  const json pose = {{"tip", {0, 0, 0}}, {"heel", {0, 0, 10}}};
  EXPECT_EQ(refusal_with("/cuts", json::parse(R"([{"path": []}])")),
            "cuts[0] has the unknown key 'path'; known are blade");
  EXPECT_EQ(refusal_with("/cuts", {{{"blade", {pose}}}}),
            "cuts[0].blade cannot be swept: a blade's path has 1 poses: a cut needs two at least");
  EXPECT_EQ(
      refusal_with("/cuts", {{{"blade", {pose, pose}}}}),
      "cuts[0].blade cannot be swept: from pose 0 to 1 the blade's edge does not move, or only along itself: "
      "it sweeps no surface");
  EXPECT_EQ(refusal_with("/cuts", json::parse(R"([{"blade": [{"tip": [0, 0], "heel": [0, 0, 1]}]}])")),
            "cuts[0].blade[0].tip has 2 elements, not 3");
}

TEST_F(StaticModelTest, RefusesWhatIsNoJson) {
  EXPECT_THAT(refusal(std::string("{\n\"mesh\": }")),
              HasSubstr("it is no JSON: parse error at line 2, column 9"));
  EXPECT_THAT(refusal(std::string()), HasSubstr("it is no JSON"));
  EXPECT_EQ(refusal(std::string(R"({"mesh": "a", "mesh": "b"})")),
            "the key 'mesh' stands twice in one object");
  EXPECT_THAT(refusal(std::string(R"({"mesh": 1e999})")), HasSubstr("it is no JSON"));
  EXPECT_THROW(read_static_model(folder_ / "absent.json"), IoError);
  EXPECT_THROW(read_static_model(folder_.path()), IoError);
}

TEST_F(StaticModelTest, WarnsOfWhatIsOddAndStillAnswers) {
  model_["length_unit"] = "m";
  EXPECT_THAT(
      read(model_).warnings,
      testing::Contains(
          "the mesh is 40 m long (40 x 20 x 20 m), strange for an organ: is length_unit \"m\" right?"));
  model_["length_unit"] = "mm";
  TetMesh mesh = test::tet_grid({4, 2, 2}, {0.04, 0.02, 0.02});
  mesh.nodes.emplace_back(0, 0, 0);
  write_mesh(mesh);
  model_["materials"].erase(1);
  EXPECT_THAT(read(model_).warnings, testing::Contains("1 node belongs to no tetrahedron: 45"));
  EXPECT_NO_THROW(solve(read(model_)));
  model_["forces"][1]["nodes"] = {45};
  EXPECT_EQ(refusal(model_), "forces[1] pulls at node 45, which belongs to no tetrahedron");
}

TEST_F(StaticModelTest, RefusesUnsoundMeshesByTheirNumber) {
  TetMesh mesh = test::tet_grid({4, 2, 2}, {0.04, 0.02, 0.02});
  std::swap(mesh.tetrahedra[7][0], mesh.tetrahedra[7][1]);
  write_mesh(mesh);
  EXPECT_EQ(refusal(model_), "mesh names a mesh that is not sound: 1 tetrahedron is inverted: 7");
}

TEST_F(StaticModelTest, LargeRotationsAreAskedForByAFlag) {
  json document = model_;
  document["fixed"] = json::array({document["fixed"][0]});
  document["forces"] = json::array({{{"nodes", {4, 9, 14}}, {"force_n", {0, 0, -0.2}}}});
  document["gravity_m_s2"] = {0, 0, 0};
  const StaticResult linear = solve(read(document));
  document["corotational"] = true;
  const StaticResult turned = solve(read(document));
  // The middle of the end goes down, and only what turns comes back towards what holds it.
  const Eigen::Index middle = 3 * 24;
  EXPECT_LT(linear.solution.displacement_m[middle + 2], -0.005);
  EXPECT_LT(turned.solution.displacement_m[middle], linear.solution.displacement_m[middle] - 0.001);
  EXPECT_NEAR(turned.reaction_n.z(), 0.2, 1e-8);
  EXPECT_EQ(turned.unknowns, linear.unknowns);
}

}  // namespace
}  // namespace kiroku::sim
