// Comparisons that a person asks for on the page: `kiroku view` has `kiroku compare` make them.
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/cube_plan.h"
#include "tests/support/eventually.h"
#include "tests/system/viewer/served_home.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

/// A sealed plan among the home's, and a case recorded by it.
class Matching : public ServedHome {
 protected:
  void SetUp() override {
    ASSERT_NO_FATAL_FAILURE(make_demo_home());
    plans_ = home() / "plans/cube";
    fs::create_directories(plans_);
    write_cube_plan(plans_);
    ASSERT_EQ(kiroku({"plan", "seal", (plans_ / "plan.json").string()}).status, 0);
    case_id_ = record({"--plan", (plans_ / "plan.seal.json").string()});
    ASSERT_NO_FATAL_FAILURE(add_users());
    start();
    surgeon_ = sign_in("a-surgeon");
  }
  [[nodiscard]] std::string record(const Arguments& more) const {
    Arguments arguments{"record",      "--json",
                        "--endoscope", "synthetic:endoscope?size=160x120&speed=max",
                        "--vitals",    "synthetic:patient?speed=max",
                        "--duration",  "00:00:04"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return fs::path(kiroku_json(arguments)["case"].get<std::string>()).filename().string();
  }
  [[nodiscard]] static std::string said(const std::string& name, const json& steps) {
    return json{{"name", name}, {"by_hand", {{"steps", steps}}}}.dump();
  }
  [[nodiscard]] HttpResponse ask_for(const std::string& cookie, const std::string& body) const {
    return ask("POST", case_path("/comparisons"), cookie, body);
  }
  /// How the one that was asked for ended.
  [[nodiscard]] json ended() const {
    HttpResponse answer;
    EXPECT_TRUE(eventually([&] {
      answer = ask("GET", case_path("/making"), surgeon_);
      return answer.status != 202;
    }));
    EXPECT_EQ(answer.status, 200) << answer.body;
    return json::parse(answer.body);
  }
  [[nodiscard]] std::vector<std::string> kept_files() const {
    std::vector<std::string> names;
    std::error_code none;
    for (const auto& file : fs::directory_iterator(home() / "comparisons" / case_id_, none))
      names.push_back(file.path().filename().string());
    return names;
  }

  fs::path plans_;
  std::string surgeon_;
};

TEST_F(Matching, TellsThePlannedStepsAndTheirMoments) {
  const HttpResponse answer = ask("GET", case_path("/matching"), surgeon_);
  ASSERT_EQ(answer.status, 200) << answer.body;
  const json told = json::parse(answer.body);
  EXPECT_EQ(told["plan"], "cube");
  EXPECT_EQ(told["stream"], "endoscope");
  ASSERT_EQ(told["steps"].size(), 3U);
  EXPECT_EQ(told["steps"][1]["name"], "Lift");
  EXPECT_EQ(told["steps"][2]["start_s"], 1);
  EXPECT_EQ(told["found"].size(), 0U) << "nobody marked anything";
  EXPECT_EQ(told["end_ns"].get<std::int64_t>() - told["begins_ns"].get<std::int64_t>(), 4'000'000'000);
  EXPECT_THAT(accesses(), testing::Contains(HasSubstr("matched a plan by hand a-surgeon (kiroku view")));
}

TEST_F(Matching, KeepsWhatTheCommandWouldUnderTheUsersName) {
  const json steps = {{{"step", 3}, {"start", 500'000'000}, {"end", 1'000'000'000}},
                      {{"step", 2}, {"start", 1'000'000'000}}};
  const HttpResponse begun = ask_for(surgeon_, said("by-hand", steps));
  ASSERT_EQ(begun.status, 202) << begun.body;
  EXPECT_EQ(json::parse(begun.body)["state"], "running");
  EXPECT_EQ(ask_for(surgeon_, said("another", steps)).status, 409) << "one at a time";
  ASSERT_EQ(ended()["state"], "done") << ended();

  const json rows = json::parse(ask("GET", case_path("/comparisons"), surgeon_).body)["comparisons"];
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0]["name"], "by-hand");
  EXPECT_EQ(rows[0]["made_by"], "a-surgeon");
  EXPECT_THAT(rows[0]["entered_by"].get<std::string>(), HasSubstr(" for a-surgeon (kiroku view, 127.0.0.1)"));
  EXPECT_EQ(rows[0]["replay"], true);
  EXPECT_EQ(rows[0]["whole"]["verdict"], "holds") << rows[0];
  EXPECT_EQ(rows[0]["sealed_before"]["verdict"], "holds") << rows[0];
  EXPECT_EQ(kiroku_json({"verify", case_id_, "--json"})["verdict"], "intact") << "the case is as it was";

  // The same as by the command, but for who made it and when.
  write_text(folder() / "hand.json", json{{"steps", steps}}.dump());
  EXPECT_EQ(kiroku_json({"compare", case_id_, (plans_ / "plan.seal.json").string(), "--by-hand",
                         (folder() / "hand.json").string(), "--name", "command", "--json"})["name"],
            "command");
  json by_page = json::parse(ask("GET", case_path("/comparisons/by-hand"), surgeon_).body);
  json by_command = json::parse(ask("GET", case_path("/comparisons/command"), surgeon_).body);
  for (json* each : {&by_page, &by_command}) {
    for (const char* own : {"made_by", "made_at", "case"}) each->erase(own);
    for (json& output : (*each)["outputs"]) output.erase("name");
  }
  EXPECT_EQ(by_page, by_command);
}

TEST_F(Matching, SaysInWordsWhatItDoesNotMake) {
  const auto sentence = [&](const HttpResponse& answer, int status) {
    EXPECT_EQ(answer.status, status) << answer.body;
    return json::parse(answer.body).value("error", "");
  };
  EXPECT_THAT(sentence(ask_for(surgeon_, said("../x", json::array())), 400), HasSubstr("cannot be called"));
  EXPECT_THAT(sentence(ask_for(surgeon_, R"({"name": "x"})"), 400), HasSubstr("'by_hand'"));
  EXPECT_EQ(ask("GET", case_path("/making"), surgeon_).status, 404);
  EXPECT_EQ(ask("DELETE", case_path("/making"), surgeon_, "{}").status, 404);

  ASSERT_EQ(ask_for(surgeon_, said("wrong", {{{"step", 7}, {"start", 1}}})).status, 202);
  const json wrong = ended();
  EXPECT_EQ(wrong["state"], "failed");
  EXPECT_THAT(wrong["problem"].get<std::string>(),
              HasSubstr("steps[0].step is 7: the plan's steps are 1 to 3"));
  EXPECT_EQ(kept_files(), std::vector<std::string>{}) << "nothing is left";

  for (const char* role : {"operator", "auditor"}) {
    const std::string cookie = sign_in(std::string("a-") + role);
    EXPECT_EQ(ask("GET", case_path("/matching"), cookie).status, 403) << role;
    EXPECT_EQ(ask_for(cookie, said("x", json::array())).status, 403) << role;
  }
  ASSERT_EQ(ask("DELETE", "/api/session/unlock", surgeon_, "{}").status, 204);
  EXPECT_EQ(ask("GET", case_path("/matching"), surgeon_).status, 423);
  EXPECT_EQ(ask_for(surgeon_, said("x", json::array())).status, 423);

  const std::string cookie = sign_in("a-administrator");
  fs::rename(plans_, folder() / "elsewhere");
  EXPECT_THAT(sentence(ask("GET", case_path("/matching"), cookie), 404), HasSubstr("put its folder into"));
  case_id_ = record({});
  EXPECT_THAT(sentence(ask("GET", case_path("/matching"), cookie), 404),
              HasSubstr("not recorded by a sealed"));
}

TEST_F(Matching, PicksPointsOnPicturesOfThePlanAndKeepsTheCameraThatFollows) {
  const auto pick = [&](const std::string& what, const json& body) {
    HttpResponse answer;
    EXPECT_TRUE(eventually([&] {
      answer = ask("POST", case_path("/picking/" + what), surgeon_, body.dump());
      return answer.status != 202;
    }));
    EXPECT_EQ(answer.status, 200) << answer.body;
    return json::parse(answer.body);
  };
  // At rest, seen from aside and above.
  json view{{"step", 1},  {"plan_s", 0}, {"azimuth_deg", 35}, {"elevation_deg", 25}, {"zoom", 1},
            {"pan_x", 0}, {"pan_y", 0},  {"width", 160},      {"height", 120}};
  EXPECT_GT(pick("picture", view)["jpeg"].get<std::string>().size(), 1000U);
  json points = json::array();
  for (const auto& [x, y] : std::vector<std::pair<double, double>>{
           {0.5, 0.5}, {0.4, 0.4}, {0.6, 0.6}, {0.45, 0.6}, {0.62, 0.45}, {0.5, 0.35}}) {
    json at = view;
    at["x"] = x;
    at["y"] = y;
    const json organ = pick("point", at)["organ"];
    ASSERT_TRUE(organ.is_array()) << x << " " << y;
    points.push_back({{"organ", organ}, {"pixel", {x * 160 - 0.5, y * 120 - 0.5}}});
  }
  const json judged = pick("registration", {{"width", 160}, {"height", 120}, {"points", points}});
  EXPECT_LT(judged.value("rms_px", 99.0), 0.01) << judged;

  const json said{{"name", "picked"},
                  {"by_hand",
                   {{"steps", {{{"step", 2}, {"start", 1'000'000'000}}}},
                    {"registration", {{"at", 1'500'000'000}, {"points", points}}}}}};
  ASSERT_EQ(ask_for(surgeon_, said.dump()).status, 202);
  ASSERT_EQ(ended()["state"], "done") << ended();
  const json document = json::parse(ask("GET", case_path("/comparisons/picked"), surgeon_).body);
  EXPECT_NEAR(document["registration"]["rms_px"].get<double>(), judged["rms_px"].get<double>(), 1e-9);
  EXPECT_NEAR(document["registration"]["field_deg"].get<double>(), judged["field_deg"].get<double>(), 1e-9);
  EXPECT_THAT(accesses(),
              testing::Contains(HasSubstr("picked points on pictures of a plan a-surgeon (kiroku view")));

  // What is no question, and who may not ask.
  view["step"] = 99;
  const HttpResponse wrong = ask("POST", case_path("/picking/picture"), surgeon_, view.dump());
  EXPECT_EQ(wrong.status, 400);
  EXPECT_THAT(wrong.body, HasSubstr("picture.step"));
  for (const char* role : {"operator", "auditor"}) {
    const std::string cookie = sign_in(std::string("a-") + role);
    for (const char* what : {"picture", "point", "registration"})
      EXPECT_EQ(ask("POST", case_path(std::string("/picking/") + what), cookie, "{}").status, 403) << role;
  }
}

TEST_F(Matching, IsStoppedWithoutATrace) {
  ASSERT_EQ(ask_for(surgeon_, said("stopped", {{{"step", 2}, {"start", 1'000'000'000}}})).status, 202);
  EXPECT_EQ(ask("DELETE", case_path("/making"), surgeon_, "{}").status, 204);
  const json state = ended();
  EXPECT_EQ(state["state"], "failed") << state;
  EXPECT_EQ(state["problem"], "it was stopped");
  EXPECT_EQ(kept_files(), std::vector<std::string>{});
  // And the next is made.
  ASSERT_EQ(ask_for(surgeon_, said("next", {{{"step", 2}, {"start", 1'000'000'000}}})).status, 202);
  EXPECT_EQ(ended()["state"], "done");
}

}  // namespace
}  // namespace kiroku::test
