#include "media/quality/edges.h"

#include <cmath>

#include "base/error.h"

namespace kiroku::media {
namespace {

double laplacian(const Plane& plane, int x, int y) {
  double sum = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) sum += static_cast<double>(plane.at(x + dx, y + dy));
  }
  return 9 * static_cast<double>(plane.at(x, y)) - sum;
}

}  // namespace

double edges_kept(const Plane& original, const Plane& coded) {
  if (original.width != coded.width || original.height != coded.height || original.width < 3 ||
      original.height < 3) {
    throw Error("edges are compared between two pictures of one size, of at least 3x3 pixels");
  }
  double sum1 = 0, sum2 = 0, square1 = 0, square2 = 0, cross = 0, count = 0;
  for (int y = 1; y + 1 < original.height; ++y) {
    for (int x = 1; x + 1 < original.width; ++x) {
      const double e1 = laplacian(original, x, y), e2 = laplacian(coded, x, y);
      sum1 += e1;
      sum2 += e2;
      square1 += e1 * e1;
      square2 += e2 * e2;
      cross += e1 * e2;
      ++count;
    }
  }
  const double spread1 = square1 - sum1 * sum1 / count, spread2 = square2 - sum2 * sum2 / count;
  if (spread1 <= 0 && spread2 <= 0) return 1;
  if (spread1 <= 0 || spread2 <= 0) return 0;
  return (cross - sum1 * sum2 / count) / std::sqrt(spread1 * spread2);
}

}  // namespace kiroku::media
