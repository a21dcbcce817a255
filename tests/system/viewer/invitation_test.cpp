// Guests of a real kirokud: that an invitation shows one room's running case until it ends, nothing else, and
// that the appliance log tells all of it.
#include <algorithm>
#include <regex>
#include <thread>

#include <boost/system/system_error.hpp>

#include "tests/support/build_paths.h"
#include "tests/support/eventually.h"
#include "tests/support/reserved_port.h"
#include "tests/support/socket_client.h"
#include "tests/system/viewer/served_home.h"

namespace kiroku::test {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using testing::Contains;
using testing::HasSubstr;

/// Two rooms, a user of each role, and kirokud before them.
class Guests : public ServedHome {
 protected:
  void SetUp() override {
    make_demo_home();
    port_ = reserved_port();
    std::string rooms;
    for (const char* room : {"or-1", "or-2"}) {
      rooms += "\n[[room]]\nname = \"" + std::string(room) +
               "\"\n[[room.stream]]\nname = \"endoscope\"\nsource = "
               "\"synthetic:endoscope?size=320x240&rate=10\"\n";
    }
    write_text(home() / "kiroku.toml",
               read_text(home() / "kiroku.toml") + rooms + "[daemon]\nsocket = \"" + path("s") +
                   "\"\n[viewer]\nlisten = \"127.0.0.1:" + std::to_string(port_) + "\"\n");
    ASSERT_NO_FATAL_FAILURE(add_users());
    Process::Options started = options({});
    started.command = {built_file("kirokud")};
    server_.emplace(started);
    ASSERT_TRUE(server_->wait_for("recording for 2 room"));
    surgeon_ = sign_in("a-surgeon");
  }

  [[nodiscard]] std::string begin_case(const std::string& room = "or-1") {
    return kiroku_json({"case", "start", "--room", room, "--json"})["case"];
  }
  [[nodiscard]] json invite(const std::string& room = "or-1", int minutes = 60) const {
    const HttpResponse answer = ask("POST", "/api/invitations", surgeon_,
                                    json{{"guest", "Dr. Sato"}, {"room", room}, {"minutes", minutes}}.dump());
    EXPECT_EQ(answer.status, 201) << answer.body;
    return json::parse(answer.body);
  }
  [[nodiscard]] HttpResponse come_with(const std::string& token) const {
    return ask("POST", "/api/session", "", json{{"invitation", token}}.dump());
  }
  [[nodiscard]] std::string join(const json& invitation) const {
    const HttpResponse answer = come_with(invitation["token"]);
    EXPECT_EQ(answer.status, 200) << answer.body;
    return cookie_of(answer);
  }
  [[nodiscard]] json invitation(const json& made) const {
    const json all = json::parse(ask("GET", "/api/invitations", surgeon_).body);
    for (const json& each : all["invitations"]) {
      if (each["id"] == made["id"]) return each;
    }
    return {};
  }
  [[nodiscard]] std::unique_ptr<SocketClient> watch(const std::string& cookie,
                                                    const std::string& room = "or-1") const {
    return std::make_unique<SocketClient>(port_, "/api/live/" + room + "/endoscope", cookie,
                                          "https://127.0.0.1:" + std::to_string(port_));
  }
  /// Pictures until the connection ends, or so many.
  static int pictures(SocketClient& socket, int most) {
    int seen = 0;
    while (seen < most) {
      const auto message = socket.receive();
      if (!message) break;
      seen += message->is_text ? 0 : 1;
    }
    return seen;
  }
  /// A status of the WebSocket's address; 101: it is one.
  [[nodiscard]] int status_of_socket(const std::string& target, const std::string& cookie) const {
    return ask("GET", target, cookie, "",
               {{"Connection", "Upgrade"},
                {"Upgrade", "websocket"},
                {"Sec-WebSocket-Version", "13"},
                {"Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="}})
        .status;
  }

  std::string surgeon_;
};

TEST_F(Guests, SeeTheRunningCaseOfTheirRoomUntilTheInvitationIsRevoked) {
  const std::string case_id = begin_case();
  const json made = invite();
  const std::string token = made["token"];
  EXPECT_EQ(token.size(), 43U);
  EXPECT_EQ(invitation(made)["state"], "open");

  const HttpResponse joined = come_with(token);
  ASSERT_EQ(joined.status, 200) << joined.body;
  EXPECT_THAT(joined.headers.at("set-cookie"),
              testing::AllOf(HasSubstr("; Secure"), HasSubstr("; HttpOnly"), HasSubstr("; SameSite=Strict")));
  const std::string guest = cookie_of(joined);
  const json session = json::parse(ask("GET", "/api/session", guest).body);
  EXPECT_EQ(session["role"], "guest");
  EXPECT_EQ(session["unlocked"], false) << "though the home has an identity for everybody who may watch";
  EXPECT_EQ(session["invitation"], (json{{"guest", "Dr. Sato"}, {"room", "or-1"}}));
  EXPECT_GT(session["expires_s"], 3500);
  EXPECT_LE(session["expires_s"], 3600);

  // Before the guest watches: signing in takes its time, in which pictures would come.
  const std::string operator_session = sign_in("a-operator");
  const auto socket = watch(guest);
  EXPECT_GE(pictures(*socket, 10), 10);
  const auto clock = [&] { return json::parse(ask("GET", "/api/live", guest).body)["streams"][0]["now_ns"]; };
  const json then_ns = clock();
  ASSERT_TRUE(then_ns.is_number()) << "by which a guest's page knows how old a picture is";
  EXPECT_GT(then_ns, 0);
  EXPECT_GT(clock(), then_ns);
  const json now = invitation(made);
  EXPECT_EQ(now["state"], "joined");
  EXPECT_EQ(now["watches"], true);
  EXPECT_EQ(now["case"], case_id);
  EXPECT_EQ(now["address"], "127.0.0.1");
  EXPECT_FALSE(now.contains("token"));

  EXPECT_EQ(ask("DELETE", "/api/invitations/" + made["id"].get<std::string>(), operator_session).status, 204)
      << "whoever controls the room can end it";
  EXPECT_LT(pictures(*socket, 1000), 100);
  EXPECT_EQ(socket->farewell().first, 1008);
  EXPECT_EQ(ask("GET", "/api/session", guest).status, 401);
  EXPECT_EQ(status_of_socket("/api/live/or-1/endoscope", guest), 401);
  EXPECT_EQ(come_with(token).status, 401);
  EXPECT_EQ(invitation(made)["end"], "revoked");

  const std::string id = made["id"];
  EXPECT_THAT(
      accesses(),
      testing::IsSupersetOf({
          HasSubstr(case_id + " invites guest Dr. Sato to or-1 until " + made["ends"].get<std::string>() +
                    " (invitation " + id + ") a-surgeon (kiroku view, 127.0.0.1)"),
          HasSubstr(case_id + " joined or-1 by invitation " + id +
                    " of a-surgeon guest Dr. Sato (kiroku view, 127.0.0.1)"),
          HasSubstr("watched or-1/endoscope live guest Dr. Sato"),
          HasSubstr(case_id + " revokes invitation " + id +
                    " of guest Dr. Sato to or-1 "
                    "a-operator"),
      }));
  const std::string log = read_text(home() / "archive/log/ledger.jsonl");
  EXPECT_EQ(log.find(token), std::string::npos) << "the token is in no log";
  EXPECT_EQ(server_->out().find(token), std::string::npos);
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

TEST_F(Guests, AreRefusedWhateverElseTheApiHas) {
  const std::string case_id = begin_case();
  const std::string guest = join(invite());
  const json document = json::parse(read_text(source_folder() / "viewer/api/openapi.json"));
  int asked = 0;
  for (const auto& [path, methods] : document["paths"].items()) {
    if (path.starts_with("/fleet/")) continue;  // kiroku-fleet serve alone has these
    for (const auto& [method, operation] : methods.items()) {
      std::string target = "/api" + path, upper = method;
      for (const auto& [name, value] : std::map<std::string, std::string>{{"case", case_id},
                                                                          {"stream", "endoscope"},
                                                                          {"room", "or-1"},
                                                                          {"user", "a-surgeon"},
                                                                          {"invitation", "00000000"},
                                                                          {"comparison", "liver"}}) {
        target = std::regex_replace(target, std::regex("\\{" + name + "\\}"), value);
      }
      target = std::regex_replace(target, std::regex("\\{\\w+\\}"), "0");
      for (char& c : upper) c = static_cast<char>(std::toupper(c));
      const std::string right = operation["x-right"];
      if (right == "none" || right == "signed-in" || right == "watch-room") continue;
      EXPECT_EQ(ask(upper, target, guest, upper == "POST" ? "{}" : "").status, 403) << upper << " " << target;
      ++asked;
    }
  }
  EXPECT_GT(asked, 30);
  json seen = json::parse(ask("GET", "/api/live", guest).body);
  ASSERT_EQ(seen["streams"].size(), 1U);
  EXPECT_EQ(seen["streams"][0].erase("now_ns"), 1U);
  EXPECT_EQ(seen, json::parse(R"({"streams":[{"room":"or-1","stream":"endoscope"}]})"));
  EXPECT_EQ(status_of_socket("/api/live/or-2/endoscope", guest), 403) << "another room";
  EXPECT_EQ(status_of_socket("/api/live/or-9/endoscope", guest), 403) << "one that is not there";
  EXPECT_EQ(status_of_socket("/api/live/or-1/vitals", guest), 404);
  EXPECT_EQ(
      ask("POST", "/api/session/unlock", guest, json{{"identity", read_text(home() / "identity.txt")}}.dump())
          .status,
      403);
}

TEST_F(Guests, SeeNothingBeforeAndNothingAfterTheirCase) {
  const json made = invite();
  const std::string guest = join(made);
  const auto socket = watch(guest);
  const std::string first = begin_case();
  EXPECT_GE(pictures(*socket, 5), 5) << "the first case that begins";
  ASSERT_EQ(kiroku({"case", "stop", "--room", "or-1"}).status, 0);
  (void)begin_case();
  const int after = pictures(*socket, 1000);
  EXPECT_LT(after, 100) << "what was queued of the first case, none of the second";
  json now = json::object();
  EXPECT_TRUE(eventually([&] {
    now = invitation(made);
    return now.value("state", "") == "ended";
  }));
  EXPECT_EQ(now["end"], "case");
  EXPECT_EQ(now["case"], first);
  EXPECT_EQ(ask("GET", "/api/live", guest).status, 401);
  EXPECT_THAT(accesses(), Contains(HasSubstr("ended: the case is over kiroku view")));
}

TEST_F(Guests, ComeOnceWithATokenThatSomebodyGaveThem) {
  EXPECT_EQ(come_with(std::string(43, 'A')).status, 401);
  const json made = invite();
  const std::string token = made["token"];
  EXPECT_EQ(come_with(made["id"]).status, 401);
  EXPECT_EQ(come_with(token).status, 200);
  const HttpResponse again = come_with(token);
  EXPECT_EQ(again.status, 401);
  EXPECT_THAT(again.body, HasSubstr("was used before"));
  int locked = 0;
  for (int i = 0; i < 8; ++i) locked += come_with(std::string(43, 'B')).status == 429 ? 1 : 0;
  EXPECT_GE(locked, 1) << "who guesses waits";
}

TEST_F(Guests, AreInvitedBySurgeonsAndAdministratorsToRoomsThatAreThere) {
  const std::string body = json{{"guest", "Dr. Sato"}, {"room", "or-1"}, {"minutes", 5}}.dump();
  const auto status = [&](const json& asked) {
    return ask("POST", "/api/invitations", surgeon_, asked.dump()).status;
  };
  EXPECT_EQ(ask("POST", "/api/invitations", sign_in("a-operator"), body).status, 403);
  EXPECT_EQ(ask("POST", "/api/invitations", sign_in("a-auditor"), body).status, 403);
  EXPECT_EQ(ask("POST", "/api/invitations", sign_in("a-administrator"), body).status, 201);
  EXPECT_EQ(ask("GET", "/api/invitations", sign_in("a-auditor")).status, 403);
  EXPECT_EQ(status({{"guest", "Dr. Sato"}, {"room", "or-9"}, {"minutes", 5}}), 404);
  for (const json& minutes : {json(0), json(-1), json(721), json(1.5), json("60"), json(nullptr)}) {
    EXPECT_EQ(status({{"guest", "Dr. Sato"}, {"room", "or-1"}, {"minutes", minutes}}), 400) << minutes;
  }
  for (const std::string& guest :
       {std::string(), std::string("  "), std::string("a\nb"), std::string("an\u200bna"),
        std::string("Sato\u202e"), std::string(65, 'x')}) {
    EXPECT_EQ(status({{"guest", guest}, {"room", "or-1"}, {"minutes", 5}}), 400) << guest;
  }
  EXPECT_EQ(ask("POST", "/api/invitations", surgeon_, body, {{"X-Kiroku-Request", ""}}).status, 403);
  EXPECT_EQ(ask("DELETE", "/api/invitations/00000000", surgeon_).status, 404);
}

// The inviter began to type in one case, or before one, and the room went on to the next patient's.
TEST_F(Guests, AreInvitedToTheCaseThatTheInviterSawAndToNoOther) {
  const auto invited_to = [&](const std::string& meant) {
    const json asked{{"guest", "Dr. Sato"}, {"room", "or-1"}, {"minutes", 5}, {"case", meant}};
    return ask("POST", "/api/invitations", surgeon_, asked.dump());
  };
  EXPECT_EQ(invited_to("").status, 201) << "the next one, and none runs";
  EXPECT_EQ(invited_to("whichever").status, 400);
  const std::string first = begin_case();
  EXPECT_THAT(invited_to("").body, HasSubstr("room or-1 has begun case " + first + " meanwhile"));
  EXPECT_EQ(invited_to(first).status, 201);
  ASSERT_EQ(kiroku({"case", "stop", "--room", "or-1"}).status, 0);
  EXPECT_THAT(invited_to(first).body, HasSubstr("room or-1 is not recording case " + first));
  const std::string second = begin_case();
  const HttpResponse refused = invited_to(first);
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("room or-1 is recording case " + second + ", and not case " + first));
  EXPECT_EQ(ask("POST", "/api/rooms/or-1/subject", surgeon_,
                json{{"subject", {{"patient", {{"id", "A1"}}}}}, {"case", first}}.dump())
                .status,
            409)
      << "nor is its patient said of the next one";
}

TEST_F(Guests, EndTheInvitationWhenTheyLeave) {
  const json made = invite();
  const std::string guest = join(made);
  EXPECT_EQ(ask("DELETE", "/api/session", guest).status, 204);
  EXPECT_EQ(ask("GET", "/api/session", guest).status, 401);
  EXPECT_EQ(invitation(made)["end"], "left");
  EXPECT_THAT(accesses().back(), HasSubstr("of guest Dr. Sato to or-1 ended: the guest left"));
}

TEST_F(Guests, LoseTheirInvitationWithTheUserWhoMadeIt) {
  const std::string guest = join(invite());
  EXPECT_EQ(ask("GET", "/api/live", guest).status, 200);
  ASSERT_EQ(kiroku({"user", "remove", "a-surgeon"}).status, 0);
  EXPECT_TRUE(eventually([&] { return ask("GET", "/api/live", guest).status == 401; }));
}

}  // namespace
}  // namespace kiroku::test
