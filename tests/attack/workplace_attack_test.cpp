// Somebody who has signed in to plan or to train, and wants what is everybody's: all places, the disk that a
// recorder writes to, a log without end. Real rooms before a real server.
#include <filesystem>
#include <fstream>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/moved_clock.h"
#include "tests/support/served_routes.h"
#include "tests/support/small_disk.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/viewer/planning/planned_block.h"
#include "viewer/planning/planning_api.h"
#include "viewer/training/training_api.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::next_said;
using test::refusal_of;
using test::Said;
using test::SocketClient;
using testing::HasSubstr;

/// The next text that has the key, whatever else comes before.
json until(SocketClient& client, const char* key) {
  while (const std::optional<Said> said = next_said(client)) {
    if (said->text.contains(key)) return said->text;
  }
  return nullptr;
}

class PlanningAttack : public testing::Test {
 protected:
  /// Two may plan at once on the plans of `folder`.
  void serve(const fs::path& plans) {
    PlanningOptions options;
    options.plans = plans;
    options.table = {"liver", sim::GpuUse::kOff, 96, 72};
    options.at_once = 2;
    options.patience = {};
    options.tell = [](const std::string& /*sentence*/) {};
    room.emplace(std::move(options));
    routes.emplace([this](Router& router) { add_planning_routes(router, *room, context); }, "anna",
                   Role::kSurgeon);
  }
  std::unique_ptr<SocketClient> open(const std::string& plan = "block/plan.json") {
    auto client = routes->connect("planning/table");
    client->send_text(json{{"open", {{"plan", plan}, {"anew", true}}}}.dump());
    return client;
  }
  static json save(SocketClient& client, const std::string& file, const char* answer) {
    client.send_text(R"({"input": 1, "hold": {"duration_s": 0.1}})");  // a plan has a step
    client.send_text(json{{"input", 2}, {"save", {{"file", file}, {"name", file}}}}.dump());
    return until(client, answer)[answer];
  }

  test::TemporaryFolder folder;
  test::MovedClock clock;
  test::PlannedBlock block;
  crypto::SigningKey key = crypto::SigningKey::generate();
  ViewerContext context{ViewerHome{.archive = folder / "archive",
                                   .catalogue_file = folder / "catalogue.sqlite",
                                   .log_folder = folder / "log",
                                   .users_file = folder / "users.sqlite",
                                   .control_socket = folder / "control",
                                   .copies_folder = folder / "copies",
                                   .device_key = &key,
                                   .device = crypto::VerifierKey("test", key.public_key()),
                                   .identities = {},
                                   .clock = &clock},
                        SessionLimits{}, [](const std::string& /*sentence*/) {}};
  std::optional<PlanningRoom> room;
  std::optional<test::ServedRoutes> routes;  // last: over before what it uses
};

TEST_F(PlanningAttack, OnePersonDoesNotTakeAllPlaces) {
  serve(block.folder());
  const auto first = open();
  EXPECT_TRUE(until(*first, "opened").is_object());
  EXPECT_THAT(refusal_of(*open()).second, HasSubstr("you plan here already, on another page"));
  routes->sign_in("ben", Role::kSurgeon);
  const auto second = open();
  EXPECT_TRUE(until(*second, "opened").is_object());
  routes->sign_in("cara", Role::kSurgeon);
  EXPECT_THAT(refusal_of(*open()).second, HasSubstr("as many people plan here as"));
}

TEST_F(PlanningAttack, PlansThatAreSavedLeaveARecorderItsRoom) {
  const test::SmallDisk disk(std::uint64_t{64} << 20);
  if (!disk.mounted()) GTEST_SKIP() << "no file system can be mounted here";
  fs::copy(block.folder() / "block", disk.path() / "block", fs::copy_options::recursive);
  serve(disk.path());
  const auto client = open();
  EXPECT_TRUE(until(*client, "opened").is_object());
  EXPECT_THAT(save(*client, "mine", "told").get<std::string>(), HasSubstr("the disk has no room"));
  EXPECT_FALSE(fs::exists(disk.path() / "block/mine.json"));
}

// Each is read whenever they are listed.
TEST_F(PlanningAttack, PlansAreNotSavedWithoutEnd) {
  std::ifstream plan(block.folder() / "block/plan.json");
  const std::string text{std::istreambuf_iterator<char>(plan), {}};
  for (std::size_t i = 1; i < PlanFolder::kMost; ++i)
    std::ofstream(block.folder() / ("block/" + std::to_string(i) + ".json")) << text;
  serve(block.folder());
  const auto client = open();
  EXPECT_TRUE(until(*client, "opened").is_object());
  EXPECT_THAT(save(*client, "mine", "told").get<std::string>(), HasSubstr("1000 plans here"));
  fs::remove(block.folder() / "block/1.json");
  client->send_text(R"({"input": 3, "save": {"file": "mine", "name": "mine"}})");
  EXPECT_EQ(until(*client, "saved")["saved"]["plan"], "block/mine.json");
}

// Each opening is an entry of the appliance log.
TEST_F(PlanningAttack, PlansThatAreOpenedAgainAndAgainFillNoLog) {
  serve(block.folder());
  for (int i = 0; i < 120; ++i) context.require_pace("user anna");
  EXPECT_THAT(until(*open(), "failed")["failed"].get<std::string>(),
              HasSubstr("more was done than the appliance log takes of one person at a time"));
  clock.move(std::chrono::seconds(1));
  EXPECT_TRUE(until(*open(), "opened").is_object());
}

// CTs and documents of anybody, as somebody puts them into the folder of plans: each costs itself alone.
TEST_F(PlanningAttack, AHostileFolderEndsNoPlanner) {
  const fs::path plans = block.folder() / "block";
  std::ifstream plan(plans / "plan.json");
  const json sound = json::parse(plan);
  const auto put = [&](const std::string& name, const json& document) {
    std::ofstream(plans / (name + ".json")) << document.dump();
  };
  const auto with_volume = [&](const std::string& name, const std::string& file, const std::string& bytes) {
    std::ofstream(plans / file, std::ios::binary) << bytes;
    json document = sound;
    document["volume"] = file;
    put(name, document);
  };
  const std::string nrrd =
      "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\n"
      "space directions: (2,0,0) (0,2,0) (0,0,2)\nspace origin: (-5,-5,-5)\n";
  with_volume("many-voxels", "a.nrrd", nrrd + "sizes: 100000 100000 100000\nencoding: raw\n\n");
  with_volume("eight-gigabytes", "b.nrrd", nrrd + "sizes: 2000 2000 1000\nencoding: raw\n\n");
  with_volume("negative", "c.nrrd", nrrd + "sizes: -1 -1 -1\nencoding: raw\n\n");
  with_volume("of-another-file", "d.nrrd", nrrd + "sizes: 8 8 8\nencoding: raw\ndata file: /etc/passwd\n\n");
  with_volume("noise", "e.nii", std::string(4096, '\x7f'));
  with_volume("brackets", "f.nrrd", std::string(100'000, '['));
  json deep = sound;
  deep["mesh"] = {{"series", 3}};
  put("series-that-is-no-text", deep);
  std::ofstream(plans / "deep.json") << R"({"mesh":1,"tools":{},"steps":[)" << std::string(100'000, '[')
                                     << std::string(100'000, ']') << "]}";
  fs::create_symlink("/dev/zero", plans / "zero.json");
  ASSERT_EQ(::mkfifo((plans / "pipe.json").c_str(), 0600), 0);
  serve(block.folder());
  for (const char* name : {"many-voxels", "eight-gigabytes", "negative", "of-another-file", "noise",
                           "brackets", "series-that-is-no-text", "deep", "zero", "pipe"}) {
    const auto client = open("block/" + std::string(name) + ".json");
    const json said = until(*client, "failed");
    EXPECT_TRUE(said.is_object()) << name;
  }
  EXPECT_TRUE(until(*open(), "opened").is_object());
}

class TrainingAttack : public testing::Test {
 protected:
  TrainingAttack() {
    TrainingOptions options;
    options.database = folder / "training.sqlite";
    options.vertices = 300;
    options.practice_s = 0;
    options.tell = [](const std::string& /*sentence*/) {};
    room.emplace(std::move(options));
    room->with_results([](trainer::TrainingDatabase& results) {
      results.add_trainee("Aoki", trainer::kStressShown, false, "anna");
      results.add_trainee("Baba", trainer::kStressShown, false, "ben");
    });
    routes.emplace([this](Router& router) { add_training_routes(router, *room); }, "anna", Role::kOperator);
  }
  /// The refusal's sentence; "" where the attempt began, which is broken off then.
  std::string begin(const std::string& trainee) {
    const auto client = routes->connect("training/attempt");
    client->send_text(
        json{{"begin",
              {{"trainee", trainee}, {"object", "a"}, {"fingers", 1}, {"test", false}, {"expert", false}}}}
            .dump());
    while (const std::optional<Said> said = next_said(*client)) {
      if (!said->text.contains("began")) continue;
      client->send_text(R"({"end": true})");
      until(*client, "over");
      return "";
    }
    return refusal_of(*client).second;
  }

  test::TemporaryFolder folder;
  std::optional<TrainingRoom> room;
  std::optional<test::ServedRoutes> routes;  // last: over before what it uses
};

TEST_F(TrainingAttack, NobodyTrainsOrIsAddedInAnothersName) {
  routes->sign_in("ben", Role::kOperator);
  EXPECT_THAT(begin("Aoki"), HasSubstr("only the user bound to Aoki"));
  EXPECT_EQ(routes->ask("GET", "training/trainees/Aoki/results").status, 404);
  const auto add = [&](const json& asked) { return routes->ask("POST", "training/trainees", asked.dump()); };
  EXPECT_EQ(add({{"name", "Chiba"}, {"group", trainer::kStressShown}, {"user", "cara"}}).status, 409)
      << "ben trains as Baba already, whoever he names";
  routes->sign_in("cara", Role::kOperator);
  EXPECT_EQ(add({{"name", "Aoki"}, {"group", trainer::kStressShown}}).status, 400) << "the name is taken";
  EXPECT_EQ(add({{"name", "Chiba\u202e"}, {"group", trainer::kStressShown}}).status, 400);
  EXPECT_EQ(add({{"name", std::string(5000, 'x')}, {"group", trainer::kStressShown}}).status, 400);
  routes->sign_out();
  EXPECT_EQ(routes->ask("GET", "training").status, 401);
}

}  // namespace
}  // namespace kiroku::viewer
