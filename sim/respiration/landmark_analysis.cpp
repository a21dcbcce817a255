#include "sim/respiration/landmark_analysis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>

#include <Eigen/Geometry>
#include <Eigen/QR>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/respiration/line_plot.h"

namespace kiroku::sim {
namespace {

constexpr double kMillimetres = 1000;

using Transform = std::function<Vector3(const Vector3&)>;
using Fit = std::function<Transform(const LandmarkPairs&)>;

Vector3 mean_of(const std::vector<Vector3>& points) {
  return std::accumulate(points.begin(), points.end(), Vector3(Vector3::Zero())) /
         static_cast<double>(points.size());
}

Transform translation(const LandmarkPairs& pairs) {
  const Vector3 by_m = mean_of(pairs.moving_m) - mean_of(pairs.fixed_m);
  return [by_m](const Vector3& point_m) { return Vector3(point_m + by_m); };
}

Eigen::Matrix3Xd columns_of(const std::vector<Vector3>& points) {
  Eigen::Matrix3Xd columns(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) columns.col(static_cast<Eigen::Index>(i)) = points[i];
  return columns;
}

Transform rigid(const LandmarkPairs& pairs) {
  const Eigen::Matrix4d matrix = Eigen::umeyama(columns_of(pairs.fixed_m), columns_of(pairs.moving_m), false);
  return [matrix](const Vector3& point_m) { return Vector3((matrix * point_m.homogeneous()).head<3>()); };
}

/// Monomials up to a degree of 1 or 2, of a point in decimetres from a centre.
Eigen::RowVectorXd monomials(const Vector3& point_m, const Vector3& centre_m, int degree) {
  constexpr double kPerDecimetre = 10;
  const Vector3 p = kPerDecimetre * (point_m - centre_m);
  Eigen::RowVectorXd row(degree == 1 ? 4 : 10);
  row.head<4>() << 1, p.x(), p.y(), p.z();
  if (degree == 2)
    row.tail<6>() << p.x() * p.x(), p.y() * p.y(), p.z() * p.z(), p.x() * p.y(), p.y() * p.z(), p.z() * p.x();
  return row;
}

Fit polynomial(int degree) {
  return [degree](const LandmarkPairs& pairs) -> Transform {
    const Vector3 centre_m = mean_of(pairs.fixed_m);
    const auto count = static_cast<Eigen::Index>(pairs.fixed_m.size());
    Eigen::MatrixXd rows(count, degree == 1 ? 4 : 10);
    for (Eigen::Index i = 0; i < count; ++i)
      rows.row(i) = monomials(pairs.fixed_m[static_cast<std::size_t>(i)], centre_m, degree);
    const Eigen::MatrixXd factors = rows.colPivHouseholderQr().solve(columns_of(pairs.moving_m).transpose());
    return [=](const Vector3& point_m) {
      return Vector3((monomials(point_m, centre_m, degree) * factors).transpose());
    };
  };
}

Transform thin_plate_spline(const LandmarkPairs& pairs) {
  const Vector3 centre_m = mean_of(pairs.fixed_m);
  const auto count = static_cast<Eigen::Index>(pairs.fixed_m.size());
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(count + 4, count + 4);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(count + 4, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Vector3& point_m = pairs.fixed_m[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j < count; ++j)
      system(i, j) = (point_m - pairs.fixed_m[static_cast<std::size_t>(j)]).norm();
    system.block(i, count, 1, 4) = monomials(point_m, centre_m, 1);
    system.block(count, i, 4, 1) = system.block(i, count, 1, 4).transpose();
    right.row(i) = pairs.moving_m[static_cast<std::size_t>(i)].transpose();
  }
  const Eigen::MatrixXd factors = system.colPivHouseholderQr().solve(right);
  return [=, fixed_m = pairs.fixed_m](const Vector3& point_m) {
    Eigen::RowVectorXd row(count + 4);
    for (Eigen::Index i = 0; i < count; ++i) row[i] = (point_m - fixed_m[static_cast<std::size_t>(i)]).norm();
    row.tail<4>() = monomials(point_m, centre_m, 1);
    return Vector3((row * factors).transpose());
  };
}

LandmarkBound bound_of(const std::string& name, const Fit& fit, const LandmarkPairs& pairs) {
  std::vector<double> fitted_m, left_out_m;
  const Transform all = fit(pairs);
  for (std::size_t i = 0; i < pairs.fixed_m.size(); ++i) {
    LandmarkPairs others = pairs;
    others.fixed_m.erase(others.fixed_m.begin() + static_cast<std::ptrdiff_t>(i));
    others.moving_m.erase(others.moving_m.begin() + static_cast<std::ptrdiff_t>(i));
    fitted_m.push_back((all(pairs.fixed_m[i]) - pairs.moving_m[i]).norm());
    left_out_m.push_back((fit(others)(pairs.fixed_m[i]) - pairs.moving_m[i]).norm());
  }
  return {name, spread_of(fitted_m), spread_of(left_out_m)};
}

/// Three groups of the same size, by ascending `by`; of one or two landmarks, those that are not empty.
std::vector<NamedSpread> thirds(const std::vector<double>& by, const std::vector<double>& lengths,
                                const std::array<const char*, 3>& names) {
  std::vector<std::size_t> order(by.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return by[i]; });
  std::vector<NamedSpread> groups;
  for (std::size_t third = 0; third < names.size(); ++third) {
    std::vector<double> of_group;
    for (std::size_t i = third * order.size() / 3; i < (third + 1) * order.size() / 3; ++i)
      of_group.push_back(lengths[order[i]]);
    if (!of_group.empty()) groups.push_back({names[third], spread_of(of_group)});
  }
  return groups;
}

}  // namespace

std::vector<LandmarkBound> landmark_bounds(const LandmarkPairs& pairs) {
  constexpr std::size_t kForRigid = 4, kForAffine = 5, kForQuadratic = 11;
  std::vector<LandmarkBound> bounds;
  const std::size_t count = pairs.fixed_m.size();
  if (count < kForRigid) return bounds;
  bounds.push_back(bound_of("translation", translation, pairs));
  bounds.push_back(bound_of("rigid", rigid, pairs));
  if (count >= kForAffine) bounds.push_back(bound_of("affine", polynomial(1), pairs));
  if (count >= kForQuadratic) bounds.push_back(bound_of("quadratic", polynomial(2), pairs));
  if (count >= kForAffine) bounds.push_back(bound_of("thin-plate spline", thin_plate_spline, pairs));
  return bounds;
}

LandmarkDecomposition decompose(const LandmarkErrors& errors, std::size_t step) {
  const std::vector<Vector3>& vectors = errors.vectors_of_step_m.at(step);
  if (vectors.empty()) throw Error("no landmark is in the lung, so that there is no error to take apart");
  LandmarkDecomposition parts;
  parts.mean_m = mean_of(vectors);
  std::vector<double> without, along, across, heights;
  for (std::size_t i = 0; i < vectors.size(); ++i) {
    without.push_back((vectors[i] - parts.mean_m).norm());
    along.push_back(std::abs(vectors[i].dot(errors.normals[i])));
    across.push_back((vectors[i] - vectors[i].dot(errors.normals[i]) * errors.normals[i]).norm());
    heights.push_back(errors.inside.fixed_m[i].z());
  }
  parts.without_mean_m = spread_of(without);
  parts.along_normal_m = spread_of(along);
  parts.across_m = spread_of(across);
  const std::vector<double>& lengths = errors.of_step_m.at(step);
  parts.by_height = thirds(heights, lengths, {"lower third", "middle third", "upper third"});
  parts.by_depth = thirds(errors.depth_m, lengths, {"nearest to the surface", "between", "deepest"});
  return parts;
}

std::string landmark_csv(const LandmarkErrors& errors, const std::vector<ShapeFitStep>& steps) {
  constexpr int kDigits = 6;
  const auto millimetres = [](double metres) { return number_text(kMillimetres * metres, kDigits); };
  std::string text = "x_mm,y_mm,z_mm,depth_mm";
  for (const ShapeFitStep& step : steps) {
    std::string name = step.name;
    std::ranges::replace(name, ' ', '_');
    for (const char* what : {"_x_mm", "_y_mm", "_z_mm", "_mm"}) text += "," + name + what;
  }
  text += "\n";
  for (std::size_t i = 0; i < errors.before_m.size(); ++i) {
    const Vector3& place_m = errors.inside.fixed_m[i];
    text += millimetres(place_m.x()) + "," + millimetres(place_m.y()) + "," + millimetres(place_m.z()) + "," +
            millimetres(errors.depth_m[i]);
    for (std::size_t s = 0; s < steps.size(); ++s) {
      for (const double component : errors.vectors_of_step_m[s][i]) text += "," + millimetres(component);
      text += "," + millimetres(errors.of_step_m[s][i]);
    }
    text += "\n";
  }
  return text;
}

std::string landmark_plot(const LandmarkErrors& errors, const std::vector<ShapeFitStep>& steps) {
  LinePlot plot{"Error at landmarks, on which nothing was fitted", "height (patient z), mm", "error, mm", {}};
  for (std::size_t s = 1; s < steps.size(); ++s) {
    PlotLine line{steps[s].name, {}, {}, true};
    for (std::size_t i = 0; i < errors.before_m.size(); ++i) {
      line.x.push_back(kMillimetres * errors.inside.fixed_m[i].z());
      line.y.push_back(kMillimetres * errors.of_step_m[s][i]);
    }
    plot.lines.push_back(std::move(line));
  }
  if (!errors.before_m.empty()) {
    const auto [low, high] = std::ranges::minmax_element(plot.lines.front().x);
    plot.lines.push_back({"observer", {*low, *high}, {kObserverMm, kObserverMm}, false});
  }
  return plot_svg(plot);
}

}  // namespace kiroku::sim
