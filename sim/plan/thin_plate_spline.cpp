#include "sim/plan/thin_plate_spline.h"

#include <string>

#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::sim {
namespace {

constexpr std::size_t kFewest = 4;

Eigen::MatrixXd rows_of(std::span<const Vector3> places_m) {
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(places_m.size()), 3);
  for (std::size_t i = 0; i < places_m.size(); ++i)
    rows.row(static_cast<Eigen::Index>(i)) = places_m[i].transpose();
  return rows;
}

void check_spread(std::span<const Vector3> places_m, const std::string& whose) {
  for (std::size_t i = 0; i < places_m.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (places_m[i] == places_m[j])
        throw Error("two landmarks of " + whose + " lie at one place: pick them anew");
    }
  }
  Eigen::MatrixXd rows = rows_of(places_m);
  rows.rowwise() -= rows.colwise().mean().eval();
  const Eigen::VectorXd spread = Eigen::JacobiSVD<Eigen::MatrixXd>(rows).singularValues();
  if (spread[2] > ThinPlateSpline::kFlattest * spread[0]) return;
  throw Error("the landmarks of " + whose + " lie in one plane, or on a line (their spread across it is " +
              number_text(100 * spread[2] / spread[0], 2) +
              " % of their largest): pick one more that lies well beside it");
}

/// (4 x 3): t, then A by columns, transposed.
Eigen::Matrix<double, 4, 3> affine_of(std::span<const Vector3> from_m, std::span<const Vector3> to_m) {
  if (from_m.size() != to_m.size()) throw UsageError("there must be as many landmarks of both organs");
  if (from_m.size() < kFewest) {
    throw Error(
        "there are " + std::to_string(from_m.size()) +
        " landmarks that both organs have, and it takes four at least: pick more, under the same names");
  }
  check_spread(from_m, "the template");
  check_spread(to_m, "the patient");
  Eigen::MatrixXd system(static_cast<Eigen::Index>(from_m.size()), 4);
  system << Eigen::VectorXd::Ones(system.rows()), rows_of(from_m);
  Eigen::Matrix<double, 4, 3> affine = system.colPivHouseholderQr().solve(rows_of(to_m));
  if (affine.bottomRows<3>().determinant() <= 0) {
    throw Error(
        "the landmarks of the patient are a mirror image of the template's: look whether left and right, or "
        "two "
        "names, are exchanged");
  }
  return affine;
}

}  // namespace

void check_landmarks(std::span<const Vector3> places_m, const std::string& whose) {
  if (places_m.size() < kFewest) {
    throw Error("there are " + std::to_string(places_m.size()) + " landmarks of " + whose +
                ", and it takes four at least: pick more");
  }
  check_spread(places_m, whose);
}

ThinPlateSpline::ThinPlateSpline(std::span<const Vector3> from_m, std::span<const Vector3> to_m)
    : from_m_(from_m.begin(), from_m.end()) {
  (void)affine_of(from_m, to_m);
  const auto count = static_cast<Eigen::Index>(from_m.size());
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(count + 4, count + 4);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Vector3& here_m = from_m_[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j < count; ++j)
      system(i, j) = (here_m - from_m_[static_cast<std::size_t>(j)]).norm();
    system(i, count) = system(count, i) = 1;
    system.block<1, 3>(i, count + 1) = here_m.transpose();
    system.block<3, 1>(count + 1, i) = here_m;
  }
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(count + 4, 3);
  right.topRows(count) = rows_of(to_m);
  weights_ = system.fullPivLu().solve(right);
}

Vector3 ThinPlateSpline::at(const Vector3& place_m) const {
  const auto count = static_cast<Eigen::Index>(from_m_.size());
  Vector3 to_m = weights_.row(count).transpose() + weights_.bottomRows<3>().transpose() * place_m;
  for (Eigen::Index i = 0; i < count; ++i)
    to_m += (place_m - from_m_[static_cast<std::size_t>(i)]).norm() * weights_.row(i).transpose();
  return to_m;
}

Eigen::Matrix3d ThinPlateSpline::gradient(const Vector3& place_m) const {
  Eigen::Matrix3d gradient = weights_.bottomRows<3>().transpose();
  for (std::size_t i = 0; i < from_m_.size(); ++i) {
    const Vector3 away_m = place_m - from_m_[i];
    if (away_m.isZero(0)) continue;  // the kernel has a tip there; its mean slope is zero
    gradient += weights_.row(static_cast<Eigen::Index>(i)).transpose() * away_m.normalized().transpose();
  }
  return gradient;
}

Eigen::Matrix3d ThinPlateSpline::turn(const Vector3& place_m) const {
  const Eigen::Matrix3d slope = gradient(place_m);
  if (slope.determinant() <= 0) {
    throw Error(
        "the mapping between the landmarks folds where a tool is to be: landmarks contradict each other, or "
        "are too "
        "far from there");
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> parts(slope, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return parts.matrixU() * parts.matrixV().transpose();
}

std::vector<double> affine_residuals_m(std::span<const Vector3> from_m, std::span<const Vector3> to_m) {
  const Eigen::Matrix<double, 4, 3> affine = affine_of(from_m, to_m);
  std::vector<double> residuals_m;
  for (std::size_t i = 0; i < from_m.size(); ++i) {
    const Vector3 mapped_m = affine.row(0).transpose() + affine.bottomRows<3>().transpose() * from_m[i];
    residuals_m.push_back((mapped_m - to_m[i]).norm());
  }
  return residuals_m;
}

}  // namespace kiroku::sim
