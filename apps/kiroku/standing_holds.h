// Which cases of a home are under legal hold. A function; one thread at a time.
#pragma once

#include "apps/kiroku/home.h"
#include "archive/upkeep/holds.h"

namespace kiroku::apps {

/// As the home's log states them, which must go on from the newest checkpoint that the home keeps, and from
/// the one that witnesses cosigned, where there is one. Throws kiroku::Error where nobody can tell.
archive::Holds standing_holds(const Home& home);

}  // namespace kiroku::apps
