// How far people agree in points: Cohen's kappa of two, Fleiss' kappa of any number, with confidence
// intervals. Pure functions, thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "trainer/statistics/comparison.h"

namespace kiroku::trainer {

/// What a disagreement weighs. Linear: by the distance of the points. Quadratic: by its square, as Fleiss and
/// Cohen, 1973.
enum class AgreementWeights { kNone, kLinear, kQuadratic };

struct Kappa {
  double value = 0;
  double standard_error = 0;
  /// 95 %, cut at -1 and at 1, as no kappa is beyond. None where the standard error is zero, as where all
  /// agree: few things that are judged alike are no proof that all others are.
  std::optional<Interval> interval;
};
struct Agreement {
  std::size_t count = 0;  // judged things that at least two answers are of
  double observed = 0;    // weighted share of agreement; 0 without any
  double by_chance = 0;
  std::optional<Kappa> kappa;
  std::string why_no_kappa;  // a sentence, where there is none
};

/// Of two readers, or of one who judged twice: an answer of each about the same thing, from 0 to
/// `points` - 1. Standard error: Fleiss, Cohen and Everitt, Psychological Bulletin 72(5), 1969, that of a
/// kappa that is not zero, equations 10 and 13; interval by the normal distribution. kiroku::UsageError for
/// answers outside of the points, and fewer than two points.
Agreement cohens_kappa(std::span<const std::pair<int, int>> answers, int points, AgreementWeights weights);

/// Of any number of readers: answers about each thing, which may be of different number. Fleiss,
/// Psychological Bulletin 76(5), 1971, with weights as Gwet, Handbook of Inter-Rater Reliability, 4th
/// edition, 2014. Standard error: Gwet's, by linearisation over things; interval by Student's t with one
/// degree of freedom less than there are things. kiroku::UsageError as above.
Agreement fleiss_kappa(std::span<const std::vector<int>> answers, int points, AgreementWeights weights);

}  // namespace kiroku::trainer
