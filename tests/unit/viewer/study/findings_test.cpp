// Readers are made up here.
#include "viewer/study/findings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::study {
namespace {

class StudyFindings : public testing::Test {
 protected:
  static constexpr std::size_t kClips = 8;
  StudyFindings() {
    study_.questions = {"Can this step be judged?", "Can the pattern be judged?"};
    study_.readers.resize(2);
    key_.codings = {{"mpeg2", 4'000'000, "MPEG-2"}, {"uncompressed", 0, "uncompressed"}};
    key_.clips.resize(kClips);
  }
  void rate(std::size_t reader, std::size_t clip, std::size_t coding, std::vector<int> points,
            bool again = false) {
    ratings_.push_back(
        {reader, clip, coding, 0, again, std::move(points), Seen{again ? 0U : 1U, 100, again ? 3U : 0U}, {}});
  }
  /// What the study of 2006 found: the step in both codings, the pattern in the uncompressed one alone.
  void rate_as_in_2006() {
    for (std::size_t reader = 0; reader < study_.readers.size(); ++reader) {
      for (std::size_t clip = 0; clip < kClips; ++clip) {
        const int other = static_cast<int>((clip + reader) % 2);
        rate(reader, clip, 0, {4 + other, 1 + static_cast<int>(clip % 3)});
        rate(reader, clip, 1, {4 + other, 4 + static_cast<int>(clip % 2)});
      }
    }
  }
  [[nodiscard]] Findings found() const { return findings_of(study_, key_, ratings_); }

  Study study_;
  StudyKey key_;
  std::vector<Rating> ratings_;
};

TEST_F(StudyFindings, TellWhatTheSurgeonsOf2006Would) {
  rate_as_in_2006();
  const Findings findings = found();
  const Points& step = findings.by_coding[0][0];
  EXPECT_EQ(step.count, 2 * kClips);
  EXPECT_THAT(step.given, testing::ElementsAre(0, 0, 0, 8, 8));
  EXPECT_EQ(step.share_judged, 1);
  EXPECT_EQ(step.median, 4.5);
  EXPECT_EQ(step.mean, 4.5);
  const Points& pattern = findings.by_coding[0][1];
  EXPECT_EQ(pattern.share_judged, 0);
  EXPECT_EQ(pattern.median, 2);
  EXPECT_EQ(findings.by_coding[1][1].share_judged, 1);
  // They never agree on the step, and always on the pattern.
  EXPECT_NEAR(step.agreement->kappa->value, -1, 1e-12);
  EXPECT_NEAR(pattern.agreement->kappa->value, 1, 1e-12);
  EXPECT_NEAR(pattern.agreement_quadratic->kappa->value, 1, 1e-12);

  ASSERT_EQ(findings.differences.size(), 2U);
  EXPECT_EQ(findings.differences[0].equal, kClips);
  EXPECT_FALSE(findings.differences[0].test.p);
  EXPECT_EQ(findings.differences[0].test.why_no_test, "no pair differs");
  const CodingDifference& difference = findings.differences[1];
  EXPECT_EQ(difference.lower, kClips);
  // In MPEG-2 1 2 3 1 2 3 1 2, uncompressed 4 5 4 5 4 5 4 5.
  EXPECT_NEAR(*difference.mean, (15 - 36) / 8.0, 1e-12);
  EXPECT_NEAR(*difference.test.p, 2.0 / 256, 1e-12) << "all eight clips in one direction";
  EXPECT_EQ(difference.p_adjusted, difference.test.p) << "the only test there was";
}

TEST_F(StudyFindings, CountClipsAndNotAnswers) {
  // Ten readers who say the same are no more clips.
  study_.readers.resize(10);
  for (std::size_t reader = 0; reader < 10; ++reader) {
    for (std::size_t clip = 0; clip < 5; ++clip) {
      rate(reader, clip, 0, {2, 2});
      rate(reader, clip, 1, {4, 4});
    }
  }
  const Findings findings = found();
  EXPECT_NEAR(*findings.differences[0].test.p, 2.0 / 32, 1e-12);
  EXPECT_NEAR(*findings.differences[0].p_adjusted, 4.0 / 32, 1e-12) << "two questions were asked";
  EXPECT_EQ(*findings.differences[0].mean, -2);
}

TEST_F(StudyFindings, TakeFleissOfMoreThanTwo) {
  study_.readers.resize(3);
  for (std::size_t clip = 0; clip < 4; ++clip) {
    for (std::size_t reader = 0; reader < 3; ++reader) {
      const int points = clip < 2 ? 1 : 5;
      rate(reader, clip, 0, {points, reader == 2 && clip == 0 ? 5 : points});
    }
  }
  const Findings findings = found();
  EXPECT_NEAR(findings.by_coding[0][0].agreement->kappa->value, 1, 1e-12);
  std::vector<std::vector<int>> answers{{0, 0, 4}, {0, 0, 0}, {4, 4, 4}, {4, 4, 4}};
  EXPECT_NEAR(findings.by_coding[0][1].agreement->kappa->value,
              trainer::fleiss_kappa(answers, kPoints, trainer::AgreementWeights::kNone).kappa->value, 1e-12);
  EXPECT_EQ(findings.by_coding[1][0].count, 0U);
  EXPECT_FALSE(findings.by_coding[1][0].median);
  EXPECT_FALSE(findings.by_coding[1][0].agreement->kappa);
}

TEST_F(StudyFindings, KeepWhatIsSeenAgainForTheReaderThemselves) {
  rate_as_in_2006();
  const Findings before = found();
  EXPECT_TRUE(before.own.empty());
  rate(0, 0, 0, {1, 1}, true);  // the first time 4 and 1
  rate(0, 1, 1, {4, 5}, true);  // the first time 5 and 5
  rate(0, 2, 1, {4, 0}, true);  // the first time 4 and 4; not answered
  const Findings after = found();
  EXPECT_EQ(after.by_coding[0][0].count, before.by_coding[0][0].count);
  EXPECT_EQ(after.by_coding[0][0].given, before.by_coding[0][0].given);
  EXPECT_EQ(after.differences[1].test.p, before.differences[1].test.p);
  ASSERT_EQ(after.own.size(), 2U) << "of one reader, two questions";
  EXPECT_EQ(after.own[0].reader, 0U);
  EXPECT_EQ(after.own[0].count, 3U);
  EXPECT_EQ(after.own[0].same, 1U);
  EXPECT_EQ(after.own[0].within_one, 2U);
  EXPECT_EQ(after.own[1].count, 2U);
  EXPECT_EQ(after.own[1].same, 2U);
  EXPECT_NEAR(after.own[1].agreement.kappa->value, 1, 1e-12);
  EXPECT_EQ(after.dropped, 9U);
  EXPECT_EQ(after.never_to_the_end, 3U);
}

TEST_F(StudyFindings, OfOneReaderHaveNoKappa) {
  study_.readers.resize(1);
  rate(0, 0, 0, {4, 4});
  EXPECT_FALSE(found().by_coding[0][0].agreement);
}

TEST_F(StudyFindings, LeaveOutWhatWasNotAnswered) {
  rate(0, 0, 0, {4, 0});
  rate(1, 0, 0, {0, 3});
  rate(0, 0, 1, {5, 5});
  const Findings findings = found();
  EXPECT_EQ(findings.by_coding[0][0].count, 1U);
  EXPECT_EQ(findings.by_coding[0][0].agreement->count, 0U);
  // Of the reader who judged both alone.
  EXPECT_EQ(*findings.differences[0].mean, -1);
  EXPECT_FALSE(findings.differences[1].mean);
}

TEST(StudyRatings, FollowTheOrder) {
  Study study;
  study.questions = {"?"};
  study.films = {{"aa.mp4", 1, {}}, {"bb.mp4", 1, {}}};
  study.readers = {{"A", {{"01", "aa.mp4"}, {"02", "bb.mp4"}, {"03", "aa.mp4"}}}};
  StudyKey key;
  key.clips.resize(1);
  key.codings.resize(2);
  key.films = {{"aa.mp4", 0, 1}, {"bb.mp4", 0, 0}};
  const std::vector<Rating> ratings =
      ratings_of(study, key, {{{"01", {"01", {5}, {}, {}}}, {"03", {"03", {4}, {}, {}}}}});
  ASSERT_EQ(ratings.size(), 2U);
  EXPECT_EQ(ratings[0].coding, 1U);
  EXPECT_FALSE(ratings[0].again);
  EXPECT_TRUE(ratings[1].again);
  EXPECT_EQ(ratings[1].place, 2U);
}

}  // namespace
}  // namespace kiroku::study
