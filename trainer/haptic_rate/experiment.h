// The haptic-rate experiment: subjects press with so many fingers, or with named ones, and thresholds come
// out.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "trainer/haptic_rate/published_thresholds.h"
#include "trainer/haptic_rate/rate_subject.h"
#include "trainer/psychophysics/threshold_method.h"
#include "trainer/statistics/comparison.h"

namespace kiroku::trainer {

struct RateTrial {
  Fingers fingers = 1;
  double rate_hz = 0;
  bool vibrating = false;
};

struct RateThreshold {
  Fingers fingers = 1;
  ThresholdEstimate estimate;    // of all answers, by ThresholdPosterior, whatever the method
  std::optional<double> own_hz;  // the method's own estimate
};

struct RateSession {
  std::string subject;
  bool simulated = false;
  MethodKind method = MethodKind::kBayesian;
  RateSeries series = RateSeries::kHapticRate;
  std::vector<RateTrial> trials;  // in their order
  std::vector<RateThreshold> thresholds;
};

struct RateProtocol {
  std::vector<Fingers> fingers{1, 2, 3, 4, 5};
  MethodKind method = MethodKind::kBayesian;
  RateSeries series = RateSeries::kHapticRate;
  std::size_t trials = 60;  // for each of these conditions
};

/// Asks the subject; `asked` is told after each answer, and may be empty. kiroku::UsageError for a protocol
/// without fingers, with the same twice, or without trials.
RateSession run_rate_session(RateSubject& subject, const RateProtocol& protocol,
                             const std::function<void(const RateTrial&)>& asked = {});

/// Of the thresholds of several subjects under one condition.
struct RateGroup {
  Fingers fingers = 1;
  SampleSummary hz;  // its mean beside the study's; rates are above zero, so no interval is taken of it
  GeometricSummary geometric_hz;
};
/// Two conditions by the same subjects: Student's t for pairs on the logarithms, p-values adjusted
/// over all pairs (Holm).
struct RatePair {
  Fingers first = 1, second = 2;
  double ratio = 1;  // geometric mean of first / second
  Comparison of_log10;
  std::optional<double> adjusted_p;
};
struct RateComparison {
  std::vector<RateGroup> groups;  // in the order of the sessions
  std::vector<RatePair> pairs;
};
/// Of those who were asked with the same fingers; kiroku::UsageError for none, or where they differ.
RateComparison compare_fingers(std::span<const RateSession> sessions);

/// One finger against several, as Table 1 of the exclusion study is tested: Welch's t of the logarithms of
/// all thresholds with one finger and of all with more, people taken for different ones. None where a side
/// has no condition.
std::optional<Comparison> compare_single_and_several(std::span<const RateSession> sessions);

/// So many simulated subjects whose thresholds are scaled so that their arithmetic mean under each condition
/// is the given one to rounding (`spread_of_subjects` of their logarithm): a mean that comes out of them
/// proves the estimator, and nothing about people. The same seed gives the same.
struct ConditionMean {
  Fingers fingers = 1;
  double hz = 1;
};
std::vector<SubjectFunctions> scaled_group(std::span<const ConditionMean> means, std::size_t subjects,
                                           double spread_of_subjects, double spread, double lapse_rate,
                                           std::uint32_t seed);

/// So many simulated subjects, drawn from a population with the published mean and standard deviation of each
/// condition: log-normal, as thresholds are above zero; conditions are drawn by themselves, as no study tells
/// how they go together. What lies beyond kLeastThresholdHz and kMostThresholdHz is drawn anew, so that the
/// population's spread is less than the published one where that does not fit between them.
/// kiroku::UsageError for conditions without a published standard deviation. The same seed gives the same.
std::vector<SubjectFunctions> drawn_group(std::span<const PublishedThreshold> conditions,
                                          std::size_t subjects, double spread, double lapse_rate,
                                          std::uint32_t seed);

}  // namespace kiroku::trainer
