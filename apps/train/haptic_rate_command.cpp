#include <cmath>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/sim/number_option.h"
#include "apps/train/output_folder.h"
#include "apps/train/person_at_device.h"
#include "apps/train/train_command.h"
#include "base/error.h"
#include "base/number_text.h"
#include "media/png.h"
#include "trainer/haptic_rate/experiment.h"
#include "trainer/haptic_rate/plate_picture.h"
#include "trainer/report/csv_field.h"
#include "trainer/report/plot.h"
#include "trainer/results/training_database.h"

namespace kiroku::apps {
namespace {

using Json = nlohmann::ordered_json;

struct Request {
  std::string output;
  std::string fingers = "1,2,3,4,5", trials = "60", thresholds = "23.3,8.8,3.0,1.3,1.2", spread = "0.08",
              lapses = "0.02", between = "0.05", seed = "1", simulated = "10";
  std::optional<std::string> method, series, hand, subject, database;
  bool force = false, json = false;
};

std::vector<double> numbers_of(const std::string& text, const std::string& what, double least,
                               double greatest) {
  std::vector<double> numbers;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    numbers.push_back(parse_number(text.substr(at, end - at), what, least, greatest));
    at = end + 1;
  }
  return numbers;
}

struct Outcome {
  std::vector<trainer::RateSession> sessions;
  /// Of simulated subjects, as the thresholds of their sessions.
  std::vector<std::vector<double>> true_hz;
};

trainer::RateProtocol protocol_of(const Request& request) {
  trainer::RateProtocol protocol;
  protocol.fingers.clear();
  for (const double fingers : numbers_of(request.fingers, "--fingers", 1, trainer::kMostFingers)) {
    if (fingers != std::floor(fingers)) throw UsageError("--fingers counts whole fingers");
    protocol.fingers.push_back(static_cast<std::size_t>(fingers));
  }
  protocol.trials = parse_count(request.trials, "--trials", 1, 1000);
  protocol.method = trainer::method_kind(request.method.value_or("bayesian"));
  protocol.series = trainer::rate_series(request.series.value_or("haptic-rate"));
  return protocol;
}

/// Who answers, as the options say it; whatever is wrong with them is told before anything is made.
struct Subjects {
  std::optional<UdpAddress> device;  // of a person; else:
  std::vector<std::vector<trainer::PsychometricFunction>> simulated;
  std::uint32_t seed = 0;
};

Subjects subjects_of(const Request& request, const trainer::RateProtocol& protocol) {
  Subjects subjects;
  if (request.hand) {
    subjects.device = udp_address(*request.hand);
    if (!subjects.device) {
      throw UsageError("--hand is '" + *request.hand +
                       "': the experiment needs a device, as udp:PORT or udp:ADDRESS:PORT");
    }
    if (!request.subject) throw UsageError("--subject is missing: whose answers are they?");
    return subjects;
  }
  const std::vector<double> means_hz = numbers_of(request.thresholds, "--thresholds", 0.7, 90);
  for (const std::size_t fingers : protocol.fingers) {
    if (fingers > means_hz.size()) {
      throw UsageError("--thresholds has " + std::to_string(means_hz.size()) +
                       " numbers, and --fingers asks for " + std::to_string(fingers) +
                       " fingers: give a threshold for each from one finger on");
    }
  }
  subjects.seed = static_cast<std::uint32_t>(parse_count(request.seed, "--seed", 0, 4'000'000'000));
  subjects.simulated =
      trainer::simulated_group(means_hz, parse_count(request.simulated, "--simulated", 1, 1000),
                               parse_number(request.between, "--between-subjects", 0, 0.5),
                               parse_number(request.spread, "--spread", 0.01, 0.5),
                               parse_number(request.lapses, "--lapses", 0, 0.5), subjects.seed);
  return subjects;
}

Outcome ask(const Request& request, const Subjects& subjects, const trainer::Plate& plate,
            const trainer::RateProtocol& protocol) {
  Outcome outcome;
  if (subjects.device) {
    PersonAtDevice person(plate, *subjects.device);
    outcome.sessions.push_back(trainer::run_rate_session(person, protocol));
    outcome.sessions.back().subject = *request.subject;
    return outcome;
  }
  Progress progress("asking simulated subjects");
  const std::uint64_t all = subjects.simulated.size() * protocol.fingers.size() * protocol.trials;
  std::uint64_t done = 0;
  for (std::size_t i = 0; i < subjects.simulated.size(); ++i) {
    trainer::SimulatedSubject subject(plate, subjects.simulated[i],
                                      subjects.seed + static_cast<std::uint32_t>(i) + 1);
    outcome.sessions.push_back(trainer::run_rate_session(
        subject, protocol, [&](const trainer::RateTrial&) { progress.update(++done, all); }));
    outcome.sessions.back().subject = "simulated " + std::to_string(i + 1);
    outcome.sessions.back().simulated = true;
    std::vector<double>& true_hz = outcome.true_hz.emplace_back();
    for (const std::size_t fingers : protocol.fingers)
      true_hz.push_back(subjects.simulated[i][fingers - 1].threshold_hz);
  }
  return outcome;
}

std::string exact(double number) { return exact_text(number); }

std::string trials_csv(const Outcome& outcome) {
  std::string csv = "subject,simulated,fingers,trial,rate_hz,answer\n";
  for (const trainer::RateSession& session : outcome.sessions) {
    std::size_t number = 0;
    for (const trainer::RateTrial& trial : session.trials) {
      csv += trainer::csv_field(session.subject) + (session.simulated ? ",yes," : ",no,") +
             std::to_string(trial.fingers) + "," + std::to_string(++number) + "," + exact(trial.rate_hz) +
             (trial.vibrating ? ",vibrating\n" : ",continuous\n");
    }
  }
  return csv;
}

std::string thresholds_csv(const Outcome& outcome) {
  std::string csv = "subject,simulated,fingers,threshold_hz,low_95_hz,high_95_hz,own_estimate_hz,true_hz\n";
  for (std::size_t s = 0; s < outcome.sessions.size(); ++s) {
    const trainer::RateSession& session = outcome.sessions[s];
    for (std::size_t i = 0; i < session.thresholds.size(); ++i) {
      const trainer::RateThreshold& threshold = session.thresholds[i];
      csv += trainer::csv_field(session.subject) + (session.simulated ? ",yes," : ",no,") +
             std::to_string(threshold.fingers) + "," + exact(threshold.estimate.hz) + "," +
             exact(threshold.estimate.interval_hz.low) + "," + exact(threshold.estimate.interval_hz.high) +
             "," + (threshold.own_hz ? exact(*threshold.own_hz) : "") + "," +
             (outcome.true_hz.empty() ? "" : exact(outcome.true_hz[s][i])) + "\n";
    }
  }
  return csv;
}

std::string comparison_csv(const trainer::RateComparison& comparison) {
  std::string csv = "fingers,and_fingers,ratio,t,degrees_of_freedom,p,p_holm,hedges_g,no_test_because\n";
  for (const trainer::RatePair& pair : comparison.pairs) {
    csv += std::to_string(pair.first) + "," + std::to_string(pair.second) + "," + exact(pair.ratio) + ",";
    if (pair.of_log10.test) {
      const trainer::TestResult& test = *pair.of_log10.test;
      csv += exact(test.t) + "," + exact(test.degrees_of_freedom) + "," + exact(test.p) + "," +
             exact(*pair.adjusted_p) + "," + exact(test.hedges_g) + ",\n";
    } else {
      csv += ",,,,," + trainer::csv_field(pair.of_log10.why_no_test) + "\n";
    }
  }
  return csv;
}

trainer::Plot plot_of(const Outcome& outcome, const trainer::RateComparison& comparison) {
  trainer::PlotSeries found{outcome.sessions.size() > 1 ? "geometric mean, 95 %" : "95 %", {}, {}, {}, true};
  const trainer::RateSeries series = outcome.sessions.front().series;
  trainer::PlotSeries paper{"the " + trainer::name_of(series) + " study", {}, {}, {}, false};
  for (std::size_t i = 0; i < comparison.groups.size(); ++i) {
    const trainer::RateGroup& group = comparison.groups[i];
    found.x.push_back(static_cast<double>(group.fingers));
    found.y.push_back(group.geometric_hz.mean);
    trainer::Interval interval = outcome.sessions.front().thresholds[i].estimate.interval_hz;
    if (group.geometric_hz.of_mean) interval = *group.geometric_hz.of_mean;
    interval.low = std::max(interval.low, 0.1);  // the axis is logarithmic
    found.intervals.push_back(interval);
    if (const auto published_hz = trainer::published_threshold_hz(series, group.fingers)) {
      paper.x.push_back(static_cast<double>(group.fingers));
      paper.y.push_back(*published_hz);
    }
  }
  const std::string subjects = std::to_string(outcome.sessions.size());
  return {"Rate below which forces are felt to vibrate",
          "fingers",
          "Hz",
          paper.x.empty() ? std::vector{found} : std::vector{found, paper},
          true,
          true,
          outcome.true_hz.empty()
              ? "answers of a person"
              : "simulated subjects: " + subjects + ", no person was asked; their means were put in"};
}

struct Recovery {
  std::size_t thresholds = 0, within = 0;
  double largest = 0;  // relative error
};
Recovery recovery_of(const Outcome& outcome) {
  Recovery found;
  for (std::size_t s = 0; s < outcome.true_hz.size(); ++s) {
    for (std::size_t i = 0; i < outcome.true_hz[s].size(); ++i) {
      const double error =
          std::abs(outcome.sessions[s].thresholds[i].estimate.hz / outcome.true_hz[s][i] - 1);
      ++found.thresholds;
      if (error <= 0.1) ++found.within;
      found.largest = std::max(found.largest, error);
    }
  }
  return found;
}

void keep(const Request& request, const std::string& database_file, const Outcome& outcome, UtcTime began) {
  trainer::TrainingDatabase database(database_file);
  for (const trainer::RateSession& session : outcome.sessions) {
    // A person may come again; simulated subjects of another run are others.
    std::optional<trainer::Trainee> subject;
    const std::string name = session.simulated
                                 ? session.subject + " of seed " + request.seed + ", " + format_utc(began)
                                 : session.subject;
    for (const trainer::Trainee& trainee : database.trainees()) {
      if (trainee.name == name) subject = trainee;
    }
    if (!subject) subject = database.add_trainee(name, "", session.simulated);
    database.add_rate_session(*subject, session, began);
  }
}

/// That what is asked for can be kept: the database opens, and a person's name is that of a person there.
void require_subject(const Request& request, const std::string& database_file) {
  trainer::TrainingDatabase database(database_file);
  if (!request.hand) return;
  for (const trainer::Trainee& trainee : database.trainees()) {
    if (trainee.name != *request.subject) continue;
    if (trainee.simulated) {
      throw UsageError("--subject is '" + *request.subject + "', a simulated trainee of " + database_file +
                       ": a person needs another name");
    }
    return;
  }
  database.add_trainee(*request.subject, "", false);
}

Json interval_json(const trainer::Interval& interval) { return {interval.low, interval.high}; }

void print(const Request& request, const Outcome& outcome, const trainer::RateComparison& comparison) {
  const Recovery recovery = recovery_of(outcome);
  if (request.json) {
    Json groups = Json::array(), pairs = Json::array();
    for (const trainer::RateGroup& group : comparison.groups) {
      Json one{{"fingers", group.fingers},
               {"mean_hz", group.hz.mean},
               {"geometric_mean_hz", group.geometric_hz.mean}};
      if (const auto published_hz =
              trainer::published_threshold_hz(outcome.sessions.front().series, group.fingers))
        one["paper_hz"] = *published_hz;
      if (group.geometric_hz.of_mean)
        one["geometric_mean_95_hz"] = interval_json(*group.geometric_hz.of_mean);
      groups.push_back(one);
    }
    for (const trainer::RatePair& pair : comparison.pairs) {
      Json one{{"fingers", {pair.first, pair.second}}, {"ratio", pair.ratio}};
      if (pair.of_log10.test) {
        one["t"] = pair.of_log10.test->t;
        one["p"] = pair.of_log10.test->p;
        one["p_holm"] = *pair.adjusted_p;
      } else {
        one["no_test_because"] = pair.of_log10.why_no_test;
      }
      pairs.push_back(one);
    }
    Json object{{"folder", request.output},
                {"simulated", !outcome.true_hz.empty()},
                {"subjects", outcome.sessions.size()},
                {"method", trainer::name_of(outcome.sessions.front().method)},
                {"series", trainer::name_of(outcome.sessions.front().series)},
                {"thresholds", groups},
                {"pairs", pairs}};
    if (!outcome.true_hz.empty()) {
      object["recovered"] = {{"thresholds", recovery.thresholds},
                             {"within_10_percent", recovery.within},
                             {"largest_relative_error", recovery.largest}};
    }
    print_json(object);
    return;
  }
  std::cout << printable(request.output) << ": " << outcome.sessions.size()
            << (outcome.true_hz.empty() ? " subject" : " simulated subjects, no person") << ", method "
            << trainer::name_of(outcome.sessions.front().method) << ", series "
            << trainer::name_of(outcome.sessions.front().series)
            << "\n  fingers  threshold: mean, geometric mean (95 %)   the study's\n";
  for (std::size_t i = 0; i < comparison.groups.size(); ++i) {
    const trainer::RateGroup& group = comparison.groups[i];
    const trainer::Interval interval =
        group.geometric_hz.of_mean.value_or(outcome.sessions.front().thresholds[i].estimate.interval_hz);
    const auto published_hz = trainer::published_threshold_hz(outcome.sessions.front().series, group.fingers);
    std::cout << "  " << group.fingers << "        " << number_text(group.hz.mean, 3) << " Hz, geometric "
              << number_text(group.geometric_hz.mean, 3) << " Hz (" << number_text(interval.low, 3) << " to "
              << number_text(interval.high, 3) << ")   "
              << (published_hz ? number_text(*published_hz, 3) + " Hz" : "none") << "\n";
  }
  for (const trainer::RatePair& pair : comparison.pairs) {
    std::cout << "  " << pair.first << " and " << pair.second << " fingers: ratio "
              << number_text(pair.ratio, 3);
    if (pair.of_log10.test) {
      std::cout << ", p " << number_text(pair.of_log10.test->p, 2) << ", " << number_text(*pair.adjusted_p, 2)
                << " by Holm\n";
    } else {
      std::cout << "; no p-value: " << pair.of_log10.why_no_test << "\n";
    }
  }
  if (!outcome.true_hz.empty()) {
    std::cout
        << "  " << recovery.within << " of " << recovery.thresholds
        << " thresholds found within 10 %, the worst is off by " << number_text(100 * recovery.largest, 3)
        << " %\n  the subjects' means were put in (--thresholds): this proves the estimator, and nothing "
           "about people\n";
  }
}

int run(const Request& request) {
  const trainer::RateProtocol protocol = protocol_of(request);
  const Subjects subjects = subjects_of(request, protocol);
  const OutputFolder folder(
      request.output,
      {"trials.csv", "thresholds.csv", "comparison.csv", "thresholds.svg", "thresholds.pdf", "touch.png"},
      request.force);
  const std::string database_file = request.database.value_or(folder.path("results.sqlite").string());
  require_subject(request, database_file);  // before hours of somebody's time
  const UtcTime began = utc_now();
  const trainer::Plate plate;
  const Outcome outcome = ask(request, subjects, plate, protocol);
  folder.write("trials.csv", trials_csv(outcome));
  keep(request, database_file, outcome, began);
  const trainer::RateComparison comparison = trainer::compare_fingers(outcome.sessions);
  folder.write("thresholds.csv", thresholds_csv(outcome));
  folder.write("comparison.csv", comparison_csv(comparison));
  const trainer::Plot plot = plot_of(outcome, comparison);
  folder.write("thresholds.svg", trainer::plot_file(plot, trainer::PlotForm::kSvg));
  folder.write("thresholds.pdf", trainer::plot_file(plot, trainer::PlotForm::kPdf));
  const sim::Picture picture = trainer::picture_of_press(plate, trainer::kMostFingers);
  folder.write("touch.png", media::png_of({picture.width, picture.height, 3, picture.rgb}));
  print(request, outcome, comparison);
  return kDone;
}

}  // namespace

void add_train_haptic_rate_command(Command& train) {
  Command& command =
      train.add_command("haptic-rate", "how often must forces come? The experiment with one to five fingers");
  const auto request = std::make_shared<Request>();
  command.required_option("-o,--output", "DIR", request->output, "where to");
  command.option(
      "--hand", "HAND", request->hand,
      "a person at a device, udp:PORT or udp:ADDRESS:PORT, who answers on the terminal; else simulated "
      "subjects");
  command.option("--subject", "NAME", request->subject, "who the person is");
  command.option("--fingers", "N,N,...", request->fingers, "with so many fingers, one after the other");
  command.choice("--method", {"search", "staircase", "bayesian"}, request->method, "which rate is given next",
                 "bayesian");
  command.choice("--series", {"haptic-rate", "exclusion"}, request->series,
                 "whose series of rates: the haptic-rate study's or the exclusion trainer's", "haptic-rate");
  command.option("--trials", "N", request->trials, "answers for each number of fingers");
  command.option("--simulated", "N", request->simulated, "simulated subjects");
  command.option("--thresholds", "HZ,HZ,...", request->thresholds,
                 "their mean thresholds with one finger, two fingers, ...");
  command.option("--between-subjects", "LOG10", request->between, "how their thresholds differ");
  command.option("--spread", "LOG10", request->spread, "of the answers of one subject around the threshold");
  command.option("--lapses", "SHARE", request->lapses, "of answers that are guessed");
  command.option("--seed", "N", request->seed, "of all chance in it");
  command.option("--database", "FILE", request->database, "keeps the results there, beside what it has",
                 "DIR/results.sqlite");
  command.flag("-f,--force", request->force, "replaces what an earlier run left in DIR");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "A soft plate of 20 x 20 x 1.5 cm is pressed between 0.5 and 1 N while its forces are renewed at 100 "
      "Hz or 1 / (0.006 i) Hz, i from 2 to 750; with --series exclusion 1 / (0.0065 i) Hz, i from 2 to 250. "
      "The subject says whether it vibrates or is continuous. 'search' halves the series at each answer, "
      "'staircase' goes up after vibrating and down after continuous, 'bayesian' asks what tells most. "
      "Thresholds come with their 95 % interval from all answers.");
  command.explain(
      "Writes trials.csv, thresholds.csv, comparison.csv (paired t-tests, Holm), thresholds.svg and .pdf, "
      "and "
      "touch.png: the plate under five fingers, blue near 0.5 N, red near 1 N.");
  command.example("kiroku train haptic-rate -o rates",
                  "ten simulated subjects with the haptic-rate study's thresholds");
  command.example("kiroku train haptic-rate --hand udp:7001 --subject Aoki -o aoki",
                  "a person at a device that sends to port 7001");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
