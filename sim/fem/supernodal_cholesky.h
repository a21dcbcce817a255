// The numbers of a supernodal factor on several threads, each bit the same whatever their number.
//
// CHOLMOD lays the factor out and solves with it; its own numeric phase uses one thread well and several
// badly. Here every supernode is a front that takes what its children in the elimination tree leave to it, in
// ascending order, and leaves to its parent what its own columns take off (multifrontal: Duff and Reid, "The
// multifrontal solution of indefinite sparse symmetric linear equations", ACM TOMS 9, 1983). Large fronts are
// worked on in tiles, which do not depend on the number of threads. Where a few elements change, only the
// fronts from theirs to the root are computed again: what all other subtrees leave is kept.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sim/fem/stiffness.h"

struct cholmod_factor_struct;

namespace kiroku::sim {

/// L of L L^T = P K P^T, K restricted to its unknowns. BLAS must be set to one thread. Not thread-safe.
class SupernodalCholesky {
 public:
  /// `unknown_of` (3 |V|) counts the unknowns; `factor` is supernodal and has memory for its numbers. Matrix
  /// and factor must outlive it and stay where they are.
  SupernodalCholesky(const StiffnessMatrix& stiffness, std::span<const std::uint32_t> unknown_of,
                     cholmod_factor_struct& factor);
  ~SupernodalCholesky();

  /// Fills the factor. Returns the first column (in the factor's order) where K is not positive definite,
  /// nothing if it is. Throws what a thread of its own throws (std::bad_alloc).
  std::optional<std::size_t> compute(unsigned threads);
  /// The same bits as compute() gives where since the last call only blocks of K between these nodes have
  /// changed: only supernodes with their columns, and the ancestors of these, have other numbers. The first
  /// call computes all of them, and from then on what every front leaves to its parent is kept, which takes
  /// several times the factor's memory.
  std::optional<std::size_t> recompute(std::span<const std::uint32_t> nodes, unsigned threads);

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace kiroku::sim
