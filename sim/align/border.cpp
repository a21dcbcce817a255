#include "sim/align/border.h"

#include <algorithm>
#include <cmath>

namespace kiroku::sim {

Border seek_border(const ColourCells& cells, const ColourModel& model, const OutlinePoint& point, int reach) {
  Border border;
  constexpr double kShared = 0.25;  // neighbouring pixels say the same: of four, one counts
  const int count = 2 * reach + 1;
  std::vector<double> evidence(static_cast<std::size_t>(count), 0);
  std::vector<bool> shows_tissue(static_cast<std::size_t>(count), false);
  int covered = 0;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d at = point.pixel + (i - reach) * point.outward;
    const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
    if (x < 0 || y < 0 || x >= cells.width || y >= cells.height) continue;
    const std::uint16_t cell = cells.at(x, y);
    if (cell == ColourCells::kCovered) {
      ++covered;
      continue;
    }
    evidence[static_cast<std::size_t>(i)] = model.evidence[cell];
    shows_tissue[static_cast<std::size_t>(i)] = true;
  }
  double all = 0;
  for (const double each : evidence) all += each;
  // Before sample k: k samples are within.
  std::vector<double> score(static_cast<std::size_t>(count) + 1);
  double within = 0, best = -1e300;
  std::size_t best_at = 0;
  for (std::size_t k = 0; k < score.size(); ++k) {
    score[k] = kShared * (within - (all - within));
    if (score[k] > best) {
      best = score[k];
      best_at = k;
    }
    if (k < evidence.size()) within += evidence[k];
  }
  double sum = 0, mean = 0, square = 0;
  for (std::size_t k = 0; k < score.size(); ++k) {
    const double weight = std::exp(score[k] - best), at = double(k) - reach - 0.5;
    sum += weight;
    mean += weight * at;
    square += weight * at * at;
  }
  border.off_px = mean / sum;
  border.variance_px2 = std::max(0.0, square / sum - border.off_px * border.off_px);
  // A border has the organ on its one side and something else on its other.
  constexpr int kSides = 6;
  constexpr double kClear = 0.35;
  const int at = static_cast<int>(best_at);
  double inner = 0, outer = 0;
  int inner_count = 0, outer_count = 0;
  const auto add = [&](int i, double& side, int& samples) {
    if (!shows_tissue[static_cast<std::size_t>(i)]) return;
    side += evidence[static_cast<std::size_t>(i)];
    ++samples;
  };
  for (int i = std::max(0, at - kSides); i < at; ++i) add(i, inner, inner_count);
  for (int i = at; i < std::min(count, at + kSides); ++i) add(i, outer, outer_count);
  border.supported =
      inner_count >= 3 && outer_count >= 3 && inner > kClear * inner_count && outer < -kClear * outer_count;
  constexpr double kMuch = 0.3;
  border.covered = !border.supported && covered >= kMuch * count;
  return border;
}

double tukey(double residual, double bound) {
  const double share = residual / bound;
  if (std::abs(share) >= 1) return 0;
  const double left = 1 - share * share;
  return left * left;
}

double scale_of(const std::vector<double>& residuals) {
  constexpr double kNormal = 1.4826, kLeastPx = 0.4;
  std::vector<double> sizes;
  for (const double each : residuals) sizes.push_back(std::abs(each));
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return std::max(kLeastPx, kNormal * *middle);
}

double correlation_length(const std::vector<double>& residuals) {
  double mean = 0, power = 0;
  const std::size_t count = residuals.size();
  for (const double each : residuals) mean += each / double(count);
  for (const double each : residuals) power += (each - mean) * (each - mean);
  if (power <= 0) return 1;
  double length = 1;
  for (std::size_t lag = 1; lag < count / 3; ++lag) {
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i)
      sum += (residuals[i] - mean) * (residuals[(i + lag) % count] - mean);
    if (sum / power < 0.05) break;
    length += 2 * sum / power;
  }
  return length;
}

}  // namespace kiroku::sim
