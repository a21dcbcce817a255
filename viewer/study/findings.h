// What the answers of a closed study come to. Pure functions, thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "trainer/statistics/agreement.h"
#include "trainer/statistics/signed_ranks.h"
#include "viewer/study/answers.h"
#include "viewer/study/study.h"

namespace kiroku::study {

/// One reader's answer to one showing, with what was shown.
struct Rating {
  std::size_t reader = 0, clip = 0, coding = 0;  // from 0
  std::size_t place = 0;                         // in the reader's order, from 0
  bool again = false;                            // the reader had seen the same film before
  std::vector<int> points;                       // of each question, 0: none
  Seen seen;
  UtcTime utc;
};
/// Of all readers; `answers` has as many as the study has. Showings without any answer are left out.
std::vector<Rating> ratings_of(const Study& study, const StudyKey& key,
                               const std::vector<NewestAnswers>& answers);

/// Points of one question in one coding, over all clips and readers, each film the first time it was seen.
struct Points {
  std::size_t count = 0;
  std::array<std::size_t, kPoints> given{};  // how often 1, 2, …
  std::optional<double> median, mean;
  std::optional<double> share_judged;  // of points from kJudged on
  /// Of the readers, by clip: Cohen's kappa of two readers, Fleiss' of more; nothing for one reader.
  std::optional<trainer::Agreement> agreement, agreement_quadratic;
};
/// What counts as "can be judged".
inline constexpr int kJudged = 4;

/// Two codings beside each other, of one question: for each clip the readers' mean points in the first less
/// those in the second, of readers who judged both.
struct CodingDifference {
  std::size_t first = 0, second = 0;  // numbers of codings
  std::size_t question = 0;
  std::optional<double> mean;                    // of the clips
  std::size_t higher = 0, equal = 0, lower = 0;  // clips
  trainer::SignedRanks test;                     // over clips
  std::optional<double> p_adjusted;              // among all differences of the study (Holm, 1979)
};

/// A reader who saw films twice.
struct OwnAgreement {
  std::size_t reader = 0, question = 0;
  std::size_t count = 0, same = 0, within_one = 0;
  trainer::Agreement agreement, agreement_quadratic;
};

struct Findings {
  std::vector<std::vector<Points>> by_coding;  // [coding][question]
  std::vector<Points> together;                // [question], of all codings
  std::vector<CodingDifference> differences;
  std::vector<OwnAgreement> own;  // of readers who saw any film twice
  std::uint64_t pictures = 0, dropped = 0;
  std::size_t never_to_the_end = 0;  // answers to films that were not played to their end
};
Findings findings_of(const Study& study, const StudyKey& key, const std::vector<Rating>& ratings);

}  // namespace kiroku::study
