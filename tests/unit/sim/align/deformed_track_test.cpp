// A rendered organ that is pulled before an endoscope: deformed to fit where that says more than the rigid
// organ does, and rigid with a reason elsewhere.
#include "sim/align/deformed_track.h"

#include <array>

#include <gmock/gmock.h>

#include "sim/align/surroundings.h"
#include "tests/support/pulled_organ.h"

namespace kiroku::sim {
namespace {

using test::EndoscopeScene;

constexpr double kDistanceM = 0.17;

TetMesh tracked_mesh() { return test::liver_like_mesh({16, 5, 12}); }

class DeformedTrackTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    truth_ = new test::PulledOrgan({22, 7, 16});
    force_ = new Eigen::VectorXd(truth_->force_n({0.05, -0.01, -0.01}, {0.3, -0.2, -1}, 0.02));
    organ_ = new DeformableOrgan(test::plan_body(tracked_mesh()));
  }
  static void TearDownTestSuite() {
    delete organ_;
    delete force_;
    delete truth_;
  }

  /// Pulled by that share of the whole force.
  [[nodiscard]] EndoscopeScene::Look look(double pulled, std::uint32_t seed) const {
    EndoscopeScene::Look made;
    made.camera = scene_.camera(8, -18, kDistanceM, 5);
    made.seed = seed;
    const Eigen::VectorXd gone = truth_->displacement_m(pulled * *force_);
    made.displacement_m.assign(gone.data(), gone.data() + gone.size());
    return made;
  }

  DeformedMoment take(const EndoscopeScene::Look& seen) {
    rigid_ = track_.take(rigid_.time_ns + 1, scene_.picture(seen));
    return deformed_.take(track_.taken(), rigid_);
  }

  /// How far the surface is from where it is before the camera, on average.
  [[nodiscard]] double off_m(const EndoscopeScene::Look& seen, const Camera& camera,
                             const std::vector<Vector3>& displacement_m) const {
    const Eigen::VectorXd gone = Eigen::Map<const Eigen::VectorXd>(
        seen.displacement_m.data(), static_cast<Eigen::Index>(seen.displacement_m.size()));
    const std::vector<Vector3> truth_m = truth_->at_nodes_of(organ_->surface(), gone);
    double sum = 0;
    for (std::size_t i = 0; i < truth_m.size(); ++i) {
      const Vector3& node = organ_->surface().nodes[i];
      const Vector3 went = displacement_m.empty() ? Vector3(Vector3::Zero()) : displacement_m[i];
      sum += (camera.view_m(node + went) - seen.camera.view_m(node + truth_m[i])).norm();
    }
    return sum / double(truth_m.size());
  }

  static const test::PulledOrgan* truth_;
  static const Eigen::VectorXd* force_;
  static const DeformableOrgan* organ_;
  EndoscopeScene scene_{truth_->mesh()};
  OrganTrack track_{tracked_mesh(), EndoscopeScene::kFieldDeg};
  DeformedTrack deformed_{*organ_};
  AlignedMoment rigid_;
};
const test::PulledOrgan* DeformedTrackTest::truth_ = nullptr;
const Eigen::VectorXd* DeformedTrackTest::force_ = nullptr;
const DeformableOrgan* DeformedTrackTest::organ_ = nullptr;

TEST_F(DeformedTrackTest, LaysAPulledOrganWithinThreeOfItsStatedErrors) {
  EXPECT_EQ(take(look(0, 1)).why, WhyRigid::kAtRest);
  const std::int64_t rest_ns = rigid_.time_ns;
  EXPECT_EQ(take(look(0, 2)).why, WhyRigid::kWithinError) << "nothing pulls";
  (void)take(look(0.2, 3));
  (void)take(look(0.4, 4));
  const EndoscopeScene::Look pulled = look(0.6, 5);
  const DeformedMoment moment = take(pulled);
  ASSERT_EQ(moment.why, WhyRigid::kDeformed) << name_of(moment.why) << ", " << name_of(moment.unfitted);
  EXPECT_EQ(moment.rest_ns, rest_ns);
  const double off = off_m(pulled, moment.camera, moment.displacement_m);
  EXPECT_LT(off, 3 * moment.standard_error_m);
  EXPECT_GT(moment.largest_m, 0.005);
  EXPECT_GT(moment.beyond, DeformedTrack::kLeastBeyond);
}

TEST_F(DeformedTrackTest, KeepsTheRigidOrganWhereTheEndoscopeMoves) {
  EXPECT_EQ(take(look(0, 1)).why, WhyRigid::kAtRest);
  EndoscopeScene::Look moved = look(0.5, 2);
  moved.camera = scene_.camera(11, -16, kDistanceM, 5);
  EXPECT_EQ(take(moved).why, WhyRigid::kMoved);
}

TEST_F(DeformedTrackTest, KeepsTheRigidOrganWhereNothingAroundItIsSeen) {
  EXPECT_EQ(take(look(0, 1)).why, WhyRigid::kAtRest);
  EndoscopeScene::Look smoke = look(0, 2);
  smoke.smoke = 1;
  EXPECT_EQ(take(smoke).why, WhyRigid::kUnseen);
  // It stands where it stood before the smoke.
  EXPECT_EQ(take(look(1, 3)).why, WhyRigid::kDeformed);
}

TEST_F(DeformedTrackTest, CountsNoDisplacementsFromAPictureThatTheRigidOrganDoesNotExplain) {
  EXPECT_EQ(take(look(1, 1)).why, WhyRigid::kNoRest) << rigid_.misfit_px;
}

TEST_F(DeformedTrackTest, BeginsAnewInPicturesOfAnotherSize) {
  EXPECT_EQ(take(look(0, 1)).why, WhyRigid::kAtRest);
  Picture half;
  const Picture whole = scene_.picture(look(0, 2));
  half.width = whole.width / 2;
  half.height = whole.height / 2;
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      const auto* const at = whole.rgb.data() + 3 * (2 * y * whole.width + 2 * x);
      half.rgb.insert(half.rgb.end(), at, at + 3);
    }
  }
  rigid_ = track_.take(rigid_.time_ns + 1, half);
  EXPECT_THAT(deformed_.take(track_.taken(), rigid_).why,
              testing::AnyOf(WhyRigid::kAtRest, WhyRigid::kNoRest));
  EXPECT_EQ(take(look(0, 3)).why, WhyRigid::kAtRest) << "and back";
}

class SurroundingsTest : public DeformedTrackTest {
 protected:
  [[nodiscard]] SurroundingsLook after(const EndoscopeScene::Look& later) {
    return after(scene_.picture(later));
  }
  [[nodiscard]] SurroundingsLook after(const Picture& later) {
    const EndoscopeScene::Look before = look(0, 1);
    const Picture picture = scene_.picture(before);
    const Pinhole pinhole =
        pinhole_of(EndoscopeScene::kFieldDeg, EndoscopeScene::kWidth, EndoscopeScene::kHeight);
    const auto organ =
        silhouette_of(organ_->surface(), before.camera, pinhole, picture.width, picture.height, 2);
    const Surroundings around(picture, cover_of(picture), *organ);
    return around.look(later, cover_of(later));
  }
};

TEST_F(SurroundingsTest, StandWhileTheOrganIsPulled) {
  const SurroundingsLook found = after(look(1, 2));
  EXPECT_EQ(found.stillness, Stillness::kStill) << found.moved_px << " px, alike " << found.alike;
  EXPECT_LT(found.moved_px, 0.4);
}

TEST_F(SurroundingsTest, TellAMotionOfTwoPixels) {
  EndoscopeScene::Look moved = look(0, 2);
  // Two pixels of 416 a unit of slope.
  moved.camera.eye_m += kDistanceM * 2 / 416 * moved.camera.to_view.row(0).transpose();
  const SurroundingsLook found = after(moved);
  EXPECT_EQ(found.stillness, Stillness::kMoved) << found.moved_px;
}

// What has no features is explained by any place, if only its contrast may be anything.
TEST_F(SurroundingsTest, DoNotStandBeforeAPlainWall) {
  Picture wall = scene_.picture(look(0, 2));
  for (std::size_t at = 0; at < wall.rgb.size(); ++at) {
    constexpr std::array<std::uint8_t, 3> kPlain{190, 130, 104};
    wall.rgb[at] = kPlain[at % 3];
  }
  const SurroundingsLook found = after(wall);
  EXPECT_NE(found.stillness, Stillness::kStill) << found.moved_px << " px, alike " << found.alike;
}

TEST_F(SurroundingsTest, AreUnseenInSmoke) {
  EndoscopeScene::Look smoke = look(0, 2);
  smoke.smoke = 1;
  EXPECT_EQ(after(smoke).stillness, Stillness::kUnseen);
}

}  // namespace
}  // namespace kiroku::sim
