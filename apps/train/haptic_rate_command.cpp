#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/sim/number_option.h"
#include "apps/train/output_folder.h"
#include "apps/train/person_at_device.h"
#include "apps/train/train_command.h"
#include "base/csv_field.h"
#include "base/error.h"
#include "base/number_text.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "media/png.h"
#include "trainer/haptic_rate/experiment.h"
#include "trainer/haptic_rate/plate_picture.h"
#include "trainer/haptic_rate/sensing_subject.h"
#include "trainer/report/plot.h"
#include "trainer/results/training_database.h"

namespace kiroku::apps {
namespace {

using Json = nlohmann::ordered_json;

struct Request {
  std::string output;
  std::string trials = "60", spread = "0.08", lapses = "0.02", between = "0.05", seed = "1", simulated = "10",
              masking = "0";
  std::optional<std::string> fingers, thresholds, method, series, hand, subject, database, subjects, manner,
      device;
  bool force = false, json = false;
};

/// The pieces of a list with commas.
std::vector<std::string> pieces_of(const std::string& text) {
  std::vector<std::string> pieces;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    pieces.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return pieces;
}

std::vector<double> numbers_of(const std::string& text, const std::string& what, double least,
                               double greatest) {
  std::vector<double> numbers;
  for (const std::string& piece : pieces_of(text))
    numbers.push_back(parse_number(piece, what, least, greatest));
  return numbers;
}

struct Outcome {
  std::vector<trainer::RateSession> sessions;
  /// Of simulated subjects to whom thresholds were given, as the thresholds of their sessions.
  std::vector<std::vector<double>> true_hz;
  std::string note;  // what the data are, for tables and plots
  /// Of a person: what the hand did in each trial, hand motions as text; none of simulated subjects.
  std::vector<std::string> motions;
};

/// The file of a trial's hand motion, trials counted from 1.
std::string motion_file(std::size_t trial) { return "hand-" + std::to_string(trial) + ".txt"; }

/// Hand motions of an earlier run that this one, with so many, did not write: beside its trials.csv they
/// would belong to no answer.
void remove_other_motions(const OutputFolder& folder, std::size_t motions) {
  namespace fs = std::filesystem;
  std::vector<fs::path> others;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder.path(""))) {
    const std::string name = entry.path().filename().string();
    constexpr std::string_view kBefore = "hand-", kAfter = ".txt";
    if (name.size() <= kBefore.size() + kAfter.size() || !name.starts_with(kBefore) ||
        !name.ends_with(kAfter))
      continue;
    const std::string number = name.substr(kBefore.size(), name.size() - kBefore.size() - kAfter.size());
    if (number.find_first_not_of("0123456789") != std::string::npos) continue;
    bool written = false;
    for (std::size_t trial = 1; trial <= motions && !written; ++trial) written = name == motion_file(trial);
    if (!written) others.push_back(entry.path());
  }
  for (const fs::path& other : others) {
    std::error_code failed;
    fs::remove(other, failed);
    if (failed) throw IoError("remove", other, failed.value());
  }
}

trainer::RateProtocol protocol_of(const Request& request) {
  trainer::RateProtocol protocol;
  protocol.series = trainer::rate_series(request.series.value_or("haptic-rate"));
  protocol.fingers.clear();
  if (request.fingers) {
    for (const std::string& piece : pieces_of(*request.fingers)) {
      try {
        protocol.fingers.push_back(trainer::Fingers::of(piece));
      } catch (const UsageError& error) {
        throw UsageError(std::string("--fingers: ") + error.what());
      }
    }
  } else {
    for (const trainer::PublishedThreshold& one : trainer::published_thresholds(protocol.series))
      protocol.fingers.push_back(one.fingers);
  }
  protocol.trials = parse_count(request.trials, "--trials", 1, 1000);
  protocol.method = trainer::method_kind(request.method.value_or("bayesian"));
  return protocol;
}

trainer::PublishedThreshold published_condition(trainer::RateSeries series, const trainer::Fingers& fingers) {
  for (const trainer::PublishedThreshold& one : trainer::published_thresholds(series)) {
    if (one.fingers == fingers) return one;
  }
  throw UsageError("the " + trainer::name_of(series) + " study has no table of thresholds with " +
                   fingers.in_words() + ": leave --fingers out for what it has");
}

/// Of scaled subjects: what --thresholds says for each condition, or what the study published.
std::vector<trainer::ConditionMean> means_of(const Request& request, const trainer::RateProtocol& protocol) {
  std::vector<trainer::ConditionMean> means;
  if (request.thresholds) {
    const std::vector<double> hz = numbers_of(*request.thresholds, "--thresholds", 0.7, 90);
    if (hz.size() != protocol.fingers.size()) {
      throw UsageError("--thresholds has " + std::to_string(hz.size()) + " numbers, and --fingers " +
                       std::to_string(protocol.fingers.size()) + " conditions: give a threshold for each");
    }
    for (std::size_t i = 0; i < hz.size(); ++i) means.push_back({protocol.fingers[i], hz[i]});
    return means;
  }
  for (const trainer::Fingers& fingers : protocol.fingers) {
    const std::optional<double> hz = trainer::published_threshold_hz(protocol.series, fingers);
    if (!hz) {
      throw UsageError("no threshold with " + fingers.in_words() +
                       " was published: give --thresholds, one for each "
                       "of --fingers");
    }
    means.push_back({fingers, *hz});
  }
  return means;
}

/// Who answers, as the options say it; whatever is wrong with them is told before anything is made.
struct Subjects {
  std::optional<UdpAddress> device;  // of a person; else one of these:
  std::vector<trainer::SubjectFunctions> simulated;
  std::vector<trainer::SensingModel> sensing;
  std::uint32_t seed = 0;
  std::string note;
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
  const std::string kind = request.subjects.value_or("scaled");
  if (kind != "scaled" && request.thresholds)
    throw UsageError("--thresholds is for '--subjects scaled', whose means it gives");
  if (kind != "sensing" && (request.manner || request.device || request.masking != "0"))
    throw UsageError("--manner, --device-bandwidth and --masking are for '--subjects sensing'");
  const std::size_t count = parse_count(request.simulated, "--simulated", 1, 1000);
  const double between = parse_number(request.between, "--between-subjects", 0, 0.5),
               spread = parse_number(request.spread, "--spread", 0.01, 0.5),
               lapses = parse_number(request.lapses, "--lapses", 0, 0.5);
  subjects.seed = static_cast<std::uint32_t>(parse_count(request.seed, "--seed", 0, 4'000'000'000));
  if (kind == "sensing") {
    trainer::SensingModel model;
    model.manner = trainer::manner_of(request.manner.value_or("press"));
    if (request.device) model.device_hz = parse_number(*request.device, "--device-bandwidth", 1, 1e5);
    model.masking_db = parse_number(request.masking, "--masking", 0, 60);
    // What a step moves the skin by goes as the time between steps: a factor of the rate is one of the
    // amplitude.
    constexpr double kDecibels = 20;
    model.spread_db = kDecibels * spread;
    model.lapse_rate = lapses;
    subjects.sensing = trainer::sensing_group(model, count, kDecibels * between, subjects.seed);
    subjects.note = "their thresholds follow from force steps by a published curve of what fingertips feel";
    return subjects;
  }
  if (kind == "drawn") {
    std::vector<trainer::PublishedThreshold> conditions;
    for (const trainer::Fingers& fingers : protocol.fingers)
      conditions.push_back(published_condition(protocol.series, fingers));
    subjects.simulated = trainer::drawn_group(conditions, count, spread, lapses, subjects.seed);
    subjects.note =
        "drawn from populations with the published means and standard deviations: this proves the estimator, "
        "and "
        "nothing about people";
    return subjects;
  }
  const std::vector<trainer::ConditionMean> means = means_of(request, protocol);
  subjects.simulated = trainer::scaled_group(means, count, between, spread, lapses, subjects.seed);
  subjects.note = "the subjects' means were put in: this proves the estimator, and nothing about people";
  return subjects;
}

Outcome ask(const Request& request, const Subjects& subjects, const trainer::Plate& plate,
            const trainer::RateProtocol& protocol) {
  Outcome outcome;
  outcome.note = subjects.note;
  if (subjects.device) {
    PersonAtDevice person(plate, *subjects.device);
    outcome.sessions.push_back(trainer::run_rate_session(person, protocol, [&](const trainer::RateTrial&) {
      outcome.motions.push_back(trainer::text_of(person.motion()));
    }));
    outcome.sessions.back().subject = *request.subject;
    return outcome;
  }
  Progress progress("asking simulated subjects");
  const std::size_t count = std::max(subjects.simulated.size(), subjects.sensing.size());
  const std::uint64_t all = count * protocol.fingers.size() * protocol.trials;
  std::uint64_t done = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t seed = subjects.seed + static_cast<std::uint32_t>(i) + 1;
    std::unique_ptr<trainer::RateSubject> subject;
    if (subjects.sensing.empty()) {
      subject = std::make_unique<trainer::SimulatedSubject>(plate, subjects.simulated[i], seed);
    } else {
      subject = std::make_unique<trainer::SensingSubject>(plate, subjects.sensing[i], seed);
    }
    outcome.sessions.push_back(trainer::run_rate_session(
        *subject, protocol, [&](const trainer::RateTrial&) { progress.update(++done, all); }));
    outcome.sessions.back().subject = "simulated " + std::to_string(i + 1);
    outcome.sessions.back().simulated = true;
    if (!subjects.sensing.empty()) continue;
    std::vector<double>& true_hz = outcome.true_hz.emplace_back();
    for (const trainer::Fingers& fingers : protocol.fingers)
      true_hz.push_back(subjects.simulated[i].at(fingers).threshold_hz);
  }
  return outcome;
}

std::string exact(double number) { return exact_text(number); }

std::string trials_csv(const Outcome& outcome) {
  std::string csv = "subject,simulated,fingers,trial,rate_hz,answer,hand_motion,hand_motion_sha256\n";
  for (const trainer::RateSession& session : outcome.sessions) {
    std::size_t number = 0;
    for (const trainer::RateTrial& trial : session.trials) {
      csv += csv_field(session.subject) + (session.simulated ? ",yes," : ",no,") + trial.fingers.text() +
             "," + std::to_string(++number) + "," + exact(trial.rate_hz) +
             (trial.vibrating ? ",vibrating," : ",continuous,");
      // Which motion an answer is of, so that one that is mixed up or changed is seen.
      if (!outcome.motions.empty())
        csv +=
            motion_file(number) + "," + crypto::to_hex(crypto::sha256(bytes_of(outcome.motions[number - 1])));
      csv += outcome.motions.empty() ? ",\n" : "\n";
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
      csv += csv_field(session.subject) + (session.simulated ? ",yes," : ",no,") + threshold.fingers.text() +
             "," + exact(threshold.estimate.hz) + "," + exact(threshold.estimate.interval_hz.low) + "," +
             exact(threshold.estimate.interval_hz.high) + "," +
             (threshold.own_hz ? exact(*threshold.own_hz) : "") + "," +
             (outcome.true_hz.empty() ? "" : exact(outcome.true_hz[s][i])) + "\n";
    }
  }
  return csv;
}

std::string comparison_csv(const trainer::RateComparison& comparison) {
  std::string csv = "fingers,and_fingers,ratio,t,degrees_of_freedom,p,p_holm,hedges_g,no_test_because\n";
  for (const trainer::RatePair& pair : comparison.pairs) {
    csv += pair.first.text() + "," + pair.second.text() + "," + exact(pair.ratio) + ",";
    if (pair.of_log10.test) {
      const trainer::TestResult& test = *pair.of_log10.test;
      csv += exact(test.t) + "," + exact(test.degrees_of_freedom) + "," + exact(test.p) + "," +
             exact(*pair.adjusted_p) + "," + exact(test.hedges_g) + ",\n";
    } else {
      csv += ",,,,," + csv_field(pair.of_log10.why_no_test) + "\n";
    }
  }
  return csv;
}

/// Where a condition stands in a plot: numbers of fingers at their number, named ones in their order.
double place_of(const trainer::RateComparison& comparison, std::size_t i) {
  const bool any_named = std::ranges::any_of(
      comparison.groups, [](const trainer::RateGroup& group) { return group.fingers.named(); });
  return static_cast<double>(any_named ? i + 1 : comparison.groups[i].fingers.count());
}

/// "1 index, 2 middle" where numbers alone do not say it.
std::string x_label_of(const trainer::RateComparison& comparison) {
  std::string label;
  for (std::size_t i = 0; i < comparison.groups.size(); ++i) {
    if (!comparison.groups[i].fingers.named()) continue;
    label += (label.empty() ? "" : ", ") + std::to_string(i + 1) + " " + comparison.groups[i].fingers.text();
  }
  return label.empty() ? "fingers" : label;
}

trainer::Plot plot_of(const Outcome& outcome, const trainer::RateComparison& comparison) {
  trainer::PlotSeries found{outcome.sessions.size() > 1 ? "geometric mean, 95 %" : "95 %", {}, {}, {}, true};
  const trainer::RateSeries series = outcome.sessions.front().series;
  trainer::PlotSeries paper{"the " + trainer::name_of(series) + " study", {}, {}, {}, false};
  for (std::size_t i = 0; i < comparison.groups.size(); ++i) {
    const trainer::RateGroup& group = comparison.groups[i];
    found.x.push_back(place_of(comparison, i));
    found.y.push_back(group.geometric_hz.mean);
    trainer::Interval interval = outcome.sessions.front().thresholds[i].estimate.interval_hz;
    if (group.geometric_hz.of_mean) interval = *group.geometric_hz.of_mean;
    interval.low = std::max(interval.low, 0.1);  // the axis is logarithmic
    found.intervals.push_back(interval);
    if (const auto published_hz = trainer::published_threshold_hz(series, group.fingers)) {
      paper.x.push_back(place_of(comparison, i));
      paper.y.push_back(*published_hz);
    }
  }
  const std::string subjects = std::to_string(outcome.sessions.size());
  return {"Rate below which forces are felt to vibrate",
          x_label_of(comparison),
          "Hz",
          paper.x.empty() ? std::vector{found} : std::vector{found, paper},
          true,
          true,
          outcome.sessions.front().simulated
              ? "simulated subjects: " + subjects + ", no person was asked; " + outcome.note
              : "answers of a person"};
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

/// A number, or names.
Json fingers_json(const trainer::Fingers& fingers) {
  return fingers.named() ? Json(fingers.text()) : Json(fingers.count());
}

Json interval_json(const trainer::Interval& interval) { return {interval.low, interval.high}; }

void print(const Request& request, const Outcome& outcome, const trainer::RateComparison& comparison) {
  const Recovery recovery = recovery_of(outcome);
  if (request.json) {
    Json groups = Json::array(), pairs = Json::array();
    for (const trainer::RateGroup& group : comparison.groups) {
      Json one{{"fingers", fingers_json(group.fingers)},
               {"mean_hz", group.hz.mean},
               {"sd_hz", group.hz.standard_deviation},
               {"geometric_mean_hz", group.geometric_hz.mean}};
      if (const auto published_hz =
              trainer::published_threshold_hz(outcome.sessions.front().series, group.fingers))
        one["paper_hz"] = *published_hz;
      for (const trainer::PublishedThreshold& published :
           trainer::published_thresholds(outcome.sessions.front().series)) {
        if (published.fingers == group.fingers && published.sd_hz) one["paper_sd_hz"] = *published.sd_hz;
      }
      if (group.geometric_hz.of_mean)
        one["geometric_mean_95_hz"] = interval_json(*group.geometric_hz.of_mean);
      groups.push_back(one);
    }
    for (const trainer::RatePair& pair : comparison.pairs) {
      Json one{{"fingers", {fingers_json(pair.first), fingers_json(pair.second)}}, {"ratio", pair.ratio}};
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
                {"simulated", outcome.sessions.front().simulated},
                {"subjects", outcome.sessions.size()},
                {"method", trainer::name_of(outcome.sessions.front().method)},
                {"series", trainer::name_of(outcome.sessions.front().series)},
                {"thresholds", groups},
                {"pairs", pairs}};
    if (!outcome.note.empty()) object["note"] = outcome.note;
    if (const auto found = trainer::compare_single_and_several(outcome.sessions)) {
      Json& one = object["single_and_several"];
      one["ratio"] = std::pow(10, found->difference);
      if (found->test) {
        one["t"] = found->test->t;
        one["p"] = found->test->p;
        one["hedges_g"] = found->test->hedges_g;
      } else {
        one["no_test_because"] = found->why_no_test;
      }
    }
    if (!outcome.true_hz.empty()) {
      object["recovered"] = {{"thresholds", recovery.thresholds},
                             {"within_10_percent", recovery.within},
                             {"largest_relative_error", recovery.largest}};
    }
    print_json(object);
    return;
  }
  std::cout << printable(request.output) << ": " << outcome.sessions.size()
            << (outcome.sessions.front().simulated ? " simulated subjects, no person" : " subject")
            << ", method " << trainer::name_of(outcome.sessions.front().method) << ", series "
            << trainer::name_of(outcome.sessions.front().series)
            << "\n  fingers  threshold: mean, geometric mean (95 %)   the study's mean\n";
  for (std::size_t i = 0; i < comparison.groups.size(); ++i) {
    const trainer::RateGroup& group = comparison.groups[i];
    const trainer::Interval interval =
        group.geometric_hz.of_mean.value_or(outcome.sessions.front().thresholds[i].estimate.interval_hz);
    const auto published_hz = trainer::published_threshold_hz(outcome.sessions.front().series, group.fingers);
    std::cout << "  " << group.fingers.text() << "        " << number_text(group.hz.mean, 3) << " Hz";
    if (group.hz.count > 1) std::cout << " (SD " << number_text(group.hz.standard_deviation, 3) << ")";
    std::cout << ", geometric " << number_text(group.geometric_hz.mean, 3) << " Hz ("
              << number_text(interval.low, 3) << " to " << number_text(interval.high, 3) << ")   "
              << (published_hz ? number_text(*published_hz, 3) + " Hz" : "none") << "\n";
  }
  for (const trainer::RatePair& pair : comparison.pairs) {
    std::cout << "  " << pair.first.text() << " and " << pair.second.text() << " fingers: ratio "
              << number_text(pair.ratio, 3);
    if (pair.of_log10.test) {
      std::cout << ", p " << number_text(pair.of_log10.test->p, 2) << ", " << number_text(*pair.adjusted_p, 2)
                << " by Holm\n";
    } else {
      std::cout << "; no p-value: " << pair.of_log10.why_no_test << "\n";
    }
  }
  if (const auto found = trainer::compare_single_and_several(outcome.sessions); found && found->test) {
    std::cout << "  one finger and several: ratio " << number_text(std::pow(10, found->difference), 3)
              << ", p " << number_text(found->test->p, 2) << " (Welch)\n";
  }
  if (!outcome.true_hz.empty()) {
    std::cout << "  " << recovery.within << " of " << recovery.thresholds
              << " thresholds found within 10 %, the worst is off by "
              << number_text(100 * recovery.largest, 3) << " %\n";
  }
  if (!outcome.note.empty()) std::cout << "  " << outcome.note << "\n";
}

int run(const Request& request) {
  const trainer::RateProtocol protocol = protocol_of(request);
  const Subjects subjects = subjects_of(request, protocol);
  std::vector<std::string> files{"trials.csv",     "thresholds.csv", "comparison.csv",
                                 "thresholds.svg", "thresholds.pdf", "touch.png"};
  const std::size_t trials = protocol.fingers.size() * protocol.trials;
  for (std::size_t trial = 1; subjects.device && trial <= trials; ++trial)
    files.push_back(motion_file(trial));
  const OutputFolder folder(request.output, files, request.force);
  const std::string database_file = request.database.value_or(folder.path("results.sqlite").string());
  require_subject(request, database_file);  // before hours of somebody's time
  const UtcTime began = utc_now();
  const trainer::Plate plate;
  const Outcome outcome = ask(request, subjects, plate, protocol);
  for (std::size_t trial = 1; trial <= outcome.motions.size(); ++trial)
    folder.write(motion_file(trial), outcome.motions[trial - 1]);
  folder.write("trials.csv", trials_csv(outcome));
  // Not before: until then the earlier run's answers stand, and name them.
  if (request.force) remove_other_motions(folder, outcome.motions.size());
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
  command.option("--fingers", "F,F,...", request->fingers,
                 "which fingers, one condition after the other: a number, or names joined by +: 2, little, "
                 "index+middle",
                 "those of the series' study");
  command.choice("--method", {"search", "staircase", "bayesian"}, request->method, "which rate is given next",
                 "bayesian");
  command.choice("--series", {"haptic-rate", "exclusion"}, request->series,
                 "whose series of rates: the haptic-rate study's or the exclusion trainer's", "haptic-rate");
  command.option("--trials", "N", request->trials, "answers for each condition");
  command.option("--simulated", "N", request->simulated, "simulated subjects");
  command.choice(
      "--subjects", {"scaled", "drawn", "sensing"}, request->subjects,
      "what they are: scaled to the study's means, drawn from its means and spreads, or sensing: their "
      "thresholds follow from force steps",
      "scaled");
  command.option("--thresholds", "HZ,HZ,...", request->thresholds,
                 "mean thresholds of scaled ones, one for each condition", "the study's");
  command.choice("--manner", {"press", "stroke"}, request->manner, "how sensing ones touch the plate",
                 "press");
  command.option("--device-bandwidth", "HZ", request->device, "of a device that smooths their forces",
                 "none is smoothed");
  command.option("--masking", "DB", request->masking,
                 "by which a finger raises its neighbour's threshold, of sensing ones");
  command.option("--between-subjects", "LOG10", request->between,
                 "how thresholds of scaled and sensing ones differ");
  command.option("--spread", "LOG10", request->spread, "of the answers of one subject around the threshold");
  command.option("--lapses", "SHARE", request->lapses, "of answers that are guessed");
  command.option("--seed", "N", request->seed, "of all chance in it");
  command.option("--database", "FILE", request->database, "keeps the results there, beside what it has",
                 "DIR/results.sqlite");
  command.writes("--database");
  command.flag("-f,--force", request->force,
               "replaces what an earlier run left in DIR, its hand motions included");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "A soft plate of 20 x 20 x 1.5 cm is pressed between 0.5 and 1 N while its forces are renewed at 100 "
      "Hz or 1 / (0.006 i) Hz, i from 2 to 750; with --series exclusion 1 / (0.0065 i) Hz, i from 2 to 250. "
      "The subject says whether it vibrates or is continuous. 'search' halves the series at each answer, "
      "'staircase' goes up after vibrating and down after continuous, 'bayesian' asks what tells most. "
      "Thresholds come with their 95 % interval from all answers.");
  command.explain(
      "Writes trials.csv, thresholds.csv, comparison.csv (paired t-tests, Holm), thresholds.svg and .pdf, "
      "and touch.png: the plate under five fingers, blue near 0.5 N, red near 1 N. Of a person also "
      "hand-1.txt and on: what the hand did in each trial, whose SHA-256 stands beside its answer in "
      "trials.csv.");
  command.example("kiroku train haptic-rate -o rates",
                  "ten simulated subjects with the haptic-rate study's thresholds");
  command.example("kiroku train haptic-rate --series exclusion --subjects drawn --simulated 6 -o table-1",
                  "six with the means and spreads of the exclusion study's named fingers and pairs");
  command.example("kiroku train haptic-rate --subjects sensing --device-bandwidth 20 -o sensing",
                  "ten whose thresholds follow from force steps");
  command.example("kiroku train haptic-rate --hand udp:7001 --subject Aoki -o aoki",
                  "a person at a device that sends to port 7001");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
