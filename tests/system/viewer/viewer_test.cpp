// `kiroku view` as a whole, on a home with a recorded case: used as people use it, and attacked.
#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <future>
#include <regex>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/build_paths.h"
#include "tests/support/eventually.h"
#include "tests/system/viewer/served_home.h"

namespace kiroku::test {
namespace {

using nlohmann::json;
using testing::AnyOf;
using testing::HasSubstr;
using namespace std::chrono_literals;

/// Of no case that was recorded.
constexpr const char* kOtherCase = "20200101T000000Z-00000000";

/// One home, one case, one user of each role and one server for all of these tests; each runs in a process of
/// its own anyway when CTest runs it.
class Viewer : public ServedHome {
 protected:
  void SetUp() override {
    ASSERT_NO_FATAL_FAILURE(make_demo_home());
    case_id_ = std::filesystem::path(record()).filename().string();
    ASSERT_NO_FATAL_FAILURE(add_users());
    start();
  }
  /// Every operation of the API's own description, with addresses that fit.
  struct Operation {
    std::string method, target, right;
  };
  [[nodiscard]] std::vector<Operation> operations(const std::string& case_id) const {
    const json document = json::parse(read_text(source_folder() / "viewer/api/openapi.json"));
    std::vector<Operation> out;
    for (const auto& [path, methods] : document["paths"].items()) {
      for (const auto& [method, operation] : methods.items()) {
        std::string target = "/api" + path;
        for (const auto& [name, value] : std::map<std::string, std::string>{{"case", case_id},
                                                                            {"stream", "endoscope"},
                                                                            {"room", "or-1"},
                                                                            {"invitation", "00000000"},
                                                                            {"user", "nobody"},
                                                                            {"comparison", "liver"}}) {
          target = std::regex_replace(target, std::regex("\\{" + name + "\\}"), value);
        }
        target = std::regex_replace(target, std::regex("\\{\\w+\\}"), "0");
        std::string upper = method;
        for (char& c : upper) c = static_cast<char>(std::toupper(c));
        out.push_back({upper, target, operation["x-right"]});
      }
    }
    return out;
  }
};

// Somebody who can write to the archive takes the checkpoint of a hold away, which a command signed.
TEST_F(Viewer, CutsOffNothingThatAnotherProcessOfTheHomeSigned) {
  const std::string link = started_["sign_in"];
  const std::string token = link.substr(link.find("#sign-in=") + 9);
  const std::string cookie = cookie_of(ask("POST", "/api/session", "", json{{"link", token}}.dump()));
  ASSERT_EQ(ask("GET", case_path("/export?stream=endoscope&form=ts"), cookie).status, 200);
  ASSERT_EQ(kiroku({"hold", case_id_, "--reason", "court order"}).status, 0);
  std::filesystem::path note;
  for (const auto& each : std::filesystem::directory_iterator(home() / "archive/log/checkpoints"))
    note = std::max(note, each.path());
  ASSERT_TRUE(std::filesystem::remove(note));
  EXPECT_EQ(ask("GET", case_path("/export?stream=endoscope&form=ts"), cookie).status, 200);
  EXPECT_THAT(accesses().back(), HasSubstr("exported endoscope"));
  EXPECT_TRUE(std::filesystem::exists(note)) << "it is put back";
  EXPECT_THAT(kiroku({"hold", "--list"}).out, HasSubstr("court order"));
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

TEST_F(Viewer, ShowsVerifiesAndExportsACaseAndEntersEachAccessBeforeItLeaves) {
  const std::string link = started_["sign_in"];
  const std::string token = link.substr(link.find("#sign-in=") + 9);
  const HttpResponse signed_in = ask("POST", "/api/session", "", json{{"link", token}}.dump());
  ASSERT_EQ(signed_in.status, 200) << signed_in.body;
  EXPECT_THAT(signed_in.headers.at("set-cookie"),
              testing::AllOf(testing::StartsWith("__Host-kiroku="), HasSubstr("; Path=/"),
                             HasSubstr("; Secure"), HasSubstr("; HttpOnly"), HasSubstr("; SameSite=Strict")));
  EXPECT_EQ(ask("POST", "/api/session", "", json{{"link", token}}.dump()).status, 401) << "works once";
  const std::string cookie = cookie_of(signed_in);
  EXPECT_EQ(json::parse(signed_in.body)["unlocked"], true);
  EXPECT_THAT(accesses().back(), HasSubstr("* unlocked recordings with the server's identity demo"));

  const json list = json::parse(ask("GET", "/api/cases?search=endoscope", cookie).body);
  ASSERT_EQ(list["cases"].size(), 1U);
  EXPECT_EQ(list["cases"][0]["id"], case_id_);
  EXPECT_EQ(json::parse(ask("GET", case_path(""), cookie).body)["streams"][0]["name"], "endoscope");

  EXPECT_EQ(ask("GET", case_path("/verification"), cookie).status, 404);
  EXPECT_EQ(ask("POST", case_path("/verification"), cookie).status, 202);
  json found = json::object();
  EXPECT_TRUE(eventually([&] {
    found = json::parse(ask("GET", case_path("/verification"), cookie).body);
    return found.value("state", "") == "done";
  }));
  EXPECT_EQ(found["verdict"], "intact");
  EXPECT_EQ(json::parse(ask("GET", "/api/cases", cookie).body)["cases"][0]["verdict"], "intact");

  const HttpResponse film = ask("GET", case_path("/export?stream=endoscope&form=ts"), cookie);
  ASSERT_EQ(film.status, 200) << film.body;
  EXPECT_EQ(film.body.size() % 188, 0U);
  EXPECT_EQ(film.body.front(), 'G');
  EXPECT_THAT(accesses().back(), HasSubstr(case_id_ + " exported endoscope demo (kiroku view, 127.0.0.1)"));
  const HttpResponse part =
      ask("GET", case_path("/export?stream=endoscope&form=ts"), cookie, "", {{"Range", "bytes=188-375"}});
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, film.body.substr(188, 188));
  const std::filesystem::recursive_directory_iterator left(home() / "viewer-files");
  EXPECT_TRUE(std::all_of(begin(left), end(left), [](const auto& entry) { return entry.is_directory(); }))
      << "no plaintext stays behind";

  const HttpResponse excerpt = ask("GET", case_path("/excerpt.tar?stream=vitals"), cookie);
  ASSERT_EQ(excerpt.status, 200);
  write_text(path("excerpt.tar"), excerpt.body);
  ASSERT_EQ(tool({"tar", "xf", path("excerpt.tar"), "-C", folder().string()}).status, 0);
  EXPECT_EQ(kiroku({"verify", "--excerpt", path(case_id_ + "-excerpt")}).status, 0);
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

TEST_F(Viewer, AnswersNobodyWhoHasNotSignedIn) {
  for (const Operation& each : operations(case_id_)) {
    if (each.right == "none") continue;
    for (const char* cookie :
         {"", "__Host-kiroku=", "__Host-kiroku=AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA"}) {
      const HttpResponse answer = ask(each.method, each.target, cookie);
      EXPECT_EQ(answer.status, 401) << each.method << " " << each.target;
      EXPECT_EQ(answer.body, "{\"error\":\"sign in first\"}\n");
    }
  }
}

TEST_F(Viewer, LetsEachRoleDoWhatItMayAndNoMore) {
  const std::map<std::string, std::set<std::string>> rights{
      {"operator", {"list-cases", "see-live", "watch-room", "control-rooms", "train"}},
      {"surgeon",
       {"list-cases", "read-case", "watch", "compare", "verify", "see-live", "watch-room", "control-rooms",
        "invite", "plan", "train"}},
      {"auditor", {"list-cases", "read-case", "verify", "read-log", "train"}},
      {"administrator",
       {"list-cases", "read-case", "watch", "compare", "verify", "read-log", "see-live", "watch-room",
        "control-rooms", "invite", "manage-users", "plan", "train"}}};
  for (const std::string& role : kRoles) {
    const std::string cookie = sign_in("a-" + role);
    for (const Operation& each : operations(kOtherCase)) {
      if (each.target.starts_with("/api/fleet/")) continue;  // kiroku-fleet serve alone has these
      if (each.right == "none" || each.right == "signed-in" || each.target == "/api/session/unlock") continue;
      const int status = ask(each.method, each.target, cookie).status;
      if (rights.at(role).contains(each.right)) {
        EXPECT_NE(status, 403) << role << " " << each.method << " " << each.target;
      } else {
        EXPECT_EQ(status, 403) << role << " " << each.method << " " << each.target;
      }
    }
  }
}

TEST_F(Viewer, GivesNothingForForgedAddresses) {
  const std::string cookie = sign_in("a-administrator");
  std::filesystem::create_directory_symlink(home(), home() / "archive" / kOtherCase);
  for (const std::string target :
       {"/api/cases/..", "/api/cases/%2e%2e", "/api/cases/..%2f..%2fdevice.key",
        "/api/cases/%2e%2e%2fdevice.key", "/api/cases/log", "/api/cases/20200101T000000Z-00000000",
        "/api/cases/20200101T000000Z-00000000/export?stream=endoscope", "/../device.key",
        "/%2e%2e/device.key", "/..%5cdevice.key", "/%c0%ae%c0%ae/device.key", "/device.key", "//etc/passwd",
        "/etc/passwd", "/api//cases", "/api/cases/", "/api/cases/x%00y", "/.git/config",
        "https://localhost/api/cases"}) {
    const HttpResponse answer = ask("GET", target, cookie);
    // Names without a dot are the page's own to make sense of, and get the page.
    const bool is_page = answer.body.find("<div id=\"page\">") != std::string::npos;
    if (!is_page) {
      EXPECT_THAT(answer.status, AnyOf(400, 404)) << target << " " << answer.body;
    }
    EXPECT_THAT(answer.body, testing::Not(AnyOf(HasSubstr("PRIVATE KEY"), HasSubstr("root:")))) << target;
  }
  for (const std::string rest :
       {"/export?stream=../../device.key", "/export?stream=..%2f..%2fx", "/export?stream=none", "/export",
        "/export?stream=endoscope&form=exe", "/export?stream=endoscope&from_ns=-1",
        "/export?stream=endoscope&from_ns=5&to_ns=5", "/export?stream=endoscope&stream=room",
        "/export?stream=endoscope&from_ns=99999999999999999999", "/excerpt.tar?stream=..%2fx"}) {
    EXPECT_THAT(ask("GET", case_path(rest), cookie).status, AnyOf(400, 423)) << rest;
  }
}

TEST_F(Viewer, ChangesNothingForAnotherSite) {
  const std::string cookie = sign_in("a-administrator");
  const std::string body =
      json{{"user", "mallory"}, {"password", kPassword}, {"role", "administrator"}}.dump();
  using Headers = std::map<std::string, std::string>;
  for (const Headers& headers :
       {Headers{{"X-Kiroku-Request", ""}}, Headers{{"Origin", "https://evil.example"}},
        Headers{{"Origin", "null"}}, Headers{{"Sec-Fetch-Site", "cross-site"}},
        Headers{{"Content-Type", "text/plain"}},
        Headers{{"Content-Type", "application/x-www-form-urlencoded"}}}) {
    EXPECT_THAT(ask("POST", "/api/users", cookie, body, headers).status, AnyOf(403, 415));
  }
  EXPECT_EQ(ask("DELETE", "/api/users/a-surgeon", cookie, "", {{"X-Kiroku-Request", ""}}).status, 403);
  const HttpResponse users = ask("GET", "/api/users", cookie);
  EXPECT_THAT(users.body, testing::AllOf(testing::Not(HasSubstr("mallory")), HasSubstr("a-surgeon")));
  EXPECT_EQ(ask("POST", "/api/users", cookie, body, {{"Origin", "https://localhost"}}).status, 201);
}

TEST_F(Viewer, UnlocksForOneSessionAndForgets) {
  const std::string cookie = sign_in("a-auditor");
  EXPECT_EQ(json::parse(ask("GET", "/api/session", cookie).body)["unlocked"], false)
      << "an auditor sees no pictures";
  const std::string surgeon = sign_in("a-surgeon");
  EXPECT_EQ(ask("DELETE", "/api/session/unlock", surgeon).status, 204);
  EXPECT_EQ(ask("GET", case_path("/export?stream=endoscope&form=ts"), surgeon).status, 423);
  const auto unlock = [&](const std::string& identity) {
    return ask("POST", "/api/session/unlock", surgeon, json{{"identity", identity}}.dump());
  };
  EXPECT_EQ(unlock("AGE-SECRET-KEY-1WRONG").status, 400);
  const HttpResponse unlocked = unlock(read_text(home() / "identity.txt"));
  ASSERT_EQ(unlocked.status, 200) << unlocked.body;
  EXPECT_EQ(unlocked.body.find("AGE-SECRET"), std::string::npos);
  EXPECT_THAT(accesses().back(), HasSubstr("unlocked recordings with an identity a-surgeon"));
  EXPECT_EQ(ask("GET", case_path("/export?stream=endoscope&form=ts"), surgeon).status, 200);
  const HttpResponse out = ask("DELETE", "/api/session", surgeon);
  EXPECT_EQ(out.status, 204);
  EXPECT_THAT(out.headers.at("set-cookie"), HasSubstr("Max-Age=0"));
  EXPECT_EQ(ask("GET", "/api/session", surgeon).status, 401);
}

/// What leaves a case, by each way out of it, and what the case's consents say of that.
class ViewerOfASiteWithPurposes : public Viewer {
 protected:
  void SetUp() override {
    ASSERT_NO_FATAL_FAILURE(Viewer::SetUp());
    // The viewer runs already: it is read anew.
    write_text(home() / "kiroku.toml",
               read_text(home() / "kiroku.toml") + "\n[consent]\ndemand_purpose = true\n");
    write_text(path("who.txt"), "Hana Mori, patient\n");
    surgeon_ = sign_in("a-surgeon");
  }
  void state(const std::string& kind, const std::string& purpose) const {
    const ProcessResult stated =
        kiroku({"consent", kind, case_id_, "--person", path("who.txt"), "--purpose", purpose});
    EXPECT_EQ(stated.status, 0) << stated.err;
  }
  [[nodiscard]] HttpResponse take(const std::string& what, const std::string& purpose) const {
    return ask("GET", case_path("/" + what + (purpose.empty() ? "" : "&purpose=" + purpose)), surgeon_);
  }
  /// The last use of the case for a purpose that the log has: "exported endoscope for teaching", or "".
  [[nodiscard]] std::string last_use() const {
    std::string last;
    std::istringstream lines(read_text(home() / "archive/log/ledger.jsonl"));
    for (std::string line; std::getline(lines, line);) {
      const json entry = json::parse(line);
      if (entry["type"] != "access" || !entry.contains("purpose")) continue;
      EXPECT_EQ(entry["case"], case_id_);
      last = entry["what"].get<std::string>() + " for " + entry["purpose"].get<std::string>();
    }
    return last;
  }
  [[nodiscard]] json consents() const {
    return json::parse(ask("GET", case_path("/consents"), surgeon_).body);
  }

  static constexpr std::array<const char*, 2> kWaysOut{"export?stream=vitals&form=csv",
                                                       "excerpt.tar?stream=vitals"};
  std::string surgeon_;
};

TEST_F(ViewerOfASiteWithPurposes, HandsOutForAPurposeAsLongAsAConsentToItStands) {
  for (const char* way : kWaysOut) {
    const HttpResponse unnamed = take(way, "");
    EXPECT_EQ(unnamed.status, 400);
    EXPECT_THAT(unnamed.body, HasSubstr("this site demands a purpose of every export"));
    const HttpResponse unknown = take(way, "billing");
    EXPECT_EQ(unknown.status, 400);
    EXPECT_THAT(unknown.body, HasSubstr("'billing' is no purpose of this site"));
    const HttpResponse absent = take(way, "teaching");
    EXPECT_EQ(absent.status, 403);
    EXPECT_THAT(absent.body, HasSubstr("no consent to the purpose teaching was given for case " + case_id_));
  }
  EXPECT_EQ(last_use(), "") << "what was refused is no use";
  state("give", "teaching");
  EXPECT_EQ(take(kWaysOut[0], "teaching").status, 200);
  EXPECT_EQ(last_use(), "exported vitals for teaching");
  EXPECT_EQ(take(kWaysOut[1], "teaching").status, 200);
  EXPECT_EQ(last_use(), "took an excerpt, sealed as it is for teaching");
  EXPECT_EQ(take(kWaysOut[0], "research").status, 403);
  state("withdraw", "teaching");
  for (const char* way : kWaysOut) {
    const HttpResponse withdrawn = take(way, "teaching");
    EXPECT_EQ(withdrawn.status, 403);
    EXPECT_THAT(withdrawn.body, HasSubstr("the consent to the purpose teaching was withdrawn"));
  }
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

TEST_F(ViewerOfASiteWithPurposes, TellsWhatStandsAndWhenNobodyCanTell) {
  EXPECT_EQ(consents()["purposes"], json::array());
  EXPECT_EQ(consents()["demand_purpose"], true);
  EXPECT_EQ(consents()["site_purposes"].size(), 5U);
  state("give", "teaching");
  state("give", "research");
  const std::string before = read_text(home() / "archive/log/ledger.jsonl");
  state("withdraw", "teaching");
  json told = consents();
  EXPECT_EQ(told["state"], "checked");
  ASSERT_EQ(told["purposes"].size(), 2U);
  EXPECT_EQ(told["purposes"][0]["purpose"], "research");
  EXPECT_EQ(told["purposes"][0]["stands"], true);
  EXPECT_EQ(told["purposes"][1]["purpose"], "teaching");
  EXPECT_EQ(told["purposes"][1]["stands"], false);
  EXPECT_EQ(told.dump().find("Mori"), std::string::npos);
  // Somebody takes the withdrawal out of the log.
  write_text(home() / "archive/log/ledger.jsonl", before);
  told = consents();
  EXPECT_EQ(told["state"], "could-not-check");
  EXPECT_THAT(told["problem"].get<std::string>(), HasSubstr("nobody can tell what was consented to"));
  EXPECT_EQ(told["purposes"], json::array());
  for (const char* way : kWaysOut) {
    const HttpResponse untold = take(way, "research");
    EXPECT_EQ(untold.status, 422);
    EXPECT_THAT(untold.body, HasSubstr("could not check the consent, so nothing is handed out"));
  }
}

TEST_F(ViewerOfASiteWithPurposes, HandsNothingOutByAConfigurationThatCannotBeRead) {
  write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") + "purposes = [\"Teaching!\"]\n");
  for (const char* way : kWaysOut) {
    const HttpResponse refused = take(way, "");
    EXPECT_EQ(refused.status, 500);
    EXPECT_THAT(refused.body, HasSubstr("the site's purposes cannot be read, so nothing is handed out"));
  }
}

TEST_F(Viewer, LocksWhoGuessesAndTellsNoNames) {
  const auto attempt = [&](const std::string& user) {
    return ask("POST", "/api/session", "", json{{"user", user}, {"password", "wrong password"}}.dump());
  };
  const HttpResponse known = attempt("a-surgeon");
  const HttpResponse unknown = attempt("nobody");
  EXPECT_EQ(known.status, 401);
  EXPECT_EQ(known.body, unknown.body);
  int refused = 0;
  for (int i = 0; i < 8; ++i) refused += attempt("a-surgeon").status == 429 ? 1 : 0;
  EXPECT_GE(refused, 1);
  EXPECT_EQ(
      ask("POST", "/api/session", "", json{{"user", "a-surgeon"}, {"password", kPassword}}.dump()).status,
      429)
      << "also with the right one";
}

TEST_F(Viewer, EndsTheSessionsOfAUserWhoIsRemoved) {
  const std::string cookie = sign_in("a-surgeon");
  ASSERT_EQ(kiroku({"user", "remove", "a-surgeon"}).status, 0);
  EXPECT_TRUE(eventually([&] { return ask("GET", "/api/session", cookie).status == 401; }));
}

TEST_F(Viewer, RefusesWhatIsTooLargeOrNoHttp) {
  EXPECT_EQ(ask("GET", "/" + std::string(20'000, 'a')).status, 431);
  EXPECT_EQ(ask("GET", "/", "", "", {{"X-Large", std::string(20'000, 'a')}}).status, 431);
  EXPECT_EQ(ask("POST", "/api/session", "", std::string(70'000, 'x')).status, 413);
  EXPECT_EQ(ask("POST", "/api/session", "", "x", {{"Content-Length", "999999999999"}}).status, 413);
  const std::string chunked =
      "POST /api/session HTTP/1.1\r\nHost: localhost\r\nX-Kiroku-Request: 1\r\nContent-Type: "
      "application/json\r\nTransfer-Encoding: chunked\r\n\r\n";
  EXPECT_EQ(ask_once(port_, chunked + "20000\r\n" + std::string(0x20000, 'x') + "\r\n0\r\n\r\n").status, 413);
  EXPECT_EQ(ask_once(port_, "this is no HTTP\r\n\r\n").status, 400);
  EXPECT_EQ(ask_once(port_, "GET / HTTP/1.1\r\n\r\n").status, 400) << "no Host";
  EXPECT_EQ(ask_once(port_, "GET / HTTP/1.0\r\nHost: localhost\r\n\r\n").status, 505);
  EXPECT_EQ(ask_once(port_,
                     "POST /api/session HTTP/1.1\r\nHost: a\r\nContent-Length: 2\r\nTransfer-Encoding: "
                     "chunked\r\n\r\n0\r\n\r\n")
                .status,
            400)
      << "two lengths: a request would hide in another";
  EXPECT_EQ(ask("POST", "/api/session", "", "{\"user\":").status, 400);
  EXPECT_EQ(ask("POST", "/api/session", "", "[]").status, 400);
  EXPECT_EQ(ask("POST", "/api/session", "", R"({"user":1,"password":{}})").status, 400);
  EXPECT_EQ(ask("POST", "/api/session", "", std::string(60'000, '[')).status, 400) << "deep nesting";
}

TEST_F(Viewer, KeepsAConnectionAndAnswersInOrder) {
  HttpsConnection connection(port_);
  connection.send(http_request("GET", "/api/session") + http_request("HEAD", "/") +
                  http_request("GET", "/api/openapi.json"));
  EXPECT_EQ(connection.receive().status, 401);
  const HttpResponse head = connection.receive(false);
  EXPECT_THAT(head.status, AnyOf(200, 404));
  EXPECT_NE(head.headers.at("content-length"), "0");
  EXPECT_EQ(connection.receive().status, 401);
  connection.send(http_request("GET", "/api/session", {{"Connection", "close"}}));
  EXPECT_EQ(connection.receive().headers.at("connection"), "close");
  EXPECT_TRUE(connection.is_closed_within(10s));
}

TEST_F(Viewer, LetsNobodyHoldAConnectionBySendingSlowly) {
  HttpsConnection slow(port_);
  std::atomic<bool> is_over{false};
  const auto begun = std::chrono::steady_clock::now();
  ASSERT_TRUE(slow.send("GET / HTTP/1.1\r\nHost: localhost\r\n"));
  // A byte each second keeps no time limit from passing.
  for (int i = 0; i < 40 && !is_over; ++i) {
    is_over = slow.is_closed_within(1s) || !slow.send("X");
  }
  EXPECT_TRUE(is_over);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 35s);
}

TEST_F(Viewer, StaysOpenForOthersUnderAThousandConnections) {
  std::vector<HttpsConnection> held;
  for (int i = 0; i < 1000; ++i) held.emplace_back(port_, "127.0.0." + std::to_string(10 + i % 4));
  EXPECT_TRUE(held.front().is_closed_within(10s)) << "200 of each address; the idlest makes room";
  EXPECT_TRUE(held[199].is_closed_within(10s));
  EXPECT_TRUE(held[200].send(http_request("GET", "/api/session")));
  EXPECT_EQ(held[200].receive().status, 401);
  EXPECT_EQ(ask("GET", "/api/session").status, 401) << "another address is answered";
  held.clear();
  EXPECT_TRUE(eventually([&] {
    try {
      return ask_once(port_, http_request("GET", "/api/session"), "127.0.0.10").status == 401;
    } catch (const std::runtime_error&) {
      return false;
    }
  })) << "places are given back";
}

TEST_F(Viewer, AnswersManyAtOnce) {
  const std::string cookie = sign_in("a-surgeon");
  std::vector<std::future<int>> answers;
  for (int i = 0; i < 60; ++i) {
    answers.push_back(
        std::async(std::launch::async, [&] { return ask("GET", "/api/cases", cookie).status; }));
  }
  for (auto& answer : answers) EXPECT_EQ(answer.get(), 200);
}

TEST_F(Viewer, SpeaksTls12And13AloneWithStrongCiphers) {
  if (!has_tool("openssl")) GTEST_SKIP() << "openssl is not installed";
  const auto handshake = [&](const Arguments& more) {
    Arguments command{"openssl", "s_client", "-connect", "127.0.0.1:" + std::to_string(port_)};
    command.insert(command.end(), more.begin(), more.end());
    return tool(command, "Q\n");
  };
  EXPECT_THAT(handshake({"-tls1_3"}).out, HasSubstr("New, TLSv1.3"));
  EXPECT_THAT(handshake({"-tls1_2"}).out, HasSubstr("ECDHE-ECDSA-"));
  for (const char* old : {"-tls1", "-tls1_1"}) {
    EXPECT_NE(handshake({old, "-cipher", "ALL:@SECLEVEL=0"}).status, 0) << old;
  }
  for (const char* weak :
       {"AES128-SHA", "ECDHE-ECDSA-AES128-SHA", "ECDHE-ECDSA-AES128-SHA256", "NULL", "aNULL"}) {
    EXPECT_NE(handshake({"-tls1_2", "-cipher", std::string(weak) + ":@SECLEVEL=0"}).status, 0) << weak;
  }
}

TEST_F(Viewer, HasACertificateForThisMachineWhoseFingerprintItTells) {
  const std::string file = (home() / "viewer.pem").string();
  const std::string told = started_["fingerprint"];
  EXPECT_THAT(tool({"openssl", "x509", "-in", file, "-noout", "-fingerprint", "-sha256"}).out,
              HasSubstr(told));
  EXPECT_THAT(tool({"openssl", "x509", "-in", file, "-noout", "-ext", "subjectAltName"}).out,
              testing::AllOf(HasSubstr("DNS:localhost"), HasSubstr("IP Address:127.0.0.1")));
  EXPECT_EQ(std::filesystem::status(home() / "viewer.key").permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
}

TEST_F(Viewer, IsNotOpenedToTheNetworkWithoutAUser) {
  for (const std::string& role : kRoles) ASSERT_EQ(kiroku({"user", "remove", "a-" + role}).status, 0);
  EXPECT_REFUSED(kiroku({"view", "--listen", "0.0.0.0:0"}), "add a user with 'kiroku user add NAME'");
}

TEST_F(Viewer, RefusesOptionsItCannotServeWith) {
  EXPECT_REFUSED(kiroku({"view", "--listen", "nowhere"}), "is no address to listen on");
  EXPECT_REFUSED(kiroku({"view", "--listen", "127.0.0.1:" + std::to_string(port_)}), "cannot listen on");
  EXPECT_REFUSED(kiroku({"view", "--certificate", "x.pem"}), "--certificate and --key belong together");
  EXPECT_REFUSED(kiroku({"view", "--web", folder().string()}), "there is no page in");
  write_text(path("x.pem"), "nothing");
  EXPECT_REFUSED(kiroku({"view", "--certificate", path("x.pem"), "--key", path("x.pem")}),
                 "no PEM certificate");
}

}  // namespace
}  // namespace kiroku::test
