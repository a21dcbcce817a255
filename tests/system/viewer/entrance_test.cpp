// One address for cases, planning and training: the programs as a technician starts them, asked as a browser
// asks.
#include <gmock/gmock.h>

#include "tests/support/build_paths.h"
#include "tests/support/socket_client.h"
#include "tests/system/viewer/served_home.h"

namespace kiroku::test {
namespace {

using nlohmann::json;
using testing::Contains;
using testing::HasSubstr;

class Entrance : public ServedHome {
 protected:
  void SetUp() override {
    make_demo_home();
    add_users();
    std::filesystem::create_directories(home() / "plans/demonstration");
    const std::filesystem::path demonstration = source_folder() / "deploy/demonstration";
    std::filesystem::copy_file(demonstration / "plan.json", home() / "plans/demonstration/plan.json");
    start();
  }
  std::unique_ptr<Process> behind(const Arguments& arguments) {
    auto program = std::make_unique<Process>(options(arguments));
    EXPECT_TRUE(program->wait_for("Ctrl-C ends it")) << program->wait(std::chrono::seconds(1)).err;
    return program;
  }
  static void expect_end(Process& program) {
    program.signal(SIGTERM);
    EXPECT_EQ(program.wait().status, 0);
  }
  /// "planning: open"
  std::vector<std::string> workplaces(const std::string& cookie) {
    std::vector<std::string> out;
    const json told = json::parse(ask("GET", "/api/workplaces", cookie).body);
    for (const json& place : told["workplaces"])
      out.push_back(place["name"].get<std::string>() + ": " + place["state"].get<std::string>());
    return out;
  }
};

TEST_F(Entrance, LeadsToWhatRunsAndSaysWhatDoesNot) {
  const std::string surgeon = sign_in("a-surgeon"), auditor = sign_in("a-auditor");
  EXPECT_THAT(workplaces(surgeon), testing::ElementsAre("cases: open", "planning: not-running",
                                                        "breathing: not-running", "training: not-running"));
  const HttpResponse away = ask("GET", "/api/planning/plans", surgeon);
  EXPECT_EQ(away.status, 503);
  EXPECT_THAT(away.body, HasSubstr("start kiroku plan serve"));

  auto planning = behind({"plan", "serve", "--gpu", "off"});
  EXPECT_THAT(planning->out(), HasSubstr("through the viewer of this home"));
  auto training = behind({"train", "serve", "--vertices", "900"});
  EXPECT_THAT(workplaces(surgeon), testing::ElementsAre("cases: open", "planning: open",
                                                        "breathing: not-running", "training: open"));
  EXPECT_THAT(workplaces(auditor), Contains("planning: no-right"));
  const json plans = json::parse(ask("GET", "/api/planning/plans", surgeon).body);
  EXPECT_EQ(plans["plans"][0]["plan"], "demonstration/plan.json");
  EXPECT_EQ(ask("GET", "/api/planning/plans", auditor).status, 403);

  // Who trains is who signed in at the viewer.
  const HttpResponse added =
      ask("POST", "/api/training/trainees", surgeon, R"({"name":"Aoki","group":"stress shown"})");
  EXPECT_EQ(added.status, 201) << added.body;
  EXPECT_EQ(json::parse(added.body)["user"], "a-surgeon");
  EXPECT_EQ(json::parse(ask("GET", "/api/training", auditor).body)["trainees"], json::array());

  const Process::Options again = options({"plan", "serve"});
  EXPECT_REFUSED(run_process(again), "another program answers");
  expect_end(*planning);
  EXPECT_THAT(workplaces(surgeon), Contains("planning: not-running"));
  EXPECT_FALSE(std::filesystem::exists(home() / "planning.sock"));
  // One that was killed leaves its socket behind, which the next one replaces.
  training->signal(SIGKILL);
  training->wait();
  EXPECT_THAT(workplaces(surgeon), Contains("training: not-running"));
  EXPECT_TRUE(std::filesystem::exists(home() / "training.sock"));
  training = behind({"train", "serve", "--vertices", "900"});
  EXPECT_THAT(workplaces(surgeon), Contains("training: open"));
  expect_end(*training);
}

TEST_F(Entrance, AnAttemptRunsThroughTheViewerAndIsOfWhoSignedInThere) {
  const auto training = behind({"train", "serve", "--vertices", "900", "--practice", "0"});
  const std::string cookie = sign_in("a-surgeon");
  ASSERT_EQ(ask("POST", "/api/training/trainees", cookie, R"({"name":"Aoki","group":"stress shown"})").status,
            201);
  SocketClient client(port_, "/api/training/attempt", cookie, "https://127.0.0.1:" + std::to_string(port_));
  client.send_text(R"({"begin":{"trainee":"Aoki","object":"a","fingers":3,"test":false,"expert":false}})");
  std::size_t pictures = 0;
  bool began = false;
  while (pictures < 5) {
    const auto message = client.receive(std::chrono::seconds(60));
    ASSERT_TRUE(message) << client.farewell().second;
    if (message->is_text)
      began = began || text_of(message->bytes).find("\"began\"") != std::string_view::npos;
    if (!message->is_text) ++pictures;
  }
  EXPECT_TRUE(began);
  client.send_text(R"({"end":true})");
  json over;
  while (over.is_null()) {
    const auto message = client.receive(std::chrono::seconds(60));
    ASSERT_TRUE(message) << client.farewell().second;
    if (!message->is_text) continue;
    const json said = json::parse(text_of(message->bytes));
    if (said.contains("over")) over = said["over"];
  }
  EXPECT_EQ(over["ending"], "given-up");
  const json results = json::parse(ask("GET", "/api/training/trainees/Aoki/results?object=a", cookie).body);
  EXPECT_EQ(results["attempts"].size(), 1U);
}

TEST_F(Entrance, APathThatIsTooLongForASocketIsToldInASentence) {
  const std::filesystem::path deep = folder() / std::string(110, 'd');
  ASSERT_EQ(kiroku({"init", "--demo", "--home", deep.string()}).status, 0);
  EXPECT_REFUSED(kiroku({"train", "serve", "--home", deep.string()}), "use a home with a shorter one");
}

}  // namespace
}  // namespace kiroku::test
