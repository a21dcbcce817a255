// 'kiroku train' as a person calls it.
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "tests/support/build_paths.h"
#include "tests/support/flat_organ_volume.h"
#include "tests/support/reserved_port.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

class Training : public ProgramTest {};

TEST_F(Training, TheHapticRateExperimentGivesThresholdsAndKeepsThem) {
  const nlohmann::json found =
      kiroku_json({"train", "haptic-rate", "-o", path("rates"), "--simulated", "3", "--fingers", "1,5",
                   "--trials", "30", "--method", "staircase", "--json"});
  EXPECT_EQ(found["simulated"], true);
  ASSERT_EQ(found["thresholds"].size(), 2U);
  EXPECT_NEAR(found["thresholds"][0]["mean_hz"].get<double>(), 23.3, 5);
  EXPECT_NEAR(found["thresholds"][1]["mean_hz"].get<double>(), 1.2, 0.3);
  EXPECT_LT(found["pairs"][0]["p_holm"].get<double>(), 0.05);
  EXPECT_EQ(found["recovered"]["thresholds"], 6);
  EXPECT_THAT(read_text(folder() / "rates/trials.csv"), HasSubstr("simulated 3,yes,5,60,"));
  EXPECT_THAT(read_text(folder() / "rates/thresholds.svg"), HasSubstr("<svg"));
  EXPECT_THAT(read_text(folder() / "rates/touch.png"), testing::StartsWith("\x89PNG"));
  // Three more, with the same numbers, in the same database.
  EXPECT_EQ(kiroku({"train", "haptic-rate", "-o", path("again"), "--simulated", "3", "--fingers", "1,5",
                    "--trials", "30", "--method", "staircase", "--database", path("rates/results.sqlite")})
                .status,
            0);
  EXPECT_EQ(read_text(folder() / "again/trials.csv"), read_text(folder() / "rates/trials.csv"));
}

TEST_F(Training, AnExperimentThatIsDoneAgainLeavesNoHandMotionOfTheOneBefore) {
  const Arguments once{"train", "haptic-rate", "-o", path("rates"), "--simulated",
                       "1",     "--fingers",   "1",  "--trials",    "2"};
  ASSERT_EQ(kiroku(once).status, 0);
  for (const char* name : {"hand-1.txt", "hand-61.txt", "hand-x.txt", "hand-.txt", "notes.txt"})
    write_text(folder() / "rates" / name, "of an earlier run\n");
  EXPECT_REFUSED(kiroku(once), "--force");
  EXPECT_TRUE(std::filesystem::exists(folder() / "rates/hand-61.txt"));
  Arguments again = once;
  again.emplace_back("--force");
  ASSERT_EQ(kiroku(again).status, 0);
  // No person moved a hand this time; what is no hand motion of a trial is left alone.
  for (const char* name : {"hand-1.txt", "hand-61.txt"})
    EXPECT_FALSE(std::filesystem::exists(folder() / "rates" / name)) << name;
  for (const char* name : {"hand-x.txt", "hand-.txt", "notes.txt"})
    EXPECT_TRUE(std::filesystem::exists(folder() / "rates" / name)) << name;
}

TEST_F(Training, AnExperimentWhoseAnswersCannotBeWrittenLeavesTheHandMotionsOfTheOneBefore) {
  std::filesystem::create_directories(folder() / "rates/trials.csv");  // no file can take its place
  write_text(folder() / "rates/hand-61.txt", "of an earlier run\n");
  EXPECT_REFUSED(kiroku({"train", "haptic-rate", "-o", path("rates"), "--simulated", "1", "--fingers", "1",
                         "--trials", "2", "--force"}),
                 "trials.csv");
  EXPECT_TRUE(std::filesystem::exists(folder() / "rates/hand-61.txt"));
}

TEST_F(Training, TheExclusionTrainersSeriesStandsBesideItsOwnThresholds) {
  const nlohmann::json found =
      kiroku_json({"train", "haptic-rate", "-o", path("rates"), "--series", "exclusion", "--fingers", "1,3",
                   "--thresholds", "15.8,3", "--simulated", "1", "--trials", "5", "--json"});
  EXPECT_EQ(found["series"], "exclusion");
  EXPECT_EQ(found["thresholds"][0]["paper_hz"], 15.8);
  EXPECT_FALSE(found["thresholds"][1].contains("paper_hz"));
  EXPECT_THAT(read_text(folder() / "rates/thresholds.svg"), HasSubstr("</svg>"));
  EXPECT_REFUSED(kiroku({"train", "haptic-rate", "-o", path("other"), "--series", "papers"}), "--series");
}

TEST_F(Training, NamedFingersAreDrawnFromTable1AndSensingOnesFollowFromForces) {
  const nlohmann::json drawn =
      kiroku_json({"train", "haptic-rate", "-o", path("drawn"), "--series", "exclusion", "--subjects",
                   "drawn", "--simulated", "6", "--trials", "20", "--json"});
  ASSERT_EQ(drawn["thresholds"].size(), 6U);
  EXPECT_EQ(drawn["thresholds"][4]["fingers"], "index+middle");
  EXPECT_EQ(drawn["thresholds"][0]["paper_sd_hz"], 35.0);
  EXPECT_GT(drawn["thresholds"][0]["sd_hz"].get<double>(), 0);
  EXPECT_EQ(drawn["pairs"].size(), 15U);
  EXPECT_TRUE(drawn["single_and_several"].contains("p"));
  EXPECT_THAT(drawn["note"].get<std::string>(), HasSubstr("proves the estimator"));
  EXPECT_THAT(read_text(folder() / "drawn/thresholds.csv"), HasSubstr("simulated 6,yes,middle+third,"));
  const nlohmann::json sensing = kiroku_json({"train", "haptic-rate", "-o", path("sensing"), "--subjects",
                                              "sensing", "--device-bandwidth", "10", "--simulated", "1",
                                              "--fingers", "1", "--trials", "20", "--json"});
  EXPECT_FALSE(sensing.contains("recovered"));
  EXPECT_THAT(sensing["note"].get<std::string>(), HasSubstr("follow from force steps"));
}

TEST_F(Training, WhatTouchLetsExpectAndWhatItTakesToFindIsTold) {
  const nlohmann::json predicted = kiroku_json({"train", "predict", "--series", "exclusion", "--json"});
  ASSERT_EQ(predicted["predictions"].size(), 12U);  // six conditions, pressed and stroked
  const nlohmann::json& first = predicted["predictions"][0];
  EXPECT_EQ(first["fingers"], "index");
  EXPECT_EQ(first["predicted"], "above 100 Hz");
  EXPECT_GT(first["beside_first_hz"][0].get<double>(), 19);
  const nlohmann::json power = kiroku_json({"train", "power", "--json"});
  EXPECT_EQ(power["conditions"].size(), 6U);
  EXPECT_EQ(power["pairs"].size(), 15U);
  EXPECT_GT(power["values_each_for_published_p"].get<int>(), 6);
  EXPECT_REFUSED(kiroku({"train", "power", "--power", "2"}), "--power");
  EXPECT_REFUSED(kiroku({"train", "predict", "--masking", "-1"}), "--masking");
}

TEST_F(Training, OneSubjectGetsASentenceInsteadOfAPValue) {
  const ProcessResult result = kiroku(
      {"train", "haptic-rate", "-o", path("one"), "--simulated", "1", "--fingers", "2,3", "--trials", "10"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("no p-value: a test needs at least 3 pairs"));
}

TEST_F(Training, RefusesInOneSentence) {
  const auto rates = [&](const Arguments& more) {
    Arguments all{"train", "haptic-rate", "-o", path("refused")};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  };
  EXPECT_REFUSED(rates({"--fingers", "0"}), "--fingers");
  EXPECT_REFUSED(rates({"--fingers", "1,6"}), "--fingers");
  EXPECT_REFUSED(rates({"--fingers", "1.5"}), "names no fingers");
  EXPECT_REFUSED(rates({"--fingers", "1,ring"}), "--fingers");
  EXPECT_REFUSED(rates({"--fingers", "index"}), "--thresholds");
  EXPECT_REFUSED(rates({"--subjects", "drawn"}), "no spread");
  EXPECT_REFUSED(rates({"--subjects", "drawn", "--fingers", "index"}), "leave --fingers out");
  EXPECT_REFUSED(rates({"--masking", "6"}), "--subjects sensing");
  EXPECT_REFUSED(rates({"--subjects", "sensing", "--thresholds", "9"}), "--subjects scaled");
  EXPECT_REFUSED(rates({"--method", "guess"}), "--method");
  EXPECT_REFUSED(rates({"--thresholds", "20", "--fingers", "1,2"}), "--thresholds has 1");
  EXPECT_REFUSED(rates({"--hand", "usb:1"}), "udp:PORT");
  EXPECT_REFUSED(rates({"--hand", "udp:0", "--subject", "Aoki"}), "--hand udp:0");
  EXPECT_REFUSED(rates({"--hand", "udp:7001"}), "--subject");
  write_text(folder() / "words.sqlite", std::string(4096, 'x'));
  EXPECT_REFUSED(rates({"--database", path("words.sqlite")}), "no database");
  write_text(folder() / "refused/touch.png", "mine");
  EXPECT_REFUSED(rates({}), "--force");
  EXPECT_EQ(read_text(folder() / "refused/touch.png"), "mine");
}

TEST_F(Training, StressIsToldByNumberAndMannerOfTheFingers) {
  const nlohmann::json found =
      kiroku_json({"train", "stress", "--object", "b", "--vertices", "2500", "-o", path("stress"), "--json"});
  ASSERT_EQ(found["lifts"].size(), 9U);
  EXPECT_EQ(found["lift_m"], 0.01);
  for (const nlohmann::json& lift : found["lifts"]) {
    EXPECT_EQ(lift["forces_n"].size(), lift["fingers"].get<std::size_t>());
    EXPECT_LT(lift["von_mises_95_percent_pa"], lift["von_mises_99_percent_pa"]);
    EXPECT_GT(lift["away_from_fingers"]["largest_von_mises_pa"],
              lift["away_from_fingers"]["of_uniform_object_pa"]);
  }
  // Five that are spread lift more of the border than one, with more force in all.
  EXPECT_GT(found["lifts"][4]["wrist_force_n"], found["lifts"][0]["wrist_force_n"]);
  EXPECT_GT(found["lifts"][4]["visible_share"], found["lifts"][0]["visible_share"]);
  EXPECT_THAT(read_text(folder() / "stress/stress.png"), testing::StartsWith("\x89PNG"));
  EXPECT_THAT(read_text(folder() / "stress/cut.png"), testing::StartsWith("\x89PNG"));
  EXPECT_EQ(nlohmann::json::parse(read_text(folder() / "stress/stress.json"))["lifts"], found["lifts"]);
  EXPECT_REFUSED(kiroku({"train", "stress", "-o", path("other"), "--lift", "80"}), "--lift");
  EXPECT_REFUSED(kiroku({"train", "stress", "-o", path("stress")}), "stress.json");
  // A coarse mesh lies a little above the border that it stands for.
  EXPECT_REFUSED(kiroku({"train", "stress", "--object", "b", "--vertices", "900", "--lift", "0.5", "-o",
                         path("untouched")}),
                 "do not touch the border");
}

TEST_F(Training, TheBudgetComparesWhatIsAskedWithWhatIsThere) {
  const nlohmann::json found =
      kiroku_json({"train", "budget", "-o", path("budget"), "--seconds", "0.3", "--json"});
  ASSERT_EQ(found["fingers"].size(), 5U);
  EXPECT_EQ(found["required_from"], "the haptic-rate study");
  EXPECT_EQ(found["fingers"][0]["required_hz"], 23.3);
  EXPECT_EQ(found["fingers"][4]["paper_force_ms"], 29.7);
  EXPECT_GT(found["fingers"][4]["force_ms"].get<double>(), 0);
  EXPECT_THAT(read_text(folder() / "budget/budget.svg"), HasSubstr("<svg"));
  EXPECT_REFUSED(kiroku({"train", "budget", "-o", path("other"), "--database", path("none.sqlite")}),
                 "no database");
}

class Exclusion : public ProgramTest {
 protected:
  [[nodiscard]] ProcessResult push(const std::string& hand, const std::string& to,
                                   const Arguments& more = {}) const {
    Arguments all{"train",  "exclusion",  "--hand", hand,     "-o",
                  path(to), "--vertices", "900",    "--size", "160x120"};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  }
};

TEST_F(Exclusion, AnOrganIsPushedAsideAndItsMotionPlayedAgain) {
  const ProcessResult first = push("simulated", "first", {"--stress"});
  EXPECT_EQ(first.status, 0) << first.err;
  EXPECT_THAT(first.out, HasSubstr("the line was seen for a second"));
  EXPECT_THAT(first.out, HasSubstr("no person did this"));
  const auto score = nlohmann::json::parse(read_text(folder() / "first/score.json"));
  EXPECT_EQ(score["score"]["done"], true);
  EXPECT_GT(score["score"]["largest_von_mises_pa"].get<double>(), 1e3);
  EXPECT_GT(std::filesystem::file_size(folder() / "first/film.mp4"), 1000U);
  // The recorded hand does it again, with itself as a ghost.
  const std::string hand = path("first/hand.txt");
  const ProcessResult again = push(hand, "again", {"--ghost", hand});
  EXPECT_EQ(again.status, 0) << again.out << again.err;
  const auto repeated = nlohmann::json::parse(read_text(folder() / "again/score.json"));
  EXPECT_NEAR(repeated["score"]["time_s"].get<double>(), score["score"]["time_s"].get<double>(), 0.3);
  EXPECT_EQ(push(hand, "third", {"--ghost", hand}).status, 0);
  EXPECT_EQ(read_text(folder() / "third/forces.csv"), read_text(folder() / "again/forces.csv"));
}

TEST_F(Exclusion, AWholeHandTouchesWithMoreThanItsFingertips) {
  ASSERT_EQ(push("simulated", "first").status, 0);
  const std::string hand = path("first/hand.txt");
  (void)push(hand, "fingers");
  const ProcessResult whole = push(hand, "hand", {"--touch", "hand"});
  EXPECT_LE(whole.status, 1) << whole.err;  // whether the line is seen is not asked here
  const auto score_of = [&](const std::string& name) {
    return nlohmann::json::parse(read_text(folder() / name / "score.json"));
  };
  EXPECT_EQ(score_of("fingers")["touch"], "fingertips");
  EXPECT_EQ(score_of("hand")["touch"], "hand");
  EXPECT_NE(score_of("hand")["score"]["peak_wrist_force_n"],
            score_of("fingers")["score"]["peak_wrist_force_n"]);
  EXPECT_THAT(read_text(folder() / "hand/forces.csv"), HasSubstr("finger_3_n,phalanges_and_palm_n\n"));
  EXPECT_THAT(read_text(folder() / "fingers/forces.csv"), HasSubstr("finger_3_n\n"));
  const ProcessResult kept =
      push(hand, "kept", {"--touch", "hand", "--trainee", "Aoki", "--database", path("t.sqlite")});
  EXPECT_EQ(kept.status, 2);
  EXPECT_THAT(kept.err, HasSubstr("--touch hand is kept with no trainee"));
}

/// The numbers of a hand motion, a moment each.
std::vector<std::vector<double>> moments_of(const std::string& text) {
  std::vector<std::vector<double>> moments;
  std::istringstream lines(text);
  std::string line;
  while (std::getline(lines, line)) {
    std::istringstream in(line);
    std::vector<double> numbers;
    for (double number = 0; in >> number;) numbers.push_back(number);
    if (!numbers.empty()) moments.push_back(numbers);
  }
  return moments;
}

// Real time: a hand sends 500 positions a second, and the trainer takes them as they come; where other
// work holds either up, the organ is not lifted as it was.
class ExclusionRealTime : public Exclusion {};

TEST_F(ExclusionRealTime, AHandOnTheNetworkPlaysARecordedMotion) {
  ASSERT_EQ(push("simulated", "first").status, 0);
  const std::string port = std::to_string(reserved_port());
  Process::Options trainer;
  trainer.command = {built_file("kiroku"), "train",      "exclusion", "--hand", "udp:" + port, "-o",
                     path("net"),          "--vertices", "900",       "--size", "160x120",     "--json",
                     "--seconds",          "3600"};  // it ends by what the hand does
  Process runs(trainer);
  // Begins at the first datagram that is heard; those before are lost, as from a hand that is there already.
  Process::Options hand;
  hand.command = {built_file("hand_player"), path("first/hand.txt"), port};
  // It is played until the trainer ends. Which play it ends in, and how much of one it heard, is the
  // machine's: all of them are judged together.
  unsigned answers = 0;
  double largest_n = 0;
  while (runs.runs()) {
    const ProcessResult played = run_process(hand, std::chrono::seconds(60));
    ASSERT_EQ(played.status, 0) << played.err;
    unsigned answers_now = 0;
    double largest_now_n = 0;
    std::istringstream(played.out) >> answers_now >> largest_now_n;
    answers += answers_now;
    largest_n = std::max(largest_n, largest_now_n);
  }
  EXPECT_GT(answers, 100U);
  EXPECT_GT(largest_n, 0.5);
  const ProcessResult result = runs.wait();
  EXPECT_EQ(result.status, 0) << result.err;
  const nlohmann::json told = nlohmann::json::parse(result.out);
  EXPECT_EQ(told["score"]["done"], true);
  EXPECT_EQ(told["faults"]["unsound"], 0);
  // What was played was recorded, too.
  EXPECT_EQ(push(path("net/hand.txt"), "again", {"--seconds", "3600"}).status, 0);
}

TEST_F(ExclusionRealTime, WhatAHandDidStandsBesideItsAnswers) {
  // A finger on the plate's middle, and a wrist behind it: 0.5 to 1 N deep, for longer than both trials.
  std::string motion = "kiroku-hand-motion 2\nfingers 1\n";
  for (int moment = 0; moment <= 120; ++moment) {
    const double deep_m = 1.0e-3 + 0.5e-3 * (moment % 2);
    motion +=
        std::to_string(moment) + " 0 0 " + std::to_string(0.008 - deep_m) + " 1 0 0 0 0 -0.17 0.05 1 0 0 0\n";
  }
  write_text(folder() / "pressing.txt", motion);
  const std::string port = std::to_string(reserved_port());
  Process::Options hand;
  hand.command = {built_file("hand_player"), path("pressing.txt"), port};
  Process plays(hand);
  Process::Options experiment;
  experiment.command = {built_file("kiroku"),
                        "train",
                        "haptic-rate",
                        "--hand",
                        "udp:" + port,
                        "--subject",
                        "Aoki",
                        "-o",
                        path("aoki"),
                        "--trials",
                        "2",
                        "--fingers",
                        "1"};
  experiment.input = "y\nn\n";
  const ProcessResult result = run_process(experiment, std::chrono::seconds(120));
  ASSERT_EQ(result.status, 0) << result.err;
  std::istringstream trials(read_text(folder() / "aoki/trials.csv"));
  std::string line;
  std::getline(trials, line);
  EXPECT_EQ(line, "subject,simulated,fingers,trial,rate_hz,answer,hand_motion,hand_motion_sha256");
  for (int trial = 1; trial <= 2; ++trial) {
    const std::string name = "hand-" + std::to_string(trial) + ".txt";
    ASSERT_TRUE(std::getline(trials, line)) << trial;
    const std::string text = read_text(folder() / "aoki" / name);
    EXPECT_THAT(line, testing::EndsWith((trial == 1 ? "vibrating," : "continuous,") + name + "," +
                                        crypto::to_hex(crypto::sha256(bytes_of(text)))));
    EXPECT_THAT(text, testing::StartsWith("kiroku-hand-motion 2\nfingers 1\n"));
    const std::vector<std::vector<double>> moments = moments_of(text);
    ASSERT_GT(moments.size(), 100U);
    // Four seconds from the first touch on, by the clock, however many steps a busy machine skips.
    EXPECT_GE(moments.back()[0], 3.5);
    double highest_m = 0, lowest_m = 1, path_m = 0, before_m = moments.front()[3];
    for (const std::vector<double>& moment : moments) {
      ASSERT_EQ(moment.size(), 15U);  // seconds, the finger, the wrist
      EXPECT_NEAR(moment[9], -0.17, 1e-9);
      highest_m = std::max(highest_m, moment[3]);
      lowest_m = std::min(lowest_m, moment[3]);
      path_m += std::abs(moment[3] - before_m);
      before_m = moment[3];
    }
    EXPECT_LE(highest_m, 0.0071);
    EXPECT_GE(lowest_m, 0.0064);
    EXPECT_GT(highest_m - lowest_m, 2e-4);  // it moved, as the hand did
    // Half a millimetre a second, and no faster; datagrams of a second may have come late and at once.
    EXPECT_LE(path_m, 0.5e-3 * (moments.back()[0] + 1));
  }
  EXPECT_FALSE(std::getline(trials, line));
  // An answer's motion is not written over.
  EXPECT_REFUSED(run_process(experiment, std::chrono::seconds(60)), "--force");
}

/// Of forces.csv, each picture's numbers by the names of their columns.
std::vector<std::map<std::string, double>> rows_of(const std::string& csv) {
  std::istringstream lines(csv);
  std::string line;
  const auto pieces = [](const std::string& text) {
    std::vector<std::string> found;
    std::istringstream in(text);
    for (std::string piece; std::getline(in, piece, ',');) found.push_back(piece);
    return found;
  };
  std::getline(lines, line);
  const std::vector<std::string> names = pieces(line);
  std::vector<std::map<std::string, double>> rows;
  while (std::getline(lines, line)) {
    const std::vector<std::string> numbers = pieces(line);
    EXPECT_EQ(numbers.size(), names.size());
    std::map<std::string, double>& row = rows.emplace_back();
    for (std::size_t i = 0; i < names.size() && i < numbers.size(); ++i) {
      if (!numbers[i].empty()) row[names[i]] = std::stod(numbers[i]);
    }
  }
  return rows;
}

TEST_F(Exclusion, InstrumentsInTrocarsLiftByTheirLevers) {
  const ProcessResult first =
      push("simulated", "first", {"--touch", "trocar", "--fingers", "2", "--seal-friction", "0.5"});
  EXPECT_EQ(first.status, 0) << first.out << first.err;
  EXPECT_THAT(first.out, HasSubstr("N on the wall at a trocar"));
  const auto told = nlohmann::json::parse(read_text(folder() / "first/score.json"));
  EXPECT_EQ(told["touch"], "trocar");
  EXPECT_EQ(told["instruments"]["tip"], "retractor");
  EXPECT_EQ(told["instruments"]["seal_friction_n"], 0.5);
  const auto rows = rows_of(read_text(folder() / "first/forces.csv"));
  ASSERT_GT(rows.size(), 20U);
  double largest_n = 0, largest_wall_n = 0;
  for (const auto& row : rows) {
    for (const std::string of : {"instrument_1", "instrument_2"}) {
      double tissue_2 = 0, wall_2 = 0;
      for (const std::string axis : {"_x_n", "_y_n", "_z_n"}) {
        const double tissue = row.at(of + "_tissue" + axis), handle = row.at(of + "_handle" + axis),
                     wall = row.at(of + "_wall" + axis);
        // Of the columns: each force stands where its name says.
        EXPECT_NEAR(tissue, handle + wall, 1e-4 * (1 + std::abs(tissue) + std::abs(wall)));
        tissue_2 += tissue * tissue;
        wall_2 += wall * wall;
      }
      largest_n = std::max(largest_n, std::sqrt(tissue_2));
      largest_wall_n = std::max(largest_wall_n, std::sqrt(wall_2));
      EXPECT_GT(row.at(of + "_depth_m"), 0.05);
    }
  }
  EXPECT_GT(largest_n, 0.5);
  EXPECT_GT(largest_wall_n, largest_n);  // the wall bears the hand's force, too
  EXPECT_GE(told["instruments"]["peak_wall_force_n"].get<double>(), largest_wall_n - 1e-3);
  // The tips went up: the handles went down.
  EXPECT_LT(rows.back().at("instrument_1_tilt_y_rad"), rows.front().at("instrument_1_tilt_y_rad"));
  const std::vector<std::vector<double>> hand = moments_of(read_text(folder() / "first/hand.txt"));
  EXPECT_LT(hand.back()[3], hand.front()[3]);
  // The motion of the handles does it again.
  const ProcessResult again =
      push(path("first/hand.txt"), "again",
           {"--touch", "trocar", "--seal-friction", "0.5", "--ghost", path("first/hand.txt")});
  EXPECT_EQ(again.status, 0) << again.out << again.err;
  const ProcessResult jaws = push("simulated", "jaws", {"--touch", "trocar", "--tip", "jaws"});
  EXPECT_EQ(jaws.status, 0) << jaws.out << jaws.err;
  const auto of_jaws = nlohmann::json::parse(read_text(folder() / "jaws/score.json"));
  EXPECT_EQ(of_jaws["instruments"]["tip"], "jaws");
  EXPECT_GT(of_jaws["score"]["peak_force_n"].get<double>(), 1);
  EXPECT_REFUSED(push("simulated", "x", {"--tip", "jaws"}), "add --touch trocar");
  EXPECT_REFUSED(push("simulated", "x", {"--seal-friction", "1"}), "add --touch trocar");
  EXPECT_REFUSED(push("simulated", "x", {"--touch", "trocar", "--seal-friction", "21"}), "--seal-friction");
  EXPECT_REFUSED(push("simulated", "x", {"--touch", "trocar", "--tip", "hook"}), "--tip");
  EXPECT_REFUSED(push("simulated", "x", {"--touch", "trocar", "--feedback", "tangential"}),
                 "leave it out with --touch trocar");
  EXPECT_REFUSED(
      push("simulated", "x", {"--touch", "trocar", "--trainee", "Aoki", "--database", path("t.sqlite")}),
      "--touch trocar is kept with no trainee");
}

TEST_F(Exclusion, APluginMovesTheHandAndIsRefusedInWords) {
  const ProcessResult result =
      push("plugin:" + built_file("lifting_finger") + ":0.03", "plugged", {"--json"});
  EXPECT_EQ(result.status, 0) << result.out << result.err;
  EXPECT_EQ(nlohmann::json::parse(result.out)["score"]["done"], true);
  EXPECT_REFUSED(push("plugin:" + path("absent.so"), "x"), "cannot be loaded");
  EXPECT_REFUSED(push("plugin:" + built_file("lifting_finger") + ":up", "x"), "'up' is no height");
  EXPECT_REFUSED(push("plugin:", "x"), "names no plug-in");
}

TEST_F(Exclusion, APersonPractisesBeforeATest) {
  const std::string database = path("training.sqlite");
  ASSERT_EQ(kiroku({"train", "trainee", "Aoki", "--database", database}).status, 0);
  ASSERT_EQ(push("simulated", "first").status, 0);
  EXPECT_REFUSED(push(path("first/hand.txt"), "x", {"--trainee", "Aoki", "--database", database, "--test"}),
                 "Aoki has practised 0:00 of the 3:00 minutes of session 1: the test comes after them");
  EXPECT_REFUSED(
      push(path("first/hand.txt"), "y", {"--trainee", "Aoki", "--database", database, "--session", "2"}),
      "goes on with session 1");
  EXPECT_EQ(push(path("first/hand.txt"), "z",
                 {"--trainee", "Aoki", "--database", database, "--test", "--practice", "0"})
                .status,
            0);
  EXPECT_EQ(kiroku({"train", "trainee", "Aoki", "--database", database, "--user", "anna"}).status, 0);
}

TEST_F(Exclusion, ATestIsSealedAsACaseAndProvenAsOne) {
  const std::string database = path("training.sqlite"), home = path("home");
  ASSERT_EQ(kiroku({"init", "--demo", "--home", home}).status, 0);
  ASSERT_EQ(kiroku({"train", "trainee", "Model", "--simulated", "--database", database}).status, 0);
  const ProcessResult result =
      push("simulated", "test",
           {"--trainee", "Model", "--database", database, "--test", "--seal", "--home", home, "--json"});
  ASSERT_EQ(result.status, 0) << result.err;
  const auto told = nlohmann::json::parse(result.out);
  const std::string folder_of_case = told["case"];
  const nlohmann::json verdict = kiroku_json({"verify", folder_of_case, "--home", home, "--json"});
  EXPECT_EQ(verdict["verdict"], "intact");
  EXPECT_THAT(verdict["tokens"], testing::Ge(2)) << "one before the film, one after";
  // Who may open it finds the attempt again: what it was, each picture, each force.
  const ProcessResult subject =
      kiroku({"unseal", "-i", home + "/identity.txt", folder_of_case + "/subject.json.age"});
  ASSERT_EQ(subject.status, 0) << subject.err;
  const auto training = nlohmann::json::parse(subject.out)["training"];
  EXPECT_EQ(training["trainee"], "Model");
  EXPECT_EQ(training["simulated"], true);
  EXPECT_EQ(training["test"], true);
  EXPECT_EQ(training["score"], told["score"]);
  EXPECT_EQ(training["files"]["hand.txt"].get<std::string>().size(), 64U);
  ASSERT_EQ(kiroku({"export", folder_of_case, "--stream", "forces", "-o", path("forces.csv"), "--home", home})
                .status,
            0);
  EXPECT_THAT(read_text(folder() / "forces.csv"), HasSubstr("force of finger 1"));
  // Without a home to seal it in nothing is begun.
  EXPECT_REFUSED(push("simulated", "none", {"--seal", "--home", path("nowhere")}), "nowhere");
  EXPECT_FALSE(std::filesystem::exists(folder() / "none"));
}

TEST_F(Exclusion, AttemptsOfATraineeBecomeAReport) {
  const std::string database = path("training.sqlite");
  EXPECT_EQ(
      kiroku({"train", "trainee", "Model", "--simulated", "--group", "one", "--database", database}).status,
      0);
  EXPECT_REFUSED(kiroku({"train", "trainee", "Model", "--database", database}), "a trainee 'Model'");
  EXPECT_REFUSED(kiroku({"train", "results", "--database", database, "-o", path("report")}),
                 "no attempt yet");
  EXPECT_EQ(push("simulated", "one", {"--trainee", "Model", "--database", database, "--test"}).status, 0);
  const nlohmann::json found =
      kiroku_json({"train", "results", "--database", database, "-o", path("report"), "--json"});
  EXPECT_EQ(found["attempts"], 1);
  EXPECT_EQ(found["simulated_attempts"], 1);
  EXPECT_THAT(read_text(folder() / "report/attempts.csv"), HasSubstr("Model,one,yes,1,test,no,a,3,yes,"));
  EXPECT_THAT(read_text(folder() / "report/report.pdf"), testing::StartsWith("%PDF"));
  EXPECT_REFUSED(push("simulated", "two", {"--trainee", "Nobody", "--database", database}),
                 "no trainee 'Nobody'");
}

TEST_F(Exclusion, TheStudyRunsFromSessionsToATest) {
  const nlohmann::json found =
      kiroku_json({"train", "study", "-o", path("study"), "--object", "a", "--shown", "3", "--hidden", "3",
                   "--sessions", "2", "--practice", "8", "--json"});
  EXPECT_EQ(found["simulated"], true);
  EXPECT_EQ(found["trainees"], 6);
  EXPECT_GE(found["attempts"], 24);
  EXPECT_EQ(found["days"].size(), 4U);  // two groups, two days
  EXPECT_THAT(read_text(folder() / "study/object-a.svg"), HasSubstr("<svg"));
  EXPECT_TRUE(found["comparisons"][0].contains("p"));
  EXPECT_THAT(read_text(folder() / "study/attempts.csv"),
              HasSubstr("\"simulated, stress shown, 1\",stress shown,yes"));
  const nlohmann::json again = kiroku_json(
      {"train", "results", "--database", path("study/results.sqlite"), "-o", path("results"), "--json"});
  EXPECT_EQ(again["comparisons"], found["comparisons"]);
  const ProcessResult small = kiroku({"train", "study", "-o", path("small"), "--object", "a", "--shown", "1",
                                      "--hidden", "1", "--sessions", "1", "--practice", "8"});
  EXPECT_THAT(small.out, HasSubstr("no p-value: a test needs at least 3 results in each group"));
}

TEST_F(Exclusion, RefusesInOneSentence) {
  EXPECT_REFUSED(push(path("none.txt"), "x"), "none.txt");
  write_text(folder() / "words.txt", "words\n");
  EXPECT_REFUSED(push(path("words.txt"), "x"), "no hand motion");
  EXPECT_REFUSED(push("simulated", "x", {"--fingers", "6"}), "--fingers");
  EXPECT_REFUSED(push("simulated", "x", {"--object", "d"}), "--object");
  EXPECT_REFUSED(push("simulated", "x", {"--trainee", "Aoki"}), "belong together");
  EXPECT_REFUSED(push("simulated", "x", {"--test"}), "--test belongs to a trainee");
  EXPECT_REFUSED(push("udp:70000", "x"), "port");
  EXPECT_REFUSED(push("simulated", "x", {"--damage", "0"}), "--damage");
  EXPECT_FALSE(std::filesystem::exists(folder() / "x"));
}

TEST_F(Training, AnOrganOfACtIsPushedAside) {
  const std::string organ = write_flat_organ_document(folder()).string();
  const nlohmann::json told =
      kiroku_json({"train", "exclusion", "--organ", organ, "--hand", "simulated", "--damage", "9000",
                   "--size", "160x120", "-o", path("lobe"), "--json"});
  EXPECT_EQ(told["object"], "left lobe");
  EXPECT_EQ(told["damage_pa"], 9000);
  EXPECT_EQ(told["score"]["done"], true);
  EXPECT_REFUSED(kiroku({"train", "exclusion", "--organ", organ, "--object", "b", "--hand", "simulated", "-o",
                         path("two")}),
                 "--organ and --object");
  write_flat_organ_document(folder(), R"(, "exclusion": {"line": [[-20, -260, 120], [20, -260, 120]]})");
  EXPECT_REFUSED(kiroku({"train", "exclusion", "--organ", organ, "--hand", "simulated", "-o", path("seen")}),
                 "can be seen already");
  // As bone: no fingers lift it, which is said before a person tries.
  write_flat_organ_document(folder());
  std::string stiff = read_text(organ);
  stiff.replace(stiff.find("20000"), 5, "1e9");
  write_text(organ, stiff);
  const ProcessResult doubted = kiroku({"train", "exclusion", "--organ", organ, "--hand",
                                        "plugin:" + built_file("lifting_finger") + ":0.02", "--fingers", "3",
                                        "--seconds", "2", "--size", "160x120", "-o", path("bone")});
  EXPECT_EQ(doubted.status, 1) << doubted.out << doubted.err;
  EXPECT_THAT(doubted.err,
              HasSubstr("warning: perhaps nobody can bring the line behind left lobe into sight"));
}

TEST_F(Training, ServingThePageRefusesInOneSentence) {
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("home")}).status, 0);
  std::filesystem::create_directory(folder() / "page");
  write_text(folder() / "page/index.html", "<!doctype html>");
  const auto serve = [&](const Arguments& more, const std::string& listen = "127.0.0.1:0") {
    Arguments all{"train", "serve", "--home", path("home"), "--listen", listen, "--web", path("page")};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  };
  EXPECT_REFUSED(serve({"--vertices", "12"}), "--vertices");
  EXPECT_REFUSED(serve({"--at-once", "0"}), "--at-once");
  EXPECT_REFUSED(serve({"--key", "key.pem"}), "--certificate and --key belong together");
  write_text(folder() / "words.txt", "up and down");
  EXPECT_REFUSED(serve({"--expert-a", path("words.txt")}), "words.txt");
  write_text(folder() / "words.sqlite", std::string(4096, 'x'));
  EXPECT_REFUSED(serve({"--database", path("words.sqlite")}), "no database");
  const std::string organ = write_flat_organ_document(folder()).string();
  EXPECT_REFUSED(serve({"--organ", organ, "--organ", organ}), "two organs are called 'left lobe'");
  EXPECT_REFUSED(serve({}, "0.0.0.0:0"), "kiroku user add");
}

}  // namespace
}  // namespace kiroku::test
