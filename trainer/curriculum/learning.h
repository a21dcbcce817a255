// What training did: learning curves, groups compared, as tables and documents. Pure functions, thread-safe.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "trainer/exclusion/exclusion_score.h"
#include "trainer/report/plot.h"
#include "trainer/statistics/comparison.h"

namespace kiroku::trainer {

/// One attempt, as it is kept.
struct ExclusionRecord {
  std::string trainee, group;
  bool simulated = false;
  int session = 1;    // of the trainee: days of a curriculum
  bool test = false;  // a session's test, without stress shown; else practice
  bool stress_shown = false;
  std::string object;
  std::size_t fingers = 0;
  Ending ending = Ending::kTimeOver;
  ExclusionScore score;
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
TraineeProgress progress_of(const std::vector<ExclusionRecord>& records, const std::string& trainee,
                            const std::string& object);

/// What is looked at of a score.
enum class Measure { kStress, kTime, kPath, kForce, kDamage };
inline constexpr std::array<Measure, 5> kMeasures{Measure::kStress, Measure::kTime, Measure::kPath,
                                                  Measure::kForce, Measure::kDamage};
/// With its unit: "largest von Mises stress, kPa".
std::string label_of(Measure measure);
double value_of(Measure measure, const ExclusionScore& score);

struct CurvePoint {
  int session = 1;
  SampleSummary summary;  // of the group's trainees: each one's mean of the session's tests
};
struct LearningCurve {
  std::string group;
  std::vector<CurvePoint> points;  // by session
};
/// Of tests alone that are results; groups by name. `object` "a" or "b".
std::vector<LearningCurve> learning_curves(const std::vector<ExclusionRecord>& records,
                                           const std::string& object, Measure measure);

/// A trainee's own: the mean of each session's tests, by session.
std::vector<std::pair<int, double>> learning_curve_of(const std::vector<ExclusionRecord>& records,
                                                      const std::string& trainee, const std::string& object,
                                                      Measure measure);

/// Two groups in the tests of one session, by Welch.
struct GroupComparison {
  int session = 1;
  std::string first, second;
  Comparison comparison;
};
/// Each pair of groups in the last session that both have tests of; none where there is one group.
std::vector<GroupComparison> compare_at_end(const std::vector<ExclusionRecord>& records,
                                            const std::string& object, Measure measure);

/// A line an attempt, with its head.
std::string attempts_csv(const std::vector<ExclusionRecord>& records);
/// A line a group, session and measure.
std::string curves_csv(const std::vector<ExclusionRecord>& records);
/// Curves, comparisons and what the data are, as a PDF; kiroku::UsageError without records.
Bytes training_report(const std::vector<ExclusionRecord>& records);

}  // namespace kiroku::trainer
