#include "media/pointing_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::media {
namespace {

TEST(PointingLine, IsWhatTheFormatSays) {
  EXPECT_EQ(
      pointing_line({1'500'000'000, {"Dr. Sato", "guest", "endoscope", 0.41234, 0.6, 1'260'000'000}}),
      "{\"time_ns\":1500000000,\"by\":\"Dr. Sato\",\"role\":\"guest\",\"stream\":\"endoscope\",\"x\":0.4123,"
      "\"y\":0.6,\"picture_ns\":1260000000}\n");
  EXPECT_EQ(pointing_line({7, {"佐藤", "guest", "room", 0, 1, {}}}),
            "{\"time_ns\":7,\"by\":\"佐藤\",\"role\":\"guest\",\"stream\":\"room\",\"x\":0.0,\"y\":1.0}\n");
}

TEST(PointingLine, IsReadAsItWasWritten) {
  const auto line = parse_pointing_line(pointing_line({-5, {"a\"b", "surgeon", "room", 0.25, 0.75, 9}}));
  ASSERT_TRUE(line);
  EXPECT_EQ(line->time_ns, -5);
  EXPECT_EQ(line->at.by, "a\"b");
  EXPECT_EQ(line->at.role, "surgeon");
  EXPECT_EQ(line->at.stream, "room");
  EXPECT_EQ(line->at.x, 0.25);
  EXPECT_EQ(line->at.y, 0.75);
  EXPECT_EQ(line->at.picture_ns, 9);
}

TEST(PointingLine, IsReadWhateverTheOrderOfItsKeysAndTheBlanksBetween) {
  const auto line = parse_pointing_line(
      R"( { "y" : 0.75, "picture_ns":9 ,"x":2.5e-1,"stream":"room",	"role":"surgeon", "by":"anna", "time_ns":5 } )");
  ASSERT_TRUE(line);
  EXPECT_EQ(pointing_line(*line), pointing_line({5, {"anna", "surgeon", "room", 0.25, 0.75, 9}}));
}

TEST(PointingLine, IsNothingElse) {
  for (const char* text :
       {"", "{}", "[1]", R"({"time_ns":1,"by":"a","role":"b","stream":"c","x":0.5})",
        R"({"time_ns":1,"by":"a","role":"b","stream":"c","x":1.5,"y":0})",
        R"({"time_ns":1,"by":"a","role":"b","stream":"c","x":0,"y":-0.1})",
        R"({"time_ns":"1","by":"a","role":"b","stream":"c","x":0,"y":0})", R"({"salt":"00","event":"{}"})"}) {
    EXPECT_FALSE(parse_pointing_line(text)) << text;
  }
}

}  // namespace
}  // namespace kiroku::media
