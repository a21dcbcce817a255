#include "sim/respiration/gradient_terms.h"

#include <algorithm>
#include <cmath>

namespace kiroku::sim {
namespace {

/// Correlations nearer to 1 than by this are no better evidence: pictures are never that alike.
constexpr double kLeastMisfit = 1e-4;

/// Inner products of the differences of pictures, the last of them of ones (for means).
Eigen::MatrixXd products_of(std::span<const float* const> images, std::size_t columns, std::size_t rows,
                            bool down, std::span<const float> roots) {
  const std::size_t next = down ? columns : 1, across = columns - 1;
  const auto count = static_cast<Eigen::Index>(images.size());
  constexpr std::size_t kRowsAtOnce = 16;
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(count + 1, count + 1);
  Eigen::MatrixXf part;
  for (std::size_t begin = 0; begin + 1 < rows; begin += kRowsAtOnce) {
    const std::size_t end = std::min(begin + kRowsAtOnce, rows - 1);
    part.resize(static_cast<Eigen::Index>((end - begin) * across), count + 1);
    for (Eigen::Index picture = 0; picture <= count; ++picture) {
      float* to = part.col(picture).data();
      for (std::size_t row = begin; row < end; ++row) {
        if (picture == count) {
          std::fill(to, to + across, 1.0F);
        } else {
          const float* const from = images[static_cast<std::size_t>(picture)] + row * columns;
          for (std::size_t column = 0; column < across; ++column)
            to[column] = from[column + next] - from[column];
        }
        if (!roots.empty()) {
          const float* const root = roots.data() + row * columns;
          for (std::size_t column = 0; column < across; ++column) to[column] *= root[column];
        }
        to += across;
      }
    }
    sums += (part.transpose() * part).cast<double>();
  }
  return sums;
}

}  // namespace

GradientTerms gradient_terms(const ProjectionImage& measured, std::span<const float> computed,
                             std::span<const float* const> derivatives, std::span<const float> roots) {
  std::vector<const float*> images{measured.values.data(), computed.data()};
  images.insert(images.end(), derivatives.begin(), derivatives.end());
  const auto unknowns = static_cast<Eigen::Index>(derivatives.size());
  GradientTerms terms{0, 0, Eigen::MatrixXd::Zero(unknowns, unknowns), Eigen::VectorXd::Zero(unknowns)};
  for (const bool down : {false, true}) {
    Eigen::MatrixXd products = products_of(images, measured.columns, measured.rows, down, roots);
    // Without their means.
    const Eigen::Index last = products.cols() - 1;
    const double n = products(last, last);
    if (!(n > 0)) continue;
    const Eigen::VectorXd sums = products.col(last);
    products -= sums * sums.transpose() / n;
    const double aa = products(0, 0), bb = products(1, 1);
    if (!(aa > 0) || !(bb > 0)) continue;
    const double c = products(0, 1) / std::sqrt(aa * bb);
    terms.similarity += c / 2;
    // What is alike the wrong way round is no better than what is not alike at all.
    if (!(c > 0)) continue;
    const double misfit = std::max(1 - c * c, kLeastMisfit);
    terms.log_misfit += std::log(misfit);
    if (unknowns == 0) continue;
    const Eigen::VectorXd of_a = products.row(0).segment(2, unknowns) / std::sqrt(aa),
                          of_b = products.row(1).segment(2, unknowns) / std::sqrt(bb);
    const double information = n / kSharedDifferences / misfit;
    terms.normal +=
        information * c * c / bb * (products.block(2, 2, unknowns, unknowns) - of_b * of_b.transpose());
    terms.right += information * c / std::sqrt(bb) * (of_a - c * of_b);
  }
  return terms;
}

Eigen::VectorXf normalised_differences(std::span<const float> image, std::size_t columns, std::size_t rows) {
  const std::size_t across = columns - 1, count = across * (rows - 1);
  Eigen::VectorXf differences(static_cast<Eigen::Index>(2 * count));
  for (const bool down : {false, true}) {
    auto part =
        differences.segment(static_cast<Eigen::Index>(down ? count : 0), static_cast<Eigen::Index>(count));
    const std::size_t next = down ? columns : 1;
    for (std::size_t row = 0; row + 1 < rows; ++row) {
      for (std::size_t column = 0; column < across; ++column) {
        const std::size_t at = row * columns + column;
        part[static_cast<Eigen::Index>(row * across + column)] = image[at + next] - image[at];
      }
    }
    part.array() -= part.mean();
    const float length = part.norm();
    if (length > 0) part /= length * std::sqrt(2.0F);
  }
  return differences;
}

}  // namespace kiroku::sim
