#include "archive/format/event_line.h"

#include <string>

#include <gtest/gtest.h>

namespace kiroku::archive {
namespace {

TEST(EventLine, IsASaltAndAnEventAndNothingElse) {
  const std::string salt = R"("salt":")" + std::string(64, 'a') + '"', event = R"("event":"{}")";
  const auto is_one = [](const std::string& members) {
    return parse_event_line("{" + members + "}").has_value();
  };
  EXPECT_TRUE(is_one(salt + "," + event));
  EXPECT_TRUE(is_one(event + " ,\t" + salt));
  EXPECT_FALSE(is_one(salt));
  EXPECT_FALSE(is_one(event));
  EXPECT_FALSE(is_one(salt + "," + event + R"(,"event":"{\"kind\":\"mark\"}")")) << "two readers, two events";
  EXPECT_FALSE(is_one(salt + "," + salt + "," + event));
  EXPECT_FALSE(is_one(salt + "," + event + R"(,"more":1)"));
  EXPECT_FALSE(is_one(R"("salt":"aa",)" + event)) << "whoever knows the event finds so short a salt";
  EXPECT_FALSE(is_one(R"("salt":")" + std::string(66, 'a') + "\"," + event));
  EXPECT_FALSE(is_one(R"("salt":")" + std::string(64, 'A') + "\"," + event));
  EXPECT_FALSE(is_one(salt + R"(,"event":{})"));
}

}  // namespace
}  // namespace kiroku::archive
