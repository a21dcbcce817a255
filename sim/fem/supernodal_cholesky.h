// The numbers of a supernodal factor on several threads, each bit the same whatever their number.
//
// CHOLMOD lays the factor out and solves with it; its own numeric phase uses one thread well and several
// badly. Here every supernode is computed by one thread, from its descendants in ascending order
// (left-looking: Ng and Peyton, "Block sparse Cholesky algorithms on advanced uniprocessor computers", SIAM
// J. Sci. Comput. 14, 1993), and supernodes whose subtrees are done wait for no other.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sim/fem/stiffness.h"

struct cholmod_factor_struct;

namespace kiroku::sim {

/// Fills `factor`, supernodal and with memory for its numbers, with L of L L^T = P K P^T; K restricted to the
/// unknowns that `unknown_of` (3 |V|) counts. Returns the first column (in the factor's order) where K is not
/// positive definite, nothing if it is. BLAS must be set to one thread. Throws what a thread of its own
/// throws (std::bad_alloc).
std::optional<std::size_t> factorise_supernodes(const StiffnessMatrix& stiffness,
                                                std::span<const std::uint32_t> unknown_of, unsigned threads,
                                                cholmod_factor_struct& factor);

}  // namespace kiroku::sim
