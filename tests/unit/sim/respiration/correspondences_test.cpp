// Tables of places in two CTs.
#include "sim/respiration/correspondences.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

TEST(Correspondences, SixColumnsAreTwoPlaces) {
  const Correspondences read =
      parse_correspondences("ax,ay,az,bx,by,bz\n1,2,3,4,5,6\n-1,0,0,0,0,7.5\n", "a.csv");
  ASSERT_EQ(read.first_m.size(), 2U);
  EXPECT_EQ(read.first_m[0], Vector3(0.001, 0.002, 0.003));
  EXPECT_EQ(read.second_m[1], Vector3(0, 0, 0.0075));
}

TEST(Correspondences, WhatIsWrongIsToldInASentence) {
  const auto parse = [](const std::string& text) -> std::string {
    try {
      static_cast<void>(parse_correspondences(text, "a.csv"));
    } catch (const Error& error) {
      return error.what();
    }
    return "taken";
  };
  EXPECT_THAT(parse("a,b,c\n1,2,3\n"),
              HasSubstr("cannot use a.csv: it has 3 columns where six are expected"));
  EXPECT_THAT(parse("1,2,3,4,5,6\n1,2,3,4,5,6\n"), HasSubstr("its first line holds numbers"));
  EXPECT_THAT(parse("a,b,c,d,e,f\n"), HasSubstr("it holds no correspondence"));
  EXPECT_THAT(parse("a,b,c,d,e,f\n1,2,3,4,5,x\n"), HasSubstr("cannot use a.csv, line 2"));
  EXPECT_THAT(parse("a,b,c,d,e,f\n1,2,3,4,5\n"), HasSubstr("line 2: it has 5 fields"));
  EXPECT_THAT(parse(""), HasSubstr("it is empty"));
}

/// A box, whose inside bends by a formula.
struct Bent {
  TetMesh mesh = test::tet_grid({5, 5, 8}, {0.1, 0.1, 0.16});
  Correspondences places;
  static Vector3 moved(const Vector3& p) {
    return {1.1 * p.x() + 0.6 * p.z() * p.z(), 1.2 * p.y(), 1.4 * p.z() - 0.8 * p.y() * p.z() + 0.02};
  }
  std::vector<Vector3> near_m;
  Bent() {
    for (std::int32_t& region : mesh.regions) region = 1;
    for (const Vector3& node : mesh.nodes) near_m.emplace_back(moved(node) + Vector3(0.004, -0.003, 0.005));
    for (int i = 0; i < 9; ++i) {
      for (int j = 0; j < 9; ++j) {
        for (int k = 0; k < 12; ++k) {
          const Vector3 place_m(0.006 + 0.011 * i, 0.006 + 0.011 * j, 0.007 + 0.013 * k);
          places.first_m.push_back(place_m);
          places.second_m.push_back(moved(place_m));
        }
      }
    }
  }
  [[nodiscard]] Spread errors(const std::vector<Vector3>& places_m) const {
    std::vector<double> errors_m;
    for (std::size_t node = 0; node < places_m.size(); ++node)
      errors_m.push_back((places_m[node] - moved(mesh.nodes[node])).norm());
    return spread_of(errors_m);
  }
};

TEST(Correspondences, TheMeshFollowsThemWhereEachEighthIsWrong) {
  Bent bent;
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < bent.places.second_m.size(); i += 8, ++wrong)
    bent.places.second_m[i] += Vector3(i % 16 == 0 ? 0.02 : -0.025, 0.01, -0.015);
  const CorrespondenceFit fit = follow_correspondences(bent.mesh, bent.places, bent.near_m);
  RecordProperty("mean_mm", std::to_string(1000 * bent.errors(fit.places_m).mean));
  EXPECT_LT(bent.errors(fit.places_m).mean, 0.0005);
  EXPECT_LT(bent.errors(fit.places_m).greatest, 0.003);
  EXPECT_EQ(fit.use.refused, wrong);
  EXPECT_EQ(fit.use.left_m.count + wrong, fit.use.given);
  EXPECT_EQ(fit.agreed.size(), fit.use.left_m.count);
}

TEST(Correspondences, AnEvenStretchIsMetExactly) {
  Bent bent;
  const auto even = [](const Vector3& p) {
    return Vector3(1.3 * p.x() + 0.1 * p.z(), 0.9 * p.y(), 1.6 * p.z());
  };
  for (std::size_t i = 0; i < bent.places.first_m.size(); ++i)
    bent.places.second_m[i] = even(bent.places.first_m[i]);
  std::vector<Vector3> near_m;
  for (const Vector3& node : bent.mesh.nodes) near_m.emplace_back(even(node) + Vector3(0.005, 0, 0));
  const CorrespondenceFit fit = follow_correspondences(bent.mesh, bent.places, near_m);
  for (std::size_t node = 0; node < near_m.size(); ++node)
    EXPECT_LT((fit.places_m[node] - even(bent.mesh.nodes[node])).norm(), 1e-6);
}

TEST(Correspondences, NothingTurnsInsideOutWhereTheyCross) {
  // Neighbours that change places, too many of them to be taken for wrong ones.
  Bent bent;
  const Vector3 middle(0.05, 0.05, 0.08);
  for (std::size_t i = 0; i < bent.places.first_m.size(); ++i) {
    Vector3 place_m = bent.places.first_m[i];
    if ((place_m - middle).norm() < 0.03) place_m.x() = 2 * middle.x() - place_m.x();
    bent.places.second_m[i] = place_m;
  }
  const CorrespondenceFit fit = follow_correspondences(bent.mesh, bent.places, bent.mesh.nodes);
  TetMesh moved = bent.mesh;
  moved.nodes = fit.places_m;
  for (std::size_t t = 0; t < moved.tetrahedra.size(); ++t) EXPECT_GT(signed_volume_m3(moved, t), 0);
}

TEST(Correspondences, ThoseOfAnotherLungAreRefused) {
  Bent bent;
  const auto refusal = [&] {
    try {
      static_cast<void>(follow_correspondences(bent.mesh, bent.places, bent.near_m));
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  const std::vector<Vector3> sorted_m = bent.places.second_m;
  for (std::size_t i = 0; i < sorted_m.size(); ++i)
    bent.places.second_m[i] = sorted_m[101 * i % sorted_m.size()];
  EXPECT_THAT(refusal(), HasSubstr("correspondences agree with each other"));
  for (Vector3& place_m : bent.places.first_m) place_m *= 10;
  EXPECT_THAT(refusal(), HasSubstr("of 972 correspondences are in the lung"));
}

}  // namespace
}  // namespace kiroku::sim
