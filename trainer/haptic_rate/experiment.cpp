#include "trainer/haptic_rate/experiment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <boost/math/distributions/normal.hpp>

#include "base/error.h"
#include "sim/haptics/haptic_rate.h"
#include "trainer/psychophysics/rate_series.h"
#include "trainer/psychophysics/threshold_posterior.h"

namespace kiroku::trainer {

RateSession run_rate_session(RateSubject& subject, const RateProtocol& protocol,
                             const std::function<void(const RateTrial&)>& asked) {
  if (protocol.fingers.empty() || protocol.trials == 0)
    throw UsageError("an experiment needs at least one number of fingers and one trial");
  if (std::set(protocol.fingers.begin(), protocol.fingers.end()).size() != protocol.fingers.size())
    throw UsageError("a number of fingers is named twice");
  for (const std::size_t fingers : protocol.fingers) {
    if (fingers < 1 || fingers > kMostFingers)
      throw UsageError("a hand has 1 to 5 fingers, not " + std::to_string(fingers));
  }
  RateSession session;
  session.method = protocol.method;
  session.series = protocol.series;
  for (const std::size_t fingers : protocol.fingers) {
    const std::unique_ptr<ThresholdMethod> method = make_method(protocol.method, protocol.series);
    ThresholdPosterior posterior(protocol.series);
    for (std::size_t trial = 0; trial < protocol.trials; ++trial) {
      const std::size_t rate = method->next_rate();
      const double given_hz = rate_hz(protocol.series, rate);
      const bool vibrating = subject.feels_vibration(fingers, given_hz);
      method->answer(vibrating);
      posterior.add(rate, vibrating);
      session.trials.push_back({fingers, given_hz, vibrating});
      if (asked) asked(session.trials.back());
    }
    session.thresholds.push_back({fingers, posterior.estimate(), method->own_estimate_hz()});
  }
  return session;
}

RateComparison compare_fingers(std::span<const RateSession> sessions) {
  if (sessions.empty()) throw UsageError("there are no sessions to compare");
  RateComparison found;
  const std::vector<RateThreshold>& like = sessions.front().thresholds;
  std::vector<std::vector<double>> hz(like.size()), log_hz(like.size());
  for (const RateSession& session : sessions) {
    if (!std::ranges::equal(session.thresholds, like, {}, &RateThreshold::fingers, &RateThreshold::fingers))
      throw UsageError("only sessions with the same numbers of fingers in the same order can be compared");
    for (std::size_t i = 0; i < like.size(); ++i) {
      hz[i].push_back(session.thresholds[i].estimate.hz);
      log_hz[i].push_back(std::log10(hz[i].back()));
    }
  }
  std::vector<double> p;
  for (std::size_t i = 0; i < like.size(); ++i) {
    found.groups.push_back({like[i].fingers, summary_of(hz[i]), geometric_summary_of(hz[i])});
    for (std::size_t j = i + 1; j < like.size(); ++j) {
      RatePair pair{like[i].fingers, like[j].fingers, 1, compare_pairs(log_hz[i], log_hz[j]), std::nullopt};
      pair.ratio = std::pow(10, pair.of_log10.difference);
      if (pair.of_log10.test) p.push_back(pair.of_log10.test->p);
      found.pairs.push_back(std::move(pair));
    }
  }
  const std::vector<double> adjusted = holm_adjusted(p);
  for (std::size_t at = 0; RatePair & pair : found.pairs) {
    if (pair.of_log10.test) pair.adjusted_p = adjusted[at++];
  }
  return found;
}

std::optional<double> published_threshold_hz(RateSeries series, std::size_t fingers) {
  if (fingers < 1 || fingers > kMostFingers) return std::nullopt;
  if (series == RateSeries::kHapticRate) return sim::haptic_rate_hz(fingers);
  constexpr std::array<double, 2> kExclusionHz{15.8, 4.2};
  if (fingers > kExclusionHz.size()) return std::nullopt;
  return kExclusionHz[fingers - 1];
}

std::vector<std::vector<PsychometricFunction>> simulated_group(std::span<const double> means_hz,
                                                               std::size_t subjects,
                                                               double spread_of_subjects, double spread,
                                                               double lapse_rate, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<std::vector<PsychometricFunction>> group(subjects);
  for (const double mean_hz : means_hz) {
    std::vector<double> factors(subjects);
    double sum = 0;
    for (double& factor : factors) {
      const double within = std::clamp(uniform(random), 1e-9, 1 - 1e-9);
      factor = std::pow(10, spread_of_subjects * boost::math::quantile(boost::math::normal(), within));
      sum += factor;
    }
    for (std::size_t i = 0; i < subjects; ++i)
      group[i].push_back({mean_hz * factors[i] * static_cast<double>(subjects) / sum, spread, lapse_rate});
  }
  return group;
}

}  // namespace kiroku::trainer
