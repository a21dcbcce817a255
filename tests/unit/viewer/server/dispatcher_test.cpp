#include "viewer/server/dispatcher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace kiroku::viewer {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Pair;

using Headers = std::map<std::string, std::string, std::less<>>;

class DispatcherTest : public testing::Test {
 protected:
  DispatcherTest() {
    add("GET", "api/public", Right::kNone, [](const Request& /*request*/) { return Response::nothing(); });
    add("POST", "api/public", Right::kNone,
        [](const Request& request) { return Response::text(request.body, "text/plain"); });
    add("GET", "api/cases", Right::kListCases,
        [](const Request& request) { return Response::text(request.session->user(), "text/plain"); });
    add("GET", "api/users", Right::kManageUsers,
        [](const Request& /*request*/) { return Response::nothing(); });
    add("POST", "api/users", Right::kManageUsers,
        [](const Request& /*request*/) { return Response::nothing(); });
    add("GET", "api/bytes", Right::kNone, [](const Request& /*request*/) {
      Response response = Response::bytes(to_bytes("0123456789"), "application/octet-stream");
      response.entity_tag = "\"tag\"";
      return response;
    });
    add("GET", "api/fails/{how:name}", Right::kNone, [](const Request& request) -> Response {
      const std::string& how = request.parameter("how");
      if (how == "refusal") throw Refusal(423, "locked");
      if (how == "usage") throw UsageError("no such stream");
      if (how == "error") throw Error("none of the identities fits");
      if (how == "io") throw IoError("read", "/srv/secret/path", 5);
      throw std::runtime_error("a detail");
    });
  }
  void add(const char* method, const char* pattern, Right right, Handler handler) {
    router.add(method, pattern, right, std::move(handler));
  }
  Response ask(const std::string& method, const std::string& target, Headers headers = {},
               const std::string& body = "") {
    headers.try_emplace("host", "or-3:8443");
    if (!body.empty()) headers.try_emplace("content-length", std::to_string(body.size()));
    auto admission = dispatcher.admit({method, target, "192.0.2.7", std::move(headers)});
    if (admission.refusal) return std::move(*admission.refusal);
    admission.request.body = body;
    return dispatcher.answer(admission);
  }
  std::string signed_in(Role role) {
    return std::string(kSessionCookie) + "=" + sessions.open("anna", role, {}).token;
  }
  static std::string text_of_body(const Response& response) {
    if (const auto* bytes = std::get_if<BytesBody>(&response.body)) {
      return std::string(text_of(*bytes->bytes).substr(bytes->offset, bytes->size));
    }
    return std::get<std::string>(response.body);
  }

  Router router;
  SessionStore sessions;
  StaticFiles page;
  std::vector<std::string> told;
  Dispatcher dispatcher{router, sessions, page,
                        [this](const std::string& sentence) { told.push_back(sentence); }};
};

TEST_F(DispatcherTest, TellsAStrangerNothingNotEvenWhatThereIs) {
  for (const char* target : {"/api/cases", "/api/users", "/api/absent", "/api", "/api/cases/x/y/z"}) {
    EXPECT_EQ(ask("GET", target).status, 401) << target;
    EXPECT_EQ(ask("PUT", target).status, 401) << target;
  }
  EXPECT_EQ(ask("GET", "/api/cases", {{"cookie", "__Host-kiroku=forged"}}).status, 401);
  EXPECT_EQ(ask("GET", "/api/public").status, 204);
}

TEST_F(DispatcherTest, LetsARoleDoWhatItMay) {
  const Headers cookie{{"cookie", signed_in(Role::kOperator)}};
  EXPECT_EQ(text_of_body(ask("GET", "/api/cases", cookie)), "anna");
  EXPECT_EQ(ask("GET", "/api/users", cookie).status, 403);
  EXPECT_EQ(ask("GET", "/api/absent", cookie).status, 404);
  const Response refused = ask("DELETE", "/api/users", cookie);
  EXPECT_EQ(refused.status, 405);
  EXPECT_THAT(refused.headers, Contains(Pair("Allow", "GET, POST")));
}

TEST_F(DispatcherTest, ChangesNothingWithoutTheHeaderThatOtherSitesCannotSend) {
  Headers headers{{"cookie", signed_in(Role::kAdministrator)}};
  EXPECT_EQ(ask("POST", "/api/users", headers).status, 403);
  headers["x-kiroku-request"] = "yes";
  EXPECT_EQ(ask("POST", "/api/users", headers).status, 403);
  headers["x-kiroku-request"] = "1";
  EXPECT_EQ(ask("POST", "/api/users", headers).status, 204);
}

TEST_F(DispatcherTest, AnswersNoOtherSite) {
  Headers headers{{"cookie", signed_in(Role::kAdministrator)}, {"x-kiroku-request", "1"}};
  for (const char* origin : {"https://evil.example", "null", "http://or-3:8443", "https://or-3"}) {
    headers["origin"] = origin;
    EXPECT_EQ(ask("POST", "/api/users", headers).status, 403) << origin;
    EXPECT_EQ(ask("GET", "/api/users", headers).status, 403) << origin;
  }
  headers["origin"] = "https://or-3:8443";
  EXPECT_EQ(ask("POST", "/api/users", headers).status, 204);
  for (const char* site : {"cross-site", "same-site"}) {
    headers["sec-fetch-site"] = site;
    EXPECT_EQ(ask("GET", "/api/users", headers).status, 403) << site;
  }
  headers["sec-fetch-site"] = "same-origin";
  EXPECT_EQ(ask("GET", "/api/users", headers).status, 204);
}

TEST_F(DispatcherTest, TakesJsonAlone) {
  Headers headers{{"x-kiroku-request", "1"}, {"content-type", "text/plain"}};
  EXPECT_EQ(ask("POST", "/api/public", headers, "{}").status, 415);
  headers["content-type"] = "application/json; charset=utf-8";
  EXPECT_EQ(text_of_body(ask("POST", "/api/public", headers, "{}")), "{}");
  headers["content-type"] = "application/jsonx";
  EXPECT_EQ(ask("POST", "/api/public", headers, "{}").status, 415);
}

TEST_F(DispatcherTest, LimitsABodyByItsRouteAndTakesNoneWithGet) {
  const auto limit = [&](const char* method) {
    return dispatcher
        .admit({method, "/api/public", "192.0.2.7", {{"host", "or-3"}, {"x-kiroku-request", "1"}}})
        .body_limit;
  };
  EXPECT_EQ(limit("POST"), kUsualBodyLimit);
  EXPECT_EQ(limit("GET"), 0U);
}

TEST_F(DispatcherTest, RefusesWhatIsMalformed) {
  EXPECT_EQ(ask("GET", "/api/../etc/passwd").status, 400);
  EXPECT_EQ(ask("GET", "/api/%2e%2e/x").status, 400);
  EXPECT_EQ(dispatcher.admit({"GET", "/api/public", "192.0.2.7", {}}).refusal->status, 400);
  EXPECT_EQ(ask("POST", "/").status, 405);
  EXPECT_EQ(ask("GET", "/").status, 404);
}

TEST_F(DispatcherTest, TurnsErrorsIntoSentencesAndTellsNoInnards) {
  EXPECT_EQ(ask("GET", "/api/fails/refusal").status, 423);
  EXPECT_EQ(ask("GET", "/api/fails/usage").status, 400);
  EXPECT_THAT(text_of_body(ask("GET", "/api/fails/usage")), HasSubstr("no such stream"));
  EXPECT_EQ(ask("GET", "/api/fails/error").status, 409);
  EXPECT_TRUE(told.empty());
  for (const char* how : {"io", "other"}) {
    const Response response = ask("GET", std::string("/api/fails/") + how);
    EXPECT_EQ(response.status, 500);
    EXPECT_THAT(text_of_body(response),
                testing::Not(testing::AnyOf(HasSubstr("secret"), HasSubstr("detail"))));
  }
  EXPECT_EQ(told.size(), 2U);
}

TEST_F(DispatcherTest, PutsTheSecurityHeadersOnEveryAnswer) {
  for (const Response& response :
       {ask("GET", "/"), ask("GET", "/api/cases"), ask("GET", "/api/public"), ask("GET", "/api/fails/io"),
        ask("GET", "/api/bytes", {{"range", "bytes=99-"}}), Dispatcher::refuse(431, "too large")}) {
    for (const char* name : {"Content-Security-Policy", "Strict-Transport-Security", "X-Content-Type-Options",
                             "X-Frame-Options", "Referrer-Policy", "Cross-Origin-Opener-Policy",
                             "Cross-Origin-Resource-Policy", "Permissions-Policy"}) {
      EXPECT_THAT(response.headers, Contains(Pair(name, testing::Ne("")))) << response.status;
    }
    for (const auto& [name, value] : response.headers)
      EXPECT_EQ(value.find("unsafe"), std::string::npos) << name;
    EXPECT_EQ(response.cache, "no-store");
  }
}

TEST_F(DispatcherTest, AnswersRangesAndConditions) {
  const Response part = ask("GET", "/api/bytes", {{"range", "bytes=2-4"}});
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(text_of_body(part), "234");
  EXPECT_THAT(part.headers, Contains(Pair("Content-Range", "bytes 2-4/10")));
  const Response beyond = ask("GET", "/api/bytes", {{"range", "bytes=10-"}});
  EXPECT_EQ(beyond.status, 416);
  EXPECT_THAT(beyond.headers, Contains(Pair("Content-Range", "bytes */10")));
  EXPECT_EQ(ask("GET", "/api/bytes", {{"if-none-match", "\"tag\""}, {"range", "bytes=2-4"}}).status, 304);
  EXPECT_EQ(ask("GET", "/api/bytes", {{"if-range", "\"tag\""}, {"range", "bytes=2-4"}}).status, 206);
  EXPECT_EQ(ask("GET", "/api/bytes", {{"if-range", "\"old\""}, {"range", "bytes=2-4"}}).status, 200);
  EXPECT_EQ(text_of_body(ask("HEAD", "/api/bytes")), "0123456789");
}

TEST_F(DispatcherTest, TellsWhyAStreamBroke) {
  add("GET", "api/stream", Right::kNone, [](const Request& /*request*/) {
    return Response::stream([](Bytes& /*into*/) -> bool { throw Error("the disk is gone"); }, "video/mp4");
  });
  const Response response = ask("GET", "/api/stream");
  Bytes into;
  EXPECT_THROW(std::get<StreamBody>(response.body)(into), Error);
  EXPECT_THAT(told, Contains(HasSubstr("the disk is gone")));
}

TEST_F(DispatcherTest, DoesNothingForASessionThatEndedAfterTheHead) {
  int done = 0;
  add("POST", "api/deed", Right::kManageUsers, [&done](const Request& /*request*/) {
    ++done;
    return Response::nothing();
  });
  add("POST", "api/costly", Right::kManageUsers, [&done](const Request& /*request*/) {
    return Response::later({.work =
                                [&done] {
                                  ++done;
                                  return Response::nothing();
                                },
                            .goes_first = true,
                            .who = "anna"});
  });
  const auto admitted = [&](const std::string& target) {
    Headers headers{{"host", "or-3:8443"}, {"cookie", signed_in(Role::kAdministrator)}};
    headers.emplace("x-kiroku-request", "1");
    auto admission = dispatcher.admit({"POST", target, "192.0.2.7", std::move(headers)});
    EXPECT_FALSE(admission.refusal);
    return admission;
  };
  auto lasting = admitted("/api/deed");
  EXPECT_EQ(dispatcher.answer(lasting).status, 204);
  EXPECT_EQ(done, 1);
  auto slow = admitted("/api/deed");
  slow.request.session->end();  // while its body came
  EXPECT_EQ(dispatcher.answer(slow).status, 401);
  EXPECT_EQ(done, 1);
  auto waiting = admitted("/api/costly");
  Response response = dispatcher.answer(waiting);
  ASSERT_TRUE(response.costly);
  waiting.request.session->end();  // while others' work was done
  EXPECT_EQ(response.costly->work().status, 401);
  EXPECT_EQ(done, 1);
  // Whoever needs no session is answered as before.
  auto stranger = admitted("/api/public");
  stranger.request.session->end();
  EXPECT_EQ(dispatcher.answer(stranger).status, 200);
}

TEST_F(DispatcherTest, GivesNoFileToASessionThatEndedWhileItWasMade) {
  add("GET", "api/made", Right::kListCases, [](const Request& request) {
    if (request.query_text("ends")) request.session->end();
    return Response::bytes(to_bytes("a film"), "video/mp4");
  });
  EXPECT_EQ(ask("GET", "/api/made", {{"cookie", signed_in(Role::kSurgeon)}}).status, 200);
  const Response late = ask("GET", "/api/made?ends=1", {{"cookie", signed_in(Role::kSurgeon)}});
  EXPECT_EQ(late.status, 401);
  EXPECT_THAT(text_of_body(late), HasSubstr("the session has ended"));
}

}  // namespace
}  // namespace kiroku::viewer
