#include "viewer/training/attempt_messages.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using testing::HasSubstr;

std::string refusal(const std::string& text) {
  try {
    (void)parse_page_message(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(AttemptMessages, AreReadAsTheyAreMeant) {
  const auto begin = std::get<BeginMessage>(parse_page_message(
      R"({"begin":{"trainee":"青木","object":"b","fingers":3,"test":true,"expert":false}})"));
  EXPECT_EQ(begin.trainee, "青木");
  EXPECT_EQ(begin.object, "b");
  EXPECT_EQ(begin.fingers, 3U);
  EXPECT_TRUE(begin.test);
  EXPECT_FALSE(begin.press);
  const auto coloured = std::get<BeginMessage>(parse_page_message(
      R"({"begin":{"trainee":"x","object":"a","fingers":1,"test":false,"expert":false,"press":true}})"));
  EXPECT_TRUE(coloured.press);
  EXPECT_EQ(coloured.instrument, "");
  const auto led = std::get<BeginMessage>(parse_page_message(
      R"({"begin":{"trainee":"x","object":"a","fingers":2,"test":false,"expert":false,"instrument":"retractor"}})"));
  EXPECT_EQ(led.instrument, "retractor");
  const auto input = std::get<trainer::PointerInput>(
      parse_page_message(R"({"input":17,"pointers":[{"finger":2,"x":0.5,"y":1,"push_m":-0.01}]})"));
  EXPECT_EQ(input.number, 17U);
  ASSERT_EQ(input.pointers.size(), 1U);
  EXPECT_EQ(input.pointers[0].finger, 2U);
  EXPECT_EQ(input.pointers[0].y, 1);
  EXPECT_EQ(input.pointers[0].push_m, -0.01);
  EXPECT_TRUE(std::holds_alternative<EndMessage>(parse_page_message(R"({"end":true})")));
}

TEST(AttemptMessages, ThatAreNoneAreRefusedInWords) {
  EXPECT_THAT(refusal(""), HasSubstr("JSON object"));
  EXPECT_THAT(refusal("[1]"), HasSubstr("JSON object"));
  EXPECT_THAT(refusal(R"({"input":1)"), HasSubstr("JSON object"));
  EXPECT_THAT(refusal(R"({"stop":1})"), HasSubstr("'begin', 'input' or 'end'"));
  EXPECT_THAT(refusal(R"({"begin":"Aoki"})"), HasSubstr("'begin'"));
  EXPECT_THAT(refusal(R"({"begin":{"trainee":7}})"), HasSubstr("'trainee' must be a text"));
  EXPECT_THAT(refusal(R"({"begin":{"trainee":"x","object":7}})"), HasSubstr("'object' must be a text"));
  EXPECT_THAT(refusal(R"({"begin":{"trainee":"x","object":"a","fingers":-1}})"), HasSubstr("'fingers'"));
  EXPECT_THAT(refusal(R"({"begin":{"trainee":"x","object":"a","fingers":1,"test":1}})"), HasSubstr("'test'"));
  EXPECT_THAT(
      refusal(
          R"({"begin":{"trainee":"x","object":"a","fingers":1,"test":false,"expert":false,"press":"red"}})"),
      HasSubstr("'press' must be true or false"));
  const auto with_instrument = [](const std::string& instrument, bool test, bool expert) {
    return nlohmann::json{{"begin",
                           {{"trainee", "x"},
                            {"object", "a"},
                            {"fingers", 1},
                            {"test", test},
                            {"expert", expert},
                            {"instrument", instrument}}}}
        .dump();
  };
  EXPECT_THAT(refusal(with_instrument("jaws", false, false)),
              HasSubstr("must be 'retractor', or be left out"));
  EXPECT_THAT(refusal(with_instrument("retractor", true, false)), HasSubstr("a test is with fingertips"));
  EXPECT_THAT(refusal(with_instrument("retractor", false, true)),
              HasSubstr("an expert's hand has fingertips"));
  EXPECT_THAT(refusal(R"({"input":1})"), HasSubstr("'pointers' is missing"));
  EXPECT_THAT(refusal(R"({"input":1.5,"pointers":[]})"), HasSubstr("'input'"));
  EXPECT_THAT(refusal(R"({"input":1,"pointers":[1]})"), HasSubstr("object"));
  EXPECT_THAT(refusal(R"({"input":1,"pointers":[{},{},{},{},{},{}]})"), HasSubstr("at most 5"));
  EXPECT_THAT(refusal(R"({"input":1,"pointers":[{"finger":1,"x":"0","y":0,"push_m":0}]})"),
              HasSubstr("'x' must be a number"));
  EXPECT_THAT(refusal(R"({"input":1,"pointers":[{"finger":1,"x":1e999,"y":0,"push_m":0}]})"),
              HasSubstr("JSON"));
}

TEST(AttemptMessages, DamagedOnesAreReadOrRefusedAndNothingElse) {
  const std::string sound =
      R"({"input":17,"pointers":[{"finger":2,"x":0.5,"y":0.25,"push_m":-0.01},{"finger":1,"x":0,"y":1,"push_m":0}]})";
  std::mt19937 random(11);
  int refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::string damaged = sound;
    for (std::uint32_t j = 0; j <= random() % 3; ++j)
      damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
    if (random() % 4 == 0) damaged.resize(random() % damaged.size());
    try {
      (void)parse_page_message(damaged);
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 15'000);
}

}  // namespace
}  // namespace kiroku::viewer
