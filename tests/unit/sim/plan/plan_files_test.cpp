// Which files a plan is made of, of both kinds.
#include "sim/plan/plan_files.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace kiroku::sim {
namespace {

using testing::ElementsAre;

class PlanFiles : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  [[nodiscard]] std::vector<std::string> roles() const {
    std::vector<std::string> roles;
    for (const PlanFile& file : files_of_plan(folder_ / "plan.json", data_file_of_))
      roles.push_back(file.role + " " + file.name);
    return roles;
  }
  test::TemporaryFolder folder_;
  DataFileOf data_file_of_ = [](const std::filesystem::path& file) {
    return file.extension() == ".mhd" ? std::optional<std::string>("voxels.raw") : std::nullopt;
  };
};

TEST_F(PlanFiles, OfABreathingLungAreItsMeshLabelsAndTrace) {
  for (const char* const name : {"lung.msh", "labels.nii.gz", "rpm.csv"}) write(name, name);
  write(
      "plan.json",
      R"({"mesh": "lung.msh", "length_unit": "mm", "labels": "labels.nii.gz", "breathing": {"trace": "rpm.csv"}})");
  EXPECT_EQ(kind_of_plan(folder_ / "plan.json"), PlanKind::kBreathing);
  EXPECT_THAT(roles(),
              ElementsAre("plan plan.json", "mesh lung.msh", "labels labels.nii.gz", "trace rpm.csv"));
}

TEST_F(PlanFiles, OfAVolumeInTwoFilesAreBoth) {
  std::filesystem::create_directory(folder_ / "ct");
  for (const char* const name : {"ct/block.mhd", "ct/voxels.raw", "l.mhd", "voxels.raw"}) write(name, name);
  write(
      "plan.json",
      R"({"mesh": {"organ": "liver", "labels": "l.mhd"}, "volume": "ct/block.mhd", "length_unit": "mm", "steps": []})");
  EXPECT_THAT(roles(), ElementsAre("plan plan.json", "labels l.mhd", "labels voxels.raw",
                                   "volume ct/block.mhd", "volume ct/voxels.raw"));
}

TEST_F(PlanFiles, WhatHasStepsOrIsNoDocumentIsAnOperation) {
  write("lung.msh", "mesh");
  write("plan.json", R"({"mesh": "lung.msh", "length_unit": "mm", "breathing": {}, "steps": []})");
  EXPECT_EQ(kind_of_plan(folder_ / "plan.json"), PlanKind::kSteps);
  write("plan.json", R"({"mesh": "lung.msh", "length_unit": "mm"})");
  EXPECT_EQ(kind_of_plan(folder_ / "plan.json"), PlanKind::kSteps);
  EXPECT_THAT(roles(), ElementsAre("plan plan.json", "mesh lung.msh"));
  write("plan.json", "[1, 2");
  EXPECT_EQ(kind_of_plan(folder_ / "plan.json"), PlanKind::kSteps);
  EXPECT_EQ(kind_of_plan(folder_ / "nothing.json"), PlanKind::kSteps);
}

}  // namespace
}  // namespace kiroku::sim
