// The haptic-rate experiment: subjects press with one to five fingers, thresholds come out.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "trainer/haptic_rate/rate_subject.h"
#include "trainer/psychophysics/threshold_method.h"
#include "trainer/statistics/comparison.h"

namespace kiroku::trainer {

struct RateTrial {
  std::size_t fingers = 1;
  double rate_hz = 0;
  bool vibrating = false;
};

struct RateThreshold {
  std::size_t fingers = 1;
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
  std::vector<std::size_t> fingers{1, 2, 3, 4, 5};
  MethodKind method = MethodKind::kBayesian;
  RateSeries series = RateSeries::kHapticRate;
  std::size_t trials = 60;  // for each number of fingers
};

/// Asks the subject; `asked` is told after each answer, and may be empty. kiroku::UsageError for a protocol
/// without fingers, with more than kMostFingers or the same twice, or without trials.
RateSession run_rate_session(RateSubject& subject, const RateProtocol& protocol,
                             const std::function<void(const RateTrial&)>& asked = {});

/// Of the thresholds of several subjects with one number of fingers.
struct RateGroup {
  std::size_t fingers = 1;
  SampleSummary hz;  // its mean beside the study's; rates are above zero, so no interval is taken of it
  GeometricSummary geometric_hz;
};
/// Two numbers of fingers by the same subjects: Student's t for pairs on the logarithms, p-values adjusted
/// over all pairs (Holm).
struct RatePair {
  std::size_t first = 1, second = 2;  // fingers
  double ratio = 1;                   // geometric mean of first / second
  Comparison of_log10;
  std::optional<double> adjusted_p;
};
struct RateComparison {
  std::vector<RateGroup> groups;  // by fingers
  std::vector<RatePair> pairs;
};
/// Of those who were asked with the same numbers of fingers; kiroku::UsageError for none, or where they
/// differ.
RateComparison compare_fingers(std::span<const RateSession> sessions);

/// The mean threshold that the study of this series published for so many fingers; none where it has none.
///
/// Source: of RateSeries::kHapticRate sim::haptic_rate_hz(), one to five fingers; of kExclusion section 6.1
/// of "Construction of Training Environment for Surgical Exclusion with a Basic Study of Multi-finger Haptic
/// Interaction", single fingers and pairs.
std::optional<double> published_threshold_hz(RateSeries series, std::size_t fingers);

/// So many simulated subjects, whose thresholds are spread around the given means (`spread_of_subjects` of
/// their logarithm) so that their arithmetic mean is the given one to rounding: a mean that comes out of
/// them proves the estimator, and nothing about people. For each subject the functions for 1, 2, ... fingers.
/// The same seed gives the same.
std::vector<std::vector<PsychometricFunction>> simulated_group(std::span<const double> means_hz,
                                                               std::size_t subjects,
                                                               double spread_of_subjects, double spread,
                                                               double lapse_rate, std::uint32_t seed);

}  // namespace kiroku::trainer
