#include "trainer/haptic_rate/experiment.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "trainer/psychophysics/rate_series.h"
#include "trainer/psychophysics/threshold_posterior.h"

namespace kiroku::trainer {

RateSession run_rate_session(RateSubject& subject, const RateProtocol& protocol,
                             const std::function<void(const RateTrial&)>& asked) {
  if (protocol.fingers.empty() || protocol.trials == 0)
    throw UsageError("an experiment needs fingers that press and at least one trial");
  if (std::set(protocol.fingers.begin(), protocol.fingers.end()).size() != protocol.fingers.size())
    throw UsageError("the same fingers are named twice");
  RateSession session;
  session.method = protocol.method;
  session.series = protocol.series;
  for (const Fingers& fingers : protocol.fingers) {
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
      throw UsageError("only sessions with the same fingers in the same order can be compared");
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

std::optional<Comparison> compare_single_and_several(std::span<const RateSession> sessions) {
  std::vector<double> single, several;
  for (const RateSession& session : sessions) {
    for (const RateThreshold& threshold : session.thresholds)
      (threshold.fingers.count() == 1 ? single : several).push_back(std::log10(threshold.estimate.hz));
  }
  if (single.empty() || several.empty()) return std::nullopt;
  return compare_groups(single, several);
}

std::vector<SubjectFunctions> scaled_group(std::span<const ConditionMean> means, std::size_t subjects,
                                           double spread_of_subjects, double spread, double lapse_rate,
                                           std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<SubjectFunctions> group(subjects);
  for (const ConditionMean& mean : means) {
    std::vector<double> factors(subjects);
    double sum = 0;
    for (double& factor : factors) {
      factor = std::pow(10, spread_of_subjects * standard_normal(random));
      sum += factor;
    }
    for (std::size_t i = 0; i < subjects; ++i) {
      group[i][mean.fingers] = {mean.hz * factors[i] * static_cast<double>(subjects) / sum, spread,
                                lapse_rate};
    }
  }
  return group;
}

std::vector<SubjectFunctions> drawn_group(std::span<const PublishedThreshold> conditions,
                                          std::size_t subjects, double spread, double lapse_rate,
                                          std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<SubjectFunctions> group(subjects);
  for (const PublishedThreshold& condition : conditions) {
    if (!condition.sd_hz) {
      throw UsageError("no spread of thresholds with " + condition.fingers.in_words() +
                       " was published: take the exclusion study's named fingers");
    }
    const LogNormal population = log_normal(condition.mean_hz, *condition.sd_hz);
    for (SubjectFunctions& subject : group) {
      double hz = 0;
      while (hz < kLeastThresholdHz || hz > kMostThresholdHz)
        hz = std::exp(population.location + population.spread * standard_normal(random));
      subject[condition.fingers] = {hz, spread, lapse_rate};
    }
  }
  return group;
}

}  // namespace kiroku::trainer
