#include "viewer/http/router.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "viewer/http/role.h"

namespace kiroku::viewer {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

constexpr const char* kPiece = "api/cases/{case:case}/streams/{stream:name}/pieces/{piece:number}.mp4";

class RouterTest : public testing::Test {
 protected:
  RouterTest() {
    const auto nothing = [](const Request& /*request*/) { return Response::nothing(); };
    router.add("GET", kPiece, Right::kWatch, nothing);
    router.add("GET", "api/users", Right::kManageUsers, nothing);
    router.add("POST", "api/users", Right::kManageUsers, nothing);
    router.add("DELETE", "api/users/{user:text}", Right::kManageUsers, nothing);
  }
  [[nodiscard]] Router::Match piece(const std::string& id, const std::string& stream,
                                    const std::string& file) const {
    return router.match("GET", {"api", "cases", id, "streams", stream, "pieces", file});
  }
  Router router;
};

TEST_F(RouterTest, FindsARouteAndItsParameters) {
  const Router::Match match = piece("20260805T091502Z-3f9c21ab", "endoscope", "17.mp4");
  ASSERT_NE(match.route, nullptr);
  EXPECT_EQ(match.route->pattern, kPiece);
  EXPECT_THAT(match.parameters, ElementsAre(Pair("case", "20260805T091502Z-3f9c21ab"), Pair("piece", "17"),
                                            Pair("stream", "endoscope")));
}

TEST_F(RouterTest, KnowsNoAddressWhoseParametersAreNotOfTheirKind) {
  const std::string id = "20260805T091502Z-3f9c21ab";
  EXPECT_EQ(piece("20260805T091502Z-3F9C21AB", "endoscope", "1.mp4").route, nullptr);
  EXPECT_NE(piece("or-1~" + id, "endoscope", "1.mp4").route, nullptr);
  for (const char* appliance : {"~", "OR~", "..~", "or-1~or-1~", "or 1~"})
    EXPECT_EQ(piece(appliance + id, "endoscope", "1.mp4").route, nullptr) << appliance;
  EXPECT_EQ(piece("log", "endoscope", "1.mp4").route, nullptr);
  EXPECT_EQ(piece(id, "Endoscope", "1.mp4").route, nullptr);
  EXPECT_EQ(piece(id, ".hidden", "1.mp4").route, nullptr);
  for (const char* file :
       {"1", ".mp4", "-1.mp4", "01.mp4", "1e3.mp4", "+1.mp4", "9223372036854775808.mp4", "1.mp4.mp4"}) {
    EXPECT_EQ(piece(id, "endoscope", file).route, nullptr) << file;
  }
  EXPECT_NE(piece(id, "endoscope", "9223372036854775807.mp4").route, nullptr);
  EXPECT_EQ(router.match("DELETE", {"api", "users", std::string(129, 'x')}).route, nullptr);
}

TEST_F(RouterTest, HasNoWebSocketForEverybody) {
  const SocketOpener opener = [](const Request& /*request*/,
                                 const std::shared_ptr<SocketOutput>& /*output*/) {
    return std::unique_ptr<SocketHandler>();
  };
  EXPECT_THROW(router.add_socket("api/open", Right::kNone, opener), std::invalid_argument);
  router.add_socket("api/live", Right::kSeeLive, opener);
  const Router::Match match = router.match("GET", {"api", "live"});
  ASSERT_NE(match.route, nullptr);
  EXPECT_TRUE(match.route->socket);
  EXPECT_EQ(match.route->right, Right::kSeeLive);
}

TEST_F(RouterTest, TellsWhichMethodsAnAddressKnows) {
  const Router::Match match = router.match("PUT", {"api", "users"});
  EXPECT_EQ(match.route, nullptr);
  EXPECT_THAT(match.allowed, ElementsAre("GET", "POST"));
  EXPECT_THAT(router.match("GET", {"api", "nothing"}).allowed, IsEmpty());
}

TEST_F(RouterTest, RefusesPatternsThatAreMalformedOrThere) {
  const auto add = [&](const char* pattern) {
    router.add("GET", pattern, Right::kNone, [](const Request& /*request*/) { return Response::nothing(); });
  };
  EXPECT_THROW(add("api/users"), std::invalid_argument);
  EXPECT_THROW(add("api/{user}"), std::invalid_argument);
  EXPECT_THROW(add("api/{user:emperor}"), std::invalid_argument);
}

TEST(Roles, MayDoWhatTheDocumentSays) {
  const auto rights_of = [](Role role) {
    std::vector<std::string> rights;
    for (const Right right :
         {Right::kListCases, Right::kReadCase, Right::kWatch, Right::kCompare, Right::kPlan, Right::kTrain,
          Right::kVerify, Right::kReadLog, Right::kSeeLive, Right::kControlRooms, Right::kManageUsers}) {
      if (may(role, right)) rights.emplace_back(right_name(right));
    }
    return rights;
  };
  EXPECT_THAT(rights_of(Role::kOperator), ElementsAre("list-cases", "train", "see-live", "control-rooms"));
  EXPECT_THAT(rights_of(Role::kSurgeon), ElementsAre("list-cases", "read-case", "watch", "compare", "plan",
                                                     "train", "verify", "see-live", "control-rooms"));
  EXPECT_THAT(rights_of(Role::kAuditor),
              ElementsAre("list-cases", "read-case", "train", "verify", "read-log"));
  EXPECT_THAT(rights_of(Role::kAdministrator),
              ElementsAre("list-cases", "read-case", "watch", "compare", "plan", "train", "verify",
                          "read-log", "see-live", "control-rooms", "manage-users"));
}

TEST(Roles, HaveNamesThatAreReadBack) {
  for (const Role role : {Role::kOperator, Role::kSurgeon, Role::kAuditor, Role::kAdministrator}) {
    EXPECT_EQ(parse_role(role_name(role)), role);
  }
  EXPECT_EQ(parse_role("root"), std::nullopt);
}

}  // namespace
}  // namespace kiroku::viewer
