#include "sim/fem/factorisation.h"

#include <algorithm>
#include <new>
#include <string>
#include <suitesparse/cholmod.h>
#include <sys/mman.h>
#include <utility>

#include "base/error.h"
#include "sim/fem/supernodal_cholesky.h"

extern "C" void openblas_set_num_threads(int number);  // its header declares far more, in C99

namespace kiroku::sim {

/// RAII around CHOLMOD's handles; its own messages stay off.
struct Factorisation::Cholmod {
  Cholmod() {
    cholmod_l_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
  }
  ~Cholmod() {
    cholmod_l_free_factor(&factor, &common);
    cholmod_l_finish(&common);
  }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;

  struct SparseDeleter {
    cholmod_common* common;
    void operator()(cholmod_sparse* matrix) const { cholmod_l_free_sparse(&matrix, common); }
  };
  using Sparse = std::unique_ptr<cholmod_sparse, SparseDeleter>;
  struct DenseDeleter {
    cholmod_common* common;
    void operator()(cholmod_dense* matrix) const { cholmod_l_free_dense(&matrix, common); }
  };
  using Dense = std::unique_ptr<cholmod_dense, DenseDeleter>;

  /// A lower triangle, columns sorted; `type` CHOLMOD_REAL or CHOLMOD_PATTERN.
  Sparse allocate(std::size_t size, std::size_t entries, int type) {
    Sparse matrix(cholmod_l_allocate_sparse(size, size, entries, 1, 1, -1, type, &common), {&common});
    check();
    return matrix;
  }
  void check() const {
    if (common.status == CHOLMOD_OUT_OF_MEMORY) throw std::bad_alloc();
    if (common.status == CHOLMOD_TOO_LARGE)
      throw Error("the mesh is too large to be factorised: take a coarser one");
    if (common.status < 0) throw Error("CHOLMOD failed with status " + std::to_string(common.status));
  }

  mutable cholmod_common common{};
  cholmod_factor* factor = nullptr;
};

namespace {

std::int64_t* column_pointers(cholmod_sparse& matrix) { return static_cast<std::int64_t*>(matrix.p); }
std::int64_t* row_numbers(cholmod_sparse& matrix) { return static_cast<std::int64_t*>(matrix.i); }

/// The kernel then clears and maps 2 MiB at a time; it may decline.
void use_huge_pages(cholmod_factor& factor) {
  constexpr std::uintptr_t kPage = 2U << 20;
  const auto begin = (reinterpret_cast<std::uintptr_t>(factor.x) + kPage - 1) & ~(kPage - 1);
  const auto end =
      (reinterpret_cast<std::uintptr_t>(factor.x) + factor.xsize * sizeof(double)) & ~(kPage - 1);
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
}

}  // namespace

Factorisation::Factorisation(const StiffnessMatrix& stiffness, const std::vector<bool>& free,
                             unsigned threads)
    : cholmod_(std::make_unique<Cholmod>()) {
  static_assert(sizeof(SuiteSparse_long) == sizeof(std::int64_t));
  openblas_set_num_threads(1);
  // Unknowns and the nodes that have any, counted without gaps.
  std::vector<std::uint32_t> unknown_of(free.size(), kNoUnknown),
      graph_node_of(stiffness.nodes(), kNoUnknown);
  std::vector<std::uint32_t> graph_nodes;
  for (std::size_t number = 0; number < free.size(); ++number) {
    if (!free[number]) continue;
    unknown_of[number] = static_cast<std::uint32_t>(unknown_.size());
    unknown_.push_back(number);
    if (graph_node_of[number / 3] == kNoUnknown) {
      graph_node_of[number / 3] = static_cast<std::uint32_t>(graph_nodes.size());
      graph_nodes.push_back(static_cast<std::uint32_t>(number / 3));
    }
  }
  if (unknown_.empty()) return;

  // The order of elimination is sought on the graph of nodes, a ninth of the matrix.
  std::size_t graph_entries = 0, entries = 0;
  for (const std::uint32_t node : graph_nodes) {
    graph_entries += stiffness.rows(node).size();
    entries += 9 * stiffness.rows(node).size();
  }
  std::vector<std::int64_t> node_order(graph_nodes.size());
  {
    const Cholmod::Sparse graph = cholmod_->allocate(graph_nodes.size(), graph_entries, CHOLMOD_PATTERN);
    std::int64_t at = 0;
    for (std::size_t column = 0; column < graph_nodes.size(); ++column) {
      column_pointers(*graph)[column] = at;
      for (const std::uint32_t row : stiffness.rows(graph_nodes[column])) {
        if (graph_node_of[row] != kNoUnknown) row_numbers(*graph)[at++] = graph_node_of[row];
      }
    }
    column_pointers(*graph)[graph_nodes.size()] = at;
    cholmod_l_metis(graph.get(), nullptr, 0, 1, node_order.data(), &cholmod_->common);
    cholmod_->check();
  }
  std::vector<std::int64_t> order;
  order.reserve(unknown_.size());
  for (const std::int64_t position : node_order) {
    const std::size_t node = graph_nodes[static_cast<std::size_t>(position)];
    for (std::size_t number = 3 * node; number < 3 * node + 3; ++number) {
      if (free[number]) order.push_back(unknown_of[number]);
    }
  }

  const Cholmod::Sparse pattern = cholmod_->allocate(unknown_.size(), entries, CHOLMOD_PATTERN);
  std::int64_t at = 0;
  for (std::size_t column = 0; column < unknown_.size(); ++column) {
    column_pointers(*pattern)[column] = at;
    const std::size_t number = unknown_[column];
    for (const std::uint32_t node : stiffness.rows(number / 3)) {
      for (std::size_t row = 3 * std::size_t{node}; row < 3 * std::size_t{node} + 3; ++row) {
        if (row >= number && free[row]) row_numbers(*pattern)[at++] = unknown_of[row];
      }
    }
  }
  column_pointers(*pattern)[unknown_.size()] = at;

  cholmod_->common.nmethods = 1;
  cholmod_->common.method[0].ordering = CHOLMOD_GIVEN;
  cholmod_->factor = cholmod_l_analyze_p(pattern.get(), order.data(), nullptr, 0, &cholmod_->common);
  cholmod_->check();
  cholmod_l_change_factor(CHOLMOD_REAL, 1, 1, 1, 1, cholmod_->factor, &cholmod_->common);
  cholmod_->check();
  use_huge_pages(*cholmod_->factor);
  const auto failed = factorise_supernodes(stiffness, unknown_of, threads, *cholmod_->factor);
  if (failed) {
    const auto* const permutation = static_cast<const std::int64_t*>(cholmod_->factor->Perm);
    const std::size_t number = unknown_[static_cast<std::size_t>(permutation[*failed])];
    throw Error(
        "node " + std::to_string(number / 3) +
        " can move without any resistance: it hangs on tetrahedra that can turn about an edge or a node");
  }
}

Factorisation::~Factorisation() = default;

std::size_t Factorisation::entries() const {
  return cholmod_->factor == nullptr ? 0 : static_cast<std::size_t>(cholmod_->factor->xsize);
}

Eigen::VectorXd Factorisation::solve(const Eigen::VectorXd& force_n) const {
  Eigen::VectorXd displacement_m = Eigen::VectorXd::Zero(force_n.size());
  if (unknown_.empty()) return displacement_m;
  const Cholmod::DenseDeleter deleter{&cholmod_->common};
  const Cholmod::Dense right(
      cholmod_l_allocate_dense(unknown_.size(), 1, unknown_.size(), CHOLMOD_REAL, &cholmod_->common),
      deleter);
  cholmod_->check();
  auto* const forces = static_cast<double*>(right->x);
  for (std::size_t i = 0; i < unknown_.size(); ++i)
    forces[i] = force_n[static_cast<Eigen::Index>(unknown_[i])];
  const Cholmod::Dense solution(cholmod_l_solve(CHOLMOD_A, cholmod_->factor, right.get(), &cholmod_->common),
                                deleter);
  cholmod_->check();
  const auto* const moved = static_cast<const double*>(solution->x);
  for (std::size_t i = 0; i < unknown_.size(); ++i)
    displacement_m[static_cast<Eigen::Index>(unknown_[i])] = moved[i];
  return displacement_m;
}

}  // namespace kiroku::sim
