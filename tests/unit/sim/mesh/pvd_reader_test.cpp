#include "sim/mesh/pvd_reader.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

std::string list(const std::string& frames) {
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\"><Collection>" + frames +
         "</Collection></VTKFile>";
}
std::string frame(const std::string& time, const std::string& file) {
  return "<DataSet timestep=\"" + time + "\" file=\"" + file + "\"/>";
}
std::string refusal(const std::string& text) {
  try {
    parse_pvd(text, "run/list.pvd");
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(PvdReader, GivesFramesWithTheirTimes) {
  const std::vector<ListedFrame> frames = parse_pvd(
      list(frame("-0.5", "frames/00000.vtu") + frame("1e-1", "./frames/00001.vtu")), "run/list.pvd");
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0].time_s, -0.5);
  EXPECT_EQ(frames[1].time_s, 0.1);
  EXPECT_EQ(frames[1].file, "run/frames/00001.vtu");
}

TEST(PvdReader, RefusesInASentence) {
  EXPECT_THAT(refusal("solid"), HasSubstr("run/list.pvd: it is no list of frames"));
  EXPECT_THAT(refusal(list(frame("0", "a.vtu")).substr(0, 90)), HasSubstr("cut off"));
  EXPECT_THAT(refusal(list("")), HasSubstr("it lists no frames"));
  EXPECT_THAT(refusal(list(frame("1", "a.vtu") + frame("1", "b.vtu"))),
              HasSubstr("at 1 s follows one at 1 s"));
  EXPECT_THAT(refusal(list(frame("1s", "a.vtu"))), HasSubstr("the time step of 'a.vtu' is '1s', no number"));
  EXPECT_THAT(refusal(list(frame("nan", "a.vtu"))), HasSubstr("no number"));
  for (const char* outside : {"../a.vtu", "/etc/passwd", "frames/../../a.vtu", ""})
    EXPECT_THAT(refusal(list(frame("1", outside))), HasSubstr("not below the list's folder")) << outside;
}

}  // namespace
}  // namespace kiroku::sim
