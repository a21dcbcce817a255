#include "trainer/exclusion/stress_score.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace kiroku::trainer {

double stress_of_share_pa(const sim::TetMesh& mesh, std::span<const double> volumes_m3,
                          std::span<const sim::SymmetricTensor> stress_at_nodes_pa, double share) {
  std::vector<std::pair<double, double>> heap;  // stress, volume
  heap.reserve(mesh.tetrahedra.size());
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    sim::SymmetricTensor mean_pa = sim::SymmetricTensor::Zero();
    for (const std::uint32_t node : mesh.tetrahedra[t]) mean_pa += stress_at_nodes_pa[node] / 4;
    heap.emplace_back(sim::von_mises(mean_pa), volumes_m3[t]);
  }
  if (heap.empty()) return 0;
  const double wanted_m3 = share * std::accumulate(volumes_m3.begin(), volumes_m3.end(), 0.0);
  std::ranges::make_heap(heap);
  double before_pa = heap.front().first, before_m3 = 0, above_m3 = 0;
  // From the most stressed element on; the middle of an element's volume stands for its stress.
  while (!heap.empty()) {
    const auto [stress_pa, volume_m3] = heap.front();
    const double middle_m3 = above_m3 + volume_m3 / 2;
    if (middle_m3 >= wanted_m3) {
      const double part = middle_m3 > before_m3 ? (wanted_m3 - before_m3) / (middle_m3 - before_m3) : 1;
      return before_pa + std::clamp(part, 0.0, 1.0) * (stress_pa - before_pa);
    }
    before_pa = stress_pa;
    before_m3 = middle_m3;
    above_m3 += volume_m3;
    std::ranges::pop_heap(heap);
    heap.pop_back();
  }
  return before_pa;
}

}  // namespace kiroku::trainer
