#include "viewer/compare/organ_deformation.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>

namespace kiroku::compare {
namespace {

double in_mm(double metres) { return 1000 * metres; }

/// Divided last: a product with 0.01 would have seventeen digits.
double in_steps(double value, double step) {
  const double per_one = std::round(1 / step);
  return std::round(value * per_one) / per_one;
}

double farthest(const Eigen::VectorXd& vectors) {
  double most = 0;
  for (Eigen::Index i = 0; i < vectors.size(); i += 3) most = std::max(most, vectors.segment<3>(i).norm());
  return most;
}

/// Rounded up to 1, 2 or 5 times a power of ten.
double round_mm(double largest_m) {
  constexpr double kLeastMm = 5;
  const double largest_mm = std::max(kLeastMm, in_mm(largest_m));
  const double ten = std::pow(10, std::floor(std::log10(largest_mm)));
  for (const double times : {1.0, 2.0, 5.0}) {
    if (times * ten >= largest_mm) return times * ten;
  }
  return 10 * ten;
}

}  // namespace

std::vector<double> DisplacementFields::weights_of(const Eigen::VectorXd& displacement_mm) const {
  const auto count = static_cast<Eigen::Index>(fields_.size());
  Eigen::MatrixXd products(count, count);
  Eigen::VectorXd onto(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    onto[i] = fields_[static_cast<std::size_t>(i)].dot(displacement_mm);
    for (Eigen::Index j = 0; j <= i; ++j) {
      products(i, j) = products(j, i) =
          fields_[static_cast<std::size_t>(i)].dot(fields_[static_cast<std::size_t>(j)]);
    }
  }
  std::vector<double> weights;
  if (count == 0) return weights;
  const Eigen::VectorXd found = products.ldlt().solve(onto);
  for (const double weight : found) weights.push_back(in_steps(weight, kWeightStepMm));
  while (!weights.empty() && weights.back() == 0) weights.pop_back();
  return weights;
}

Eigen::VectorXd DisplacementFields::sum_mm(const std::vector<double>& weights_mm) const {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(nodes_));
  for (std::size_t i = 0; i < weights_mm.size() && i < fields_.size(); ++i) sum += weights_mm[i] * fields_[i];
  return sum;
}

std::optional<std::vector<double>> DisplacementFields::take(const std::vector<sim::Vector3>& displacement_m) {
  Eigen::VectorXd wanted_mm(3 * static_cast<Eigen::Index>(nodes_));
  for (std::size_t i = 0; i < nodes_; ++i)
    wanted_mm.segment<3>(3 * static_cast<Eigen::Index>(i)) = 1000 * displacement_m[i];
  const std::size_t before = fields_.size();
  for (;;) {
    std::vector<double> weights = weights_of(wanted_mm);
    const Eigen::VectorXd left_mm = wanted_mm - sum_mm(weights);
    if (farthest(left_mm) <= kMostErrorMm) return weights;
    if (fields_.size() >= kMostFields) {
      fields_.resize(before);
      return {};
    }
    Eigen::VectorXd field = left_mm / left_mm.cwiseAbs().maxCoeff();
    for (double& value : field) value = in_steps(value, kFieldStep);
    fields_.push_back(std::move(field));
  }
}

std::vector<sim::Vector3> DisplacementFields::sum(const std::vector<double>& weights_mm) const {
  const Eigen::VectorXd mm = sum_mm(weights_mm);
  std::vector<sim::Vector3> all;
  for (Eigen::Index i = 0; i < mm.size(); i += 3) all.emplace_back(mm.segment<3>(i) / 1000);
  return all;
}

void DeformedAlignment::take(const sim::DeformedMoment& moment, const sim::DrawnSurface& drawn) {
  Deformation& kept = moments.emplace_back();
  kept.why = moment.why;
  kept.unfitted = moment.unfitted;
  if (!moment.deformed()) return;
  // A node that stands for several goes where they go on average, and is told where all of them are.
  std::vector<sim::Vector3> displacement_m(drawn.nodes.size(), sim::Vector3::Zero());
  std::vector<double> members(drawn.nodes.size(), 0);
  kept.told.assign(drawn.nodes.size(), true);
  for (std::size_t node = 0; node < drawn.of_node.size(); ++node) {
    const std::uint32_t into = drawn.of_node[node];
    displacement_m[into] += moment.displacement_m[node];
    members[into] += 1;
    if (!moment.told[node]) kept.told[into] = false;
  }
  for (std::size_t node = 0; node < members.size(); ++node)
    displacement_m[node] /= std::max(1.0, members[node]);
  std::optional<std::vector<double>> weights = fields.take(displacement_m);
  if (!weights) {
    kept = {};
    kept.why = sim::WhyRigid::kNotKept;
    return;
  }
  kept.weights_mm = std::move(*weights);
  kept.rest_ns = moment.rest_ns;
  kept.camera = moment.camera;
  kept.standard_error_m = moment.standard_error_m;
  kept.largest_m = moment.largest_m;
  kept.misfit_px = moment.misfit_px;
  kept.supported = moment.supported;
}

std::size_t DeformedAlignment::deformed() const {
  return static_cast<std::size_t>(std::ranges::count_if(moments, &Deformation::deformed));
}

std::vector<DeformedAlignment::Count> DeformedAlignment::rigid() const {
  using sim::WhyRigid;
  std::vector<Count> all;
  for (const WhyRigid why :
       {WhyRigid::kAtRest, WhyRigid::kNoRest, WhyRigid::kMoved, WhyRigid::kUnseen, WhyRigid::kUnfitted,
        WhyRigid::kWithinError, WhyRigid::kNotBetter, WhyRigid::kNotKept}) {
    const auto pictures = static_cast<std::size_t>(std::ranges::count(moments, why, &Deformation::why));
    if (pictures > 0) all.push_back({why, pictures});
  }
  return all;
}

double DeformedAlignment::largest_m() const {
  double largest = 0;
  for (const Deformation& moment : moments) largest = std::max(largest, moment.largest_m);
  return largest;
}

double DeformedAlignment::scale_mm() const { return round_mm(largest_m()); }

double DeformedAlignment::departure_scale_mm() const {
  double largest = 0;
  for (const Departure& moment : departures) largest = std::max(largest, moment.largest_m);
  return round_mm(largest);
}

ShownDeformation DeformedAlignment::shown(const Deformation& deformation) const {
  return {deformation.camera, fields.sum(deformation.weights_mm), deformation.told,
          deformation.standard_error_m, deformation.largest_m};
}

std::string sentence_of(sim::WhyRigid why) {
  switch (why) {
    case sim::WhyRigid::kDeformed:
      return "it was deformed";
    case sim::WhyRigid::kAtRest:
      return "displacements count from here";
    case sim::WhyRigid::kNoRest:
      return "it was not seen at rest before";
    case sim::WhyRigid::kMoved:
      return "the endoscope moved";
    case sim::WhyRigid::kUnseen:
      return "too little is seen around it to know whether the endoscope moved";
    case sim::WhyRigid::kUnfitted:
      return "no deformation explains the picture";
    case sim::WhyRigid::kWithinError:
      return "its displacement is within its standard error";
    case sim::WhyRigid::kNotBetter:
      return "a deformation explains the picture no better";
    case sim::WhyRigid::kNotKept:
      return "the document has no room for more kinds of displacement";
  }
  return "nothing is known";
}

}  // namespace kiroku::compare
