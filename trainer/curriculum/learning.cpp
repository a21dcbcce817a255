#include "trainer/curriculum/learning.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>
#include <set>

#include "base/csv_field.h"
#include "base/error.h"
#include "base/number_text.h"
#include "trainer/curriculum/assessment_report.h"

namespace kiroku::trainer {
namespace {

using Conditions = std::optional<AttemptConditions>;

/// Who is compared: the same group with as many fingers, under the same conditions.
struct Cohort {
  std::string group;
  std::size_t fingers = 0;
  Conditions conditions;
  auto operator<=>(const Cohort&) const = default;
};
/// By cohort and session, a number a trainee: the mean of his or her tests.
using Tests = std::map<Cohort, std::map<int, std::vector<double>>>;

Tests tests_of(const std::vector<ExclusionRecord>& records, const std::string& object, Measure measure) {
  std::map<Cohort, std::map<int, std::map<std::string, std::vector<double>>>> by_trainee;
  for (const ExclusionRecord& record : records) {
    const std::optional<double> value = value_of(measure, record.score);
    if (record.test && is_result(record.ending) && record.object == object && value)
      by_trainee[{record.group, record.fingers, record.conditions}][record.session][record.trainee].push_back(
          *value);
  }
  Tests tests;
  for (const auto& [cohort, sessions] : by_trainee) {
    for (const auto& [session, trainees] : sessions) {
      for (const auto& [trainee, values] : trainees)
        tests[cohort][session].push_back(summary_of(values).mean);
    }
  }
  return tests;
}

std::set<std::string> objects_of(const std::vector<ExclusionRecord>& records) {
  std::set<std::string> objects;
  for (const ExclusionRecord& record : records) objects.insert(record.object);
  return objects;
}

std::string group_name(const std::string& group) { return group.empty() ? "no group" : group; }
std::string fingers_text(std::size_t fingers) {
  return std::to_string(fingers) + (fingers == 1 ? " finger" : " fingers");
}

std::string interval_text(const Interval& interval) {
  return number_text(interval.low, 3) + " to " + number_text(interval.high, 3);
}

/// Whether curves of one object were made under more than one set of conditions, so that each must be named.
bool conditions_differ(const std::vector<LearningCurve>& curves) {
  return std::ranges::adjacent_find(curves, std::not_equal_to(), &LearningCurve::conditions) != curves.end();
}

/// Of the columns friction, damage_limit_pa, vertices and tetrahedra, with a comma before each.
std::string conditions_csv(const Conditions& conditions) {
  if (!conditions) return ",,,,";
  return "," + exact_text(conditions->friction) + "," + exact_text(conditions->damage_pa) + "," +
         std::to_string(conditions->vertices) + "," + std::to_string(conditions->tetrahedra);
}

std::string sentence_of(const GroupComparison& found, bool name_conditions) {
  std::string text = group_name(found.first) + " less " + group_name(found.second) + " with " +
                     fingers_text(found.fingers) +
                     (name_conditions ? " (" + text_of(found.conditions) + ")" : "") + " in session " +
                     std::to_string(found.session) + ": " + number_text(found.comparison.difference, 3);
  if (!found.comparison.test) return text + "; no p-value: " + found.comparison.why_no_test + ".";
  const TestResult& test = *found.comparison.test;
  return text + " (95 % " + interval_text(test.of_difference) + "), Welch's t " + number_text(test.t, 3) +
         " with " + number_text(test.degrees_of_freedom, 3) + " degrees of freedom, p " +
         number_text(test.p, 2) + ", Hedges' g " + number_text(test.hedges_g, 2) + " (95 % " +
         interval_text(test.of_hedges_g) + ").";
}

Plot plot_of(const std::vector<LearningCurve>& curves, Measure measure, const std::string& note) {
  Plot plot{label_of(measure), "session", label_of(measure), {}, false, true, note};
  const bool differ = conditions_differ(curves);
  for (const LearningCurve& curve : curves) {
    plot.series.push_back(series_of(curve, group_name(curve.group) + ", " + fingers_text(curve.fingers) +
                                               (differ ? ", " + text_of(curve.conditions) : "")));
  }
  return plot;
}

}  // namespace

PlotSeries series_of(const LearningCurve& curve, const std::string& name) {
  PlotSeries series{name, {}, {}, {}, true};
  for (const CurvePoint& point : curve.points) {
    series.x.push_back(point.session);
    series.y.push_back(point.summary.mean);
    series.intervals.push_back(
        point.summary.of_mean.value_or(Interval{point.summary.mean, point.summary.mean}));
  }
  return series;
}

AttemptConditions conditions_of(const ExclusionBody& body) {
  const sim::TetMesh& mesh = body.body().mesh();
  return {body.task().friction, body.task().damage_pa, static_cast<std::int64_t>(mesh.nodes.size()),
          static_cast<std::int64_t>(mesh.tetrahedra.size())};
}

std::string text_of(const Conditions& conditions) {
  if (!conditions) return "friction, damage limit and mesh not recorded";
  return "friction " + number_text(conditions->friction, 3) + ", damage limit " +
         number_text(conditions->damage_pa / 1e3, 4) + " kPa, mesh of " +
         std::to_string(conditions->vertices) + " vertices and " + std::to_string(conditions->tetrahedra) +
         " tetrahedra";
}

std::vector<ExclusionRecord> comparable_records(const std::vector<ExclusionRecord>& records,
                                                const std::string& trainee, const std::string& object) {
  const ExclusionRecord *own = nullptr, *any = nullptr;
  for (const ExclusionRecord& record : records) {
    if (!record.test || !is_result(record.ending) || record.object != object) continue;
    any = &record;
    if (record.trainee == trainee) own = &record;
  }
  const ExclusionRecord* newest = own != nullptr ? own : any;
  std::vector<ExclusionRecord> found;
  if (newest == nullptr) return found;
  std::ranges::copy_if(records, std::back_inserter(found), [&](const ExclusionRecord& record) {
    return record.object == object && record.conditions == newest->conditions;
  });
  return found;
}

std::string label_of(Measure measure) {
  constexpr std::array<const char*, kMeasures.size()> kLabels{
      "largest von Mises stress, kPa",
      "stress that 99 % of the tissue stays below, kPa",
      "time, s",
      "path of the fingers, cm",
      "largest force of a finger, N",
      "tissue above the damage limit, ml"};
  return kLabels[static_cast<std::size_t>(measure)];
}

std::optional<double> value_of(Measure measure, const ExclusionScore& score) {
  switch (measure) {
    case Measure::kStress:
      return score.largest_von_mises_pa / 1e3;
    case Measure::kHighStress:
      if (!score.high_von_mises_pa) return std::nullopt;
      return *score.high_von_mises_pa / 1e3;
    case Measure::kTime:
      return score.time_s;
    case Measure::kPath:
      return 100 * score.path_m;
    case Measure::kForce:
      return score.peak_force_n;
    case Measure::kDamage:
      break;
  }
  return 1e6 * score.damaged_m3;
}

std::size_t tests_without_result_before(const std::vector<ExclusionRecord>& records,
                                        const ExclusionRecord& record) {
  const auto count = std::ranges::count_if(records, [&](const ExclusionRecord& other) {
    return other.trainee == record.trainee && other.object == record.object &&
           other.session == record.session && other.test && !is_result(other.ending) &&
           (record.number == 0 || other.number < record.number);
  });
  return static_cast<std::size_t>(count);
}

TraineeProgress progress_of(const std::vector<ExclusionRecord>& records, const std::string& trainee,
                            const std::string& object) {
  TraineeProgress progress;
  for (const ExclusionRecord& record : records) {
    if (record.trainee != trainee || record.object != object) continue;
    if (record.session > progress.session) progress = {record.session, 0};
    if (!record.test && record.session == progress.session) progress.practised_s += record.score.time_s;
    if (record.test && is_result(record.ending) && record.session == progress.session)
      progress = {record.session + 1, 0};
  }
  return progress;
}

std::string not_allowed(const TraineeProgress& progress, bool test, double practice_s) {
  if (practice_s <= 0) return "";
  // An attempt ends with a picture, at most a moment before its time.
  constexpr double kMomentSeconds = 1;
  const auto clock = [](double seconds) {
    const auto whole = static_cast<int>(seconds);
    const int rest = whole % 60;
    return std::to_string(whole / 60) + (rest < 10 ? ":0" : ":") + std::to_string(rest);
  };
  const bool practised = progress.practised_s >= practice_s - kMomentSeconds;
  const std::string done = "has practised " + clock(progress.practised_s) + " of the " + clock(practice_s) +
                           " minutes of session " + std::to_string(progress.session);
  if (test && !practised) return done + ": the test comes after them";
  if (!test && practised) return done + ": the test comes now";
  return "";
}

std::vector<OwnCurve> learning_curves_of(const std::vector<ExclusionRecord>& records,
                                         const std::string& trainee, const std::string& object,
                                         Measure measure) {
  std::vector<ExclusionRecord> own;
  std::ranges::copy_if(records, std::back_inserter(own),
                       [&](const ExclusionRecord& record) { return record.trainee == trainee; });
  std::vector<OwnCurve> curves;
  for (const auto& [cohort, sessions] : tests_of(own, object, measure)) {
    OwnCurve& curve = curves.emplace_back();
    curve.fingers = cohort.fingers;
    curve.conditions = cohort.conditions;
    for (const auto& [session, values] : sessions) curve.points.emplace_back(session, values.front());
  }
  return curves;
}

std::vector<LearningCurve> learning_curves(const std::vector<ExclusionRecord>& records,
                                           const std::string& object, Measure measure) {
  std::vector<LearningCurve> curves;
  for (const auto& [cohort, sessions] : tests_of(records, object, measure)) {
    LearningCurve& curve = curves.emplace_back();
    curve.group = cohort.group;
    curve.fingers = cohort.fingers;
    curve.conditions = cohort.conditions;
    for (const auto& [session, values] : sessions) curve.points.push_back({session, summary_of(values)});
  }
  return curves;
}

std::vector<GroupComparison> compare_at_end(const std::vector<ExclusionRecord>& records,
                                            const std::string& object, Measure measure) {
  const Tests tests = tests_of(records, object, measure);
  std::vector<GroupComparison> found;
  for (auto first = tests.begin(); first != tests.end(); ++first) {
    for (auto second = std::next(first); second != tests.end(); ++second) {
      const Cohort &one = first->first, &other = second->first;
      if (one.fingers != other.fingers || one.conditions != other.conditions) continue;
      int last = 0;
      for (const auto& [session, values] : first->second) {
        if (second->second.contains(session)) last = session;
      }
      if (last == 0) continue;
      found.push_back({last, one.fingers, one.group, other.group,
                       compare_groups(first->second.at(last), second->second.at(last)), one.conditions});
    }
  }
  return found;
}

std::string attempts_csv(const std::vector<ExclusionRecord>& records) {
  std::string csv =
      "trainee,group,simulated,session,kind,stress_shown,object,fingers,done,ending,time_s,largest_von_mises_"
      "pa,"
      "damaged_ml,"
      "path_m,peak_force_n,peak_wrist_force_n,best_visible_share,friction,damage_limit_pa,vertices,"
      "tetrahedra,high_von_mises_pa,instrument\n";
  for (const ExclusionRecord& record : records) {
    const ExclusionScore& score = record.score;
    csv += csv_field(record.trainee) + "," + csv_field(record.group) + (record.simulated ? ",yes," : ",no,") +
           std::to_string(record.session) + (record.test ? ",test," : ",practice,") +
           (record.stress_shown ? "yes," : "no,") + record.object + "," + std::to_string(record.fingers) +
           (score.done ? ",yes," : ",no,") + name_of(record.ending);
    for (const double number :
         {score.time_s, score.largest_von_mises_pa, 1e6 * score.damaged_m3, score.path_m, score.peak_force_n,
          score.peak_wrist_n, score.best_visible_share})
      csv += "," + exact_text(number);
    csv += conditions_csv(record.conditions) + "," +
           (score.high_von_mises_pa ? exact_text(*score.high_von_mises_pa) : "") + "," + record.instrument +
           "\n";
  }
  return csv;
}

std::string curves_csv(const std::vector<ExclusionRecord>& records) {
  std::string csv =
      "object,measure,group,fingers,session,trainees,mean,standard_deviation,low_95,high_95,friction,damage_"
      "limit_pa,vertices,tetrahedra\n";
  for (const std::string& object : objects_of(records)) {
    for (const Measure measure : kMeasures) {
      for (const LearningCurve& curve : learning_curves(records, object, measure)) {
        for (const CurvePoint& point : curve.points) {
          const SampleSummary& summary = point.summary;
          csv += object + "," + csv_field(label_of(measure)) + "," + csv_field(curve.group) + "," +
                 std::to_string(curve.fingers) + "," + std::to_string(point.session) + "," +
                 std::to_string(summary.count) + "," + exact_text(summary.mean) + ",";
          if (summary.of_mean) {
            csv += exact_text(summary.standard_deviation) + "," + exact_text(summary.of_mean->low) + "," +
                   exact_text(summary.of_mean->high);
          } else {
            csv += ",,";  // of one trainee there is no spread
          }
          csv += conditions_csv(curve.conditions) + "\n";
        }
      }
    }
  }
  return csv;
}

Bytes training_report(const std::vector<ExclusionRecord>& records) {
  if (records.empty()) throw UsageError("there is no attempt to report: train first");
  std::set<std::string> people, simulated;
  for (const ExclusionRecord& record : records)
    (record.simulated ? simulated : people).insert(record.trainee);
  const std::string note = simulated.empty()
                               ? "tests without stress shown; bars: 95 % of the mean"
                               : "simulated trainees among them; tests without stress shown; bars: 95 %";
  std::vector<ReportBlock> blocks{
      {"What the data are",
       std::to_string(records.size()) + " attempts of " + std::to_string(people.size()) + " people and " +
           std::to_string(simulated.size()) + " simulated trainees." +
           (simulated.empty() ? "" : " What is simulated says nothing about people.") +
           " Curves are of the tests, in which no stress is shown; bars are 95 % intervals of the mean over "
           "trainees, "
           "by Student's t. Groups are compared by Welch's t, those with as many fingers and the same "
           "friction, damage "
           "limit and mesh only.",
       {},
       {}}};
  for (const std::string& object : objects_of(records)) {
    for (const Measure measure : kMeasures) {
      const std::vector<LearningCurve> curves = learning_curves(records, object, measure);
      if (curves.empty()) continue;
      ReportBlock block;
      block.heading = "Object " + object + ": " + label_of(measure);
      const bool differ = conditions_differ(curves);
      for (const GroupComparison& found : compare_at_end(records, object, measure))
        block.text += (block.text.empty() ? "" : " ") + sentence_of(found, differ);
      if (!differ)
        block.text += (block.text.empty() ? "All: " : " All: ") + text_of(curves[0].conditions) + ".";
      block.table.push_back(
          {"group", "fingers", "session", "trainees", "mean", "standard deviation", "95 % of the mean"});
      for (const LearningCurve& curve : curves) {
        for (const CurvePoint& point : curve.points) {
          const SampleSummary& summary = point.summary;
          block.table.push_back({group_name(curve.group) + (differ ? ", " + text_of(curve.conditions) : ""),
                                 std::to_string(curve.fingers), std::to_string(point.session),
                                 std::to_string(summary.count), number_text(summary.mean, 4),
                                 summary.of_mean ? number_text(summary.standard_deviation, 3) : "one trainee",
                                 summary.of_mean ? interval_text(*summary.of_mean) : ""});
        }
      }
      block.plot = plot_of(curves, measure, note);
      blocks.push_back(std::move(block));
    }
  }
  for (ReportBlock& block : assessment_blocks(records)) blocks.push_back(std::move(block));
  return report_pdf("Training: pushing an organ aside", blocks);
}

}  // namespace kiroku::trainer
