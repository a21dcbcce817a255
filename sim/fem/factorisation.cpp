#include "sim/fem/factorisation.h"

#include <algorithm>
#include <new>
#include <span>
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
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_METIS;
    // Supernodes are merged by their number of columns; those of the graph are three of the matrix.
    common.nrelax[0] = 2;
    common.nrelax[1] = 6;
    common.nrelax[2] = 16;
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

  /// Of a lower triangle, columns sorted.
  Sparse allocate_pattern(std::size_t size, std::size_t entries) {
    Sparse matrix(cholmod_l_allocate_sparse(size, size, entries, 1, 1, -1, CHOLMOD_PATTERN, &common),
                  {&common});
    check();
    return matrix;
  }
  /// Lays the factor of a graph of nodes out anew for their unknowns: node i has those from first_unknown[i]
  /// to first_unknown[i + 1], one to three.
  void expand(const std::vector<std::size_t>& first_unknown);
  /// Replaces one of the factor's arrays.
  void replace(void*& array, std::size_t old_size, const std::vector<std::int64_t>& content) {
    cholmod_l_free(old_size, sizeof(std::int64_t), array, &common);
    array = cholmod_l_malloc(content.size(), sizeof(std::int64_t), &common);
    check();
    std::ranges::copy(content, static_cast<std::int64_t*>(array));
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

/// The kernel then clears and maps 2 MiB at a time; it may decline.
void use_huge_pages(cholmod_factor& factor) {
  constexpr std::uintptr_t kPage = 2U << 20;
  const auto begin = (reinterpret_cast<std::uintptr_t>(factor.x) + kPage - 1) & ~(kPage - 1);
  const auto end =
      (reinterpret_cast<std::uintptr_t>(factor.x) + factor.xsize * sizeof(double)) & ~(kPage - 1);
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
}

}  // namespace

void Factorisation::Cholmod::expand(const std::vector<std::size_t>& first_unknown) {
  const std::size_t nodes = factor->n, unknowns = first_unknown.back();
  const std::span order(static_cast<const std::int64_t*>(factor->Perm), nodes);
  // Of each node in the order of elimination, where its unknowns begin in that order.
  std::vector<std::int64_t> begin{0}, permutation;
  permutation.reserve(unknowns);
  for (const std::int64_t node : order) {
    const auto i = static_cast<std::size_t>(node);
    for (std::size_t u = first_unknown[i]; u < first_unknown[i + 1]; ++u)
      permutation.push_back(static_cast<std::int64_t>(u));
    begin.push_back(static_cast<std::int64_t>(permutation.size()));
  }
  const auto expanded = [&](std::int64_t node) { return begin[static_cast<std::size_t>(node)]; };
  const std::span old_columns(static_cast<const std::int64_t*>(factor->super), factor->nsuper + 1);
  const std::span old_rows_begin(static_cast<const std::int64_t*>(factor->pi), factor->nsuper + 1);
  const std::span old_rows(static_cast<const std::int64_t*>(factor->s), factor->ssize);
  std::vector<std::int64_t> columns{0}, rows_begin{0}, numbers_begin{0}, rows, column_counts;
  column_counts.reserve(unknowns);
  std::int64_t most_below = 1;
  for (std::size_t s = 0; s < factor->nsuper; ++s) {
    columns.push_back(expanded(old_columns[s + 1]));
    for (std::int64_t i = old_rows_begin[s]; i < old_rows_begin[s + 1]; ++i) {
      const std::int64_t node = old_rows[static_cast<std::size_t>(i)];
      for (std::int64_t row = expanded(node); row < expanded(node + 1); ++row) rows.push_back(row);
    }
    rows_begin.push_back(static_cast<std::int64_t>(rows.size()));
    const std::int64_t width = columns[s + 1] - columns[s], height = rows_begin[s + 1] - rows_begin[s];
    numbers_begin.push_back(numbers_begin.back() + width * height);
    for (std::int64_t column = 0; column < width; ++column) column_counts.push_back(height - column);
    most_below = std::max(most_below, height - width);
  }
  replace(factor->Perm, nodes, permutation);
  replace(factor->ColCount, nodes, column_counts);
  replace(factor->super, factor->nsuper + 1, columns);
  replace(factor->pi, factor->nsuper + 1, rows_begin);
  replace(factor->px, factor->nsuper + 1, numbers_begin);
  replace(factor->s, factor->ssize, rows);
  factor->n = factor->minor = unknowns;
  factor->ssize = rows.size();
  factor->xsize = static_cast<std::size_t>(numbers_begin.back());
  factor->maxcsize *= 9;  // at most
  factor->maxesize = static_cast<std::size_t>(most_below);
}

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

  // Order and layout are sought on the graph of nodes, a ninth of the matrix.
  std::size_t entries = 0;
  for (const std::uint32_t node : graph_nodes) entries += stiffness.rows(node).size();
  const Cholmod::Sparse graph = cholmod_->allocate_pattern(graph_nodes.size(), entries);
  auto* const column_begin = static_cast<std::int64_t*>(graph->p);
  auto* const rows = static_cast<std::int64_t*>(graph->i);
  std::int64_t at = 0;
  for (std::size_t column = 0; column < graph_nodes.size(); ++column) {
    column_begin[column] = at;
    for (const std::uint32_t row : stiffness.rows(graph_nodes[column])) {
      if (graph_node_of[row] != kNoUnknown) rows[at++] = graph_node_of[row];
    }
  }
  column_begin[graph_nodes.size()] = at;
  cholmod_->factor = cholmod_l_analyze(graph.get(), &cholmod_->common);
  cholmod_->check();
  std::vector<std::size_t> first_unknown(graph_nodes.size() + 1, unknown_.size());
  for (std::size_t unknown = unknown_.size(); unknown-- > 0;) {
    first_unknown[graph_node_of[unknown_[unknown] / 3]] = unknown;
  }
  cholmod_->expand(first_unknown);
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
