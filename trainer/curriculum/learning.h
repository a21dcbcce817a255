// What training did: learning curves, groups compared, as tables and documents. Pure functions, thread-safe.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "trainer/assessment/assessment.h"
#include "trainer/exclusion/exclusion_body.h"
#include "trainer/exclusion/exclusion_score.h"
#include "trainer/report/plot.h"
#include "trainer/statistics/comparison.h"

namespace kiroku::trainer {

/// What makes attempts comparable besides object and fingers: a score of another friction, limit or mesh is
/// another measure.
struct AttemptConditions {
  double friction = 0;
  double damage_pa = 0;
  std::int64_t vertices = 0, tetrahedra = 0;  // of the mesh
  auto operator<=>(const AttemptConditions&) const = default;
};
AttemptConditions conditions_of(const ExclusionBody& body);
/// "friction 0.5, damage limit 100 kPa, mesh of 2012 vertices and 7000 tetrahedra", or that they were not
/// recorded.
std::string text_of(const std::optional<AttemptConditions>& conditions);

/// One attempt, as it is kept.
struct ExclusionRecord {
  std::string trainee, group;
  bool simulated = false;
  int session = 1;    // of the trainee: days of a curriculum
  bool test = false;  // a session's test, without stress shown; else practice
  bool stress_shown = false;
  std::string object;
  std::size_t fingers = 0;
  std::string instrument;  // "retractor": so many in trocars; empty: fingertips
  Ending ending = Ending::kTimeOver;
  ExclusionScore score;
  std::int64_t number = 0;  // where it is kept; 0: nowhere
  std::string sealed_case;  // the case that was made of it, or empty
  /// Absent for attempts that were kept before these were, and for those that ended before there was a mesh.
  std::optional<AttemptConditions> conditions;
  /// What was said of it, where that was asked.
  std::optional<Questionnaire> questionnaire;
  std::optional<Checklist> checklist;
};

/// The study's groups: whether stress is shown in practice.
inline constexpr const char *kStressShown = "stress shown", *kStressHidden = "stress hidden";
/// Of a session, after the study: three minutes of practice, then a test without stress.
inline constexpr double kPracticeSeconds = 180;
/// Where a trainee stands: a session is over with its first test on an object that is a result.
struct TraineeProgress {
  int session = 1;         // the one to go on with
  double practised_s = 0;  // in it
};
/// Why the curriculum does not allow a test, or more practice, as the end of a sentence about the trainee;
/// empty where it does. `practice_s` of a session; 0: as much as one likes, or none.
std::string not_allowed(const TraineeProgress& progress, bool test, double practice_s);
/// How many tests of the record's session on its object the trainee began before it that are no results, as
/// they were given up or broken off: whoever judges the one that counts should know. Of a record that is kept
/// nowhere yet, all of them.
std::size_t tests_without_result_before(const std::vector<ExclusionRecord>& records,
                                        const ExclusionRecord& record);
TraineeProgress progress_of(const std::vector<ExclusionRecord>& records, const std::string& trainee,
                            const std::string& object);

/// What is looked at of a score.
enum class Measure { kStress, kHighStress, kTime, kPath, kForce, kDamage };
inline constexpr std::array<Measure, 6> kMeasures{Measure::kStress, Measure::kHighStress, Measure::kTime,
                                                  Measure::kPath,   Measure::kForce,      Measure::kDamage};
/// With its unit: "largest von Mises stress, kPa".
std::string label_of(Measure measure);
/// Absent where it was not measured.
std::optional<double> value_of(Measure measure, const ExclusionScore& score);

struct CurvePoint {
  int session = 1;
  SampleSummary summary;  // of the group's trainees: each one's mean of the session's tests
};
struct LearningCurve {
  std::string group;
  std::size_t fingers = 0;         // what is done with one is not what is done with five
  std::vector<CurvePoint> points;  // by session
  std::optional<AttemptConditions> conditions;
};
/// Its means by session, with the 95 % of each, or the mean alone where there is one trainee.
PlotSeries series_of(const LearningCurve& curve, const std::string& name);

/// Of tests alone that are results; by group, fingers and conditions. `object` "a" or "b".
std::vector<LearningCurve> learning_curves(const std::vector<ExclusionRecord>& records,
                                           const std::string& object, Measure measure);

/// A trainee's own: the mean of each session's tests, by fingers and conditions.
struct OwnCurve {
  std::size_t fingers = 0;
  std::vector<std::pair<int, double>> points;  // by session
  std::optional<AttemptConditions> conditions;
};
std::vector<OwnCurve> learning_curves_of(const std::vector<ExclusionRecord>& records,
                                         const std::string& trainee, const std::string& object,
                                         Measure measure);

/// The records that the trainee's newest result in a test on the object can be laid beside: those of its
/// conditions; all of the newest such test of anybody where the trainee has none.
std::vector<ExclusionRecord> comparable_records(const std::vector<ExclusionRecord>& records,
                                                const std::string& trainee, const std::string& object);

/// Two groups in the tests of one session, by Welch.
struct GroupComparison {
  int session = 1;
  std::size_t fingers = 0;
  std::string first, second;
  Comparison comparison;
  std::optional<AttemptConditions> conditions;
};
/// Each pair of groups with as many fingers and the same conditions in the last session that both have tests
/// of; none where there is one group.
std::vector<GroupComparison> compare_at_end(const std::vector<ExclusionRecord>& records,
                                            const std::string& object, Measure measure);

/// A line an attempt, with its head.
std::string attempts_csv(const std::vector<ExclusionRecord>& records);
/// A line a group, number of fingers, session and measure.
std::string curves_csv(const std::vector<ExclusionRecord>& records);
/// Curves, comparisons, what was said of attempts and what the data are, as a PDF; kiroku::UsageError without
/// records.
Bytes training_report(const std::vector<ExclusionRecord>& records);

}  // namespace kiroku::trainer
