#include "viewer/kept/sealed_plan.h"

#include <fstream>

#include <gtest/gtest.h>

#include "base/bytes.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::compare {
namespace {

namespace fs = std::filesystem;

class SealedPlan : public testing::Test {
 protected:
  fs::path write(const fs::path& name, const std::string& text) {
    const fs::path file = folder_ / name;
    fs::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << text;
    return file;
  }
  [[nodiscard]] std::optional<fs::path> find(const std::string& text) const {
    return find_sealed_plan(folder_.path(), crypto::sha256(bytes_of(text)));
  }
  test::TemporaryFolder folder_;
};

TEST_F(SealedPlan, IsFoundByItsHashWhereverItLies) {
  write("liver/liver.seal.json", "{}");
  const fs::path kidney = write("2026/08/sato/kidney.seal.json", "kidney");
  EXPECT_EQ(find("kidney"), kidney);
  EXPECT_EQ(find("none"), std::nullopt);
  EXPECT_EQ(find_sealed_plan(folder_ / "absent", {}), std::nullopt);
}

TEST_F(SealedPlan, AreListedWithTheirNames) {
  write("b/liver.seal.json", R"({"plan":"Liver: grasp"})");
  write("a.seal.json", R"({"plan":7})");
  write("broken.seal.json", "{");
  write("plan.json", R"({"plan":"no seal"})");
  const std::vector<SealedPlanFile> all = sealed_plans(folder_.path());
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].name, "");
  EXPECT_EQ(all[1].name, "Liver: grasp");
  EXPECT_EQ(all[1].seal, crypto::sha256(bytes_of(R"({"plan":"Liver: grasp"})")));
  EXPECT_TRUE(sealed_plans(folder_ / "absent").empty());
}

TEST_F(SealedPlan, IsNoOtherFileNoLinkAndNothingFarBelow) {
  write("plan.json", "plan");
  EXPECT_EQ(find("plan"), std::nullopt);
  write("a/b/c/d/deep.seal.json", "deep");
  EXPECT_EQ(find("deep"), std::nullopt);
  const test::TemporaryFolder elsewhere;
  std::ofstream(elsewhere / "far.seal.json") << "far";
  fs::create_symlink(elsewhere / "far.seal.json", folder_ / "far.seal.json");
  fs::create_directory_symlink(elsewhere.path(), folder_ / "all");
  EXPECT_EQ(find("far"), std::nullopt);
}

}  // namespace
}  // namespace kiroku::compare
