#include "sim/respiration/series_change.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "sim/respiration/gradient_terms.h"

namespace kiroku::sim {

SeriesChange explained_change(const BreathingScene& scene, const std::vector<ProjectionGeometry>& views,
                              std::span<const MovedPicture> pictures, double step_m) {
  double r0 = 0, r1 = 0, d0 = 0, d1 = 0;
  for (const MovedPicture& picture : pictures) {
    r0 = std::min(r0, picture.state.rib_cage_m);
    r1 = std::max(r1, picture.state.rib_cage_m);
    d0 = std::min(d0, picture.state.diaphragm_m);
    d1 = std::max(d1, picture.state.diaphragm_m);
  }
  const StateAxis rib_cage = StateAxis::covering(r0, r1, 2 * step_m),
                  diaphragm = StateAxis::covering(d0, d1, step_m);
  double together = 0, of_pictures = 0, of_computed = 0;
  std::vector<Eigen::MatrixXf> products;
  for (std::size_t view = 0; view < views.size(); ++view) {
    const BreathingPictures table(scene, views[view], rib_cage, diaphragm);
    std::vector<Eigen::VectorXf> measured, computed;
    BreathingPictures::Looked looked;
    for (const MovedPicture& picture : pictures) {
      if (picture.view != view) continue;
      table.look_up(picture.state, looked);
      measured.push_back(normalised_differences(picture.image->values, table.columns(), table.rows()));
      computed.push_back(normalised_differences(looked.value, table.columns(), table.rows()));
    }
    const auto matrix = [](const std::vector<Eigen::VectorXf>& vectors) {
      Eigen::MatrixXf all(vectors.front().size(), static_cast<Eigen::Index>(vectors.size()));
      for (std::size_t i = 0; i < vectors.size(); ++i) all.col(static_cast<Eigen::Index>(i)) = vectors[i];
      all.colwise() -= all.rowwise().mean().eval();
      return all;
    };
    const Eigen::MatrixXf a = matrix(measured), b = matrix(computed);
    products.emplace_back(a.transpose() * b);
    together += double(products.back().trace());
    of_pictures += double(a.squaredNorm());
    of_computed += double(b.squaredNorm());
  }
  const double lengths = std::sqrt(of_pictures * of_computed);
  if (!(lengths > 0)) return {};
  SeriesChange change;
  change.explained = together / lengths;
  constexpr int kOrders = 50;
  std::mt19937 random(19);
  double squares = 0;
  for (int order = 0; order < kOrders; ++order) {
    double sum = 0;
    for (const Eigen::MatrixXf& product : products) {
      std::vector<Eigen::Index> other(static_cast<std::size_t>(product.rows()));
      std::iota(other.begin(), other.end(), Eigen::Index{0});
      for (std::size_t i = other.size() - 1; i > 0; --i) std::swap(other[i], other[random() % (i + 1)]);
      for (Eigen::Index i = 0; i < product.rows(); ++i)
        sum += double(product(i, other[static_cast<std::size_t>(i)]));
    }
    squares += std::pow(sum / lengths, 2) / kOrders;
  }
  change.by_chance = std::sqrt(squares);
  return change;
}

}  // namespace kiroku::sim
