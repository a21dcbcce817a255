#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <set>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/common/time_option.h"
#include "apps/sim/number_option.h"
#include "apps/train/output_folder.h"
#include "apps/train/train_command.h"
#include "base/error.h"
#include "base/number_text.h"
#include "trainer/curriculum/assessment_report.h"
#include "trainer/curriculum/simulated_study.h"
#include "trainer/results/training_database.h"

namespace kiroku::apps {
namespace {

using Json = nlohmann::ordered_json;

const std::vector<std::string> kReportFiles{"attempts.csv", "curves.csv", "assessments.csv", "report.pdf"};

struct TraineeRequest {
  std::string name, database;
  std::optional<std::string> group, user;
  bool simulated = false;
};

struct StudyRequest {
  std::string output, shown = "7", hidden = "6", sessions = "5", practice = "180", fingers = "3",
                      vertices = "900", seed = "1";
  std::optional<std::string> object;
  bool force = false, json = false;
};

struct ResultsRequest {
  std::string database, output;
  bool force = false, json = false;
};

Json comparisons_json(const std::vector<trainer::ExclusionRecord>& records) {
  std::set<std::string> objects;
  for (const trainer::ExclusionRecord& record : records) objects.insert(record.object);
  Json all = Json::array();
  for (const std::string& object : objects) {
    for (const trainer::Measure measure : trainer::kMeasures) {
      for (const trainer::GroupComparison& found : trainer::compare_at_end(records, object, measure)) {
        Json one{{"object", object},
                 {"measure", trainer::label_of(measure)},
                 {"session", found.session},
                 {"fingers", found.fingers},
                 {"first", found.first},
                 {"second", found.second},
                 {"conditions", trainer::text_of(found.conditions)},
                 {"difference", found.comparison.difference}};
        if (found.comparison.test) {
          const trainer::TestResult& test = *found.comparison.test;
          one["difference_95"] = {test.of_difference.low, test.of_difference.high};
          one["t"] = test.t;
          one["degrees_of_freedom"] = test.degrees_of_freedom;
          one["p"] = test.p;
          one["hedges_g"] = test.hedges_g;
          one["hedges_g_95"] = {test.of_hedges_g.low, test.of_hedges_g.high};
        } else {
          one["no_test_because"] = found.comparison.why_no_test;
        }
        all.push_back(one);
      }
    }
  }
  return all;
}

void print_comparisons(const Json& comparisons) {
  for (const Json& one : comparisons) {
    std::cout << "  object " << one["object"].get<std::string>() << ", session " << one["session"] << ", "
              << one["fingers"] << (one["fingers"] == 1 ? " finger, " : " fingers, ")
              << one["measure"].get<std::string>() << ": " << one["first"].get<std::string>() << " less "
              << one["second"].get<std::string>() << " " << number_text(one["difference"].get<double>(), 3);
    if (one.contains("p")) {
      std::cout << ", p " << number_text(one["p"].get<double>(), 2) << ", Hedges' g "
                << number_text(one["hedges_g"].get<double>(), 2) << "\n";
    } else {
      std::cout << "; no p-value: " << one["no_test_because"].get<std::string>() << "\n";
    }
  }
}

void write_report(const OutputFolder& folder, const std::vector<trainer::ExclusionRecord>& records) {
  folder.write("attempts.csv", trainer::attempts_csv(records));
  folder.write("curves.csv", trainer::curves_csv(records));
  folder.write("assessments.csv", trainer::assessments_csv(records));
  folder.write("report.pdf", trainer::training_report(records));
}

std::size_t simulated_count(const std::vector<trainer::ExclusionRecord>& records) {
  return static_cast<std::size_t>(std::ranges::count(records, true, &trainer::ExclusionRecord::simulated));
}

int add_trainee(const TraineeRequest& request) {
  trainer::TrainingDatabase database(request.database);
  if (request.user && request.simulated)
    throw UsageError("no user trains as a simulated trainee: leave --user out");
  const std::vector<trainer::Trainee> known = database.trainees();
  const auto same = std::ranges::find(known, request.name, &trainer::Trainee::name);
  if (request.user && !request.group && same != known.end()) {
    database.bind_to_user(*same, *request.user);
    std::cout << request.database << ": " << *request.user << " trains as " << request.name
              << " from now on\n";
    return kDone;
  }
  database.add_trainee(request.name, request.group.value_or(""), request.simulated,
                       request.user.value_or(""));
  std::cout << request.database << ": added " << request.name << "; " << database.trainees().size()
            << (database.trainees().size() == 1 ? " trainee" : " trainees") << " now\n";
  return kDone;
}

/// What people have done cannot be made anew.
void refuse_results_of_people(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) return;
  const trainer::TrainingDatabase database(file);
  const std::vector<trainer::Trainee> trainees = database.trainees();
  if (!std::ranges::all_of(trainees, &trainer::Trainee::simulated)) {
    throw UsageError(file.string() +
                     " holds results of people, which no study replaces: choose another folder");
  }
}

/// The largest stress of the tests by day and group: what Figures 9 and 10 of the exclusion study show.
Json days_of(const std::vector<trainer::ExclusionRecord>& records, const std::string& object) {
  Json days = Json::array();
  for (const trainer::LearningCurve& curve :
       trainer::learning_curves(records, object, trainer::Measure::kStress)) {
    for (const trainer::CurvePoint& point : curve.points) {
      Json one{{"object", object},
               {"group", curve.group},
               {"day", point.session},
               {"trainees", point.summary.count},
               {"mean_kpa", point.summary.mean}};
      if (point.summary.of_mean)
        one["mean_95_kpa"] = {point.summary.of_mean->low, point.summary.of_mean->high};
      days.push_back(std::move(one));
    }
  }
  return days;
}

std::string plot_name(const std::string& object) { return "object-" + object + ".svg"; }

int run_study(const StudyRequest& request) {
  trainer::SimulatedStudy study;
  study.shown = parse_count(request.shown, "--shown", 1, 100);
  study.hidden = parse_count(request.hidden, "--hidden", 1, 100);
  study.sessions = static_cast<int>(parse_count(request.sessions, "--sessions", 1, 50));
  study.practice_s = parse_seconds(request.practice, "--practice", 1, 3600);
  study.fingers = parse_count(request.fingers, "--fingers", 1, trainer::kMostExclusionFingers);
  study.seed = static_cast<std::uint32_t>(parse_count(request.seed, "--seed", 0, 4'000'000'000));
  const std::size_t vertices =
      parse_count(request.vertices, "--vertices", trainer::kLeastObjectNodes, trainer::kMostObjectNodes);
  std::vector<std::string> objects{"a", "b"};
  if (request.object && *request.object != "both") objects = {*request.object};
  std::vector<std::string> files = kReportFiles;
  files.emplace_back("results.sqlite");
  for (const std::string& object : objects) files.push_back(plot_name(object));
  const OutputFolder folder(request.output, files, request.force);
  refuse_results_of_people(folder.path("results.sqlite"));
  Progress progress("training simulated trainees");
  // By the tests: how many attempts practice takes is not known before.
  const std::uint64_t all =
      objects.size() * (study.shown + study.hidden) * static_cast<std::uint64_t>(study.sessions);
  std::uint64_t done = 0;
  const UtcTime began = utc_now();
  std::vector<trainer::ExclusionRecord> records;
  for (const std::string& object : objects) {
    const trainer::ObjectKind kind = trainer::object_kind(object);
    const trainer::ExclusionBody body(trainer::make_object(kind, vertices), trainer::exclusion_task(kind));
    for (trainer::ExclusionRecord& record :
         trainer::run_simulated_study(body, study, [&](const trainer::ExclusionRecord& made) {
           if (made.test) progress.update(++done, all);
         }))
      records.push_back(std::move(record));
  }
  progress.clear();
  std::filesystem::remove(folder.path("results.sqlite"));  // of an earlier run, with --force
  trainer::TrainingDatabase database(folder.path("results.sqlite"));
  std::map<std::string, trainer::Trainee> trainees;
  for (const trainer::ExclusionRecord& record : records) {
    if (!trainees.contains(record.trainee))
      trainees[record.trainee] = database.add_trainee(record.trainee, record.group, true);
    database.add_attempt(trainees[record.trainee], record, began);
  }
  // What is reported is what was kept.
  const std::vector<trainer::ExclusionRecord> kept = database.attempts();
  write_report(folder, kept);
  Json days = Json::array();
  for (const std::string& object : objects) {
    folder.write(plot_name(object),
                 trainer::plot_file(trainer::plot_of_study(kept, object, trainer::Measure::kStress),
                                    trainer::PlotForm::kSvg));
    for (Json& one : days_of(kept, object)) days.push_back(std::move(one));
  }
  const Json comparisons = comparisons_json(kept);
  if (request.json) {
    print_json({{"folder", request.output},
                {"simulated", true},
                {"trainees", trainees.size()},
                {"attempts", kept.size()},
                {"days", days},
                {"comparisons", comparisons}});
    return kDone;
  }
  std::cout << printable(request.output) << ": " << kept.size() << " attempts of " << trainees.size()
            << " simulated trainees; they say nothing about people\n";
  for (const Json& one : days) {
    std::cout << "  object " << one["object"].get<std::string>() << ", " << one["group"].get<std::string>()
              << ", day " << one["day"] << ": largest stress "
              << number_text(one["mean_kpa"].get<double>(), 3) << " kPa\n";
  }
  print_comparisons(comparisons);
  return kDone;
}

int run_results(const ResultsRequest& request) {
  if (!std::filesystem::exists(request.database))
    throw UsageError("there is no database " + request.database +
                     ": 'kiroku train trainee' and 'kiroku train exclusion --database' make one");
  const trainer::TrainingDatabase database(request.database);
  const std::vector<trainer::ExclusionRecord> records = database.attempts();
  if (records.empty())
    throw UsageError(request.database +
                     " holds no attempt yet: 'kiroku train exclusion --trainee NAME --database " +
                     request.database + "' adds one");
  const OutputFolder folder(request.output, kReportFiles, request.force);
  write_report(folder, records);
  const Json comparisons = comparisons_json(records);
  const std::size_t simulated = simulated_count(records);
  if (request.json) {
    print_json({{"folder", request.output},
                {"attempts", records.size()},
                {"simulated_attempts", simulated},
                {"comparisons", comparisons}});
    return kDone;
  }
  std::cout << printable(request.output) << ": " << records.size() << " attempts";
  if (simulated > 0) std::cout << ", " << simulated << " of them simulated";
  std::cout << "\n";
  print_comparisons(comparisons);
  return kDone;
}

}  // namespace

void add_train_curriculum_commands(Command& train) {
  {
    Command& command = train.add_command("trainee", "adds a trainee to a database of results");
    const auto request = std::make_shared<TraineeRequest>();
    command.argument("NAME", request->name, "a name that nobody there has");
    command.required_option("--database", "FILE", request->database,
                            "where results are kept; made if absent");
    command.writes("--database");
    command.option("--group", "NAME", request->group, "of a study");
    command.option("--user", "USER", request->user,
                   "of 'kiroku user', who trains so on the page; for a trainee who is there, from now on");
    command.flag("--simulated", request->simulated,
                 "no person: for 'kiroku train exclusion --hand simulated'");
    command.example("kiroku train trainee Aoki --database training.sqlite --group \"stress shown\"",
                    "a trainee of a study");
    command.on_run([request] { return add_trainee(*request); });
  }
  {
    Command& command = train.add_command("results", "learning curves and groups compared, as CSV and PDF");
    const auto request = std::make_shared<ResultsRequest>();
    command.required_option("--database", "FILE", request->database, "where results are kept");
    command.required_option("-o,--output", "DIR", request->output, "where to");
    command.flag("-f,--force", request->force, "replaces what an earlier run left in DIR");
    command.flag("--json", request->json, "prints one JSON object instead");
    command.explain(
        "Writes attempts.csv, curves.csv, assessments.csv (questionnaires and checklists) and report.pdf: "
        "for each measure the learning curves of the groups "
        "with 95 % "
        "intervals, and in the last session that two groups have, Welch's t-test, Hedges' g and intervals. "
        "Groups of "
        "fewer than three get a sentence instead of a p-value.");
    command.example("kiroku train results --database training.sqlite -o report", "what training did so far");
    command.on_run([request] { return run_results(*request); });
  }
  {
    Command& command =
        train.add_command("study", "the study with simulated trainees: proves that its pipeline runs");
    const auto request = std::make_shared<StudyRequest>();
    command.required_option("-o,--output", "DIR", request->output, "where to");
    command.choice("--object", {"a", "b", "both"}, request->object,
                   "like a liver, like a lung, or one after the other", "both");
    command.option("--shown", "N", request->shown, "trainees who see stress in practice");
    command.option("--hidden", "N", request->hidden, "trainees who do not");
    command.option("--sessions", "N", request->sessions, "days, each of practice and a test");
    command.option("--practice", "T", request->practice, duration_help("of practice on a day and an object"));
    command.option("--fingers", "N", request->fingers, "1 to 5");
    command.option("--vertices", "N", request->vertices, "of the object's mesh");
    command.option("--seed", "N", request->seed, "of all chance in it");
    command.flag("-f,--force", request->force, "replaces what an earlier run left in DIR");
    command.flag("--json", request->json, "prints one JSON object instead");
    command.explain(
        "One group sees stress in practice, the other does not; tests are without. Trainees vary what they "
        "do as hands "
        "vary, and aim at what turned out better by what they were shown: the largest stress, or the largest "
        "force "
        "that they felt. No rate of learning is put in; how hands vary is. Models of trainees say nothing "
        "about "
        "people, and every record and page names them as simulated. Writes object-a.svg and object-b.svg "
        "too: the "
        "largest stress of the tests by day, as the exclusion study's Figures 9 and 10.");
    command.example("kiroku train study -o study", "thirteen simulated trainees, five days, both objects");
    command.on_run([request] { return run_study(*request); });
  }
}

}  // namespace kiroku::apps
