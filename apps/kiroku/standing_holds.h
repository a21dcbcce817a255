// Which cases of a home are under legal hold. A function; one thread at a time.
#pragma once

#include "apps/kiroku/home.h"
#include "archive/upkeep/holds.h"

namespace kiroku::apps {

/// As the home's log states them, which must go on from the checkpoint that witnesses cosigned, where the
/// home keeps one. Throws kiroku::Error where nobody can tell.
archive::Holds standing_holds(const Home& home);

}  // namespace kiroku::apps
