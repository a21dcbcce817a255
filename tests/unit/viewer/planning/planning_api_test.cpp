// The planner's routes before a real server, by the messages that a page sends.
#include "viewer/planning/planning_api.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "sim/plan/plan.h"
#include "tests/support/served_routes.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/viewer/planning/planned_block.h"
#include "viewer/api/workplaces.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using test::next_said;
using test::refusal_of;
using test::Said;
using test::SocketClient;
using testing::HasSubstr;
using testing::IsEmpty;

class PlanningApi : public testing::Test {
 protected:
  static PlanningOptions options_of(const std::filesystem::path& plans) {
    PlanningOptions options;
    options.plans = plans;
    options.patience = {};
    options.table = {"liver", sim::GpuUse::kOff, 96, 72};
    options.tell = [](const std::string& /*sentence*/) {};
    return options;
  }
  std::unique_ptr<SocketClient> connect(const std::string& origin = "") {
    return routes.connect("planning/table", origin);
  }
  /// The next text that has the key, whatever else comes before.
  static json until(SocketClient& client, const char* key) {
    while (const std::optional<Said> said = next_said(client)) {
      if (said->text.contains(key)) return said->text;
    }
    return nullptr;
  }
  /// The first picture in which the deed is.
  static json picture_of(SocketClient& client, std::uint64_t input) {
    while (const std::optional<Said> said = next_said(client)) {
      if (said->jpeg_bytes > 0 && said->text["input"] >= input) return said->text;
    }
    return nullptr;
  }

  /// Entries of the appliance log about who opened what.
  std::vector<json> openings() const {
    std::vector<json> found;
    std::ifstream log(folder / "log/ledger.jsonl");
    for (std::string line; std::getline(log, line);) {
      json entry = json::parse(line);
      if (entry["type"] == "access") found.push_back(std::move(entry));
    }
    return found;
  }

  test::TemporaryFolder folder;
  test::PlannedBlock block;
  PlanningRoom room{options_of(block.folder())};
  crypto::SigningKey key = crypto::SigningKey::generate();
  ViewerContext context{ViewerHome{.archive = folder / "archive",
                                   .catalogue_file = folder / "catalogue.sqlite",
                                   .log_folder = folder / "log",
                                   .users_file = folder / "users.sqlite",
                                   .control_socket = folder / "control",
                                   .copies_folder = folder / "copies",
                                   .device_key = &key,
                                   .device = crypto::VerifierKey("test", key.public_key()),
                                   .identities = {}},
                        SessionLimits{}, [](const std::string& /*sentence*/) {}};
  test::ServedRoutes routes{[this](Router& router) { add_planning_routes(router, room, context); }, "anna",
                            Role::kSurgeon};
};

TEST_F(PlanningApi, HasTheRoutesToWhichTheViewerLeadsAndNoOther) {
  Router router;
  add_planning_routes(router, room, context);
  test::expect_to_be(router, kPlanningRoutes);
}

TEST_F(PlanningApi, ListsPlansForWhoMayPlan) {
  EXPECT_EQ(routes.ask("GET", "planning/plans").status, 200);
  EXPECT_EQ(
      routes.answer("GET", "planning/plans"),
      json::parse(
          R"({"plans": [{"plan": "block/plan.json", "name": "Block", "steps": 2, "has_volume": true}]})"));
  for (const Role role : {Role::kOperator, Role::kAuditor}) {
    routes.sign_in("otto", role);
    EXPECT_EQ(routes.ask("GET", "planning/plans").status, 403);
  }
  routes.sign_out();
  EXPECT_EQ(routes.ask("GET", "planning/plans").status, 401);
}

TEST_F(PlanningApi, OpensPlansAndSaves) {
  const auto client = connect();
  client->send_text(R"({"open": {"plan": "block/plan.json", "anew": true}})");
  EXPECT_EQ(until(*client, "opened")["opened"]["vertices"], 225);
  const std::vector<json> entered = openings();
  ASSERT_EQ(entered.size(), 1U) << "by the time that anything of it is seen";
  EXPECT_EQ(entered[0]["what"], "opened plan block/plan.json with its volume");
  EXPECT_EQ(entered[0]["who"], "anna (kiroku view, 127.0.0.1)");
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
  EXPECT_EQ(routes.answer("GET", "planning/plans")["plans"].size(), 2U);
}

TEST_F(PlanningApi, ShowsNothingThatTheLogCannotName) {
  // As where a disk is full: what lies where the log's ledger was is none.
  std::filesystem::remove_all(folder / "log");
  std::ofstream(folder / "log") << "in the way";
  const auto client = connect();
  client->send_text(R"({"open": {"plan": "block/plan.json", "anew": true}})");
  EXPECT_THAT(until(*client, "failed")["failed"], HasSubstr("the appliance log cannot be written"));
}

TEST_F(PlanningApi, RefusesInWords) {
  const auto unknown = connect();
  unknown->send_text(R"({"open": {"plan": "../plan.json", "anew": true}})");
  EXPECT_THAT(until(*unknown, "failed")["failed"], HasSubstr("there is no plan of that name"));
  EXPECT_THAT(openings(), IsEmpty()) << "nothing was opened";
  // One place, which is taken as long as somebody plans.
  const auto second = connect();
  second->send_text(R"({"open": {"plan": "block/plan.json", "anew": true}})");
  EXPECT_TRUE(until(*second, "opened").is_object()) << "whose plan could not be opened has no place";
  const auto third = connect();
  third->send_text(R"({"open": {"plan": "block/plan.json", "anew": true}})");
  EXPECT_THAT(refusal_of(*third).second, HasSubstr("you plan here already"));
  routes.sign_in("ben", Role::kSurgeon);
  const auto fourth = connect();
  fourth->send_text(R"({"open": {"plan": "block/plan.json", "anew": true}})");
  EXPECT_THAT(refusal_of(*fourth).second, HasSubstr("as many people plan here"));
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
      {R"({"input": 1, "use": "grasp", "pointers": [{"id": 1, "x": 0, "y": 0, "push_m": 0, "lean_x_deg": 200}]})",
       "'lean_x_deg' must be a number from -180"},
      {R"({"input": 1, "use": "grasp", "pointers": [{"id": 1, "x": 0, "y": 0, "push_m": 0, "lean_y_deg": "1"}]})",
       "'lean_y_deg' must be"},
      {R"({"input": 1, "use": "press", "pointers": [1,2,3,4,5,6]})", "at most 5"},
      {R"({"input": 1, "cut": {"line": [{"x": 0, "y": 0}], "depth_m": 0.01}})", "2 to 1000 places"},
      {R"({"input": 1, "handle": {"step": 0, "handle": 1}})", "'handle' must have 'x' and 'y', 'depth_m'"},
      {R"({"input": 1, "handle": {"step": 0, "handle": 1, "x": 0.5}})", "'y' is missing"},
      {R"({"input": 1, "handle": {"step": -1, "handle": 1, "depth_m": 0.01}})", "'step' must be"},
      {R"({"input": 1, "handle": {"step": 0, "handle": 1, "depth_m": 4}})", "'depth_m' must be"},
      {R"({"input": 1, "save": {"file": "x"}})", "'name' is missing"}};
  for (const auto& [message, sentence] : bad) {
    const auto client = connect();
    client->send_text(message);
    const auto [code, said] = refusal_of(*client);
    EXPECT_EQ(code, 1008) << message;
    EXPECT_THAT(said, HasSubstr(sentence)) << message;
  }
  EXPECT_THROW(connect("https://elsewhere.example"), std::exception);
}

}  // namespace
}  // namespace kiroku::viewer
