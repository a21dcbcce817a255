// Signing in while others guess, and while others flood the server: with a hasher that the test holds.
#include <algorithm>
#include <condition_variable>
#include <future>
#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "crypto/hash.h"
#include "tests/support/https_client.h"
#include "tests/support/moved_clock.h"
#include "tests/support/temporary_folder.h"
#include "viewer/api/api.h"
#include "viewer/http/server_certificate.h"
#include "viewer/people/sign_in_link.h"
#include "viewer/server/web_server.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using test::HttpResponse;
using test::HttpsConnection;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

constexpr const char* kPassword = "correct horse battery";

/// Hashes at once, or holds each password until it is released; knows in which order they came.
class HeldHasher {
 public:
  crypto::Secret hash(const crypto::Secret& password, ByteView salt) {
    std::unique_lock lock(mutex_);
    begun_.emplace_back(password.text());
    changed_.notify_all();
    changed_.wait(lock, [this] { return !is_held_; });
    crypto::Sha256 hash;
    hash.update(password.bytes());
    hash.update(salt);
    return crypto::Secret::copy_of(hash.finish());
  }
  void hold() {
    const std::lock_guard guard(mutex_);
    is_held_ = true;
    begun_.clear();
  }
  void release() {
    const std::lock_guard guard(mutex_);
    is_held_ = false;
    changed_.notify_all();
  }
  void wait_for_begun(std::size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return begun_.size() >= count; });
  }
  std::vector<std::string> begun() {
    const std::lock_guard guard(mutex_);
    return begun_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_held_ = false;
  std::vector<std::string> begun_;
};

class SignIn : public testing::Test {
 protected:
  SignIn() {
    context.users().add("anna", Role::kSurgeon, crypto::Secret::copy_of(std::string_view(kPassword)));
    add_session_routes(router, context, link);
    add_user_routes(router, context);
  }
  ~SignIn() override { hasher.release(); }

  struct From {
    std::string address;
    std::string device;  // the cookie, "" without one
  };
  Response sign_in(const From& from, const std::string& password, const std::string& user = "anna") {
    RequestHead head{"POST",
                     "/api/session",
                     from.address,
                     {{"host", "or-3"}, {"x-kiroku-request", "1"}, {"content-type", "application/json"}}};
    if (!from.device.empty()) head.headers["cookie"] = std::string(kDeviceCookie) + "=" + from.device;
    Dispatcher::Admission admission = dispatcher.admit(std::move(head));
    admission.request.body = body(user, password);
    Response response = dispatcher.answer(admission);
    while (response.costly) response = response.costly->work();
    return response;
  }
  static std::string body(const std::string& user, const std::string& password) {
    return json{{"user", user}, {"password", password}}.dump();
  }
  static std::string header(const Response& response, const std::string& name,
                            const std::string& begin = "") {
    for (const auto& [field, value] : response.headers) {
      if (field == name && value.starts_with(begin)) return value;
    }
    return "";
  }
  /// The device's cookie that the answer sets.
  static std::string device_of(const Response& response) {
    const std::string begin = std::string(kDeviceCookie) + "=";
    const std::string field = header(response, "Set-Cookie", begin);
    return field.empty() ? "" : field.substr(begin.size(), field.find(';') - begin.size());
  }

  void serve(const CostlyWork::Limits& limits) {
    bool made = false;
    ServerCertificate certificate = own_certificate(folder.path(), {"127.0.0.1"}, made);
    WebServerOptions options;
    options.listen = "127.0.0.1:0";
    options.certificate_pem = std::move(certificate.certificate_pem);
    options.key_pem = std::move(certificate.key_pem);
    options.limits.costly = limits;
    server.emplace(std::move(options), dispatcher);
  }
  [[nodiscard]] HttpsConnection ask_to_sign_in(const std::string& address, const std::string& password,
                                               const std::string& device = "") const {
    HttpsConnection connection(server->port(), address);
    std::map<std::string, std::string> headers;
    if (!device.empty()) headers["Cookie"] = std::string(kDeviceCookie) + "=" + device;
    connection.send(test::http_request("POST", "/api/session", headers, body("anna", password)));
    return connection;
  }

  test::TemporaryFolder folder;
  HeldHasher hasher;
  test::MovedClock clock;
  crypto::SigningKey key = crypto::SigningKey::generate();
  ViewerContext context{
      ViewerHome{.archive = folder / "archive",
                 .catalogue_file = folder / "catalogue.sqlite",
                 .log_folder = folder / "log",
                 .users_file = folder / "users.sqlite",
                 .control_socket = folder / "control",
                 .copies_folder = folder / "copies",
                 .device_key = &key,
                 .device = crypto::VerifierKey("test", key.public_key()),
                 .identities = {},
                 .password_hasher = [this](const crypto::Secret& password, ByteView salt,
                                           int /*cost*/) { return hasher.hash(password, salt); },
                 .clock = &clock},
      SessionLimits{}, [](const std::string& /*sentence*/) {}};
  SignInLink link;
  Router router;
  StaticFiles page;
  Dispatcher dispatcher{router, context.sessions(), page, [](const std::string& /*sentence*/) {}};
  std::optional<WebServer> server;
};

TEST_F(SignIn, GivesTheBrowserACookieThatItKeeps) {
  const Response response = sign_in({"192.0.2.7", ""}, kPassword);
  ASSERT_EQ(response.status, 200);
  EXPECT_THAT(header(response, "Set-Cookie", "__Host-kiroku-device="),
              AllOf(HasSubstr("; Path=/"), HasSubstr("; Secure"), HasSubstr("; HttpOnly"),
                    HasSubstr("; SameSite=Strict"), HasSubstr("; Max-Age=34560000")));
  EXPECT_EQ(device_of(response).size(), 43U);
  EXPECT_NE(header(response, "Set-Cookie", "__Host-kiroku="), "");
  EXPECT_EQ(device_of(sign_in({"192.0.2.7", ""}, "a wrong password")), "") << "only after signing in";
}

TEST_F(SignIn, LetsStrangersWaitByNameAndAddress) {
  for (int i = 0; i < 5; ++i) EXPECT_EQ(sign_in({"203.0.113.9", ""}, "a wrong password").status, 401);
  const Response refused = sign_in({"203.0.113.9", ""}, kPassword);
  EXPECT_EQ(refused.status, 429) << "also with the right one";
  EXPECT_EQ(header(refused, "Retry-After"), "2");
  EXPECT_EQ(sign_in({"203.0.113.9", ""}, "a wrong password", "bert").status, 401) << "another name";
  EXPECT_EQ(sign_in({"203.0.113.10", ""}, kPassword).status, 200) << "another address";
  clock.move(std::chrono::seconds(2));
  EXPECT_EQ(sign_in({"203.0.113.9", ""}, kPassword).status, 200) << "after the wait";
}

TEST_F(SignIn, CountsAddressesOfVersion6BySlash64) {
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(sign_in({"2001:db8:1:2::" + std::to_string(i), ""}, "a wrong password").status, 401);
  }
  EXPECT_EQ(sign_in({"2001:db8:1:2:9:9:9:9", ""}, "a wrong password").status, 429);
  EXPECT_EQ(sign_in({"2001:db8:1:3::1", ""}, "a wrong password").status, 401);
}

TEST_F(SignIn, LetsOneAddressWaitThatTriesManyNames) {
  int refused = 0;
  for (int i = 0; i < 40; ++i) {
    refused +=
        sign_in({"203.0.113.9", ""}, "a wrong password", "u" + std::to_string(i)).status == 429 ? 1 : 0;
  }
  EXPECT_EQ(refused, 20);
}

TEST_F(SignIn, NobodyElseLocksOutADeviceThatSignedInBefore) {
  const std::string device = device_of(sign_in({"192.0.2.7", ""}, kPassword));
  for (int i = 0; i < 1000; ++i) {
    const int status = sign_in({"203.0.113." + std::to_string(i % 50), "forged"}, "a wrong password").status;
    EXPECT_TRUE(status == 401 || status == 429) << status;
  }
  EXPECT_EQ(sign_in({"203.0.113.9", device}, kPassword).status, 200) << "even where the guesses come from";
  EXPECT_EQ(sign_in({"192.0.2.7", ""}, kPassword).status, 200) << "and the address, without the cookie";
}

TEST_F(SignIn, ADeviceThatGuessesIsAStrangerAgain) {
  const std::string device = device_of(sign_in({"192.0.2.7", ""}, kPassword));
  int looked_at = 0;
  for (int i = 0; i < 200; ++i) {
    looked_at += sign_in({"203.0.113.9", device}, "a wrong password").status == 401 ? 1 : 0;
  }
  EXPECT_EQ(looked_at, KnownDevices::kOwnFailures + 5);
}

TEST_F(SignIn, AFloodIsRefusedAtOnceAndNothingElseWaitsBehindIt) {
  serve({.threads = 2, .waiting = 3, .of_one = 2});
  const std::string cookie =
      std::string(kSessionCookie) + "=" + context.sessions().open("anna", Role::kSurgeon, {}).token;
  hasher.hold();
  std::vector<HttpsConnection> waiting;
  for (int i = 0; i < 2; ++i) {
    waiting.push_back(ask_to_sign_in("127.0.8." + std::to_string(1 + i), "being hashed"));
    hasher.wait_for_begun(static_cast<std::size_t>(i) + 1);
  }
  // Which of these wait is not said before the refusals come: three of sixty.
  std::vector<HttpsConnection> flood;
  for (int i = 0; i < 60; ++i) flood.push_back(ask_to_sign_in("127.0.9." + std::to_string(1 + i), "flood"));
  HttpsConnection signed_in(server->port());
  for (int i = 0; i < 3; ++i) {
    signed_in.send(test::http_request("GET", "/api/session", {{"Cookie", cookie}}));
    EXPECT_EQ(signed_in.receive().status, 200);
  }
  EXPECT_EQ(hasher.begun().size(), 2U) << "no more at a time";
  std::vector<std::future<HttpResponse>> answers;
  for (HttpsConnection& each : flood) {
    answers.push_back(std::async(std::launch::async, [&each] { return each.receive(); }));
  }
  std::size_t refused = 0;
  while (refused < 57) {
    refused = 0;
    for (auto& each : answers) {
      refused += each.wait_for(std::chrono::milliseconds(1)) == std::future_status::ready ? 1U : 0U;
    }
  }
  EXPECT_EQ(hasher.begun().size(), 2U) << "refused before any work";
  hasher.release();
  std::map<int, int> statuses;
  for (auto& each : answers) {
    const HttpResponse answer = each.get();
    ++statuses[answer.status];
    EXPECT_EQ(answer.headers.contains("retry-after"), answer.status == 429);
  }
  EXPECT_EQ(statuses, (std::map<int, int>{{401, 3}, {429, 57}}));
  for (HttpsConnection& each : waiting) EXPECT_EQ(each.receive().status, 401);
}

TEST_F(SignIn, WhoSignedInBeforeGoesBeforeAFlood) {
  const std::string device = device_of(sign_in({"192.0.2.7", ""}, kPassword));
  serve({.threads = 1, .waiting = 3, .of_one = 1});
  hasher.hold();
  HttpsConnection hashed = ask_to_sign_in("127.0.8.1", "being hashed");
  hasher.wait_for_begun(1);
  EXPECT_EQ(ask_to_sign_in("127.0.8.1", "again").receive().status, 429) << "of one address";
  std::vector<std::future<int>> flood;
  for (int i = 0; i < 4; ++i) {
    flood.push_back(std::async(std::launch::async, [this, i] {
      return ask_to_sign_in("127.0.9." + std::to_string(1 + i), "flood").receive().status;
    }));
  }
  const auto is_ready = [](const std::future<int>& each) {
    return each.wait_for(std::chrono::milliseconds(1)) == std::future_status::ready;
  };
  // The fourth is refused, so that three wait.
  while (std::ranges::none_of(flood, is_ready)) {
  }
  // Asked after the flood, twice; one of them is refused, so that the other waits.
  std::vector<std::future<int>> known;
  for (const char* address : {"127.0.8.2", "127.0.8.3"}) {
    known.push_back(std::async(std::launch::async, [this, &device, address] {
      return ask_to_sign_in(address, kPassword, device).receive().status;
    }));
  }
  while (std::ranges::none_of(known, is_ready)) {
  }
  hasher.release();
  EXPECT_EQ(known[0].get() + known[1].get(), 200 + 429);
  EXPECT_EQ(hashed.receive().status, 401);
  for (auto& each : flood) each.wait();
  const std::vector<std::string> begun = hasher.begun();
  ASSERT_EQ(begun.size(), 5U);
  EXPECT_EQ(begun[1], kPassword);
}

TEST_F(SignIn, ByAOneTimePasswordIsGoodForChoosingAnotherAlone) {
  const crypto::Secret given = UserStore::new_one_time_password();
  context.users().set_password("anna", given, clock.utc() + std::chrono::hours(1));
  const Response signed_in = sign_in({"192.0.2.7", ""}, std::string(given.text()));
  ASSERT_EQ(signed_in.status, 200);
  EXPECT_EQ(json::parse(std::get<std::string>(signed_in.body))["must_change_password"], true);
  const auto ask = [&](const SessionStore::Opened& opened, const std::string& path) {
    RequestHead head{"GET", path, "192.0.2.7", {{"host", "or-3"}}};
    head.headers["cookie"] = std::string(kSessionCookie) + "=" + opened.token;
    Dispatcher::Admission admission = dispatcher.admit(std::move(head));
    return admission.refusal ? admission.refusal->status : dispatcher.answer(admission).status;
  };
  const auto temporary = context.sessions().open("anna", Role::kAdministrator, utc_now(), true);
  EXPECT_EQ(ask(temporary, "/api/session"), 200);
  EXPECT_EQ(ask(temporary, "/api/users"), 403);
  EXPECT_EQ(ask(context.sessions().open("anna", Role::kAdministrator, utc_now()), "/api/users"), 200);
}

// An account is in the hands of somebody else, who changes its password without end; while one of their
// changes is being hashed, the administrator gives the owner another.
TEST_F(SignIn, AChangeThatIsUnderWayDoesNotUndoAnAdministrators) {
  const auto opened = context.sessions().open("anna", Role::kSurgeon, context.users().find("anna")->changed);
  RequestHead head{"POST",
                   "/api/session/password",
                   "192.0.2.7",
                   {{"host", "or-3"}, {"x-kiroku-request", "1"}, {"content-type", "application/json"}}};
  head.headers["cookie"] = std::string(kSessionCookie) + "=" + opened.token;
  Dispatcher::Admission admission = dispatcher.admit(std::move(head));
  admission.request.body = json{{"password", kPassword}, {"new_password", "the thief's own"}}.dump();
  hasher.hold();
  std::future<Response> theirs = std::async(std::launch::async, [&] {
    Response response = dispatcher.answer(admission);
    while (response.costly) response = response.costly->work();
    return response;
  });
  hasher.wait_for_begun(1);
  // By another process, as `kiroku user` does; or by another thread.
  const auto other =
      UserStore::open(folder / "users.sqlite", [](const crypto::Secret& password, ByteView salt, int) {
        crypto::Sha256 hash;
        hash.update(password.bytes());
        hash.update(salt);
        return crypto::Secret::copy_of(hash.finish());
      });
  other->set_password("anna", crypto::Secret::copy_of(std::string_view("given by hand")),
                      clock.utc() + std::chrono::hours(1));
  context.sessions().close_all_of("anna");
  hasher.release();
  EXPECT_EQ(theirs.get().status, 409);
  EXPECT_EQ(sign_in({"192.0.2.8", ""}, "the thief's own").status, 401);
  EXPECT_EQ(sign_in({"192.0.2.8", ""}, "given by hand").status, 200);
}

// Whoever took a session over and knows no password keeps its owner from nothing.
TEST_F(SignIn, WrongPasswordsInOneSessionDoNotKeepAnotherFromChoosingANewOne) {
  const UtcTime credential = context.users().find("anna")->changed;
  const auto thief = context.sessions().open("anna", Role::kSurgeon, credential);
  const auto owner = context.sessions().open("anna", Role::kSurgeon, credential);
  const auto choose = [&](const SessionStore::Opened& opened, const std::string& password) {
    RequestHead head{"POST",
                     "/api/session/password",
                     "192.0.2.7",
                     {{"host", "or-3"}, {"x-kiroku-request", "1"}, {"content-type", "application/json"}}};
    head.headers["cookie"] = std::string(kSessionCookie) + "=" + opened.token;
    Dispatcher::Admission admission = dispatcher.admit(std::move(head));
    admission.request.body = json{{"password", password}, {"new_password", "the owner's new one"}}.dump();
    Response response = dispatcher.answer(admission);
    while (response.costly) response = response.costly->work();
    return response.status;
  };
  for (int i = 0; i < 20; ++i) choose(thief, "a guess");
  EXPECT_EQ(choose(thief, "a guess"), 429) << "guesses wait";
  EXPECT_EQ(choose(owner, kPassword), 200);
}

TEST_F(SignIn, WhoIsDemotedWhileTheirPasswordIsHashedComesInWithoutTheRole) {
  context.users().add("carla", Role::kAdministrator, crypto::Secret::copy_of(std::string_view(kPassword)));
  for (const std::string name : {"demoted", "removed"}) {
    context.users().add(name, Role::kAdministrator, crypto::Secret::copy_of(std::string_view(kPassword)));
    hasher.hold();
    std::future<Response> signing_in = std::async(std::launch::async, [&] {
      return sign_in({"192.0.2.7", ""}, kPassword, name);
    });
    hasher.wait_for_begun(1);
    if (name == "removed") {
      context.users().remove(name);
    } else {
      context.users().set_role(name, Role::kOperator);
    }
    context.sessions().close_all_of(name);
    hasher.release();
    const Response answer = signing_in.get();
    EXPECT_EQ(answer.status, 401) << name;
    EXPECT_EQ(header(answer, "Set-Cookie", std::string(kSessionCookie)), "") << name;
  }
}

TEST_F(SignIn, CountsWhatCostsMuchByPersonAndNotByBrowser) {
  const auto who = [this](const From& from) -> std::string {
    RequestHead head{"POST",
                     "/api/session",
                     from.address,
                     {{"host", "or-3"}, {"x-kiroku-request", "1"}, {"content-type", "application/json"}}};
    if (!from.device.empty()) head.headers["cookie"] = std::string(kDeviceCookie) + "=" + from.device;
    Dispatcher::Admission admission = dispatcher.admit(std::move(head));
    admission.request.body = body("anna", kPassword);
    const Response response = dispatcher.answer(admission);
    return response.costly ? response.costly->who : "";
  };
  const std::string one = device_of(sign_in({"192.0.2.7", ""}, kPassword));
  const std::string other = device_of(sign_in({"192.0.2.8", ""}, kPassword));
  EXPECT_NE(one, other);
  EXPECT_EQ(who({"192.0.2.7", one}), "user anna");
  EXPECT_EQ(who({"192.0.2.8", other}), "user anna");
  EXPECT_NE(who({"203.0.113.9", ""}), "user anna") << "a stranger takes nothing of hers";
}

}  // namespace
}  // namespace kiroku::viewer
