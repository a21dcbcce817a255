// The trainer's routes before a real server: attempts on a real organ, by the messages that a page sends.
#include "viewer/training/training_api.h"

#include <condition_variable>
#include <mutex>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/eventually.h"
#include "tests/support/flat_organ_volume.h"
#include "tests/support/moved_clock.h"
#include "tests/support/served_routes.h"
#include "tests/support/temporary_folder.h"
#include "trainer/exclusion/patient_organ.h"
#include "viewer/api/workplaces.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using test::next_said;
using test::refusal_of;
using test::Said;
using test::SocketClient;
using testing::HasSubstr;
using trainer::Ending;

class TrainingApi : public testing::Test {
 protected:
  using Organs = std::vector<std::shared_ptr<const trainer::ExclusionBody>>;
  explicit TrainingApi(Organs served = {}, const DeedPace::Limits& limits = TrainingOptions().pace)
      : pace(limits), organs(std::move(served)) {
    routes.emplace([this](Router& router) { add_training_routes(router, room()); }, "root",
                   Role::kAdministrator);
  }

  TrainingRoom& room() {
    if (!kept_room) {
      TrainingOptions options;
      options.database = folder / "training.sqlite";
      options.vertices = 900;
      options.at_once = 2;
      options.patience = {};
      options.pace = pace;
      options.clock = &clock;
      options.organs = organs;
      for (const auto& organ : organs) options.doubted.insert(organ->object().name);
      options.tell = [this](const std::string& sentence) {
        const std::lock_guard guard(told_mutex);
        told.push_back(sentence);
      };
      kept_room.emplace(std::move(options));
      kept_room->with_results([](trainer::TrainingDatabase& results) {
        results.add_trainee("Aoki", trainer::kStressShown, false, "anna");
        results.add_trainee("Ueda", trainer::kStressHidden, false);
        results.add_trainee("model", "", true);
      });
    }
    return *kept_room;
  }

  Response ask(const std::string& method, const std::string& path, const std::string& body = "") {
    return routes->ask(method, path, body);
  }
  json answer(const std::string& method, const std::string& path, const std::string& body = "") {
    return routes->answer(method, path, body);
  }
  std::unique_ptr<SocketClient> connect() { return routes->connect("training/attempt"); }
  static std::string begin(const std::string& trainee, bool test = false, std::size_t fingers = 3,
                           const std::string& object = "a") {
    return json{
        {"begin",
         {{"trainee", trainee}, {"object", object}, {"fingers", fingers}, {"test", test}, {"expert", false}}}}
        .dump();
  }
  /// Of what asks for the colours of pressed tissue, too.
  static std::string with_press(const std::string& asked) {
    json message = json::parse(asked);
    message["begin"]["press"] = true;
    return message.dump();
  }
  static std::string input(std::uint64_t number, double y) {
    return json{{"input", number}, {"pointers", {{{"finger", 0}, {"x", 0.5}, {"y", y}, {"push_m", 0}}}}}
        .dump();
  }
  /// The next text, whatever pictures come before.
  static json next_text(SocketClient& client) {
    while (const std::optional<Said> said = next_said(client)) {
      if (said->jpeg_bytes == 0) return said->text;
    }
    return nullptr;
  }
  std::vector<trainer::ExclusionRecord> kept() {
    return room().with_results([](const trainer::TrainingDatabase& results) { return results.attempts(); });
  }
  /// A practice attempt of so long.
  void practised(const std::string& trainee, double seconds) {
    room().with_results([&](trainer::TrainingDatabase& results) {
      trainer::ExclusionRecord record;
      record.object = "a";
      record.fingers = 3;
      record.score.time_s = seconds;
      results.add_attempt(results.trainee(trainee), record, utc_now());
    });
  }

  test::TemporaryFolder folder;
  const DeedPace::Limits pace;
  test::MovedClock clock;
  std::mutex told_mutex;
  std::vector<std::string> told;
  Organs organs;
  std::optional<TrainingRoom> kept_room;
  std::optional<test::ServedRoutes> routes;  // last: over before what it uses
};

TEST_F(TrainingApi, HasTheRoutesToWhichTheViewerLeadsAndNoOther) {
  Router router;
  add_training_routes(router, room());
  test::expect_to_be(router, kTrainingRoutes);
}

TEST_F(TrainingApi, AnAttemptIsDoneByThePointersOfAPageAndKept) {
  const auto client = connect();
  client->send_text(with_press(begin("Aoki")));
  const json began = next_text(*client)["began"];
  EXPECT_EQ(began["press_n"], json::parse("[0.5, 1.0]"));
  EXPECT_EQ(began["session"], 1);
  EXPECT_EQ(began["stress_shown"], true);
  EXPECT_EQ(began["hold_s"], 1);
  std::uint64_t number = 0, shown = 0;
  double latest_s = 0, strongest_n = 0, y = 0.66;
  json over;
  while (const std::optional<Said> said = next_said(*client)) {
    if (said->jpeg_bytes == 0) {
      over = said->text["over"];
      break;
    }
    EXPECT_GT(said->jpeg_bytes, 1000U);
    EXPECT_EQ(said->text["forces_n"].size(), 3U);
    EXPECT_TRUE(said->text.contains("largest_von_mises_pa"));
    latest_s = said->text["time_s"];
    shown = said->text["input"];
    strongest_n = std::max(strongest_n, said->text["wrist_force_n"].get<double>());
    // A person lifts until the line is in sight.
    if (said->text["visible_share"].get<double>() < 0.97 && latest_s > 1) y = std::max(0.5, y - 0.002);
    client->send_text(input(++number, y));
  }
  ASSERT_TRUE(over.is_object());
  EXPECT_EQ(over["ending"], "done");
  EXPECT_EQ(over["score"]["done"], true);
  EXPECT_GT(shown, 10U);
  EXPECT_GT(strongest_n, 1);
  EXPECT_GT(over["input_to_force"]["median_ms"].get<double>(), 0);
  EXPECT_GT(over["input_to_picture"]["median_ms"].get<double>(), over["input_to_force"]["median_ms"]);
  ASSERT_EQ(kept().size(), 1U);
  EXPECT_EQ(kept()[0].ending, Ending::kDone);
  EXPECT_EQ(kept()[0].trainee, "Aoki");
  EXPECT_TRUE(kept()[0].stress_shown);
  EXPECT_EQ(kept()[0].conditions, trainer::conditions_of(*room().body("a")));
  EXPECT_GT(kept()[0].conditions.value().tetrahedra, 0);
  EXPECT_NEAR(kept()[0].score.time_s, over["score"]["time_s"].get<double>(), 1e-9);
  const json results = answer("GET", "training/trainees/Aoki/results?object=a");
  ASSERT_EQ(results["attempts"].size(), 1U);
  EXPECT_EQ(results["attempts"][0]["ending"], "done");
  EXPECT_EQ(over["can_be_sealed"], false);  // by a server that seals nothing
  EXPECT_EQ(ask("POST", "training/attempts/1/case", "{}").status, 404);
  EXPECT_TRUE(results["curves"][0]["own"].empty());  // of tests alone
}

TEST_F(TrainingApi, InstrumentsInTrocarsAreLedByThePointersOfAPageAndKeptAsSuch) {
  const auto client = connect();
  json asked = json::parse(begin("Aoki", false, 2));
  asked["begin"]["instrument"] = "retractor";
  client->send_text(asked.dump());
  EXPECT_EQ(next_text(*client)["began"]["instrument"], "retractor");
  std::uint64_t number = 0;
  double latest_s = 0, tissue_n = 0, wall_n = 0, y = 0.66;
  json over;
  while (const std::optional<Said> said = next_said(*client)) {
    if (said->jpeg_bytes == 0) {
      over = said->text["over"];
      break;
    }
    ASSERT_EQ(said->text["forces_n"].size(), 2U);
    ASSERT_EQ(said->text["walls_n"].size(), 2U);
    latest_s = said->text["time_s"];
    tissue_n = std::max(tissue_n, said->text["forces_n"][0].get<double>());
    wall_n = std::max(wall_n, said->text["walls_n"][0].get<double>());
    if (said->text["visible_share"].get<double>() < 0.97 && latest_s > 1) y = std::max(0.5, y - 0.002);
    client->send_text(input(++number, y));
  }
  ASSERT_TRUE(over.is_object());
  EXPECT_EQ(over["ending"], "done");
  EXPECT_GT(tissue_n, 1);
  EXPECT_LT(tissue_n, 60);  // held from below, and not pierced
  EXPECT_GT(wall_n, 1);
  ASSERT_EQ(kept().size(), 1U);
  EXPECT_EQ(kept()[0].instrument, "retractor");
  EXPECT_FALSE(kept()[0].test);
  EXPECT_EQ(answer("GET", "training/trainees/Aoki/results?object=a")["attempts"][0]["instrument"],
            "retractor");
}

TEST_F(TrainingApi, AConnectionThatIsLostLeavesABrokenOffAttempt) {
  {
    const auto client = connect();
    client->send_text(begin("Ueda"));
    EXPECT_EQ(next_text(*client)["began"]["stress_shown"], false);
    const std::optional<Said> moment = next_said(*client);
    ASSERT_TRUE(moment);
    // Whose group sees no stress is not told it in other ways.
    EXPECT_FALSE(moment->text.contains("largest_von_mises_pa"));
    EXPECT_FALSE(moment->text.contains("tone_hz"));
    ASSERT_EQ(kept().size(), 1U);
    EXPECT_EQ(kept()[0].ending, Ending::kBrokenOff);  // from its beginning on
  }
  EXPECT_TRUE(test::eventually([&] { return kept()[0].score.time_s > 0; }));
  EXPECT_EQ(kept()[0].ending, Ending::kBrokenOff);
  EXPECT_FALSE(kept()[0].score.done);
  // The trainee's place is free again, a moment after the end was kept.
  EXPECT_TRUE(test::eventually([&] {
    const auto again = connect();
    again->send_text(begin("Ueda"));
    const json said = next_text(*again);
    return said.is_object() && said.contains("began");
  }));
}

TEST_F(TrainingApi, ATestShowsNoStressAndAnAttemptCanBeGivenUp) {
  practised("Aoki", 180);
  const auto client = connect();
  client->send_text(with_press(begin("Aoki", true)));
  const json began = next_text(*client)["began"];
  EXPECT_EQ(began["stress_shown"], false);
  EXPECT_FALSE(began.contains("press_n"));  // nor how hard the fingers press
  client->send_text(R"({"end":true})");
  EXPECT_EQ(next_text(*client)["over"]["ending"], "given-up");
  EXPECT_TRUE(kept()[1].test);
  EXPECT_EQ(kept()[1].ending, Ending::kGivenUp);
  // A test that was given up is no result: the session goes on, at once and by another connection.
  const auto again = connect();
  again->send_text(begin("Aoki", true));
  EXPECT_EQ(next_text(*again)["began"]["session"], 1);
  EXPECT_EQ(answer("GET", "training")["trainees"][0]["progress"]["a"]["session"], 1);
}

TEST_F(TrainingApi, ATraineeTrainsOnceAtATimeAndPlacesAreLimited) {
  const auto first = connect();
  first->send_text(begin("Aoki"));
  ASSERT_TRUE(next_text(*first).contains("began"));
  const auto same = connect();
  same->send_text(begin("Aoki"));
  EXPECT_THAT(refusal_of(*same), testing::Pair(1008, "Aoki is training already"));
  room().with_results(
      [](trainer::TrainingDatabase& results) { results.add_trainee("Mori", trainer::kStressShown, false); });
  const auto second = connect();
  second->send_text(begin("Ueda"));
  ASSERT_TRUE(next_text(*second).contains("began"));
  const auto third = connect();
  third->send_text(begin("Mori"));
  EXPECT_THAT(refusal_of(*third).second, HasSubstr("all places"));
  EXPECT_EQ(kept().size(), 2U);
}

TEST_F(TrainingApi, ATestSaysHowManyCameBeforeItWithoutAResult) {
  const auto add = [this](trainer::Ending ending) {
    room().with_results([&](trainer::TrainingDatabase& results) {
      trainer::ExclusionRecord record;
      record.object = "a";
      record.fingers = 3;
      record.test = true;
      record.ending = ending;
      results.add_attempt(results.trainee("Aoki"), record, utc_now());
    });
  };
  add(trainer::Ending::kBrokenOff);
  add(trainer::Ending::kGivenUp);
  add(trainer::Ending::kDone);
  const json attempts = answer("GET", "training/trainees/Aoki/results?object=a")["attempts"];
  ASSERT_EQ(attempts.size(), 3U);
  EXPECT_EQ(attempts[1]["tests_without_result_before"], 1);
  EXPECT_EQ(attempts[2]["tests_without_result_before"], 2);
}

class PacedTraining : public TrainingApi {
 protected:
  PacedTraining() : TrainingApi({}, {2, std::chrono::seconds(10)}) {}
};

// Each attempt stays among the results, also one that is broken off at once.
TEST_F(PacedTraining, AttemptsThatAreBrokenOffAgainAndAgainHaveTheirPace) {
  const auto broken_off = [&] {
    const auto client = connect();
    client->send_text(begin("Ueda"));
    EXPECT_TRUE(next_text(*client).contains("began"));
    client->send_text(R"({"end":true})");
    EXPECT_TRUE(next_text(*client).contains("over"));
  };
  const auto refused = [&] {
    const auto client = connect();
    client->send_text(begin("Ueda"));
    return refusal_of(*client).second;
  };
  broken_off();
  broken_off();
  EXPECT_EQ(refused(), "many attempts were begun one after the other: begin the next one in 10 s");
  EXPECT_EQ(kept().size(), 2U) << "what is refused leaves nothing";
  clock.move(std::chrono::seconds(10));
  // The place of the one that was refused is free when its connection has ended.
  ASSERT_TRUE(test::eventually([&] {
    const auto client = connect();
    client->send_text(begin("Ueda"));
    const json said = next_text(*client);
    return said.is_object() && said.contains("began");
  }));
  EXPECT_EQ(kept().size(), 3U);
}

TEST_F(TrainingApi, WhoMayNotTrainAsSomebodyNeitherHearsOfThemNorTakesTheirPlace) {
  room().with_results([](trainer::TrainingDatabase& results) {
    results.add_trainee("Mori", trainer::kStressShown, false, "mori");
  });
  const auto first = connect();
  first->send_text(begin("Ueda"));
  ASSERT_TRUE(next_text(*first).contains("began"));
  routes->sign_in("anna", Role::kSurgeon);
  for (const char* trainee : {"Ueda", "Mori"}) {
    const auto client = connect();
    client->send_text(begin(trainee));
    EXPECT_THAT(refusal_of(*client).second, HasSubstr("only the user bound to"))
        << trainee << ": nobody hears who trains";
  }
  // All places are taken: that, too, is told to whoever may train alone.
  const auto own = connect();
  own->send_text(begin("Aoki"));
  ASSERT_TRUE(next_text(*own).contains("began"));
  const auto other = connect();
  other->send_text(begin("Mori"));
  EXPECT_THAT(refusal_of(*other).second, HasSubstr("only the user bound to"));
}

TEST_F(TrainingApi, RefusesInWordsWhatNoPageSays) {
  const auto refused = [&](const std::vector<std::string>& messages) {
    const auto client = connect();
    for (const std::string& message : messages) client->send_text(message);
    const auto [code, sentence] = refusal_of(*client);
    EXPECT_EQ(code, 1008) << sentence;
    return sentence;
  };
  EXPECT_THAT(refused({"{"}), HasSubstr("JSON object"));
  EXPECT_THAT(refused({input(1, 0.5)}), HasSubstr("must begin first"));
  EXPECT_THAT(refused({begin("nobody")}), HasSubstr("no trainee 'nobody'"));
  EXPECT_THAT(refused({begin("model")}), HasSubstr("simulated"));
  EXPECT_THAT(refused({begin("Aoki", false, 6)}), HasSubstr("1 to 5 fingers"));
  EXPECT_THAT(refused({begin("Aoki", false, 3, "z")}), HasSubstr("'z' is no object"));
  EXPECT_TRUE(kept().empty());
  // During an attempt it is broken off.
  const auto client = connect();
  client->send_text(begin("Aoki"));
  ASSERT_TRUE(next_text(*client).contains("began"));
  ASSERT_TRUE(next_said(*client));
  client->send_text(R"({"input":1,"pointers":[{"finger":9,"x":0.5,"y":0.5,"push_m":0}]})");
  EXPECT_THAT(refusal_of(*client).second, HasSubstr("no finger 9"));
  EXPECT_TRUE(test::eventually([&] { return kept()[0].score.time_s > 0; }));
  EXPECT_EQ(kept()[0].ending, Ending::kBrokenOff);
}

class TrainingWithAnOrgan : public TrainingApi {
 protected:
  TrainingWithAnOrgan() : TrainingApi({organ()}) {}
  static std::shared_ptr<const trainer::ExclusionBody> organ() {
    const test::TemporaryFolder ct;
    trainer::PatientOrgan made = trainer::read_patient_organ(test::write_flat_organ_document(ct.path()));
    return std::make_shared<const trainer::ExclusionBody>(std::move(made.object), made.task);
  }
};

TEST_F(TrainingWithAnOrgan, ListsItBesideTheOthersAndKeepsItsAttempts) {
  EXPECT_EQ(answer("GET", "training")["objects"], json({"a", "b", "c", "left lobe"}));
  EXPECT_EQ(answer("GET", "training")["doubted"], json::array({"left lobe"}));
  const auto client = connect();
  client->send_text(begin("Aoki", false, 3, "left lobe"));
  EXPECT_EQ(next_text(*client)["began"]["object"], "left lobe");
  const std::optional<Said> moment = next_said(*client);
  ASSERT_TRUE(moment);
  EXPECT_EQ(moment->text["visible_share"], 0);
  client->send_text(R"({"end":true})");
  EXPECT_EQ(next_text(*client)["over"]["ending"], "given-up");
  EXPECT_EQ(kept()[0].object, "left lobe");
  EXPECT_EQ(answer("GET", "training/trainees/Aoki/results?object=left%20lobe")["attempts"].size(), 1U);
  EXPECT_EQ(answer("GET", "training")["trainees"][0]["progress"]["left lobe"]["session"], 1);
}

TEST_F(TrainingApi, KnowsTraineesAndAddsThem) {
  const json training = answer("GET", "training");
  ASSERT_EQ(training["trainees"].size(), 2U);  // people
  EXPECT_EQ(training["trainees"][0]["name"], "Aoki");
  EXPECT_EQ(training["fingers"], 5);
  EXPECT_EQ(ask("POST", "training/trainees", R"({"name":"森","group":"stress hidden"})").status, 201);
  EXPECT_EQ(answer("GET", "training")["trainees"].size(), 3U);
  EXPECT_THAT(answer("POST", "training/trainees", R"({"name":"森","group":"stress hidden"})")["error"],
              HasSubstr("already"));
  EXPECT_EQ(ask("POST", "training/trainees", R"({"name":"x","group":"best"})").status, 400);
  EXPECT_EQ(ask("POST", "training/trainees", R"({"name":"","group":"stress hidden"})").status, 400);
  EXPECT_EQ(ask("GET", "training/trainees/nobody/results?object=a").status, 404);
  EXPECT_EQ(ask("GET", "training/trainees/Aoki/results?object=z").status, 400);
  routes->sign_out();
  EXPECT_EQ(ask("GET", "training").status, 401);
}

TEST_F(TrainingApi, ATestComesAfterThreeMinutesOfPracticeAndNoPracticeAfterThem) {
  const auto refused = [&](bool test) {
    const auto client = connect();
    client->send_text(begin("Aoki", test));
    return refusal_of(*client).second;
  };
  practised("Aoki", 80);
  EXPECT_EQ(refused(true),
            "Aoki has practised 1:20 of the 3:00 minutes of session 1: the test comes after them");
  practised("Aoki", 97);
  {
    // What is left of practice ends it.
    const auto client = connect();
    client->send_text(begin("Aoki"));
    ASSERT_TRUE(next_text(*client).contains("began"));
    EXPECT_EQ(next_text(*client)["over"]["ending"], "time-over");
    EXPECT_NEAR(kept().back().score.time_s, 3, 0.5);
  }
  EXPECT_THAT(refused(false), HasSubstr("the test comes now"));
  const auto client = connect();
  client->send_text(begin("Aoki", true));
  EXPECT_EQ(next_text(*client)["began"]["test"], true);
}

TEST_F(TrainingApi, AUserTrainsAsTheOwnTraineeAndAnAdministratorAsEverybody) {
  EXPECT_EQ(answer("GET", "training")["trainees"].size(), 2U);
  EXPECT_EQ(answer("GET", "training")["supervises"], true);
  routes->sign_in("anna", Role::kOperator);
  const json training = answer("GET", "training");
  ASSERT_EQ(training["trainees"].size(), 1U);
  EXPECT_EQ(training["trainees"][0]["name"], "Aoki");
  EXPECT_EQ(training["supervises"], false);
  EXPECT_EQ(ask("GET", "training/trainees/Aoki/results?object=a").status, 200);
  EXPECT_EQ(ask("GET", "training/trainees/Ueda/results?object=a").status, 404);
  EXPECT_THAT(answer("POST", "training/trainees", R"({"name":"Anna","group":"stress shown"})")["error"],
              HasSubstr("anna trains as 'Aoki' already"));
  const auto client = connect();
  client->send_text(begin("Ueda"));
  EXPECT_THAT(refusal_of(*client).second, HasSubstr("only the user bound to Ueda, or an administrator"));
  EXPECT_TRUE(kept().empty());
  // Who has no trainee yet adds their own, whoever they name.
  routes->sign_in("ben", Role::kSurgeon);
  EXPECT_TRUE(answer("GET", "training")["trainees"].empty());
  EXPECT_EQ(
      answer("POST", "training/trainees", R"({"name":"Ben","group":"stress shown","user":"carl"})")["user"],
      "ben");
  const auto own = connect();
  own->send_text(begin("Ben"));
  EXPECT_TRUE(next_text(*own).contains("began"));
}

json questionnaire_of(int useful) {
  return {{"answers", {{"organ-feel", 1}, {"useful", useful}, {"stress-helps", nullptr}}},
          {"comment", "よい"}};
}
json checklist_of(const std::string& examiner) {
  json items;
  for (const trainer::ChecklistItem& item : trainer::kChecklistItems) items[std::string(item.name)] = "done";
  return {{"items", items}, {"global_rating", 4}, {"examiner", examiner}};
}

TEST_F(TrainingApi, KeepsWhatIsSaidOfAnAttemptAndShowsItWithTheAttempt) {
  practised("Aoki", 10);
  practised("Ueda", 10);
  const json training = answer("GET", "training");
  EXPECT_EQ(training["questions"], json({"organ-feel", "useful", "stress-helps"}));
  EXPECT_EQ(training["checklist_items"].size(), 8U);
  const auto first = [&] { return answer("GET", "training/trainees/Aoki/results?object=a")["attempts"][0]; };
  EXPECT_EQ(first()["questionnaire"], nullptr);
  EXPECT_EQ(first()["checklist"], nullptr);
  EXPECT_EQ(ask("POST", "training/attempts/1/questionnaire", questionnaire_of(2).dump()).status, 200);
  EXPECT_EQ(ask("POST", "training/attempts/1/checklist", checklist_of("Dr Sato").dump()).status, 200);
  EXPECT_EQ(first()["questionnaire"]["answers"], questionnaire_of(2)["answers"]);
  EXPECT_EQ(first()["questionnaire"]["by"], "root");
  EXPECT_EQ(first()["checklist"]["examiner"], "Dr Sato");
  EXPECT_EQ(first()["checklist"]["items"], checklist_of("Dr Sato")["items"]);
  // What is not sound changes nothing.
  const auto refused = [&](const std::string& what, const std::string& body) {
    EXPECT_EQ(ask("POST", "training/attempts/1/" + what, body).status, 400) << body;
    return answer("POST", "training/attempts/1/" + what, body)["error"].get<std::string>();
  };
  EXPECT_THAT(refused("questionnaire", questionnaire_of(3).dump()), HasSubstr("from -2 to 2, not 3"));
  EXPECT_THAT(refused("questionnaire", "{}"), HasSubstr("must be an object with these fields"));
  EXPECT_THAT(refused("checklist", checklist_of("").dump()), HasSubstr("'examiner'"));
  EXPECT_EQ(first()["questionnaire"]["answers"]["useful"], 2);
  EXPECT_EQ(ask("POST", "training/attempts/77/questionnaire", questionnaire_of(2).dump()).status, 404);
  // Who trains answers for the own attempts, and examines nobody.
  routes->sign_in("anna", Role::kSurgeon);
  EXPECT_EQ(ask("POST", "training/attempts/1/questionnaire", questionnaire_of(-1).dump()).status, 200);
  EXPECT_EQ(first()["questionnaire"]["by"], "anna");
  EXPECT_EQ(ask("POST", "training/attempts/2/questionnaire", questionnaire_of(-1).dump()).status, 404);
  EXPECT_EQ(ask("POST", "training/attempts/1/checklist", checklist_of("Anna").dump()).status, 403);
  EXPECT_EQ(first()["checklist"]["examiner"], "Dr Sato");
}

TEST_F(TrainingApi, NothingIsSaidOfAnAttemptThatRuns) {
  const auto client = connect();
  client->send_text(begin("Aoki"));
  ASSERT_TRUE(next_text(*client).contains("began"));
  EXPECT_THAT(answer("POST", "training/attempts/1/questionnaire", questionnaire_of(2).dump())["error"],
              HasSubstr("runs, or was broken off"));
  client->send_text(R"({"end":true})");
  EXPECT_EQ(next_text(*client)["over"]["ending"], "given-up");
  EXPECT_EQ(ask("POST", "training/attempts/1/questionnaire", questionnaire_of(2).dump()).status, 200);
}

TEST_F(TrainingApi, TellsATraineesCurveBesideTheGroups) {
  room().with_results([](trainer::TrainingDatabase& results) {
    for (int session = 1; session <= 2; ++session) {
      for (const char* name : {"Aoki", "Ueda"}) {
        trainer::ExclusionRecord record;
        record.session = session;
        record.test = true;
        record.object = "a";
        record.fingers = 3;
        record.score.largest_von_mises_pa = name[0] == 'A' ? 4e4 / session : 5e4;
        record.conditions = trainer::AttemptConditions{0.5, 1e5, 900, 3000};
        // Of another friction, before: listed among the attempts, on no curve.
        if (session == 1) {
          trainer::ExclusionRecord gliding = record;
          gliding.conditions->friction = 0;
          gliding.score.largest_von_mises_pa = 9e9;
          results.add_attempt(results.trainee(name), gliding, utc_now());
        }
        results.add_attempt(results.trainee(name), record, utc_now());
      }
    }
  });
  const json stress = answer("GET", "training/trainees/Aoki/results?object=a")["curves"][0];
  EXPECT_EQ(stress["measure"], "stress");
  ASSERT_EQ(stress["own"].size(), 2U);
  EXPECT_EQ(stress["own"][0]["value"], 40);
  EXPECT_EQ(stress["own"][1]["value"], 20);
  EXPECT_EQ(stress["own"][1]["fingers"], 3);
  ASSERT_EQ(stress["groups"].size(), 2U);
  EXPECT_EQ(stress["groups"][0]["group"], "stress hidden");
  EXPECT_EQ(stress["groups"][0]["points"][1]["mean"], 50);
  EXPECT_EQ(answer("GET", "training")["trainees"][0]["progress"]["a"]["session"], 3);
}

}  // namespace
}  // namespace kiroku::viewer
