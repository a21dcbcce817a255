// The breathing workbench's route before a real server, by the messages that a page sends.
#include "viewer/breathing/breathing_api.h"

#include <fstream>
#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "tests/support/served_routes.h"
#include "tests/unit/viewer/breathing/chest_bench.h"
#include "viewer/api/workplaces.h"
#include "viewer/breathing/breathing_messages.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using test::next_said;
using test::refusal_of;
using test::Said;
using test::SocketClient;
using testing::HasSubstr;

class BreathingApi : public testing::Test {
 protected:
  static json until_said(SocketClient& client, const char* key) {
    while (const std::optional<Said> said = next_said(client)) {
      if (said->text.contains(key)) return said->text[key];
    }
    return nullptr;
  }
  static json picture_with(SocketClient& client, std::uint64_t input) {
    while (const std::optional<Said> said = next_said(client)) {
      if (said->jpeg_bytes > 0 && said->text["input"] >= input) return said->text;
    }
    return nullptr;
  }
  static std::string message(std::uint64_t input, const char* key, const json& what) {
    return json{{"input", input}, {key, what}}.dump();
  }

  test::ChestBench chest;
  BreathingBench bench{chest.inputs_with_radiographs()};
  BreathingRoom room{bench, 1, [](const std::string& /*sentence*/) {}, {}, {}};
  test::TemporaryFolder folder;
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
  test::ServedRoutes routes{[this](Router& router) { add_breathing_routes(router, room, context); }, "anna",
                            Role::kSurgeon};
};

TEST_F(BreathingApi, HasTheRoutesToWhichTheViewerLeadsAndNoOther) {
  Router router;
  add_breathing_routes(router, room, context);
  test::expect_to_be(router, kBreathingRoutes);
}

// Whoever came from a case's page must see whether its pictures are open; whoever audits, of which case.
TEST_F(BreathingApi, SaysOfWhichCaseTheRadiographsAre) {
  BenchInputs inputs = chest.inputs_with_radiographs();
  inputs.recording = BenchRecording{"20261127T092621Z-6cd8605e", "fluoroscopy", 4.5};
  const BreathingBench recorded{std::move(inputs)};
  BreathingRoom of_case{recorded, 1, [](const std::string& /*sentence*/) {}};
  test::ServedRoutes served{[&](Router& router) { add_breathing_routes(router, of_case, context); }, "anna",
                            Role::kSurgeon};
  const json of = until_said(*served.connect("breathing/table"), "opened")["recording"];
  EXPECT_EQ(of["case"], "20261127T092621Z-6cd8605e");
  EXPECT_EQ(of["stream"], "fluoroscopy");
  EXPECT_EQ(of["first_s"], 4.5);
  std::ifstream log(folder / "log/ledger.jsonl");
  const std::string entered((std::istreambuf_iterator<char>(log)), {});
  EXPECT_THAT(entered, HasSubstr("with its CT and 6 radiographs of its fluoroscopy"));
  EXPECT_THAT(entered, HasSubstr("20261127T092621Z-6cd8605e"));
}

TEST_F(BreathingApi, ShowsMovesMeasuresAndSaves) {
  const auto client = routes.connect("breathing/table");
  const json opened = until_said(*client, "opened");
  EXPECT_EQ(opened["file"], "lung.json");
  EXPECT_EQ(opened["radiographs"], 6);
  EXPECT_EQ(opened["recording"], nullptr);
  EXPECT_EQ(opened["columns"], 128);
  EXPECT_GT(opened["groups"]["diaphragm"], 10);
  EXPECT_EQ(opened["motion"]["cycle_s"], 3.6);
  std::ifstream log(folder / "log/ledger.jsonl");
  const std::string entered((std::istreambuf_iterator<char>(log)), {});
  EXPECT_THAT(entered, HasSubstr("opened lung lung.json with its CT and 6 radiographs"));
  json motion = opened["motion"];
  motion["diaphragm"]["amplitude_mm"] = 4.5;
  motion["diaphragm"]["direction"] = {0, 0, -2};
  client->send_text(message(1, "motion", motion));
  json path = until_said(*client, "path");
  while (path["revision"] != 2) path = until_said(*client, "path");
  EXPECT_EQ(path["times_s"].size(), 6U);
  client->send_text(message(2, "moment", {{"time_s", bench.radiographs()[4].time_s}}));
  const json moment = picture_with(*client, 2);
  EXPECT_EQ(moment["radiograph"], 4);
  EXPECT_EQ(moment["revision"], 2);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(moment["tumour_mm"][axis].get<double>(), path["mm"][4][axis].get<double>(), 1e-9);
  }
  const json similarity = until_said(*client, "similarity");
  EXPECT_EQ(similarity["revision"], 2);
  EXPECT_EQ(similarity["values"].size(), 6U);
  client->send_text(message(3, "look", {{"mode", "wipe"}, {"part", 0.3}, {"outlined", false}}));
  EXPECT_EQ(picture_with(*client, 3)["input"], 3);
  client->send_text(message(4, "save", {{"file", "lung"}, {"motion", motion}, {"seal", false}}));
  EXPECT_THAT(until_said(*client, "told"), HasSubstr("there is a file 'lung.json' already"));
  client->send_text(message(5, "save", {{"file", "by hand"}, {"motion", motion}, {"seal", false}}));
  EXPECT_EQ(until_said(*client, "saved"), (json{{"input", 5}, {"file", "by hand.json"}, {"seal", nullptr}}))
      << "by the input the page knows what it sent";
  const sim::BreathingModel saved = sim::read_breathing_model(chest.folder() / "by hand.json");
  EXPECT_NEAR(saved.motion.diaphragm.amplitude_m, 0.0045, 1e-12);
  EXPECT_EQ(*saved.motion.diaphragm.direction, sim::Vector3(0, 0, -1));
}

TEST_F(BreathingApi, GroupsArePaintedShownAndSaved) {
  const auto client = routes.connect("breathing/table");
  json motion = until_said(*client, "opened")["motion"];
  EXPECT_EQ(motion["groups"], nullptr);
  const json surface = until_said(*client, "surface");
  const std::string own = surface["groups"];
  ASSERT_EQ(own.size(), bench.surface().nodes.size());
  EXPECT_EQ(surface["nodes_mm"].size(), 3 * own.size());
  EXPECT_EQ(surface["faces"].size(), 3 * bench.surface().faces.size());
  for (const json& corner : surface["faces"]) ASSERT_LT(corner, own.size());
  const std::uint32_t node = bench.surface().nodes[7];
  EXPECT_EQ(own[7] - '0', static_cast<int>(bench.model().groups[node]));
  EXPECT_NEAR(surface["nodes_mm"][22].get<double>(), 1000 * bench.model().mesh.nodes[node].y(), 0.006);
  // Nothing moves without a diaphragm: the page is told which motion stands, and by which message's time.
  std::string none = own;
  std::ranges::replace(none, '3', '1');
  motion["groups"] = none;
  client->send_text(message(1, "motion", motion));
  const json refused = until_said(*client, "refused");
  EXPECT_THAT(refused["why"].get<std::string>(), HasSubstr("of the group diaphragm"));
  EXPECT_EQ(refused["input"], 1);
  EXPECT_EQ(refused["motion"]["groups"], nullptr);
  std::string painted = own;
  const std::size_t at = own.find('2');
  painted[at] = '3';
  motion["groups"] = painted;
  client->send_text(message(2, "motion", motion));
  EXPECT_EQ(picture_with(*client, 2)["revision"], 2) << "a refused motion is none";
  client->send_text(message(3, "save", {{"file", "painted"}, {"motion", motion}, {"seal", false}}));
  EXPECT_EQ(until_said(*client, "saved")["file"], "painted.json");
  const sim::BreathingModel saved = sim::read_breathing_model(chest.folder() / "painted.json");
  EXPECT_EQ(saved.groups[bench.surface().nodes[at]], sim::BoundaryGroup::kDiaphragm);
}

// A fit may write over the model's file while its page is open. What is saved is what was seen.
TEST_F(BreathingApi, SavesTheModelThatWasOpened) {
  const auto client = routes.connect("breathing/table");
  const json motion = until_said(*client, "opened")["motion"];
  chest.write("lung.json", test::ChestBench::document(R"("tumour": {"region": 2}, "name": "another")"));
  client->send_text(message(1, "save", {{"file", "seen"}, {"motion", motion}, {"seal", false}}));
  EXPECT_EQ(until_said(*client, "saved")["file"], "seen.json");
  EXPECT_EQ(sim::read_breathing_model(chest.folder() / "seen.json").name, "");
  // The mesh is named, not kept: with another one the saved lung would be one that nobody has seen.
  std::ofstream(chest.folder() / "lung.msh", std::ios::app) << "\n";
  client->send_text(message(2, "save", {{"file", "other"}, {"motion", motion}, {"seal", false}}));
  EXPECT_THAT(until_said(*client, "told").get<std::string>(),
              HasSubstr("'lung.msh' has changed since this lung was opened"));
  EXPECT_FALSE(std::filesystem::exists(chest.folder() / "other.json"));
}

// Between the model and the end of all that is read beside it minutes may lie.
TEST_F(BreathingApi, SavesNothingOfAMeshThatWasExchangedWhileItBegan) {
  BenchInputs inputs = chest.inputs();
  std::ofstream(chest.folder() / "lung.msh", std::ios::app) << "\n";
  const BreathingBench begun{std::move(inputs)};
  EXPECT_THROW((void)begun.save("other", begun.own_motion()), Refusal);
  EXPECT_FALSE(std::filesystem::exists(chest.folder() / "other.json"));
}

// The folder may lie on a recorder's disk, and whoever may plan may save.
TEST_F(BreathingApi, ModelsAreNotSavedWithoutEnd) {
  for (std::size_t i = 1; i < BreathingBench::kMostModels; ++i)
    std::ofstream(chest.folder() / (std::to_string(i) + ".json")) << "{}";
  const auto client = routes.connect("breathing/table");
  const json motion = until_said(*client, "opened")["motion"];
  client->send_text(message(1, "save", {{"file", "mine"}, {"motion", motion}, {"seal", false}}));
  EXPECT_THAT(until_said(*client, "told").get<std::string>(), HasSubstr("1000 models beside this one"));
  std::filesystem::remove(chest.folder() / "1.json");
  client->send_text(message(2, "save", {{"file", "mine"}, {"motion", motion}, {"seal", false}}));
  EXPECT_EQ(until_said(*client, "saved")["file"], "mine.json");
}

TEST_F(BreathingApi, SealsNothingWithoutAHome) {
  const auto client = routes.connect("breathing/table");
  const json opened = until_said(*client, "opened");
  EXPECT_EQ(opened["may_seal"], false);
  client->send_text(message(1, "save", {{"file", "planned"}, {"motion", opened["motion"]}, {"seal", true}}));
  EXPECT_THAT(until_said(*client, "told"), HasSubstr("seals no models"));
  EXPECT_FALSE(std::filesystem::exists(chest.folder() / "planned.json"));
}

/// Whose sealer refuses the second model.
struct SealingApi : BreathingApi {
  std::vector<std::filesystem::path> sealed;
  BreathingRoom sealing_room{
      bench, 2, [](const std::string& /*sentence*/) {},
      [this](const std::filesystem::path& model) {
        EXPECT_NO_THROW(static_cast<void>(sim::read_breathing_model(model)));
        sealed.push_back(model);
        if (sealed.size() > 1) throw Error("the log is full");
        return SealedModel{"planned.seal.json", "ab12", {{"embedded", "now", "", "self-issued"}}};
      }};
  test::ServedRoutes sealing_routes{
      [this](Router& router) { add_breathing_routes(router, sealing_room, context); }, "anna",
      Role::kSurgeon};
};

TEST_F(SealingApi, SealsWhatItSavedAndTellsWhereThatFailed) {
  const auto client = sealing_routes.connect("breathing/table");
  const json opened = until_said(*client, "opened");
  EXPECT_EQ(opened["may_seal"], true);
  const auto wanted = [&](const char* file) {
    return json{{"file", file}, {"motion", opened["motion"]}, {"seal", true}};
  };
  client->send_text(message(1, "save", wanted("planned")));
  const json saved = until_said(*client, "saved");
  EXPECT_EQ(saved["file"], "planned.json");
  EXPECT_EQ(
      saved["seal"],
      (json{{"file", "planned.seal.json"},
            {"sha256", "ab12"},
            {"time_stamps",
             {{{"authority", "embedded"}, {"time", "now"}, {"kind", "self-issued"}, {"problem", ""}}}}}));
  ASSERT_EQ(sealed.size(), 1U);
  EXPECT_EQ(sealed.front(), chest.folder() / "planned.json");
  // What is there is not saved over, and not sealed.
  client->send_text(message(2, "save", wanted("planned")));
  EXPECT_THAT(until_said(*client, "told"), HasSubstr("there is a file 'planned.json' already"));
  EXPECT_EQ(sealed.size(), 1U);
  // What could not be sealed is saved all the same, and both are told.
  client->send_text(message(3, "save", wanted("other")));
  EXPECT_EQ(until_said(*client, "saved")["seal"], nullptr);
  EXPECT_THAT(until_said(*client, "told"), HasSubstr("the log is full"));
}

/// Whose authority answers once it is let.
struct SlowSealingApi : BreathingApi {
  // A test that ended before it let the authority answer would wait for it for ever.
  ~SlowSealingApi() override {
    try {
      let.set_value();
    } catch (const std::future_error&) {
      // The test let it.
    }
  }
  std::promise<void> let;
  BreathingRoom slow_room{bench, 2, [](const std::string& /*sentence*/) {},
                          [answer = let.get_future().share()](const std::filesystem::path& /*model*/) {
                            answer.wait();
                            return SealedModel{"planned.seal.json", "ab12", {{"embedded", "now", ""}}};
                          }};
  test::ServedRoutes slow_routes{[this](Router& router) { add_breathing_routes(router, slow_room, context); },
                                 "anna", Role::kSurgeon};
};

TEST_F(SlowSealingApi, PicturesGoOnWhileAuthoritiesAreAsked) {
  const auto client = slow_routes.connect("breathing/table");
  const json motion = until_said(*client, "opened")["motion"];
  client->send_text(message(1, "save", {{"file", "planned"}, {"motion", motion}, {"seal", true}}));
  client->send_text(message(2, "moment", {{"time_s", bench.radiographs()[4].time_s}}));
  EXPECT_EQ(picture_with(*client, 2)["radiograph"], 4);
  client->send_text(message(3, "save", {{"file", "another"}, {"motion", motion}, {"seal", true}}));
  EXPECT_THAT(until_said(*client, "told").get<std::string>(), HasSubstr("a model is being sealed"));
  client->send_text(message(4, "save", {{"file", "unsealed"}, {"motion", motion}, {"seal", false}}));
  EXPECT_EQ(until_said(*client, "saved")["file"], "unsealed.json");
  let.set_value();
  const json saved = until_said(*client, "saved");
  EXPECT_EQ(saved["input"], 1);
  EXPECT_EQ(saved["file"], "planned.json");
  EXPECT_EQ(saved["seal"]["file"], "planned.seal.json");
  EXPECT_FALSE(std::filesystem::exists(chest.folder() / "another.json"));
}

TEST_F(BreathingApi, SaysWhyASeriesIsTooShortForAFit) {
  const auto client = routes.connect("breathing/table");
  const json opened = until_said(*client, "opened");
  EXPECT_EQ(opened["can_fit"], false);
  client->send_text(message(1, "fit", {{"motion", opened["motion"]}, {"direction", false}}));
  EXPECT_THAT(until_said(*client, "fit_ended"), HasSubstr("the series has 6 moments; 8 at least"));
}

/// A series that is long enough for a fit.
struct LongSeriesApi : BreathingApi {
  LongSeriesApi() : fit_bench(chest.inputs_with_radiographs(16)) {}
  BreathingBench fit_bench;
  BreathingRoom fit_room{fit_bench, 2, [](const std::string& /*sentence*/) {}};
  test::ServedRoutes fit_routes{[this](Router& router) { add_breathing_routes(router, fit_room, context); },
                                "anna", Role::kSurgeon};
};

TEST_F(LongSeriesApi, FitsCancelsAndFitsAgain) {
  const auto client = fit_routes.connect("breathing/table");
  const json opened = until_said(*client, "opened");
  EXPECT_EQ(opened["can_fit"], true);
  const json wanted{{"motion", opened["motion"]}, {"direction", true}};
  {
    const auto turn = fit_room.enter_fit("otto");
    client->send_text(message(1, "fit", wanted));
    EXPECT_THAT(until_said(*client, "fit_ended"), HasSubstr("another fit is being computed"));
  }
  client->send_text(message(2, "fit", wanted));
  client->send_text(message(3, "cancel", true));
  EXPECT_THAT(until_said(*client, "fit_ended"), HasSubstr("was cancelled"));
  client->send_text(message(4, "fit", wanted));
  EXPECT_GT(until_said(*client, "fitting")["all"], 0);
  const json fitted = until_said(*client, "fitted");
  EXPECT_EQ(fitted["refusal"], nullptr);
  EXPECT_NEAR(fitted["motion"]["diaphragm"]["amplitude_mm"].get<double>(), 9, 1);
  EXPECT_NEAR(fitted["motion"]["cycle_s"].get<double>(), 3.6, 0.05);
  EXPECT_GT(fitted["errors"]["diaphragm"]["amplitude_mm"], 0);
  EXPECT_GT(fitted["errors"]["cycle_s"], 0);
  EXPECT_GT(fitted["similarity"]["after"], fitted["similarity"]["before"]);
  EXPECT_EQ(fitted["tumour"].size(), 16U);
  EXPECT_GT(std::ranges::count_if(fitted["tumour"], [](const json& one) { return !one.is_null(); }), 10);
  // What came is a motion that can be shown.
  client->send_text(message(5, "motion", fitted["motion"]));
  EXPECT_EQ(picture_with(*client, 5)["input"], 5);
}

TEST_F(BreathingApi, HasOnePlaceForWhoMayPlan) {
  const auto client = routes.connect("breathing/table");
  EXPECT_TRUE(until_said(*client, "opened").is_object());
  EXPECT_THROW(routes.connect("breathing/table"), std::exception) << "one place";
  routes.sign_in("otto", Role::kOperator);
  EXPECT_THROW(routes.connect("breathing/table"), std::exception);
  EXPECT_THROW(routes.connect("breathing/table", "https://elsewhere.example"), std::exception);
}

TEST_F(BreathingApi, RefusesWhatIsNoMessageAndNoMotion) {
  const auto changed = [&](const char* group, const char* name, const json& value) {
    json motion = motion_json(bench.own_motion());
    motion[group][name] = value;
    return message(1, "motion", motion);
  };
  json no_cycle = motion_json(bench.own_motion());
  no_cycle["cycle_s"] = 0.1;
  json of_no_group = motion_json(bench.own_motion()), no_groups = of_no_group;
  of_no_group["groups"] = "1260";
  no_groups.erase("groups");
  const std::vector<std::pair<std::string, std::string>> bad{
      {"[]", "must be a JSON object"},
      {R"({"motion": {}})", "'input' is missing"},
      {R"({"input": 1, "dance": true})", "a message must have"},
      {R"({"input": 1, "motion": {}})", "'rib_cage' is missing"},
      {changed("diaphragm", "amplitude_mm", 201), "'amplitude_mm' must be a number from -200"},
      {changed("rib_cage", "phase_s", "early"), "'phase_s' must be a number from -60"},
      {changed("rib_cage", "direction", "down"), "'direction' must be null"},
      {changed("rib_cage", "direction", {0, 0, 0}), "which is no direction"},
      {message(1, "motion", of_no_group), "'groups' must be null, or a figure from 1 to 5"},
      {message(1, "motion", no_groups), "'groups' is missing"},
      {message(1, "motion", no_cycle), "'cycle_s' must be a number from 0.2"},
      {R"({"input": 1, "moment": {"time_s": 1e9}})", "'time_s' must be"},
      {R"({"input": 1, "look": {"mode": "upside down", "part": 0, "outlined": true}})", "'mode' must be"},
      {R"({"input": 1, "look": {"mode": "wipe", "part": 2, "outlined": true}})", "'part' must be"},
      {R"({"input": 1, "save": {"file": "x"}})", "'motion' is missing"},
      {R"({"input": 1, "fit": {"direction": true}})", "'motion' is missing"},
      {message(1, "fit", {{"motion", motion_json(bench.own_motion())}}), "'direction' is missing"}};
  for (const auto& [text, sentence] : bad) {
    std::string refused = "taken";
    try {
      static_cast<void>(parse_breathing_message(text));
    } catch (const Refusal& refusal) {
      refused = refusal.what();
    }
    EXPECT_THAT(refused, HasSubstr(sentence)) << text;
  }
  // Over the connection each ends it, with the sentence.
  const auto client = routes.connect("breathing/table");
  client->send_text(R"({"input": 1, "dance": true})");
  const auto [code, said] = refusal_of(*client);
  EXPECT_EQ(code, 1008);
  EXPECT_THAT(said, HasSubstr("a message must have"));
}

}  // namespace
}  // namespace kiroku::viewer
