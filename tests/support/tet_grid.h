// A box of tetrahedra, by the name that tests know it by.
#pragma once

#include "sim/mesh/tet_grid.h"

namespace kiroku::test {

using sim::tet_grid;

}  // namespace kiroku::test
