// Where the numbers of a supernodal factor lie, found on the graph of nodes, a ninth of the matrix.
#pragma once

#include <cstdint>
#include <span>

#include "sim/fem/cholmod_handles.h"
#include "sim/fem/stiffness.h"

namespace kiroku::sim {

/// `unknown_of` (3 |V|) counts the unknowns from 0, kNoUnknown for components that are none; there is at
/// least one. `order` holds all nodes, the first to be eliminated first. The factor has memory for its
/// numbers, which are not computed. std::bad_alloc, kiroku::Error.
CholmodSession::Factor lay_out_factor(CholmodSession& session, const StiffnessMatrix& stiffness,
                                      std::span<const std::uint32_t> unknown_of,
                                      std::span<const std::uint32_t> order);

}  // namespace kiroku::sim
