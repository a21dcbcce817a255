// The document of a breathing lung: what it means, and what is refused with its place.
#include "sim/respiration/breathing_model.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/model/body_model.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/sim/respiration/box_lung.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

class BreathingDocument : public testing::Test {
 protected:
  BreathingDocument() {
    write("lung.msh", msh_text(test::box_lung_model().mesh, LengthUnit::kMillimetre));
    write("rpm.csv", "time_s,amplitude\n0,1\n1,2\n2,1\n3,0\n4,1\n");
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_.path() / name, std::ios::binary) << text;
  }
  [[nodiscard]] BreathingModel read(const std::string& rest) const {
    write("lung.json", R"({"mesh": "lung.msh", "length_unit": "mm", "lung": "right")" + rest + "}");
    return read_breathing_model(folder_.path() / "lung.json");
  }
  [[nodiscard]] std::string refusal(const std::string& rest) const {
    try {
      static_cast<void>(read(rest));
    } catch (const Error& error) {
      return error.what();
    }
    return "taken";
  }
  test::TemporaryFolder folder_;
};

TEST_F(BreathingDocument, HasTheSourcesMaterialsCycleAndPhase) {
  const BreathingModel model = read(R"(, "tumour": {"region": 2})");
  EXPECT_EQ(model.materials.at(1).young_modulus_pa, 1e4);
  EXPECT_EQ(model.materials.at(1).poisson_ratio, 0.25);
  EXPECT_EQ(model.materials.at(2).young_modulus_pa, 1e6);
  EXPECT_EQ(model.waveform.duration_s(), 3.6);
  EXPECT_EQ(model.motion.diaphragm.phase_s, 0.6);
  EXPECT_EQ(model.phases, 36U);
  EXPECT_EQ(model.times_s().size(), 36U);
  EXPECT_NEAR(model.times_s().back(), 3.5, 1e-12);
  EXPECT_EQ(model.slide, Vector3(0, 0, 1));
  EXPECT_FALSE(read("").tumour);
  EXPECT_EQ(read("").materials.at(2).young_modulus_pa, 1e4);
}

TEST_F(BreathingDocument, SaysHowBothGroupsMove) {
  const BreathingModel model = read(
      R"(, "breathing": {"cycle_s": 4, "rib_cage": {"amplitude": 5, "phase_s": 0.2, "direction": [0, -2, 0]},
         "diaphragm": {"amplitude": 12, "direction": "normal"}}, "phases": 8, "slide": [0, 0, 3])");
  EXPECT_NEAR(model.motion.rib_cage.amplitude_m, 0.005, 1e-15);
  EXPECT_EQ(*model.motion.rib_cage.direction, Vector3(0, -1, 0));
  EXPECT_FALSE(model.motion.diaphragm.direction);
  EXPECT_EQ(model.waveform.duration_s(), 4);
  EXPECT_EQ(model.times_s()[1], 0.5);
}

TEST_F(BreathingDocument, TakesTracesAndBreaths) {
  EXPECT_EQ(read(R"(, "breathing": {"trace": "rpm.csv"})").waveform.duration_s(), 4);
  const BreathingModel model = read(
      R"(, "breathing": {"breaths": [{"duration_s": 3, "depth": 1.2}, {"duration_s": 4, "baseline": 0.1}]})");
  EXPECT_EQ(model.waveform.duration_s(), 7);
  EXPECT_NEAR(model.times_s().back(), 7, 1e-12);
}

TEST_F(BreathingDocument, ATumourMayBeABall) {
  const BreathingModel model = read(R"(, "tumour": {"ball": {"center": [-70, 50, 150], "radius": 30}})");
  ASSERT_TRUE(model.tumour);
  const std::int32_t region = model.mesh.regions[model.tumour->tetrahedra.front()];
  EXPECT_EQ(model.materials.at(region).young_modulus_pa, 1e6);
  EXPECT_EQ(region, 3);
}

TEST_F(BreathingDocument, GroupsAreChangedInTheirOrder) {
  const BreathingModel model = read(
      R"(, "groups": [{"group": "free", "box": [[-121, -1, -1], [-19, 151, 1]]}, {"group": "diaphragm", "nodes": [0]}])");
  for (std::size_t node = 0; node < model.mesh.nodes.size(); ++node) {
    if (model.mesh.nodes[node].z() > 1e-9) continue;
    EXPECT_EQ(model.groups[node], node == 0 ? BoundaryGroup::kDiaphragm : BoundaryGroup::kFree);
  }
}

TEST_F(BreathingDocument, WhatIsWrongIsToldWithItsPlace) {
  EXPECT_THAT(refusal(R"(, "tumor": {"region": 2})"), HasSubstr("tumor"));
  EXPECT_THAT(refusal(R"(, "tumour": {"region": 9})"),
              HasSubstr("tumour cannot be found: nothing of the mesh is of region 9"));
  EXPECT_THAT(refusal(R"(, "tumour": {})"), HasSubstr("tumour must have either 'region' or 'ball'"));
  EXPECT_THAT(refusal(R"(, "tumour": {"ball": {"center": [0, 0, 900], "radius": 5}})"),
              HasSubstr("tumour cannot be found: no element of the mesh has its centre within 5 mm"));
  EXPECT_THAT(
      refusal(R"(, "groups": [{"group": "ribs", "nodes": [0]}])"),
      HasSubstr("groups[0].group is 'ribs': it must be one of free, rib_cage, diaphragm, trachea, back"));
  EXPECT_THAT(refusal(R"(, "breathing": {"cycle_s": 0})"),
              HasSubstr("breathing.cycle_s is 0: it must be from 0.2"));
  EXPECT_THAT(refusal(R"(, "breathing": {"cycle_s": 3, "trace": "rpm.csv"})"),
              HasSubstr("must have only one of"));
  EXPECT_THAT(refusal(R"(, "breathing": {"rib_cage": {"amplitude": 900}})"),
              HasSubstr("it must be from -200 to 200"));
  EXPECT_THAT(refusal(R"(, "breathing": {"rib_cage": {"direction": [0, 0, 0]}})"),
              HasSubstr("which is no direction"));
  EXPECT_THAT(refusal(R"(, "breathing": {"rib_cage": {"direction": "out"}})"),
              HasSubstr("must be \"normal\" or [x, y, z]"));
  EXPECT_THAT(refusal(R"(, "phases": 1)"), HasSubstr("phases is 1"));
  EXPECT_THAT(refusal(R"(, "breathing": {"trace": "none.csv"})"), HasSubstr("none.csv"));
  EXPECT_THAT(refusal(R"(, "labels": "none.nii.gz")"), HasSubstr("none.nii.gz"));
  write("rpm.csv", "time_s,amplitude\n0,1\n2,2\n1,1\n");
  EXPECT_THAT(refusal(R"(, "breathing": {"trace": "rpm.csv"})"), HasSubstr("line 4: it is not later"));
}

TEST_F(BreathingDocument, AFittedMotionIsWrittenIntoTheSameDocument) {
  const BreathingModel model = read(R"(, "name": "kept", "breathing": {"trace": "rpm.csv"})");
  EXPECT_THAT(files_of(model, folder_.path() / "lung.json"),
              testing::ElementsAre(folder_.path() / "lung.msh", folder_.path() / "rpm.csv"));
  // What was read counts, whatever is there by now.
  write("lung.json", "another");
  std::filesystem::create_directory(folder_.path() / "fitted");
  const BreathingMotion motion{{0.0042, 0.3, std::nullopt}, {0.011, 0.75, Vector3(0, 0, -1)}};
  write("fitted/lung.json",
        with_motion(model, folder_.path() / "lung.json", motion, folder_.path() / "fitted"));
  const BreathingModel again = read_breathing_model(folder_.path() / "fitted/lung.json");
  EXPECT_NEAR(again.motion.rib_cage.amplitude_m, 0.0042, 1e-15);
  EXPECT_EQ(again.motion.rib_cage.phase_s, 0.3);
  EXPECT_FALSE(again.motion.rib_cage.direction);
  EXPECT_NEAR(again.motion.diaphragm.amplitude_m, 0.011, 1e-15);
  EXPECT_EQ(*again.motion.diaphragm.direction, Vector3(0, 0, -1));
  EXPECT_EQ(again.waveform.duration_s(), 4);
  EXPECT_THAT(read_document(folder_.path() / "fitted/lung.json"), HasSubstr("\"name\": \"kept\""));
}

TEST_F(BreathingDocument, GroupsThatWerePaintedAreWrittenAfterThoseThatItHas) {
  const BreathingModel model = read(R"(, "groups": [{"group": "free", "nodes": [0]}])");
  BoundaryGroups groups = model.groups;
  std::vector<std::size_t> surface;
  for (std::size_t node = 0; node < groups.size(); ++node) {
    if (groups[node] != BoundaryGroup::kInside) surface.push_back(node);
  }
  groups[surface.front()] = BoundaryGroup::kDiaphragm;  // node 0, which the document has said is free
  groups[surface.back()] = BoundaryGroup::kFree;
  groups[surface[surface.size() / 2]] = BoundaryGroup::kTrachea;
  ASSERT_EQ(surface.front(), 0U);
  const auto written = [&](const BreathingModel& from, const BoundaryGroups& to) {
    write("painted.json",
          with_motion(from, folder_.path() / "lung.json", from.motion, folder_.path(), {}, to));
    return read_breathing_model(folder_.path() / "painted.json");
  };
  const BreathingModel painted = written(model, groups);
  EXPECT_EQ(painted.groups, groups);
  EXPECT_EQ(written(painted, model.groups).groups, model.groups) << "and back, above what was painted";
  // What is as it was needs no entry.
  const BreathingModel plain = read("");
  written(plain, plain.groups);
  EXPECT_THAT(read_document(folder_.path() / "painted.json"), testing::Not(HasSubstr("groups")));
}

}  // namespace
}  // namespace kiroku::sim
