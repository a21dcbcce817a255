#include "trainer/statistics/agreement.h"

#include <cmath>
#include <cstdint>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

using testing::HasSubstr;
using Weights = AgreementWeights;
using Answers = std::vector<std::pair<int, int>>;

/// Each pair of answers as often as its cell says.
Answers of_table(const std::vector<std::vector<int>>& table) {
  Answers answers;
  for (std::size_t i = 0; i < table.size(); ++i) {
    for (std::size_t j = 0; j < table[i].size(); ++j) {
      for (int n = 0; n < table[i][j]; ++n) answers.emplace_back(static_cast<int>(i), static_cast<int>(j));
    }
  }
  return answers;
}

// The worked example of SAS/STAT's PROC FREQ, "Agreement Study" (SkinCondition): two dermatologists, 88
// patients, four degrees. Its simple kappa is 0.3449 with an asymptotic standard error of 0.0724 and limits
// of 0.2030 and 0.4868.
const std::vector<std::vector<int>> kSkin{{10, 4, 1, 0}, {5, 10, 12, 2}, {2, 4, 12, 5}, {0, 2, 6, 13}};

TEST(Agreement, OfTwoReadersIsThatOfTheDermatologists) {
  const Agreement simple = cohens_kappa(of_table(kSkin), 4, Weights::kNone);
  ASSERT_TRUE(simple.kappa);
  EXPECT_EQ(simple.count, 88U);
  EXPECT_NEAR(simple.observed, 45.0 / 88, 1e-12);
  EXPECT_NEAR(simple.kappa->value, 0.3449, 5e-5);
  EXPECT_NEAR(simple.kappa->standard_error, 0.0724, 5e-5);
  EXPECT_NEAR(simple.kappa->interval->low, 0.2030, 5e-5);
  EXPECT_NEAR(simple.kappa->interval->high, 0.4868, 5e-5);
}

// SexualFun of the R package vcd (Agresti, Categorical Data Analysis, 1990): 91 couples, four degrees. What
// the package's documentation prints, with and without linear weights.
TEST(Agreement, OfTwoReadersIsThatOfTheCouples) {
  const Answers answers = of_table({{7, 7, 2, 3}, {2, 8, 3, 7}, {1, 5, 4, 9}, {2, 8, 9, 14}});
  const Agreement simple = cohens_kappa(answers, 4, Weights::kNone);
  ASSERT_TRUE(simple.kappa);
  EXPECT_NEAR(simple.kappa->value, 0.1293, 5e-5);
  EXPECT_NEAR(simple.kappa->standard_error, 0.06860, 5e-6);
  EXPECT_NEAR(simple.kappa->interval->low, -0.005120399, 5e-9);
  EXPECT_NEAR(simple.kappa->interval->high, 0.2637809, 5e-8);
  const Agreement linear = cohens_kappa(answers, 4, Weights::kLinear);
  ASSERT_TRUE(linear.kappa);
  EXPECT_NEAR(linear.kappa->value, 0.2374, 5e-5);
  EXPECT_NEAR(linear.kappa->standard_error, 0.07832, 5e-6);
  EXPECT_NEAR(linear.kappa->interval->low, 0.083883432, 5e-9);
  EXPECT_NEAR(linear.kappa->interval->high, 0.3908778, 5e-8);
}

// Fleiss, Statistical Methods for Rates and Proportions, 2nd edition, 1981, page 213: two psychiatrists, 100
// patients. Kappa is (0.89 - 0.66) / (1 - 0.66), 0.68.
TEST(Agreement, OfTwoReadersIsThatOfThePsychiatrists) {
  const Agreement found = cohens_kappa(of_table({{75, 1, 4}, {5, 4, 1}, {0, 0, 10}}), 3, Weights::kNone);
  ASSERT_TRUE(found.kappa);
  EXPECT_NEAR(found.observed, 0.89, 1e-12);
  EXPECT_NEAR(found.by_chance, 0.66, 1e-12);
  EXPECT_NEAR(found.kappa->value, 0.68, 0.005);
}

// By quadratic weights kappa is one less the mean square of differences over what chance makes of it (Fleiss
// and Cohen, Educational and Psychological Measurement 33(3), 1973).
TEST(Agreement, WithQuadraticWeightsIsThatOfSquaredDifferences) {
  const Answers answers = of_table(kSkin);
  const Agreement found = cohens_kappa(answers, 4, Weights::kQuadratic);
  double together = 0, apart = 0;
  for (const auto& [first, second] : answers) {
    together += (first - second) * (first - second);
    for (const auto& [other, chance] : answers) apart += (first - chance) * (first - chance);
  }
  const double expected = 1 - together / (apart / static_cast<double>(answers.size()));
  ASSERT_TRUE(found.kappa);
  EXPECT_NEAR(found.kappa->value, expected, 1e-12);
  EXPECT_GT(found.kappa->value, cohens_kappa(answers, 4, Weights::kLinear).kappa->value);
}

// The standard error is that of many studies of as many things: of kappas of samples that are drawn anew from
// the same table they scatter by as much.
TEST(Agreement, StandardErrorOfWeightedKappaIsHowStudiesScatter) {
  const Answers all = of_table(kSkin);
  const double stated = cohens_kappa(all, 4, Weights::kQuadratic).kappa->standard_error;
  std::uint32_t state = 1;
  const auto next = [&state] { return state = state * 1664525U + 1013904223U; };
  constexpr int kStudies = 4000;
  double sum = 0, squares = 0;
  for (int study = 0; study < kStudies; ++study) {
    Answers drawn;
    for (std::size_t i = 0; i < all.size(); ++i)
      drawn.push_back(all[static_cast<std::size_t>(next() / 4294967296.0 * static_cast<double>(all.size()))]);
    const double value = cohens_kappa(drawn, 4, Weights::kQuadratic).kappa->value;
    sum += value;
    squares += value * value;
  }
  const double scatter = std::sqrt(squares / kStudies - sum / kStudies * sum / kStudies);
  EXPECT_NEAR(scatter, stated, 0.07 * stated);
}

// Fleiss' kappa as the worked example of Wikipedia has it: 14 readers, ten subjects, five categories, 0.210.
TEST(Agreement, OfManyReadersIsThatOfTheWorkedExample) {
  const std::vector<std::vector<int>> counts{
      {0, 0, 0, 0, 14}, {0, 2, 6, 4, 2}, {0, 0, 3, 5, 6}, {0, 3, 9, 2, 0}, {2, 2, 8, 1, 1},
      {7, 7, 0, 0, 0},  {3, 2, 6, 3, 0}, {2, 5, 3, 2, 2}, {6, 5, 2, 1, 0}, {0, 2, 2, 3, 7}};
  std::vector<std::vector<int>> answers;
  for (const auto& of_subject : counts) {
    auto& subject = answers.emplace_back();
    for (std::size_t k = 0; k < of_subject.size(); ++k)
      subject.insert(subject.end(), static_cast<std::size_t>(of_subject[k]), static_cast<int>(k));
  }
  const Agreement found = fleiss_kappa(answers, 5, Weights::kNone);
  ASSERT_TRUE(found.kappa);
  EXPECT_NEAR(found.observed, 0.378, 5e-4);
  EXPECT_NEAR(found.by_chance, 0.213, 5e-4);
  EXPECT_NEAR(found.kappa->value, 0.210, 5e-4);
}

// cac.raw4raters of Gwet's R package irrCAC: four readers, twelve subjects, some not judged by all. What the
// package's own documentation prints: 0.76117, standard error 0.15302, interval from 0.424 to 1.
TEST(Agreement, OfManyReadersWithMissingAnswersIsGwets) {
  const std::vector<std::vector<int>> answers{{0, 0, 0},    {1, 1, 2, 1}, {2, 2, 2, 2}, {2, 2, 2, 2},
                                              {1, 1, 1, 1}, {0, 1, 2, 3}, {3, 3, 3, 3}, {0, 0, 1, 0},
                                              {1, 1, 1, 1}, {4, 4, 4},    {0, 0},       {2}};
  const Agreement found = fleiss_kappa(answers, 5, Weights::kNone);
  ASSERT_TRUE(found.kappa);
  EXPECT_EQ(found.count, 11U);
  EXPECT_NEAR(found.observed, 0.8181818, 5e-8);
  EXPECT_NEAR(found.by_chance, 0.2387153, 5e-8);
  EXPECT_NEAR(found.kappa->value, 0.76117, 5e-6);
  EXPECT_NEAR(found.kappa->standard_error, 0.15302, 5e-6);
  EXPECT_NEAR(found.kappa->interval->low, 0.424, 5e-4);
  EXPECT_EQ(found.kappa->interval->high, 1);
}

TEST(Agreement, OfWhoAlwaysAgreeIsOne) {
  const Answers answers{{0, 0}, {4, 4}, {2, 2}, {4, 4}};
  for (const Weights weights : {Weights::kNone, Weights::kLinear, Weights::kQuadratic}) {
    const Agreement found = cohens_kappa(answers, 5, weights);
    ASSERT_TRUE(found.kappa);
    EXPECT_NEAR(found.kappa->value, 1, 1e-12);
    EXPECT_NEAR(found.kappa->standard_error, 0, 1e-6);
    EXPECT_FALSE(found.kappa->interval) << "four films that are judged alike prove nothing of others";
    const Agreement of_many =
        fleiss_kappa(std::vector<std::vector<int>>{{0, 0, 0}, {4, 4, 4}, {2, 2, 2}}, 5, weights);
    ASSERT_TRUE(of_many.kappa);
    EXPECT_NEAR(of_many.kappa->value, 1, 1e-12);
  }
}

TEST(Agreement, SaysWhyThereIsNoKappa) {
  const auto why = [](const Answers& answers) {
    const Agreement found = cohens_kappa(answers, 5, Weights::kNone);
    EXPECT_FALSE(found.kappa);
    return found.why_no_kappa;
  };
  EXPECT_THAT(why({}), HasSubstr("nothing was judged"));
  EXPECT_THAT(why({{4, 3}}), HasSubstr("one thing alone"));
  EXPECT_THAT(why({{4, 4}, {4, 4}}), HasSubstr("all answers are the same"));
  const auto why_of_many = [](const std::vector<std::vector<int>>& answers) {
    const Agreement found = fleiss_kappa(answers, 5, Weights::kQuadratic);
    EXPECT_FALSE(found.kappa);
    return found.why_no_kappa;
  };
  EXPECT_THAT(why_of_many({}), HasSubstr("nothing was judged by two"));
  EXPECT_THAT(why_of_many({{1}, {2}, {}}), HasSubstr("nothing was judged by two"));
  EXPECT_THAT(why_of_many({{4, 4, 4}, {4, 4, 4}}), HasSubstr("all answers are the same"));
  EXPECT_THAT(why_of_many({{4, 3, 4}}), HasSubstr("one thing alone"));
  EXPECT_THROW(cohens_kappa(Answers{{5, 0}}, 5, Weights::kNone), UsageError);
  EXPECT_THROW(cohens_kappa(Answers{{0, 0}}, 1, Weights::kNone), UsageError);
  EXPECT_THROW(fleiss_kappa(std::vector<std::vector<int>>{{-1, 0}}, 5, Weights::kNone), UsageError);
}

TEST(Agreement, OfFewThingsHasAnIntervalThatStaysWithinWhatAKappaCanBe) {
  // Two things, three readers: by Student's t with one degree of freedom the interval goes far beyond.
  const std::vector<std::vector<int>> few{{0, 0, 1}, {1, 1, 1}};
  const Agreement fleiss = fleiss_kappa(few, 2, Weights::kNone);
  ASSERT_TRUE(fleiss.kappa && fleiss.kappa->interval);
  EXPECT_EQ(fleiss.kappa->interval->low, -1);
  EXPECT_EQ(fleiss.kappa->interval->high, 1);
  const Agreement cohen = cohens_kappa(of_table({{0, 1}, {2, 1}}), 2, Weights::kNone);
  ASSERT_TRUE(cohen.kappa && cohen.kappa->interval);
  EXPECT_EQ(cohen.kappa->interval->low, -1);
  EXPECT_LT(cohen.kappa->interval->high, 1);
}

}  // namespace
}  // namespace kiroku::trainer
