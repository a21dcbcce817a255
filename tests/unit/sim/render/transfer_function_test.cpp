#include "sim/render/transfer_function.h"

#include <cmath>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::sim {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string refusal(const std::string& text) {
  try {
    parse_transfer_function(text, "mine.json");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

std::string with_points(const std::string& points) {
  return R"({"name": "Mine", "points": [)" + points + "]}";
}

const TransferFunction::Entry& entry(const TransferFunction& function, int hu) {
  return function.entries[static_cast<std::size_t>(hu - kLeastHu)];
}

TEST(TransferFunction, RunsStraightBetweenItsPointsAndStaysBeyondThem) {
  const TransferFunction function =
      parse_transfer_function(with_points(R"({"hu": 0, "color": "#000000", "opacity_per_mm": 0},
                                             {"hu": 100, "color": "#ff8000", "opacity_per_mm": 0.5})"),
                              "mine.json");
  EXPECT_FLOAT_EQ(entry(function, 50).colour[0], 0.5F);
  EXPECT_FLOAT_EQ(entry(function, 50).colour[1], 64.0F / 255);
  // Half of the way to 0.5: three quarters of the light come through 1 mm.
  EXPECT_NEAR(std::exp2(-entry(function, 50).extinction_per_mm), 0.75, 1e-6);
  EXPECT_NEAR(std::exp2(-entry(function, 3071).extinction_per_mm), 0.5, 1e-6);
  EXPECT_EQ(entry(function, -1024).extinction_per_mm, 0);
  EXPECT_THAT(function.visible_hu(), ElementsAre(1, 3071));
}

TEST(TransferFunction, SaysWhetherARangeCanBeSeen) {
  const TransferFunction function =
      parse_transfer_function(with_points(R"({"hu": 99, "color": "#ffffff", "opacity_per_mm": 0},
                                             {"hu": 100, "color": "#ffffff", "opacity_per_mm": 1},
                                             {"hu": 101, "color": "#ffffff", "opacity_per_mm": 0})"),
                              "mine.json");
  EXPECT_TRUE(function.shows(-2000, 5000));
  EXPECT_TRUE(function.shows(99.6, 99.7)) << "rounded to 100";
  EXPECT_FALSE(function.shows(-1000, 90));
  EXPECT_FALSE(function.shows(110, 4000));
}

TEST(TransferFunction, ComesWithThoseOfTheOrgansWhichShowTheirTissue) {
  EXPECT_THAT(transfer_function_names(), ElementsAre("bone", "kidney", "liver", "lung", "skin", "vessels"));
  const std::vector<std::pair<std::string, int>> typical{{"bone", 700},  {"kidney", 120}, {"liver", 60},
                                                         {"lung", -700}, {"skin", 20},    {"vessels", 300}};
  for (const auto& [name, hu] : typical) {
    const TransferFunction function = find_transfer_function(name);
    EXPECT_GT(entry(function, hu).extinction_per_mm, 0) << name;
    EXPECT_EQ(entry(function, -1000).extinction_per_mm, 0) << name << " shows air";
  }
}

TEST(TransferFunction, IsReadFromAnEditedFile) {
  const test::TemporaryFolder folder;
  std::ofstream(folder / "mine.json") << transfer_function_text("liver");
  EXPECT_EQ(find_transfer_function((folder / "mine.json").string()).name, "Liver");
  EXPECT_THROW(find_transfer_function((folder / "absent.json").string()), IoError);
  try {
    find_transfer_function("spleen");
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("there are bone, kidney, liver, lung, skin, vessels"));
  }
}

TEST(TransferFunction, RefusesWhatHidesEverything) {
  EXPECT_THAT(refusal(with_points(R"({"hu": 0, "color": "#ffffff", "opacity_per_mm": 0})")),
              HasSubstr("mine.json: points hides everything"));
}

TEST(TransferFunction, RefusesWithTheFileAndTheJsonPath) {
  const std::string good = R"({"hu": 0, "color": "#ffffff", "opacity_per_mm": 1})";
  EXPECT_EQ(refusal(with_points(good)), "");
  EXPECT_THAT(refusal("{"), HasSubstr("mine.json"));
  EXPECT_THAT(refusal(with_points("")), HasSubstr("points must have at least one"));
  EXPECT_THAT(refusal(with_points(good + "," + good)), HasSubstr("points[1].hu must be greater"));
  EXPECT_THAT(refusal(with_points(R"({"hu": 0, "color": "red", "opacity_per_mm": 1})")),
              HasSubstr("points[0].color is 'red'"));
  EXPECT_THAT(refusal(with_points(R"({"hu": 0, "color": "#ffffff", "opacity_per_mm": 1.5})")),
              HasSubstr("points[0].opacity_per_mm must be from 0 to 1"));
  EXPECT_THAT(refusal(with_points(R"({"hu": 0, "colour": "#ffffff", "opacity_per_mm": 1})")),
              HasSubstr("colour"));
  EXPECT_THAT(refusal(R"({"name": "Mine", "points": [)" + good + R"(], "light": {"shininess": 0}})"),
              HasSubstr("light.shininess must be from 1 to 1000"));
  EXPECT_THAT(
      refusal(R"({"name": "Mine", "points": [)" + good + R"(], "light": {"edge_hu_per_mm": [5, 5]}})"),
      HasSubstr("light.edge_hu_per_mm must be two numbers"));
}

}  // namespace
}  // namespace kiroku::sim
