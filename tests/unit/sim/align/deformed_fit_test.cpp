// An organ that another model pulled, deformed to fit its picture; and where nothing may be said of it.
#include "sim/align/deformed_fit.h"

#include <gmock/gmock.h>

#include "base/error.h"
#include "tests/support/pulled_organ.h"

namespace kiroku::sim {
namespace {

using test::EndoscopeScene;

const TetMesh& fitted_mesh() {
  static const TetMesh mesh = test::liver_like_mesh({16, 5, 12});
  return mesh;
}
const DeformableOrgan& plan_organ() {
  static const DeformableOrgan organ(test::plan_body(fitted_mesh()));
  return organ;
}
const Pinhole kPinhole =
    pinhole_of(EndoscopeScene::kFieldDeg, EndoscopeScene::kWidth, EndoscopeScene::kHeight);

/// Some forces that bend the organ by centimetres.
Eigen::VectorXd bent(double size) {
  Eigen::VectorXd coefficients(plan_organ().unknowns());
  for (Eigen::Index i = 0; i < coefficients.size(); ++i) coefficients[i] = size * std::sin(0.7 * double(i));
  return coefficients;
}

TEST(DeformableOrgan, IsExpectedToMoveAsFarAsItIsTold) {
  const DeformableOrgan organ(test::plan_body(fitted_mesh()), {30, 0.02});
  EXPECT_EQ(organ.unknowns(), 90);
  const OrganShape rest = organ.shape(Eigen::VectorXd::Zero(90));
  double square = 0;
  for (std::uint32_t i = 0; i < organ.surface().nodes.size(); ++i)
    square += organ.derivative(rest, i).squaredNorm();
  EXPECT_NEAR(std::sqrt(square / double(organ.surface().nodes.size())), 0.02, 1e-9);
}

TEST(DeformableOrgan, DoesNotDependOnYoungsModulus) {
  const auto held = test::held_nodes(fitted_mesh(), {});
  const DeformableOrgan stiff(ElasticBody(fitted_mesh(), {{0, {30000, 0.4, 1000}}}, held));
  const OrganShape one = stiff.shape(bent(2)), other = plan_organ().shape(bent(2));
  for (std::size_t i = 0; i < one.displacement_m.size(); ++i)
    ASSERT_LT((one.displacement_m[i] - other.displacement_m[i]).norm(), 1e-9) << i;
}

TEST(DeformableOrgan, HasTheDerivativeOfItsDisplacement) {
  const Eigen::VectorXd at = bent(3);
  const OrganShape shape = plan_organ().shape(at);
  double most_turned = 0;
  for (const Vector3& rotation : shape.rotation) most_turned = std::max(most_turned, rotation.norm());
  ASSERT_GT(most_turned, 0.2) << "else the warp would not be looked at";
  constexpr double kStep = 1e-4;
  for (const Eigen::Index unknown : {0, 7, 31, 100}) {
    Eigen::VectorXd more = at, less = at;
    more[unknown] += kStep;
    less[unknown] -= kStep;
    const OrganShape after = plan_organ().shape(more), before = plan_organ().shape(less);
    for (std::uint32_t node = 0; node < shape.displacement_m.size(); node += 13) {
      const Vector3 went = (after.displacement_m[node] - before.displacement_m[node]) / (2 * kStep),
                    said = plan_organ().derivative(shape, node).col(unknown);
      ASSERT_LT((went - said).norm(), 1e-5 * said.norm() + 1e-10) << node << ", " << unknown;
    }
  }
}

TEST(DeformableOrgan, KeepsLengthsWhereLinearElementsStretch) {
  const OrganShape shape = plan_organ().shape(bent(6));
  const OrganSurface& rest = plan_organ().surface();
  double warped = 0, linear = 0;
  for (const OrganSurface::Edge& edge : rest.edges) {
    const auto [a, b] = edge.nodes;
    const Vector3 length = rest.nodes[a] - rest.nodes[b];
    const auto stretch = [&](const Vector3& of_a, const Vector3& of_b) {
      return std::abs((length + of_a - of_b).norm() / length.norm() - 1);
    };
    warped += stretch(shape.displacement_m[a], shape.displacement_m[b]);
    linear += stretch(shape.response_m[a], shape.response_m[b]);
  }
  EXPECT_LT(warped, 0.95 * linear);
}

TEST(DeformableOrgan, RefusesWhatCannotBeDeformed) {
  EXPECT_THROW(DeformableOrgan(test::plan_body(fitted_mesh(), {Vector3::Zero(), 1})), UsageError);
  EXPECT_THROW(DeformableOrgan(test::plan_body(fitted_mesh()), {0, 0.01}), UsageError);
  EXPECT_THROW(DeformableOrgan(test::plan_body(fitted_mesh()), {60, 0}), UsageError);
}

TEST(SurfacePlace, IsFoundAgainOnTheSurface) {
  const OrganSurface& surface = plan_organ().surface();
  for (std::uint32_t face = 0; face < surface.faces.size(); face += 17) {
    const Vector3 at = place_m(surface, {face, {0.2, 0.5, 0.3}});
    const SurfacePlace found = nearest_place(surface, at);
    EXPECT_EQ(found.face, face);
    EXPECT_LT((place_m(surface, found) - at).norm(), 1e-12);
  }
}

class DeformedFitTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    OrganNature nature;
    nature.held.middle_m += Vector3(0.003, 0, -0.003);
    nature.stiffer = 1.5;
    truth_ = new test::PulledOrgan({22, 7, 16}, nature);
    const Eigen::VectorXd force = truth_->force_n({0.05, -0.01, -0.01}, {0.3, -0.2, -1}, 0.02);
    gone_ = new Eigen::VectorXd(truth_->displacement_m(force));
  }
  static void TearDownTestSuite() {
    delete truth_;
    delete gone_;
  }
  using OrganNature = test::OrganNature;

  DeformedFitTest() {
    look_.camera = scene_.camera(8, -18, 0.17, 5);
    look_.displacement_m.assign(gone_->data(), gone_->data() + gone_->size());
    pose_.camera = look_.camera;
    constexpr double kKnownM = 0.001;
    pose_.covariance_m2 = kKnownM * kKnownM * MotionCovariance::Identity();
  }

  /// Where some of the seen tissue is in the picture, each off by half a pixel.
  [[nodiscard]] std::vector<TrackedTissue> tissue() const {
    const OrganSurface& surface = plan_organ().surface();
    const std::vector<Vector3> went = truth_->at_nodes_of(surface, *gone_);
    std::vector<TrackedTissue> all;
    for (std::uint32_t face = 0; face < surface.faces.size(); face += 7) {
      const auto& [a, b, c] = surface.faces[face];
      const Vector3 outward =
          (surface.nodes[b] - surface.nodes[a]).cross(surface.nodes[c] - surface.nodes[a]).normalized();
      const Vector3 at = (surface.nodes[a] + surface.nodes[b] + surface.nodes[c]) / 3;
      if (outward.dot((look_.camera.eye_m - at).normalized()) < 0.3) continue;
      const Vector3 now = at + (went[a] + went[b] + went[c]) / 3;
      const double turn = double(face);
      all.push_back(
          {{face, Vector3::Constant(1.0 / 3)},
           kPinhole.pixel(look_.camera.view_m(now)) + 0.5 * Eigen::Vector2d(std::cos(turn), std::sin(turn))});
    }
    return all;
  }

  [[nodiscard]] DeformedFit fit(const std::vector<TrackedTissue>& tissue) {
    return fit_of(scene_.picture(look_), tissue);
  }
  [[nodiscard]] DeformedFit fit_of(const Picture& picture, const std::vector<TrackedTissue>& tissue) const {
    return fit_deformed(colour_cells(picture, cover_of(picture)), plan_organ(), kPinhole, pose_, {}, tissue,
                        nullptr);
  }

  struct Errors {
    double mean_m = 0, rigid_m = 0, told_beyond = 0;
  };
  [[nodiscard]] Errors errors(const DeformedFit& fit) const {
    const std::vector<Vector3> went = truth_->at_nodes_of(plan_organ().surface(), *gone_);
    Errors made;
    double told = 0;
    for (std::size_t i = 0; i < went.size(); ++i) {
      const double off = (fit.shape.displacement_m[i] - went[i]).norm();
      made.mean_m += off / double(went.size());
      made.rigid_m += went[i].norm() / double(went.size());
      if (!fit.told(i)) continue;
      told += 1;
      made.told_beyond += off > 3 * fit.standard_error_m(i) ? 1 : 0;
    }
    made.told_beyond /= std::max(1.0, told);
    return made;
  }

  static const test::PulledOrgan* truth_;
  static const Eigen::VectorXd* gone_;
  EndoscopeScene scene_{truth_->mesh()};
  EndoscopeScene::Look look_;
  Expected pose_;
};
const test::PulledOrgan* DeformedFitTest::truth_ = nullptr;
const Eigen::VectorXd* DeformedFitTest::gone_ = nullptr;

TEST_F(DeformedFitTest, HasTheDerivativeOfAPixel) {
  const SurfacePlace place{40, {0.2, 0.5, 0.3}};
  const Eigen::VectorXd at = bent(3);
  const auto pixel = [&](const Eigen::VectorXd& coefficients, const Motion& motion) {
    const Camera moved = after_motion(plan_organ().surface(), look_.camera, motion);
    return kPinhole.pixel(moved.view_m(place_m(plan_organ().shape(coefficients).surface, place)));
  };
  const PixelDerivative said =
      pixel_derivative(plan_organ(), plan_organ().shape(at), look_.camera, kPinhole, place);
  EXPECT_LT((said.pixel - pixel(at, Motion::Zero())).norm(), 1e-9);
  constexpr double kStep = 1e-4, kWayM = 1e-6;
  for (const Eigen::Index unknown : {1, 50, 120}) {
    Eigen::VectorXd more = at, less = at;
    more[unknown] += kStep;
    less[unknown] -= kStep;
    const Eigen::Vector2d went = (pixel(more, Motion::Zero()) - pixel(less, Motion::Zero())) / (2 * kStep);
    EXPECT_LT((went - said.by_unknowns.col(unknown)).norm(), 1e-4 * went.norm() + 1e-6) << unknown;
  }
  for (Eigen::Index i = 0; i < 6; ++i) {
    const Motion motion = kWayM * Motion::Unit(i);
    const Eigen::Vector2d went = (pixel(at, motion) - pixel(at, -motion)) / (2 * kWayM);
    EXPECT_LT((went - said.by_unknowns.col(plan_organ().unknowns() + i)).norm(), 1e-4 * went.norm() + 1e-2)
        << i;
  }
}

TEST_F(DeformedFitTest, FindsHowAnotherModelPulledTheOrgan) {
  const DeformedFit found = fit(tissue());
  ASSERT_TRUE(found.fitted()) << name_of(found.why) << ", supported " << found.supported << ", border "
                              << found.border_px << ", agree " << found.points_agree;
  const Errors off = errors(found);
  EXPECT_GT(off.rigid_m, 2.5e-3) << "else there would be nothing to find";
  EXPECT_LT(off.mean_m, 2e-3);
  EXPECT_LT(off.mean_m, 0.5 * off.rigid_m);
  EXPECT_LT(off.told_beyond, 0.05);
}

TEST_F(DeformedFitTest, FindsNextToNothingWhereTheOrganIsAtRest) {
  look_.displacement_m.clear();
  const DeformedFit found = fit({});
  ASSERT_TRUE(found.fitted()) << name_of(found.why);
  double mean_m = 0;
  for (const Vector3& each : found.shape.displacement_m)
    mean_m += each.norm() / double(found.shape.displacement_m.size());
  EXPECT_LT(mean_m, 1e-3);
}

TEST_F(DeformedFitTest, KnowsLessOfDepthAndWithoutTissue) {
  const DeformedFit with = fit(tissue()), without = fit({});
  ASSERT_TRUE(with.fitted()) << name_of(with.why);
  ASSERT_TRUE(without.fitted()) << name_of(without.why);
  const Eigen::Matrix3d& to_view = with.camera.to_view;
  double across = 0, depth = 0, seen = 0, seen_without = 0;
  for (std::size_t i = 0; i < with.seen.size(); ++i) {
    if (!with.seen[i]) continue;
    const Eigen::Matrix3d before_camera = to_view * with.covariance_m2[i] * to_view.transpose();
    across += (before_camera(0, 0) + before_camera(1, 1)) / 2;
    depth += before_camera(2, 2);
    seen += with.covariance_m2[i].trace();
    seen_without += without.covariance_m2[i].trace();
  }
  ASSERT_GT(seen, 0);
  // By little: what the model may be wrong by is alike in all directions, and most of it.
  EXPECT_GT(depth, across);
  EXPECT_GT(seen_without, 1.2 * seen);
}

TEST_F(DeformedFitTest, KnowsLessOfWhatAnInstrumentHides) {
  // A lobe behind gauze, outline and tissue alike.
  Picture picture = scene_.picture(look_);
  const int from = 2 * picture.width / 3;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = from; x < picture.width; ++x) std::fill_n(picture.pixel(x, y), 3, 200);
  }
  std::vector<TrackedTissue> open = tissue();
  std::erase_if(open, [&](const TrackedTissue& each) { return each.pixel.x() > from - 10; });
  const DeformedFit whole = fit(tissue()), covered = fit_of(picture, open);
  ASSERT_TRUE(whole.fitted()) << name_of(whole.why);
  ASSERT_TRUE(covered.fitted()) << name_of(covered.why) << ", seen " << covered.seen_outline;
  double hidden = 0, seen = 0, count = 0;
  for (std::size_t i = 0; i < whole.seen.size(); ++i) {
    const double x = kPinhole.pixel(look_.camera.view_m(whole.shape.surface.nodes[i])).x();
    if (!whole.seen[i] || x < from + 20) continue;
    hidden += covered.covariance_m2[i].trace();
    seen += whole.covariance_m2[i].trace();
    count += 1;
  }
  ASSERT_GT(count, 10);
  EXPECT_GT(hidden, 1.1 * seen);
}

TEST_F(DeformedFitTest, RefusesAPictureWithoutTheOrgan) {
  look_.organ = false;
  const DeformedFit found = fit({});
  EXPECT_FALSE(found.fitted());
  EXPECT_EQ(found.why, WhyUnfitted::kOutlineUnexplained) << name_of(found.why);
}

TEST_F(DeformedFitTest, RefusesAnOrganThatIsCovered) {
  Picture picture = scene_.picture(look_);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < 3 * picture.width / 4; ++x) std::fill_n(picture.pixel(x, y), 3, 200);
  }
  EXPECT_EQ(fit_of(picture, {}).why, WhyUnfitted::kHidden);
}

TEST_F(DeformedFitTest, RefusesTissueThatWentWhereNoOrganGoes) {
  std::vector<TrackedTissue> points = tissue();
  for (std::size_t i = 0; i < points.size(); ++i)
    points[i].pixel += 40 * Eigen::Vector2d(std::cos(1.9 * double(i)), std::sin(2.3 * double(i)));
  const DeformedFit found = fit(points);
  EXPECT_FALSE(found.fitted());
  EXPECT_LT(found.points_agree, 0.5);
}

TEST_F(DeformedFitTest, SaysNothingOfAnOrganBehindTheEye) {
  pose_.camera.eye_m -= 0.4 * look_.camera.to_view.row(2).transpose();
  EXPECT_EQ(fit({}).why, WhyUnfitted::kNotInPicture);
}

TEST_F(DeformedFitTest, RefusesWhatIsNotOfTheOrgan) {
  const Picture picture = scene_.picture(look_);
  const ColourCells cells = colour_cells(picture, cover_of(picture));
  EXPECT_THROW(static_cast<void>(
                   fit_deformed(cells, plan_organ(), kPinhole, pose_, Eigen::VectorXd::Zero(3), {}, nullptr)),
               UsageError);
  const std::vector<TrackedTissue> nowhere{{{1000000, Vector3::Constant(1.0 / 3)}, {100, 100}}};
  EXPECT_THROW(static_cast<void>(fit_deformed(cells, plan_organ(), kPinhole, pose_, {}, nowhere, nullptr)),
               UsageError);
}

}  // namespace
}  // namespace kiroku::sim
