// The planner's routes before a real server, by the messages that a page sends.
#include "viewer/planning/planning_api.h"

#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "sim/plan/plan.h"
#include "tests/support/socket_client.h"
#include "tests/unit/viewer/planning/planned_block.h"
#include "viewer/server/server_certificate.h"
#include "viewer/server/web_server.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using test::SocketClient;
using testing::HasSubstr;
using testing::IsEmpty;

class PlanningApi : public testing::Test {
 protected:
  PlanningApi() {
    add_planning_routes(router, room);
    bool made = false;
    ServerCertificate certificate = own_certificate(folder.path(), {"127.0.0.1"}, made);
    WebServerOptions options;
    options.listen = "127.0.0.1:0";
    options.certificate_pem = std::move(certificate.certificate_pem);
    options.key_pem = std::move(certificate.key_pem);
    server.emplace(std::move(options), dispatcher);
    opened = sessions.open("anna", Role::kSurgeon, {});
  }
  static PlanningOptions options_of(const std::filesystem::path& plans) {
    PlanningOptions options;
    options.plans = plans;
    options.table = {"liver", sim::GpuUse::kOff, 96, 72};
    options.tell = [](const std::string& /*sentence*/) {};
    return options;
  }

  std::pair<unsigned, json> ask(const SessionStore::Opened& who) {
    Dispatcher::Admission admission = dispatcher.admit(
        {"GET", "/api/planning/plans", "192.0.2.7", {{"host", "or-3"}, {"cookie", cookie_of(who)}}});
    const Response response =
        admission.refusal ? std::move(*admission.refusal) : dispatcher.answer(admission);
    return {response.status, json::parse(std::get<std::string>(response.body))};
  }
  static std::string cookie_of(const SessionStore::Opened& who) {
    return std::string(kSessionCookie) + "=" + who.token;
  }
  std::unique_ptr<SocketClient> connect(const std::string& origin = "") {
    const std::string own = "https://127.0.0.1:" + std::to_string(server->port());
    return std::make_unique<SocketClient>(server->port(), "/api/planning/table", cookie_of(opened),
                                          origin.empty() ? own : origin);
  }
  struct Said {
    json about;
    bool is_picture = false;
  };
  static std::optional<Said> next(SocketClient& client) {
    const std::optional<SocketClient::Message> message = client.receive();
    if (!message) return {};
    const std::string_view bytes = text_of(message->bytes);
    if (message->is_text) return Said{json::parse(bytes), false};
    std::size_t head = 0;
    for (std::size_t i = 0; i < 4; ++i) head |= static_cast<std::size_t>(message->bytes[i]) << (8 * i);
    EXPECT_EQ(bytes.substr(4 + head, 2), "\xff\xd8");
    return Said{json::parse(bytes.substr(4, head)), true};
  }
  /// The next text that has the key, whatever else comes before.
  static json until(SocketClient& client, const char* key) {
    while (const std::optional<Said> said = next(client)) {
      if (said->about.contains(key)) return said->about;
    }
    return nullptr;
  }
  static std::pair<int, std::string> refusal(SocketClient& client) {
    while (next(client)) {
    }
    return client.farewell();
  }
  /// The first picture in which the deed is.
  static json picture_of(SocketClient& client, std::uint64_t input) {
    while (const std::optional<Said> said = next(client)) {
      if (said->is_picture && said->about["input"] >= input) return said->about;
    }
    return nullptr;
  }

  test::TemporaryFolder folder;
  test::PlannedBlock block;
  PlanningRoom room{options_of(block.folder())};
  Router router;
  SessionStore sessions;
  SessionStore::Opened opened;
  StaticFiles page;
  Dispatcher dispatcher{router, sessions, page, [](const std::string& /*sentence*/) {}};
  std::optional<WebServer> server;
};

TEST_F(PlanningApi, ListsPlansForWhoMayPlan) {
  const auto [status, answer] = ask(opened);
  EXPECT_EQ(status, 200U);
  EXPECT_EQ(
      answer,
      json::parse(
          R"({"plans": [{"plan": "block/plan.json", "name": "Block", "steps": 2, "has_volume": true}]})"));
  for (const Role role : {Role::kOperator, Role::kAuditor})
    EXPECT_EQ(ask(sessions.open("otto", role, {})).first, 403U);
  EXPECT_EQ(ask({}).first, 401U);
}

TEST_F(PlanningApi, OpensPlansAndSaves) {
  const auto client = connect();
  client->send_text(R"({"open": {"plan": "block/plan.json", "anew": true}})");
  EXPECT_EQ(until(*client, "opened")["opened"]["vertices"], 225);
  client->send_text(
      R"({"input": 1, "view": {"azimuth_deg": 20, "elevation_deg": 15, "zoom": 1, "pan_x": 0, "pan_y": 0}})");
  client->send_text(
      R"({"input": 2, "use": "grasp", "pointers": [{"id": 1, "x": 0.6, "y": 0.5, "push_m": 0}]})");
  client->send_text(
      R"({"input": 3, "use": "grasp", "pointers": [{"id": 1, "x": 0.63, "y": 0.45, "push_m": 0}]})");
  while (true) {
    const json moment = picture_of(*client, 3);
    ASSERT_FALSE(moment.is_null());
    ASSERT_EQ(moment["tools"].size(), 1U);
    if (moment["tools"][0]["force_n"] > 0.01 && moment["largest_von_mises_pa"] > 1 && !moment["moves"]) break;
  }
  client->send_text(R"({"input": 4, "use": "grasp", "pointers": []})");
  client->send_text(R"({"input": 5, "hold": {"duration_s": 0.1}})");
  client->send_text(R"({"input": 6, "undo": true})");
  const json undone = picture_of(*client, 6);
  EXPECT_EQ(undone["tools"].size(), 1U);
  client->send_text(R"({"input": 7, "save": {"file": "plan", "name": "Other"}})");
  EXPECT_THAT(until(*client, "told")["told"], HasSubstr("there is a plan 'plan' already"));
  client->send_text(R"({"input": 8, "save": {"file": "mine", "name": "Mine"}})");
  EXPECT_EQ(until(*client, "saved")["saved"]["plan"], "block/mine.json");
  const sim::PlanReading saved = sim::read_plan(block.folder() / "block/mine.json");
  ASSERT_THAT(saved.errors, IsEmpty());
  EXPECT_EQ(saved.plan->steps.size(), 2U);
  EXPECT_EQ(saved.plan->name, "Mine");
  EXPECT_EQ(ask(opened).second["plans"].size(), 2U);
}

TEST_F(PlanningApi, RefusesInWords) {
  const auto unknown = connect();
  unknown->send_text(R"({"open": {"plan": "../plan.json", "anew": true}})");
  EXPECT_THAT(until(*unknown, "failed")["failed"], HasSubstr("there is no plan of that name"));
  // One place, which is taken as long as the connection is there.
  const auto second = connect();
  second->send_text(R"({"open": {"plan": "block/plan.json", "anew": true}})");
  EXPECT_THAT(refusal(*second).second, HasSubstr("as many people plan here"));
}

TEST_F(PlanningApi, RefusesWhatIsNoMessage) {
  const std::vector<std::pair<std::string, std::string>> bad{
      {"[]", "must be a JSON object"},
      {R"({"input": 1, "undo": true})", "a plan must be opened first"},
      {R"({"open": {"plan": 3, "anew": true}})", "'plan' must be a text"},
      {R"({"open": 3})", "must stand in an object"},
      {R"({"input": -1, "undo": true})", "'input' must be a whole number"},
      {R"({"input": 1, "dance": true})", "a message must have"},
      {R"({"input": 1, "view": {"azimuth_deg": 400}})", "'azimuth_deg' must be a number from -360"},
      {R"({"input": 1, "use": "poke", "pointers": []})", "'use' must be"},
      {R"({"input": 1, "use": "press", "pointers": [{"id": 1, "x": 9, "y": 0, "push_m": 0}]})",
       "'x' must be"},
      {R"({"input": 1, "use": "press", "pointers": [1,2,3,4,5,6]})", "at most 5"},
      {R"({"input": 1, "cut": {"line": [{"x": 0, "y": 0}], "depth_m": 0.01}})", "2 to 1000 places"},
      {R"({"input": 1, "save": {"file": "x"}})", "'name' is missing"}};
  for (const auto& [message, sentence] : bad) {
    const auto client = connect();
    client->send_text(message);
    const auto [code, said] = refusal(*client);
    EXPECT_EQ(code, 1008) << message;
    EXPECT_THAT(said, HasSubstr(sentence)) << message;
  }
  EXPECT_THROW(connect("https://elsewhere.example"), std::exception);
}

}  // namespace
}  // namespace kiroku::viewer
