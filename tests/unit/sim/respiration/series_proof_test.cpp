// A fit is proved on what its model does not know. tests/bench/series_proof_bench does it with other numbers
// of quanta, tests/bench/breathing_proof.py on a CT.
#include "tests/unit/sim/respiration/series_proof.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

TEST(SeriesProof, ATumourIsFollowedThroughAnotherModelsMotionAndNoise) {
  const test::SeriesProof proof =
      test::prove_series(3e4, true, {0.008, -0.005, 0.009}, std::numbers::pi / 180 * Vector3(3, -4, 2));
  ASSERT_EQ(proof.fit.refusal, "");
  ASSERT_EQ(proof.track.moments.size(), test::kProofMoments);
  double sum_m = 0, most_m = 0;
  std::size_t told = 0, beyond = 0;
  for (std::size_t i = 0; i < test::kProofMoments; ++i) {
    const TumourMoment& moment = proof.track.moments[i];
    if (i == test::kNotExposed) {
      EXPECT_EQ(moment.sight, TumourSight::kLost);
      continue;
    }
    if (moment.sight == TumourSight::kLost) continue;
    const Vector3 off_m = moment.place_m - proof.truth_m[i];
    ++told;
    sum_m += off_m.norm();
    most_m = std::max(most_m, off_m.norm());
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      beyond += std::abs(off_m[axis]) > 3 * std::sqrt(moment.covariance(axis, axis)) ? 1U : 0U;
  }
  EXPECT_EQ(told, test::kProofMoments - 1) << "every exposed moment has a place";
  // Less than a millimetre here; another compiler or processor may need a little more.
  EXPECT_LT(sum_m / double(told), 0.0012);
  EXPECT_LT(most_m, 0.003);
  EXPECT_LE(beyond, 3 * told / 20) << "of " << 3 * told << " coordinates, beyond three deviations";
}

}  // namespace
}  // namespace kiroku::sim
