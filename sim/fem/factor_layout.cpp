#include "sim/fem/factor_layout.h"

#include <algorithm>
#include <memory>
#include <sys/mman.h>
#include <vector>

namespace kiroku::sim {
namespace {

/// Lays the factor of a graph of nodes out anew for their unknowns: node i has those from first_unknown[i] to
/// first_unknown[i + 1], one to three.
void expand(cholmod_factor* factor, const std::vector<std::size_t>& first_unknown, CholmodSession& session) {
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
  const auto replace = [&](void*& array, std::size_t old_size, const std::vector<std::int64_t>& content) {
    cholmod_l_free(old_size, sizeof(std::int64_t), array, session.common());
    array = cholmod_l_malloc(content.size(), sizeof(std::int64_t), session.common());
    session.check();
    std::ranges::copy(content, static_cast<std::int64_t*>(array));
  };
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

/// The kernel then clears and maps 2 MiB at a time; it may decline.
void use_huge_pages(cholmod_factor& factor) {
  constexpr std::size_t kPage = 2U << 20;
  void* begin = factor.x;
  std::size_t bytes = factor.xsize * sizeof(double);
  if (std::align(kPage, kPage, begin, bytes) != nullptr)
    ::madvise(begin, bytes - bytes % kPage, MADV_HUGEPAGE);
}

}  // namespace

CholmodSession::Factor lay_out_factor(CholmodSession& session, const StiffnessMatrix& stiffness,
                                      std::span<const std::uint32_t> unknown_of,
                                      std::span<const std::uint32_t> order) {
  static_assert(sizeof(SuiteSparse_long) == sizeof(std::int64_t));
  // The nodes that have unknowns, counted without gaps.
  std::vector<std::uint32_t> graph_node_of(stiffness.nodes(), kNoUnknown), nodes;
  std::vector<std::size_t> first_unknown;
  std::size_t unknowns = 0, entries = 0;
  for (std::uint32_t node = 0; node < stiffness.nodes(); ++node) {
    const auto own = unknown_of.subspan(3 * std::size_t{node}, 3);
    const auto count = static_cast<std::size_t>(3 - std::ranges::count(own, kNoUnknown));
    if (count == 0) continue;
    graph_node_of[node] = static_cast<std::uint32_t>(nodes.size());
    nodes.push_back(node);
    first_unknown.push_back(unknowns);
    unknowns += count;
    entries += stiffness.rows(node).size();
  }
  first_unknown.push_back(unknowns);
  const CholmodSession::Sparse graph = session.allocate_pattern(nodes.size(), entries);
  auto* const column_begin = static_cast<std::int64_t*>(graph->p);
  auto* const rows = static_cast<std::int64_t*>(graph->i);
  std::int64_t at = 0;
  for (std::size_t column = 0; column < nodes.size(); ++column) {
    column_begin[column] = at;
    for (const std::uint32_t row : stiffness.rows(nodes[column])) {
      if (graph_node_of[row] != kNoUnknown) rows[at++] = graph_node_of[row];
    }
  }
  column_begin[nodes.size()] = at;
  std::vector<std::int64_t> graph_order;
  graph_order.reserve(nodes.size());
  for (const std::uint32_t node : order) {
    if (graph_node_of[node] != kNoUnknown) graph_order.push_back(graph_node_of[node]);
  }

  cholmod_common& common = *session.common();
  common.supernodal = CHOLMOD_SUPERNODAL;
  common.nmethods = 1;
  common.method[0].ordering = CHOLMOD_GIVEN;
  // Supernodes are merged by their number of columns; those of the graph are three of the matrix.
  common.nrelax[0] = 2;
  common.nrelax[1] = 6;
  common.nrelax[2] = 16;
  CholmodSession::Factor factor(cholmod_l_analyze_p(graph.get(), graph_order.data(), nullptr, 0, &common),
                                {&common});
  session.check();
  expand(factor.get(), first_unknown, session);
  cholmod_l_change_factor(CHOLMOD_REAL, 1, 1, 1, 1, factor.get(), &common);
  session.check();
  use_huge_pages(*factor);
  return factor;
}

}  // namespace kiroku::sim
